"""The result of a conversion, and what is said if it changed nothing."""

from __future__ import annotations

from dataclasses import dataclass, field

from itmo_video.conversion.plan import Plan

_HARDLY = 1.15  # times SDR white, which codes above white reach anyway


@dataclass
class Summary:
    """The result of a conversion: counts, and the numbers of `missing` and `damaged` frames.

    `peak_nits` is the brightest channel written, None if nothing was written.

    >>> from itmo_video import convert
    >>> once, again = convert("clip.mkv", "out"), convert("clip.mkv", "out")
    >>> (once.written, once.present), (again.written, again.present)
    ((3, 0), (0, 3))
    """

    wanted: int
    present: int
    written: int = 0
    missing: list[int] = field(default_factory=list)
    damaged: list[int] = field(default_factory=list)
    seconds: float = 0.0
    bytes_written: int = 0
    peak_nits: float | None = None


def count_frame(
    summary: Summary, number: int, size: int, peak_nits: float, *, is_damaged: bool
) -> None:
    """Add a frame that was made to the counts: its number, bytes, peak, and the source's damage."""
    summary.written += 1
    summary.bytes_written += size
    summary.peak_nits = max(peak_nits, summary.peak_nits or 0.0)
    if is_damaged:
        summary.damaged.append(number)


def nothing_expanded(plan: Plan, summary: Summary) -> str | None:
    """A notice if everything was left as it was, with the likely reason, otherwise None."""
    settings, peak = plan.settings, summary.peak_nits
    is_auto = settings.operator == "auto" and settings.footage == "auto"
    if settings.strength == 0 or not (is_auto or plan.look.needs_map):
        return None
    if peak is None or peak > _HARDLY * settings.white_nits:
        return None
    if settings.l_max_effective <= _HARDLY:
        return (
            f"nothing is expanded: the maximum is {settings.l_max_effective:.3g} times SDR white; "
            "raise --peak-nits or --l-max"
        )
    if is_auto:
        return (
            "hardly anything was expanded: little in these frames seems to have been brighter than "
            "white; --footage tone-mapped expands them anyway"
        )
    if plan.look.operator.sees == "rgb":
        return None
    return (
        "hardly anything was expanded: the picture is dark, or nowhere are --min-lights "
        f"({settings.min_lights}) of the --lights ({settings.lights}) within --radius"
    )
