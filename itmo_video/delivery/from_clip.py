"""A preview's pictures from a clip, converted on the fly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from itmo_video.conversion.from_pipe import pipe_damage, pipe_plan, wanted_indices
from itmo_video.conversion.plan import make_plan
from itmo_video.conversion.run_options import RunOptions
from itmo_video.delivery.in_order import InOrder, run_in_order
from itmo_video.delivery.pictures import Picture, Pictures, T, Work
from itmo_video.look import make_look
from itmo_video.model import Frame
from itmo_video.output.converted import peak_nits_of
from itmo_video.rendering import spans
from itmo_video.rendering.frame import Rendered
from itmo_video.settings import Settings
from itmo_video.source.opening import Clip, input_options, open_clip
from itmo_video.source.pipe import PipeClip, is_pipe
from itmo_video.words import missing


def from_clip(source: Path, settings: Settings, run: RunOptions) -> Pictures:
    """The pictures of a clip, converted on the fly; raises what `convert` raises."""
    look = make_look(settings)
    wanted: Sequence[int]
    clip: Clip
    if is_pipe(source):
        clip = PipeClip(source, input_options(settings, run.max_pixels))
        plan, wanted = pipe_plan(clip, look, run), wanted_indices(run)
    else:
        with open_clip(source, input_options(settings, run.max_pixels)) as clip:
            plan = make_plan(clip, look, run)
        wanted = sorted(plan.numbers.values())
    last_length_s = None
    if wanted and not clip.reads_once:
        last = wanted[-1]
        following = clip.time_s(last + 1) if last + 1 < clip.info.frames else None
        last_length_s = clip.last_length_s if following is None else following - clip.time_s(last)
    is_endless = isinstance(wanted, range)
    info = plan.clip
    pictures: Pictures

    def mapped(work: Work[T]) -> Iterator[T]:
        def make(buffer: InOrder[T]) -> None:
            made = 0

            def sink(frame: Frame, done: Rendered) -> None:
                nonlocal made
                made += 1
                number = frame.index + plan.first_number
                if frame.is_damaged:
                    pictures.damaged.add(number)
                item = work(
                    Picture(
                        frame.index, number, frame.time_s, done.rgb, frame, done.layers, done.alpha
                    )
                )
                buffer.put(frame.index, item)

            ended = spans.render_frames(
                clip, wanted, look, plan.jobs, sink, plan.look_at,
                on_planned=buffer.plan, on_stop=buffer.close,
            )  # fmt: skip
            pictures.damage += [error.what for error in ended]
            if isinstance(clip, PipeClip):
                pictures.damage += pipe_damage(clip, run)
            if run.frames is None and info.frames_cut_off:
                cut_off = missing(info.frames_cut_off, "frame")
                pictures.damage.append(f"the file is truncated or damaged: {cut_off}")
            if not is_endless and made < len(wanted):
                pictures.damage.append(
                    f"{missing(len(wanted) - made, 'frame')} or cannot be decoded"
                )

        longest = max(own.settings.key_reach for own in plan.looks)
        return run_in_order(make, plan.jobs * (longest + 1), clip.close)

    pictures = Pictures(
        info.display_size, info.frame_rate, info.pixel_aspect, settings.white_nits,
        max(peak_nits_of(own.settings) for own in plan.looks), settings.primaries,
        [] if is_endless else [index + plan.first_number for index in wanted],
        None if clip.reads_once else source, mapped, stream=settings.stream,
        last_length_s=last_length_s, notices=plan.notices,
    )  # fmt: skip
    return pictures
