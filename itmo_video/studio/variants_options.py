"""The options specific to `variants`."""

from __future__ import annotations

from dataclasses import dataclass

from itmo_video.options import check_options, option


@dataclass(frozen=True)
class VariantsOptions:
    """What is varied, and on which frame. Validated on creation (UsageError)."""

    vary: str = option("presets", str, "setting to vary, or 'presets'", metavar="SETTING")
    values: tuple[str, ...] = option(
        (), tuple, "values or preset names, comma-separated (default: typical ones)",
        metavar="VALUE,...",
    )  # fmt: skip
    frame: int | None = option(
        None, int, "frame to show (default: the middle one)", lower=0, metavar="N"
    )
    overwrite: bool = option(False, bool, "replace OUT")

    def __post_init__(self) -> None:
        check_options(self)
