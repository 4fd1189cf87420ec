"""What colourists, phones and broadcast make of a scene of known radiance: samples for the curve.

A sample is an SDR picture and its HDR rendition, which agree in the middle tones. A camera that
clips leaves everything below white as it was; a tone-mapped picture has its highlights compressed
into the upper half of the codes, by one curve for the whole picture or locally, as phones do.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
from scenes import BT709_WEIGHTS, Codes, Float, expose, srgb_encode, title, window

SIZE = (320, 192)
KINDS = ("clipped", "left", "global", "local")
SHARES = (0.27, 0.18, 0.25, 0.30)


def luminance(rgb: Float) -> Float:
    """BT.709's luminance (h, w, 1) of linear RGB."""
    return np.asarray(np.maximum(rgb @ BT709_WEIGHTS, 1e-6)[..., None], np.float32)


def blurred(plane: Float, radius: int, epsilon: float) -> Float:
    """A plane (h, w) smoothed along its own edges (guided filter, He et al. 2010)."""
    side = (2 * radius + 1, 2 * radius + 1)
    mean = cv2.blur(plane, side)
    variance = cv2.blur(plane * plane, side) - mean * mean
    a = variance / (variance + np.float32(epsilon))
    return np.asarray(cv2.blur(a, side) * plane + cv2.blur(mean - a * mean, side), np.float32)


def agreeing(truth: Float, recorded: Float) -> Float:
    """The truth scaled so that its middle tones have the recorded luminance."""
    ours, theirs = luminance(recorded)[..., 0], luminance(truth)[..., 0]
    low, high = np.percentile(ours, (15, 60))
    middle = (ours >= low) & (ours <= high)
    ratio = np.median(np.log(ours[middle]) - np.log(theirs[middle])) if middle.any() else 0.0
    return np.asarray(truth * np.float32(np.exp(ratio)), np.float32)


def curve_of(kind: str, scene: Float, white: float) -> Float:
    """A published tone curve of linear light whose middle grey is 0.18: to [0, 1] at `white`."""
    return np.asarray(_curve_of(kind, scene, white), np.float32)


def _curve_of(kind: str, scene: Float, white: float) -> npt.NDArray[np.floating]:
    if kind == "reinhard":  # Reinhard et al. 2002, eq. 4
        return scene * (1 + scene / white**2) / (1 + scene)
    if kind == "aces":  # Narkowicz's fit
        scene = scene * 0.6
        return scene * (2.51 * scene + 0.03) / (scene * (2.43 * scene + 0.59) + 0.14)
    if kind == "hable":
        a, b, c, d, e, f = 0.15, 0.5, 0.1, 0.2, 0.02, 0.3

        def filmic(x: Float) -> npt.NDArray[np.floating]:
            return np.asarray((x * (a * x + c * b) + d * e) / (x * (a * x + b) + d * f) - e / f)

        return filmic(2 * scene) / filmic(np.asarray(2 * white, np.float32))
    if kind == "log":  # BT.2446 method A's forward curve
        p = 1 + 32 * np.float32(0.1) ** (1 / 2.4)
        code = (np.minimum(scene / white, 1)) ** np.float32(1 / 2.4)
        return np.asarray((np.log(1 + (p - 1) * code) / np.log(p)) ** np.float32(2.2))
    knee = np.float32(0.5)  # linear up to a knee, then a shoulder
    above = np.maximum(scene - knee, 0) / (1 - knee)
    return np.asarray(np.minimum(scene, knee) + (1 - knee) * (1 - np.exp(-above)))


