"""Chromium's own decoders see what was meant: code points, and codes as FFmpeg decodes them."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import numpy.typing as npt
import pytest
from clips import moving_scene, write_ffv1

from itmo_video import PreviewOptions, preview
from itmo_video.delivery.choices import View

SIZE = (64, 96)
TYPES = {".avif": "image/avif", ".png": "image/png", ".jpg": "image/jpeg", ".mp4": "video/mp4"}
PICTURE = """
const told = async (image) => {
  const bytes = new Uint8Array(image.allocationSize());
  const planes = await image.copyTo(bytes);
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return { format: image.format, space: image.colorSpace.toJSON(), planes, codes: btoa(text) };
};
"""
STILL = """async ([url, type]) => {%s
  const data = await (await fetch(url)).arrayBuffer();
  return told((await new ImageDecoder({ data, type }).decode()).image);
}"""
FILM = """async ([url]) => {%s
  const video = document.createElement("video");
  await new Promise((done, failed) => {
    video.onloadeddata = done;
    video.onerror = () => failed(video.error.message);
    video.muted = true;
    video.src = url;
  });
  for (let tries = 0; tries < 3000; tries += 1) { // loaded is not yet shown: its frame comes later
    try {
      return await told(new VideoFrame(video));
    } catch (error) {
      if (error.name !== "InvalidStateError") throw error;
    }
    await new Promise((done) => setTimeout(done, 20));
  }
  throw new Error("the film never showed a frame");
}"""
BT2020 = {"primaries": "bt2020", "matrix": "bt2020-ncl", "fullRange": False}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pictures")
    clip = write_ffv1(folder / "c.mkv", moving_scene(2, width=SIZE[1], height=SIZE[0]))
    stills: dict[str, View | None] = {
        "pq.avif": None, "hlg.avif": "hlg", "pq.png": None, "map.jpg": None
    }  # fmt: skip
    for name, view in stills.items():
        preview(clip, folder / name, options=PreviewOptions(view=view, frame=1))
    films: tuple[View, ...] = ("hdr10", "hlg")
    for shown in films:
        preview(clip, folder / f"{shown}.mp4", options=PreviewOptions(view=shown, speed="12"))
    return folder


@pytest.fixture(scope="module")
def tab(browser: Any, folder: Path) -> Iterator[Any]:
    """A page of a secure origin that is this folder; nothing is asked of a network."""

    def serve(route: Any) -> None:
        name = route.request.url.rpartition("/")[2]
        if name:
            route.fulfill(body=(folder / name).read_bytes(), content_type=TYPES[Path(name).suffix])
        else:
            route.fulfill(body="<!doctype html><title>pictures</title>", content_type="text/html")

    page = browser.new_page()
    page.route("https://pictures.test/**", serve)
    page.goto("https://pictures.test/")
    yield page
    page.close()


def seen(tab: Any, name: str) -> dict[str, Any]:
    script = FILM if name.endswith(".mp4") else STILL
    told = tab.evaluate(script % PICTURE, [f"/{name}", TYPES[Path(name).suffix]])
    told["codes"] = base64.b64decode(told["codes"])
    return dict(told)


def plane(told: dict[str, Any], number: int, kind: Any, shape: tuple[int, int]) -> npt.NDArray[Any]:
    at, stride = (told["planes"][number][name] for name in ("offset", "stride"))
    rows = np.frombuffer(told["codes"], np.uint8)[at : at + stride * shape[0]]
    return np.asarray(rows.reshape(shape[0], stride).view(kind)[:, : shape[1]])


@pytest.mark.parametrize(
    ("name", "transfer"),
    [("pq.avif", "pq"), ("hlg.avif", "hlg"), ("hdr10.mp4", "pq"), ("hlg.mp4", "hlg")],
)
def test_ten_bits_come_through(tab: Any, folder: Path, name: str, transfer: str) -> None:
    told = seen(tab, name)
    assert told["format"] == "I420P10"
    assert told["space"] == {**BT2020, "transfer": transfer}
    with av.open(str(folder / name)) as box:
        frame = next(box.decode(video=0))
        theirs = np.split(frame.to_ndarray(), [SIZE[0], SIZE[0] * 5 // 4])
    halved = (SIZE[0] // 2, SIZE[1] // 2)
    for number, shape in enumerate((SIZE, halved, halved)):
        np.testing.assert_array_equal(
            plane(told, number, np.uint16, shape), theirs[number].reshape(shape)
        )


def test_a_png_is_pq_by_its_cicp(tab: Any, folder: Path) -> None:
    told = seen(tab, "pq.png")
    assert (told["space"]["primaries"], told["space"]["transfer"]) == ("bt2020", "pq")
    assert told["format"].startswith("BGR")
    eight = plane(told, 0, np.uint8, (SIZE[0], 4 * SIZE[1])).reshape(*SIZE, 4)[..., :3]
    ours = cv2.imread(str(folder / "pq.png"), cv2.IMREAD_UNCHANGED)
    assert ours is not None
    assert ours.dtype == np.uint16
    np.testing.assert_allclose(eight, ours / 257, atol=1)


def test_a_gain_maps_base_is_the_sdr_picture(tab: Any, folder: Path) -> None:
    told = seen(tab, "map.jpg")
    assert told["space"]["transfer"] == "iec61966-2-1"
    base = cv2.imread(str(folder / "map.jpg"))
    assert base is not None
    luma = base @ np.array([0.114, 0.587, 0.299])
    assert np.abs(plane(told, 0, np.uint8, SIZE) - luma).max() <= 2
