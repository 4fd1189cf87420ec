"""Typed errors: each has its exit code, and says what happened, where, and what to do."""


class ItmoError(Exception):
    """The base of all expected errors; `str()` is the one or two lines shown to the user.

    >>> from itmo_video import ItmoError, convert
    >>> try:
    ...     convert("nothing.mp4", "out")
    ... except ItmoError as error:
    ...     type(error).__name__, error.exit_code
    ('InputError', 3)
    """

    exit_code = 1

    def __init__(self, what: str, *, where: str | None = None, remedy: str | None = None) -> None:
        self.what, self.where, self.remedy = what, where, remedy
        super().__init__(what, where, remedy)

    def __reduce__(self) -> tuple[object, ...]:
        # For worker processes: rebuilding an error from `args` would lose the names.
        return _remake, (type(self), self.what, self.where, self.remedy)

    def __str__(self) -> str:
        first = f"{self.where}: {self.what}" if self.where else self.what
        return f"{first}\n{self.remedy}" if self.remedy else first


def _remake(kind: type[ItmoError], what: str, where: str | None, remedy: str | None) -> ItmoError:
    return kind(what, where=where, remedy=remedy)


class UsageError(ItmoError):
    """Invalid options or settings."""

    exit_code = 2


class InputError(ItmoError):
    """The input cannot be read, or is not a video."""

    exit_code = 3


class DamagedInputError(ItmoError):
    """The input is truncated, damaged or changes its size; everything else was converted."""

    exit_code = 4


class ReplacedInputError(DamagedInputError):
    """The input was modified or removed while it was being read."""


class OutputError(ItmoError):
    """The output cannot be written: no space, no permission, or another conversion's files."""

    exit_code = 5


class AlreadyHdrError(ItmoError):
    """Refused: the input is already HDR."""

    exit_code = 6


class ClusterError(ItmoError):
    """A cluster's scheduler or workers cannot be reached, died or do not match."""

    exit_code = 1


class CheckFailedError(ItmoError):
    """A requested check (--verify, --fail-above) failed."""

    exit_code = 7
