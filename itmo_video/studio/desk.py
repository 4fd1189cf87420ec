"""The studio behind its page: the clip, the document, pictures, saved files and renders."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from itmo_video.analysis.analyse import analyse
from itmo_video.analysis.model import Analysis
from itmo_video.conversion.run_options import RunOptions
from itmo_video.errors import ItmoError, UsageError
from itmo_video.events import Event, FrameDone
from itmo_video.model import ClipInfo
from itmo_video.settings import Settings
from itmo_video.source.clip import first_number
from itmo_video.source.opening import input_files, input_options
from itmo_video.studio import document as documents
from itmo_video.studio.document import Document, History
from itmo_video.studio.latest import Latest, Stale
from itmo_video.studio.running import RENDERS_AGAIN, Runner
from itmo_video.studio.saving import Saver, command, is_as_read
from itmo_video.studio.session import PARTS, SCALES, Part, Session, Shown, StaleError

LANES = ("a", "b", "sdr", "layer", "lights", "still", "try", "play")
SLOTS = ("a", "b")
RENDERS = {"convert": "", "preview": ".mp4"}


class Desk:
    """One open clip; its methods may be called from any thread. Close it, or use `with`."""

    def __init__(
        self,
        source: str | Path,
        document: Document,
        folder: Path,
        run: RunOptions | None = None,
    ) -> None:
        """Open the clip and start finding its cuts unless `document` already has its analysis."""
        run = run or RunOptions()
        self._run = run
        self._session = Session(source, input_options(document.settings, run.max_pixels))
        self.info: ClipInfo = self._session.clip.info
        self.first_number = first_number(self.info, run.start_number)
        self.opened, self.history = document, History(document)
        self.version = 1
        self.other: Document | None = None
        self.saver, self.runner = Saver(folder, input_files(source)), Runner()
        self.saved: dict[str, Path] = {}
        self._saved_as: dict[str, Document] = {}
        self.analysed, self.analysis_error = 0, ""
        self._latest = Latest(LANES)
        self._lock = threading.RLock()
        self._closing = False
        self._scratch = tempfile.TemporaryDirectory(prefix="itmo-studio-")
        document.own_looks(self.info)  # raises if the analysis belongs to another clip
        self._analyst = threading.Thread(target=self._analyse, name="studio-cuts", daemon=True)
        if document.analysis is None:
            self._analyst.start()

    def __enter__(self) -> Desk:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop all work and release the clip; a running render is interrupted."""
        self._closing = True
        self._latest.close()
        if self._analyst.is_alive():
            self._analyst.join()
        self.runner.close()
        self._session.close()
        self._scratch.cleanup()

    def stop_showing(self) -> None:
        """Stop the work on pictures, even if requests are waiting for them."""
        self._latest.close()

    # Pictures

    def picture(
        self, index: int, slot: str, part: str, scale: int, lane: str, page: str = ""
    ) -> tuple[str, Future[Shown]]:
        """A key of what a frame depends on, and the frame rendered with the current settings.

        The key is a version of the settings; for SDR, of what reading the source depends on.
        """
        with self._lock:
            version, document = self.version, self._in_slot(slot)
        shown = self._shown(index, document, part, scale, lane, page)
        return document.source_key(index, self.info) if part == "sdr" else str(version), shown

    def attempt(
        self, index: int, preset: object, values: Mapping[str, Any], scale: int,
        shot: int | None = None, page: str = "",
    ) -> tuple[float, Future[Shown]]:  # fmt: skip
        """A frame with another preset, or with `values` on top of the settings, and its peak."""
        with self._lock:
            document = self.history.now
        if preset is not None:
            document = documents.with_preset(document, preset, self.opened, shot)
        document = documents.set_values(document, values, shot)
        shown = self._shown(index, document, "hdr", scale, "try", page)
        return document.look_at(index, self.info).settings.l_max_effective, shown

    def lights(self, index: int, slot: str, page: str = "") -> Future[list[tuple[float, float]]]:
        """The median-cut lights of a frame as points (x, y), 0 to 1 across the picture."""
        self._check_index(index)
        document = self._in_slot(slot)
        look, own = document.look, document.look_at(index, self.info)

        def work(stale: Stale) -> list[tuple[float, float]]:
            return self._session.lights(index, look, own)

        return self._latest.submit("lights", work, page)

    def settings_at(self, index: int, slot: str) -> Settings:
        """The settings used for a frame."""
        self._check_index(index)
        return self._in_slot(slot).look_at(index, self.info).settings

    def settings_of(self, shot: int | None) -> Settings:
        """The current settings of the clip or of one shot; raises UsageError if there is none."""
        now = self.history.now
        if shot is None:
            return now.settings
        if not 0 <= shot < len(now.shots):
            raise UsageError(f"there is no shot {shot + 1}")
        return now.shots[shot].settings(now.settings)

    def _shown(
        self, index: int, document: Document, part: str, scale: int, lane: str, page: str
    ) -> Future[Shown]:
        self._check_index(index)
        if part not in PARTS or scale not in SCALES or lane not in LANES:
            raise UsageError(f"unknown part {part!r}, scale {scale!r} or lane {lane!r}")
        known: Part = part
        look, own = document.look, document.look_at(index, self.info)

        def work(stale: Stale) -> Shown:
            if stale():
                raise StaleError
            return self._session.picture(index, look, own, known, scale, stale)

        return self._latest.submit(lane, work, page)

    def _in_slot(self, slot: str) -> Document:
        if slot not in SLOTS:
            raise UsageError(f"unknown slot {slot!r}")
        return self.other if slot == "b" and self.other is not None else self.history.now

    def _check_index(self, index: int) -> None:
        if not 0 <= index < self.info.frames:
            raise UsageError(f"there is no frame {index + self.first_number} in this clip")

    # Edits

    def edit(self, change: Callable[[Document], Document], gesture: str | None = None) -> None:
        """Change the document; raises UsageError and changes nothing if the result is invalid."""
        with self._lock:
            self.history.do(change(self.history.now), self.info, gesture)
            self.version += 1

    def step(self, back: bool) -> None:
        """Undo or redo."""
        with self._lock:
            (self.history.undo if back else self.history.redo)()
            self.version += 1

    def keep_other(self) -> None:
        """Keep the current settings as B, for comparison."""
        with self._lock:
            self.other = self.history.now
            self.version += 1

    def swap(self) -> None:
        """Swap the current settings and B."""
        with self._lock:
            if self.other is None:
                raise UsageError(
                    "there is no B yet", remedy="Keep the current settings as B first."
                )
            before = self.history.now
            self.history.do(self.other, self.info)
            self.other = before
            self.version += 1

    def save(self, kind: str, name: str, replace: bool) -> Path:
        """Save the preset or the shot list."""
        with self._lock:
            path = self.saver.save(kind, name, self.history.now, replace)
            self.saved[kind], self._saved_as[kind] = path, self.history.now
            return path

    def command(self) -> str:
        """The command of the last render, or `convert`, with the current settings.

        It names saved files if they are up to date.
        """
        with self._lock:
            now = self.history.now
            preset = self.saved.get("preset") if self._holds("preset") else None
            shots = self.saved.get("shots") if self._holds("shots") else None
            is_film = self.runner.progress.kind == "preview"
            output = "FILM.mp4" if is_film else "OUTPUT_DIR"
            kind = "preview" if is_film else "convert"
            return command(now, self.info.path, output, preset, shots, kind, self._run)

    @property
    def shots_need_saving(self) -> bool:
        """Whether the shots differ from those that a conversion of the clip would find."""
        return bool(self.history.now.own_looks(self.info)) and not self._holds("shots")

    @property
    def preset_needs_saving(self) -> bool:
        """Whether the settings are based on a preset's file that says something else by now."""
        return not self._holds("preset") and not is_as_read(self.history.now)

    def _holds(self, kind: str) -> bool:
        saved, now = self._saved_as.get(kind), self.history.now
        if saved is None or not self.saver.is_ours(self.saved[kind]):
            return False
        if kind == "preset":
            return (saved.preset, saved.changed) == (now.preset, now.changed)
        return saved.analysis == now.analysis

    # Render

    def render(self, kind: str, name: str, again: bool = False) -> Path:
        """Start converting the clip to a folder, or to a film, next to the saved files.

        With `again`, frames with other settings, or the film, are re-rendered.
        """
        if kind not in RENDERS:
            raise UsageError(f"{kind!r} is neither convert nor preview")
        output = self.saver.path(name, RENDERS[kind])
        self._session.check_source()
        with self._lock:
            now = self.history.now
            private = Saver(Path(self._scratch.name))
            # As files, so that any setting can be passed and later edits do not affect the render.
            arguments = [kind, self.info.path, str(output)]
            serial = str(self.version)
            arguments += ["--preset", str(private.save("preset", f"p{serial}", now, True))]
            if now.own_looks(self.info):
                arguments += ["--analysis", str(private.save("shots", f"s{serial}", now, True))]
            arguments += ["--start-number", str(self.first_number)]
            arguments += ["--max-pixels", str(self._run.max_pixels)]
            arguments += [RENDERS_AGAIN[kind]] if again else []
        self.runner.start(kind, arguments, output)
        return output

    def _analyse(self) -> None:
        def on_event(event: Event) -> None:
            if self._closing:
                raise StaleError
            if isinstance(event, FrameDone):
                self.analysed = event.done

        try:
            found: Analysis = analyse(
                self.info.path,
                self.history.now.settings,
                start_number=self.first_number,
                max_pixels=self._run.max_pixels,
                on_event=on_event,
            )
        except StaleError:
            return
        except ItmoError as error:
            self.analysis_error = str(error)
            return
        if found.digest != self.info.digest:
            self.analysis_error = "the clip changed since the studio opened it"
            return
        with self._lock:
            self.history.analysed(found)
            if self.other is not None:
                self.other = documents.with_analysis(self.other, found)
            self.version += 1
