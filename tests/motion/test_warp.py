"""Flow that goes with the camera where a picture says nothing itself."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from itmo_video.model import Code
from itmo_video.motion.flow import camera_motion_px, flow_px

HEIGHT, WIDTH = 144, 256


def textured(height: int, width: int, seed: int) -> npt.NDArray[np.uint8]:
    noise = np.random.default_rng(seed).random((height, width), np.float32)
    soft = cv2.GaussianBlur(noise, (0, 0), 3)
    return np.asarray(255 * (soft - soft.min()) / np.ptp(soft), np.uint8)


def test_camera_motion_is_the_affine_motion_of_most_of_the_picture() -> None:
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    true = np.dstack([3 + 0.01 * x - 0.02 * y, -2 + 0.005 * x + 0.004 * y]).astype(np.float32)
    flow = true.copy()
    flow[30:100, 60:160] = (-20, 9)  # an object of a fifth of the picture
    found = camera_motion_px(textured(HEIGHT, WIDTH, 0), flow)
    np.testing.assert_allclose(found, true, atol=0.02, err_msg="the object moved the camera")


def test_nothing_moves_where_nothing_has_texture() -> None:
    flow = np.full((HEIGHT, WIDTH, 2), 5, np.float32)
    assert not camera_motion_px(np.full((HEIGHT, WIDTH), 90, np.uint8), flow).any()


def test_a_plain_sky_goes_with_the_panning_camera() -> None:
    wide = textured(HEIGHT, WIDTH + 8, 1)
    wide[: HEIGHT // 2] = 230
    here, there = np.ascontiguousarray(wide[:, 8:]), np.ascontiguousarray(wide[:, :-8])
    sky = flow_px(here, there)[10 : HEIGHT // 2 - 20, 20:-20]
    np.testing.assert_allclose(sky[..., 0], 8, atol=0.3, err_msg="the sky stays behind")
    np.testing.assert_allclose(sky[..., 1], 0, atol=0.3)


def test_a_noisy_still_picture_stays_still_beside_a_moving_object() -> None:
    rng = np.random.default_rng(2)

    def frame(left: int) -> Code:
        picture = 100 + rng.normal(0, 1.0, (HEIGHT, WIDTH))
        picture[:, 200:220] += 60
        picture[50:90, left : left + 40] = textured(40, 40, 3)
        return np.clip(np.rint(picture), 0, 255).astype(np.uint8)

    flow = flow_px(frame(40), frame(48))
    assert np.abs(flow[:, 198:224]).mean() < 0.2, "a still lamp is carried by the object"
    assert np.abs(flow[:, 130:]).mean() < 0.5, "the background is carried by the object"
    assert np.median(flow[60:80, 50:70, 0]) > 6, "the object is not followed"
