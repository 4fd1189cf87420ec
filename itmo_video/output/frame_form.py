"""The properties, apart from pixels, that a frame's file must have to be up to date."""

from __future__ import annotations

from dataclasses import dataclass

from itmo_video.output.exr import ExrImage, compression_constant


@dataclass(frozen=True)
class FrameForm:
    """Size (width, height) in pixels, full channel names, and the name of the compression."""

    size: tuple[int, int]
    channels: frozenset[str]
    compression: str

    def is_of(self, image: ExrImage) -> bool:
        """Whether an intact file has exactly this form, with both windows starting at (0, 0).

        A file with modified windows still opens, but with other pixels or at another position.
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
