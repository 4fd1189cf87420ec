"""Each step of a frame: the bytes it must move, its CPU time on one core, a copy's time beside it.

    python tests/benchmarks/roofline.py [CLIP] [--size 1080p] [--operator auto] [--rounds 15]
        [--footage auto]

Without a clip it makes a pan with lamps and grain. A step's bytes are those of its arrays, each
read or written once, whatever passes it makes over them; its floor is the time in which one core of
this machine copies as many from memory to memory. A step near its floor waits for memory, one far
above it computes, one below it works in the cache. The least thread CPU time of all rounds counts,
as others on the machine only add.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from against_ffmpeg import machine, make_clip
from kernels_run import add_plain, require_kernels

from itmo_video.colour.linear_light import strip_to_rgb_linear
from itmo_video.colour.luminance import limited_luminance
from itmo_video.colour.strips import strip_buffers, strips
from itmo_video.expand_map.key_map import make_key_map
from itmo_video.look import Look, context_of, make_look
from itmo_video.model import Frame
from itmo_video.motion import flow
from itmo_video.motion.cut_detection import analyse_frame
from itmo_video.operators import LuminanceOperator
from itmo_video.operators.protocol import WritesHalves
from itmo_video.output.exr_scanlines import scanline_file
from itmo_video.presets import make_settings
from itmo_video.rendering.frame import expand
from itmo_video.rendering.guidance import Guidance
from itmo_video.rendering.rows import expand_rows
from itmo_video.source.opening import open_clip

SIZES = {"1080p": (1920, 1080), "2160p": (3840, 2160)}
FRAMES = 24


def copy_speed(megabytes: int = 256) -> float:
    """Bytes a second that one core copies from memory to memory, read and written both counted."""
    source = np.ones(megabytes << 20, np.uint8)
    target = np.empty_like(source)
    best = float("inf")
    for _ in range(7):
        began = time.thread_time()
        np.copyto(target, source)
        best = min(best, time.thread_time() - began)
    return 2 * source.size / best


class Meter:
    """The least CPU seconds of each step, and its bytes, of rounds in which its parts add up."""

    def __init__(self) -> None:
        self.least_s: dict[str, float] = {}
        self.moved: dict[str, int] = {}
        self._round: dict[str, tuple[float, int]] = {}

    @contextmanager
    def step(self, name: str, moved: int) -> Iterator[None]:
        """Count what is done within, which must move so many bytes."""
        began = time.thread_time()
        yield
        spent, before = self._round.get(name, (0.0, 0))
        self._round[name] = spent + time.thread_time() - began, before + moved

    def end_round(self) -> None:
        """Keep each step's sum where it is the least so far."""
        for name, (spent, moved) in self._round.items():
            self.least_s[name] = min(spent, self.least_s.get(name, float("inf")))
            self.moved[name] = moved
        self._round.clear()


