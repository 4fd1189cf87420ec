"""What the scenes are drawn with: soft shapes, noise, rays, a lens and a walking person."""

import functools
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.floating[Any]]
Rays = tuple[Image, Image, Image]  # direction to the right, up, ahead

WIDTH, HEIGHT, RATE, FRAMES, OVERSAMPLE = 480, 270, 24, 48, 2


def rgb(red: float, green: float, blue: float) -> Image:
    """Return a colour, linear Rec.709."""
    return np.array([red, green, blue], np.float32)


def step(low: float | Image, high: float | Image, x: Image) -> Image:
    """0 at low, 1 at high (in either order), smooth between."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return np.asarray(t * t * (3 - 2 * t), np.float32)


def inside(x: Image, low: float, high: float, soft: float | Image) -> Image:
    """Return 1 between low and high, 0 outside, with soft edges."""
    return step(low - soft, low + soft, x) * step(high + soft, high - soft, x)


def over(below: Image, above: Image | float, cover: Image) -> Image:
    """Lay one picture or colour over another where `cover` is 1."""
    return below + (above - below) * cover[..., None]


@functools.cache
def noise(seed: int, slope: float, size: int = 512) -> Image:
    """Make a tile of 1/f**slope noise with mean 0 and deviation 1."""
    rows, columns = np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None]
    distance = np.hypot(rows, columns)
    distance[0, 0] = np.inf
    spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal((size, size)))
    tile = np.fft.irfft2(spectrum / distance**slope)
    return np.asarray(tile / tile.std(), np.float32)


def look_up(tile: Image, u: Image, v: Image) -> Image:
    """Read a tile, repeated for ever, at column u and row v."""
    height, width = tile.shape
    u, v = np.asarray(u % width, np.float32), np.asarray(v % height, np.float32)
    return np.asarray(
        cv2.remap(tile, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP), np.float32
    )


def blur(picture: Image, x: float, y: float) -> Image:
    """Blur by a Gaussian with deviations of x and y pixels."""
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), sigmaX=x, sigmaY=y), np.float32)


def enlarge(picture: Image) -> Image:
    """Double the width and the height."""
    return np.asarray(cv2.resize(picture, None, fx=2, fy=2), np.float32)


def view_rays(half_width: float, horizon: float, yaw: float = 0.0) -> Rays:
    """One ray a pixel of the oversampled picture; `horizon`: eye level, 0 top to 1 bottom."""
    x, y = np.meshgrid(np.arange(WIDTH * OVERSAMPLE) + 0.5, np.arange(HEIGHT * OVERSAMPLE) + 0.5)
    scale = half_width / (WIDTH * OVERSAMPLE / 2)
    right = (x - WIDTH * OVERSAMPLE / 2) * scale
    up = (horizon * HEIGHT * OVERSAMPLE - y) * scale
    return (
        np.asarray(right * np.cos(yaw) + np.sin(yaw), np.float32),
        np.asarray(up, np.float32),
        np.asarray(np.cos(yaw) - right * np.sin(yaw), np.float32),
    )


def lens(picture: Image) -> npt.NDArray[np.float32]:
    """Area average, glare and vignetting."""
    mean = np.asarray(
        cv2.resize(picture, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), np.float32
    )
    glare = 0.05 * blur(mean, 1.5, 1.5) + 0.022 * blur(mean, 7, 7) + 0.012 * blur(mean, 28, 28)
    y, x = np.mgrid[-1 : 1 : HEIGHT * 1j, -1 : 1 : WIDTH * 1j]
    vignette = (1 + 0.22 * (x * x + 0.5 * y * y)) ** -2
    return np.asarray((0.916 * mean + glare) * vignette[..., None], np.float32)


def person(u: Image, v: Image, phase: float, swing: float) -> Image:
    """Metres (negative inside) to somebody of 1.75 m who walks along u, seen from the side."""
    total = np.zeros_like(u)

    def limb(ax: float, ay: float, bx: float, by: float, thick: float, thin: float) -> None:
        nonlocal total
        along = np.clip(
            ((u - ax) * (bx - ax) + (v - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2), 0, 1
        )
        distance = np.hypot(u - ax - along * (bx - ax), v - ay - along * (by - ay))
        total += np.exp(np.clip((thick + (thin - thick) * along - distance) / 0.012, -60, 40))

    bob = 0.02 * float(np.cos(2 * phase)) * (swing > 0)
    limb(0.02, 1.65 + bob, 0.035, 1.56 + bob, 0.1, 0.068)
    limb(0.1, 1.6 + bob, 0.118, 1.585 + bob, 0.02, 0.01)
    limb(0.0, 1.55 + bob, -0.01, 1.4 + bob, 0.055, 0.075)
    limb(-0.01, 1.33 + bob, 0.0, 1.12 + bob, 0.13, 0.105)
    limb(0.0, 1.12 + bob, -0.015, 0.95 + bob, 0.105, 0.115)
    for side in (0.0, np.pi):
        leg, arm = swing * float(np.sin(phase + side)), -0.8 * swing * float(np.sin(phase + side))
        bend = swing * (0.55 + 0.55 * float(np.cos(phase + side)))
        knee = (0.43 * float(np.sin(leg)), 0.93 + bob - 0.43 * float(np.cos(leg)))
        foot = (
            knee[0] + 0.4 * float(np.sin(leg - bend)),
            knee[1] - 0.4 * float(np.cos(leg - bend)),
        )
        limb(-0.01, 0.93 + bob, *knee, 0.1, 0.062)
        limb(*knee, *foot, 0.062, 0.042)
        limb(foot[0], foot[1] - 0.03, foot[0] + 0.14, foot[1] - 0.045 - 0.03 * bend, 0.05, 0.035)
        elbow = (0.29 * float(np.sin(arm)), 1.38 + bob - 0.29 * float(np.cos(arm)))
        limb(0.0, 1.38 + bob, *elbow, 0.062, 0.048)
        limb(
            *elbow,
            elbow[0] + 0.27 * float(np.sin(arm + 0.3)),
            elbow[1] - 0.27 * float(np.cos(arm + 0.3)),
            0.046,
            0.036,
        )
    return np.asarray(-0.012 * np.log(total), np.float32)
