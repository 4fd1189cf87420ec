"""The memory limit of this process, at which FFmpeg fails for no fault of the file."""

from __future__ import annotations


def memory_limit() -> int | None:
    """The memory limit of this process in bytes (ulimit -v, ulimit -d); None if there is none."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    kinds = (resource.RLIMIT_AS, resource.RLIMIT_DATA)
    limits = [resource.getrlimit(kind)[0] for kind in kinds]
    return min((bytes_ for bytes_ in limits if bytes_ != resource.RLIM_INFINITY), default=None)


def check_memory(error: Exception) -> None:
    """Raise MemoryError if FFmpeg ran out of memory, which must not pass for damage or an end.

    Without a limit, the cause is a file that claims more than is available.
    """
    if isinstance(error, MemoryError) and memory_limit() is not None:
        raise MemoryError(str(error)) from error