def render_steps(meter: Meter, frame: Frame, look: Look, small: Any, guide: Any) -> Any:
    """What `rendering.frame.render` does to a plain frame; its halves (3, H, W)."""
    (width, height), operator = frame.size, look.operator
    context = context_of(None, look)
    edge_aware = look.settings.edge_aware and not operator.draws_edges
    with meter.step("map and guard: filters at analysis size", 2 * guide.nbytes + small.nbytes):
        guidance = Guidance(frame, guide, look.settings, small, edge_aware, operator.guard)
    out = np.empty((3, height, width), np.float16)
    if isinstance(operator, WritesHalves):
        codes = sum(p.nbytes for p in frame.planes)
        with meter.step("codes to half floats in one pass, as it is done", codes + out.nbytes):
            expand_rows(frame, slice(0, height), guidance, operator, context, 1, out)
    for rows in strips(height):
        rgb = strip_buffers(rows, width)
        plane, luma = rgb[0].nbytes, frame.planes[0][rows].nbytes
        codes = sum(p.nbytes for p in frame.planes) * (rows.stop - rows.start) // height
        with meter.step("codes to linear light", codes + 3 * plane):
            strip_to_rgb_linear(frame, rows, True, rgb)
        with meter.step("map and guard brought up", luma):
            maps, ratio = guidance.rows(rows)
        made = plane * (sum(0 not in m.strides for m in maps) + (ratio is not None))
        with meter.step("map and guard brought up", made):
            pass
        with meter.step("curve, gain, to half floats", 3 * plane + made + 3 * plane // 2):
            if isinstance(operator, LuminanceOperator):
                gain = operator.gain(limited_luminance(rgb, ratio), context)
                expand(rgb, gain, maps[0], operator.base_gain(context), 1, out[:, rows])
            else:
                assert isinstance(operator, WritesHalves)
                operator.expand(rgb, ratio, maps, context, 1, out[:, rows])
    return out


def frame_steps(meter: Meter, frames: list[Frame], look: Look) -> None:
    """All but decoding and the kernel's writing, of a frame between two keys."""
    left, frame, right = (analyse_frame(f, look.settings.map_width) for f in frames)
    codes = sum(p.nbytes for p in frame.frame.planes)
    with meter.step("pictures at analysis size", frame.frame.planes[0].nbytes):
        frame = analyse_frame(frame.frame, look.settings.map_width)
    with meter.step("a key's map (a fifth of it a frame)", codes):
        keys = make_key_map(left.frame, look)
    small = keys.nbytes
    with meter.step("flow to both keys, warp, blend", 3 * small + 2 * 8 * frame.motion.nbytes):
        carried = flow.track_map(frame.motion, (left.motion, keys), (right.motion, keys), 0.4)
    out = render_steps(meter, frame.frame, look, carried, frame.guide)
    planes = dict(zip("RGB", out, strict=True))
    for compression in ("none", "zip"):
        with meter.step(f"laid out for `{compression}`", 2 * out.nbytes):
            for _part in scanline_file(b"", planes, compression):
                pass


def decoding_s(clip: Path) -> float:
    """CPU seconds that decoding takes a frame, by one thread."""
    with open_clip(clip) as opened:
        began, count = time.thread_time(), sum(1 for _ in opened.frames())
        return (time.thread_time() - began) / count


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clip", type=Path, nargs="?")
    parser.add_argument("--size", choices=sorted(SIZES), default="1080p")
    parser.add_argument("--operator", default="auto")
    parser.add_argument("--footage", default="auto")
    parser.add_argument("--rounds", type=int, default=15)
    add_plain(parser)
    args = parser.parse_args()
    kernels = require_kernels(args.plain)
    cv2.setNumThreads(1)
    look = make_look(make_settings("default", operator=args.operator, footage=args.footage))
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "made.mp4"
        clip = args.clip or make_clip(made, *SIZES[args.size], FRAMES, "yuv420p")
        with open_clip(clip) as opened:
            frames = [f for f, _ in zip(opened.frames(), range(6), strict=False)][::5]
            frames.insert(1, next(iter(opened.frames(2))))
        meter = Meter()
        for _ in range(args.rounds):
            frame_steps(meter, frames, look)
            meter.end_round()
        decoded = min(decoding_s(clip) for _ in range(3))
    speed, (width, height) = copy_speed(), frames[0].size
    print(f"{width}x{height}, operator {args.operator}, footage {args.footage}; {kernels}")
    print(f"{machine()}; a copy moves {speed / 1e9:.1f} GB/s\n")
    print("| step | MB | floor, ms | CPU ms | of the floor |\n| --- | ---: | ---: | ---: | ---: |")
    halves = 6 * width * height
    meter.least_s["decoding, one thread"] = decoded
    meter.moved["decoding, one thread"] = sum(p.nbytes for p in frames[0].planes)
    for name, spent in meter.least_s.items():
        moved = meter.moved[name]
        floor = moved / speed
        print(f"| {name} | {moved / 1e6:.1f} | {1e3 * floor:.2f} | {1e3 * spent:.2f} "
              f"| {spent / floor:.1f} |")  # fmt: skip
    least = meter.moved["decoding, one thread"] + halves
    print(f"\nCodes in and halves out are {least / 1e6:.1f} MB: {1e3 * least / speed:.1f} ms.")


if __name__ == "__main__":
    main()