def tone_mapped(scene: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """(recorded, truth): one curve for the whole picture, of luminance or of each channel."""
    y = luminance(scene)
    grey = np.exp(np.mean(np.log(y + 1e-4))) * np.exp(rng.normal(0, 0.35))
    scene = np.minimum(scene * np.float32(0.18 / max(grey, 1e-6)), 1e3)
    y = luminance(scene)
    white = float(np.clip(np.percentile(y, rng.uniform(98, 99.95)), 1.2, 16))
    kind = str(rng.choice(["reinhard", "aces", "hable", "log", "shoulder"]))
    if rng.random() < 0.5:  # hue kept by luminance's gain, channels then clip apart
        recorded = scene * curve_of(kind, y, white) / y
    else:  # channels fade to white
        recorded = curve_of(kind, scene, white)
    return np.clip(recorded, 0, 1), scene


def locally_mapped(scene: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """(recorded, truth) as by a phone: shadows lifted in both, highlights compressed in SDR."""
    y = np.log2(luminance(scene)[..., 0] + np.float32(1e-5))
    radius, epsilon = int(np.exp(rng.uniform(np.log(4), np.log(40)))), float(rng.uniform(0.1, 2))
    base = blurred(y, radius, epsilon)
    middle = np.float32(np.percentile(base, rng.uniform(25, 65)))
    shadows, lights = np.float32(rng.uniform(0.4, 0.9)), np.float32(rng.uniform(0.6, 1.0))
    above = base - middle
    level = np.float32(np.log2(rng.uniform(0.06, 0.3)))
    hdr = level + np.where(above < 0, above * shadows, above * lights)
    detail = y - base
    top = float(np.percentile(hdr + detail, rng.uniform(98.5, 99.9)))
    knee = min(np.log2(rng.uniform(0.08, 0.35)), top - 0.1)
    room = np.log2(rng.uniform(0.85, 1.05)) - knee
    share = np.float32(min(1.0, room / max(top - knee, 1e-3)))
    fold = np.float32(rng.uniform(0.15, 0.8))  # how soft the knee is, in stops
    over = fold * np.logaddexp(0, (hdr - np.float32(knee)) / fold)
    sdr = hdr - over * (1 - share)
    keep = np.float32(rng.uniform(0.8, 1.0))
    recorded = scene * np.exp2(sdr + keep * detail - y)[..., None]
    truth = scene * np.exp2(hdr + detail - y)[..., None]
    return np.clip(recorded, 0, 1), truth


def saturated(rgb: Float, amount: float) -> Float:
    """More or less colour about the luminance."""
    y = luminance(rgb)
    return np.maximum(y + (rgb - y) * np.float32(amount), 0)


def drawn(rng: np.random.Generator) -> Float:
    """Flat shapes and soft shades, as in animation, titles and screens: linear RGB to 1."""
    w, h = SIZE
    picture = np.empty((h, w, 3), np.float32)
    ends = rng.uniform(0, 1, (2, 3)).astype(np.float32) ** 1.5
    ramp = np.linspace(0, 1, h, dtype=np.float32)[:, None, None]
    picture[:] = ends[0] * (1 - ramp) + ends[1] * ramp
    for _ in range(rng.integers(3, 30)):
        colour = rng.uniform(0, 1, 3) ** rng.uniform(0.4, 2.2)
        if rng.random() < 0.25:
            colour[:] = rng.uniform(0.6, 1.0)
        centre = (int(rng.uniform(0, w)), int(rng.uniform(0, h)))
        axes = (int(np.exp(rng.uniform(1, 4.6))), int(np.exp(rng.uniform(1, 4.6))))
        if rng.random() < 0.5:
            cv2.ellipse(picture, centre, axes, rng.uniform(0, 180), 0, 360, colour.tolist(), -1)
        else:
            corner = (centre[0] + axes[0], centre[1] + axes[1])
            cv2.rectangle(picture, centre, corner, colour.tolist(), -1)
    shade = cv2.resize(rng.uniform(0.6, 1, (4, 6)).astype(np.float32), SIZE)
    return np.asarray(np.clip(picture * shade[..., None], 0, 1), np.float32)


def delivered(recorded: Float, rng: np.random.Generator) -> Codes:
    """8-bit codes as they reach the user: levels, grain, sharpening, scaling, compression."""
    code = srgb_encode(np.clip(recorded, 0, 1))
    kind = rng.random()
    if kind < 0.15:
        black, white = rng.uniform(0, 0.06), rng.uniform(0.85, 1)
        code = np.float32(black) + code * np.float32(white - black)
    if rng.random() < 0.2:
        soft = cv2.GaussianBlur(code, (0, 0), rng.uniform(0.6, 1.5))
        code = soft if rng.random() < 0.5 else code + (code - soft) * np.float32(rng.uniform(0, 1))
    grain = rng.choice([0.0, 0.003, 0.01])
    code = code + np.float32(grain) * rng.standard_normal(code.shape[:2], np.float32)[..., None]
    codes = np.rint(np.clip(code, 0, 1) * 255).astype(np.uint8)
    if rng.random() < 0.8:
        quality = int(rng.choice([rng.integers(12, 60), rng.integers(60, 98)]))
        ok, data = cv2.imencode(".jpg", codes[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
        assert ok
        shown = cv2.imdecode(data, cv2.IMREAD_COLOR)
        assert shown is not None
        codes = np.ascontiguousarray(shown[..., ::-1])
    return codes


def rendition(scene: Float, rng: np.random.Generator) -> tuple[Codes, Float, str]:
    """(codes uint8 (h, w, 3), truth (h, w, 3) with 1.0 at SDR white, kind) of a random window."""
    kind = str(rng.choice(KINDS, p=SHARES))
    cut = window(scene, SIZE, rng)
    if kind == "clipped":
        truth = expose(cut, rng)
        if rng.random() < 0.15:
            truth = title(truth, rng)
        white = np.float32(1.0 if rng.random() < 0.7 else rng.uniform(0.9, 1))
        return delivered(np.clip(truth, 0, 1) * white, rng), truth * white, kind
    if kind == "left":
        if rng.random() < 0.4:
            truth = drawn(rng)
        else:
            y = luminance(cut)
            top = max(float(np.percentile(y, 99.9)), 1e-6)
            truth = cut * np.float32(rng.uniform(0.45, 1) / top)
        if rng.random() < 0.25:
            truth = title(truth, rng)
        truth = np.clip(truth, 0, 1)
        return delivered(truth, rng), truth, kind
    tint = np.exp(rng.normal(0, 0.08, 3)).astype(np.float32)
    recorded, truth = (tone_mapped if kind == "global" else locally_mapped)(cut * tint, rng)
    recorded = np.clip(saturated(recorded, rng.uniform(0.8, 1.3)), 0, 1)
    codes = delivered(recorded, rng)
    light = (codes.astype(np.float32) / 255 + np.float32(0.055)) / np.float32(1.055)
    return codes, agreeing(truth, np.maximum(light, 0) ** np.float32(2.4)), kind
