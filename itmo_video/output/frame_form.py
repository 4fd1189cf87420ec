"""What a frame's file must look like, beside its pixels, to count as the one that is wanted."""

from __future__ import annotations

from dataclasses import dataclass

from itmo_video.output.exr import ExrImage, compression_constant


@dataclass(frozen=True)
class FrameForm:
    """Size (width, height) in pixels, channels by their full names, and the compression's name."""

    size: tuple[int, int]
    channels: frozenset[str]
    compression: str

    def is_of(self, image: ExrImage) -> bool:
        """Whether a whole file has this form: both windows from (0, 0), and nothing more or less.

        A file whose windows were changed still opens, with other pixels or in another place.
        """
        window = (0, 0), (self.size[0] - 1, self.size[1] - 1)
        windows = (image.attributes.get(name) for name in ("dataWindow", "displayWindow"))
        return (
            all(_corners(found) == window for found in windows)
            and set(image.channels) == self.channels
            and all(pixels.shape == self.size[::-1] for pixels in image.channels.values())
            and image.attributes.get("compression") == compression_constant(self.compression)
        )


def _corners(window: object) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(int(v) for v in corner) for corner in window)  # type: ignore[attr-defined]
