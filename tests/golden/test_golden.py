"""A few finished frames held against stored ones: to the bit where they were made, near elsewhere.

    python tests/golden/test_golden.py       makes golden.json anew, after a change meant to show

Other versions of OpenCV or NumPy and other CPUs round differently; there a sample of the pixels
must agree to a part of a half float's steps.
"""

from __future__ import annotations

import hashlib
import json
import platform
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from itmo_video import RunOptions, convert, make_settings
from itmo_video.kernels import library
from itmo_video.output.exr import read_exr

HERE = Path(__file__).resolve().parent
CLIPS = HERE.parents[1] / "sample_clips"
STORED = HERE / "golden.json"
STEP_PX = 24  # every so many pixels and lines one is stored
LOG2_TOLERANCE = 0.02  # of a sampled pixel, in stops; 1.4 %
MEAN_TOLERANCE = 0.001  # of a channel's mean, as a share of it

# name: (clip, frame, preset, settings)
CASES: dict[str, tuple[str, int, str, dict[str, Any]]] = {
    "night": ("night_street", 21, "default", {}),
    "flash": ("cut_and_flash", 33, "default", {}),
    "paper": ("bright_window", 13, "paper", {}),
    "acescg": ("bright_window", 8, "default", {"primaries": "acescg", "over_white": "keep"}),
}


def environment() -> dict[str, str]:
    """What may change the last bit of a result."""
    return {
        "machine": platform.machine(),
        "cpu": cv2.getCPUFeaturesLine(),
        "loops": "compiled" if library.library() else "libraries",
        **{n: version(n) for n in ("av", "numpy", "scipy", "opencv-contrib-python-headless")},
    }


def frame_of(case: str, folder: Path) -> npt.NDArray[np.float16]:
    """One frame of a case: (3, H, W)."""
    clip, number, preset, changes = CASES[case]
    settings = make_settings(preset, compression="none", **changes)
    convert(CLIPS / f"{clip}.mp4", folder, settings, RunOptions(frames=str(number), jobs=1))
    channels = read_exr(folder / f"{clip}.{number:04d}.exr").channels
    return np.stack([channels[name] for name in "RGB"])


def facts_of(rgb: npt.NDArray[np.float16]) -> dict[str, Any]:
    """Digest, means and a sample of a frame; the sample as log2 of 1/1024 plus the value."""
    sample = np.log2(rgb[:, ::STEP_PX, ::STEP_PX].astype(np.float64) + 1 / 1024)
    return {
        "digest": hashlib.blake2b(rgb.tobytes(), digest_size=16).hexdigest(),
        "means": [round(float(mean), 6) for mean in rgb.astype(np.float64).mean(axis=(1, 2))],
        "shape": list(sample.shape),
        "sample": [round(float(value), 3) for value in sample.ravel()],
    }


@pytest.mark.parametrize("case", sorted(CASES))
def test_frame_is_as_stored(case: str, tmp_path: Path) -> None:
    stored = json.loads(STORED.read_text())
    want, found = stored["frames"][case], facts_of(frame_of(case, tmp_path))
    assert found["shape"] == want["shape"]
    assert found["means"] == pytest.approx(want["means"], rel=MEAN_TOLERANCE)
    apart = np.abs(np.subtract(found["sample"], want["sample"]))
    assert apart.max() <= LOG2_TOLERANCE, f"a pixel is {apart.max():.3f} stops off"
    if stored["environment"] == environment():
        assert found["digest"] == want["digest"], "near, but not the same bytes as before"


def test_the_tolerance_sees_a_change_of_the_picture(tmp_path: Path) -> None:
    """A tenth of a stop more at the top does not pass."""
    want = json.loads(STORED.read_text())["frames"]["paper"]
    settings = make_settings("paper", compression="none", l_max=5.3)
    convert(CLIPS / "bright_window.mp4", tmp_path, settings, RunOptions(frames="13", jobs=1))
    channels = read_exr(tmp_path / "bright_window.0013.exr").channels
    found = facts_of(np.stack([channels[name] for name in "RGB"]))
    assert np.abs(np.subtract(found["sample"], want["sample"])).max() > LOG2_TOLERANCE
    assert found["means"] != pytest.approx(want["means"], rel=MEAN_TOLERANCE)


def main() -> None:
    """Make the stored frames anew."""
    frames = {}
    for case in sorted(CASES):
        with tempfile.TemporaryDirectory() as folder:
            frames[case] = facts_of(frame_of(case, Path(folder)))
    stored = {"environment": environment(), "frames": frames}
    text = json.dumps(stored)
    STORED.write_text(text.replace('}, "', '},\n"').replace('"sample"', '\n"sample"') + "\n")


if __name__ == "__main__":
    main()
