"""Record three drawn HDR scenes with a simulated SDR camera.

The scenes come from formulas, so their linear radiance is known:
Rec.709, 1.0 is the radiance that just reaches SDR white.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import numpy.typing as npt
from bright_window import bright_window
from cut_and_flash import cut_and_flash
from drawing import HEIGHT, RATE, WIDTH, Image, blur, lens
from night_street import night_street

SCENES = {
    "night_street": night_street,
    "bright_window": bright_window,
    "cut_and_flash": cut_and_flash,
}
CRF = {"night_street": 19, "bright_window": 17, "cut_and_flash": 21}


def scene_frames(name: str) -> Iterator[npt.NDArray[np.float32]]:
    """Yield a clip's true radiance: (270, 480, 3) a frame, linear, noiseless, not clipped."""
    for picture in SCENES[name]():
        yield lens(picture)


def _record(truth: Image, random: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Sensor noise, clipping, BT.1886, and limited-range BT.709 YCbCr 4:2:0, chroma sited left."""
    noise = blur(random.standard_normal(truth.shape, np.float32), 0.45, 0.45) * 1.6
    sensor = truth + noise * np.sqrt(0.002**2 + 0.0003 * np.minimum(truth, 2))
    red, green, blue = np.moveaxis(np.clip(sensor, 0, 1) ** (1 / 2.4), 2, 0)
    luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    planes = [16 + 219 * luma]
    for difference in ((blue - luma) / 1.8556, (red - luma) / 1.5748):
        left = np.pad(difference, ((0, 0), (1, 0)), mode="edge")
        across = 0.25 * left[:, :-1:2] + 0.5 * left[:, 1::2] + 0.25 * difference[:, 1::2]
        planes.append(128 + 224 * 0.5 * (across[0::2] + across[1::2]))
    codes = np.concatenate([plane.ravel() for plane in planes]).reshape(-1, WIDTH)
    return np.asarray(np.rint(codes), np.uint8)


def _write_clip(name: str, folder: Path, with_truth: bool) -> None:
    random = np.random.default_rng(sum(name.encode()))
    x264 = "threads=1:cpu-independent=1"  # without these its bytes differ from run to run
    options = {"crf": str(CRF[name]), "preset": "slow", "tune": "grain", "x264-params": x264}
    with av.open(str(folder / f"{name}.mp4"), "w", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=RATE, options=options)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        context = stream.codec_context
        context.color_primaries = context.color_trc = context.colorspace = context.color_range = 1
        for index, truth in enumerate(scene_frames(name)):
            frame = av.VideoFrame.from_ndarray(_record(truth, random), format="yuv420p")
            frame.color_primaries = frame.color_trc = frame.colorspace = frame.color_range = 1
            frame.pts = index
            container.mux(stream.encode(frame))
            if with_truth:
                _write_exr(folder / f"{name}_truth" / f"frame.{index:04d}.exr", truth)
        container.mux(stream.encode(None))


def _write_exr(path: Path, truth: Image) -> None:
    import OpenEXR  # only needed for --truth

    path.parent.mkdir(parents=True, exist_ok=True)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": truth.astype(np.float16)}).write(str(path))


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Write the sample clips.")
    parser.add_argument(
        "folder", metavar="OUT_DIR", nargs="?", type=Path, default=Path(__file__).parent
    )
    parser.add_argument("--truth", action="store_true", help="also write the true radiance as EXR")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for name in CRF:
        _write_clip(name, arguments.folder, arguments.truth)


if __name__ == "__main__":
    main()
