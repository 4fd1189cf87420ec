/* A disk that fails in mid-file: reads of FAILING_PATH at or behind byte FAILING_AT give EIO, once
 * it has been read from its beginning more than FAILING_AFTER times. To be preloaded. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

static int begun;

static ssize_t allowed(int fd, off_t at, size_t count) { /* bytes that may be read, -1 for EIO */
    const char *path = getenv("FAILING_PATH"), *limit = getenv("FAILING_AT");
    const char *after = getenv("FAILING_AFTER");
    struct stat own, file;
    if (!path || !limit || stat(path, &file) || fstat(fd, &own)) return (ssize_t)count;
    if (own.st_ino != file.st_ino || own.st_dev != file.st_dev) return (ssize_t)count;
    if (at == 0) __atomic_add_fetch(&begun, 1, __ATOMIC_SEQ_CST);
    if (after && __atomic_load_n(&begun, __ATOMIC_SEQ_CST) <= atoi(after)) return (ssize_t)count;
    off_t end = atoll(limit);
    if (at >= end) return -1;
    return end - at < (off_t)count ? (ssize_t)(end - at) : (ssize_t)count;
}

ssize_t read(int fd, void *into, size_t count) {
    static ssize_t (*next)(int, void *, size_t);
    if (!next) next = dlsym(RTLD_NEXT, "read");
    off_t at = lseek(fd, 0, SEEK_CUR);
    ssize_t may = at < 0 || !count ? (ssize_t)count : allowed(fd, at, count);
    if (may < 0) { errno = EIO; return -1; }
    return next(fd, into, (size_t)may);
}

ssize_t pread64(int fd, void *into, size_t count, off64_t at) {
    static ssize_t (*next)(int, void *, size_t, off64_t);
    if (!next) next = dlsym(RTLD_NEXT, "pread64");
    ssize_t may = allowed(fd, at, count);
    if (may < 0) { errno = EIO; return -1; }
    return next(fd, into, (size_t)may, at);
}

ssize_t pread(int fd, void *into, size_t count, off_t at) { return pread64(fd, into, count, at); }
