"""A sunset over the sea, a hard cut to a stage, and one camera flash."""

from collections.abc import Iterator

import numpy as np
from drawing import (
    FRAMES,
    RATE,
    Image,
    Rays,
    blur,
    inside,
    look_up,
    noise,
    over,
    person,
    rgb,
    step,
    view_rays,
)

CUT, FLASH = 20, 33  # the first frame of the second shot; the white frame
SUN, SEA_EYE, STAGE_EYE, CURTAIN_Z, LAMP_Y, LAMP_Z = (
    (0.07, 0.045),
    6.0,
    2.2,
    11.0,
    4.3,
    8.3,
)  # SUN: to the right, up
SPOTS = [  # left edge, swing, its phase, colour
    (-3.6, 1.5, 0.0, rgb(0.35, 0.55, 1.5)),
    (-1.2, 0.9, 2.1, rgb(1.3, 1.0, 0.6)),
    (1.2, 0.9, 4.0, rgb(1.25, 0.95, 0.65)),
    (3.6, 1.5, 1.2, rgb(1.5, 0.35, 0.75)),
]


def cut_and_flash() -> Iterator[Image]:
    """Yield a sunset over the sea, then a stage, where a camera in the audience flashes once."""
    for n in range(CUT):
        yield _sunset(n / RATE)
    rays = view_rays(0.6, 0.5)
    for n in range(CUT, FRAMES):
        flash = 2.6 * np.exp(-1.2 * rays[0] ** 2 - 1.2 * rays[1] ** 2) * (n == FLASH)
        yield _stage(rays, n / RATE) + flash[..., None] * rgb(0.98, 1, 1.04)


def _sunset(time: float) -> Image:
    dx, dy, dz = view_rays(0.3, 0.63)
    ripples, rock = noise(21, 1.15), noise(22, 1.3)
    sky = _evening_sky(dx, dy, time)
    sun = np.hypot(dx - SUN[0], dy - SUN[1])
    veil = np.exp(-2.2 * _clouds(dx, dy, time))
    sky += (50 * step(0.0125, 0.0115, sun) * veil)[..., None] * rgb(1.3, 0.96, 0.5)
    # the sea: a mirror broken by waves of three sizes
    far = SEA_EYE / np.maximum(-dy, 0.0008)
    x, z = far * dx, far * dz
    slope = np.zeros_like(far)
    for size, speed, height in ((1.6, 9.0, 0.25), (6.0, 16.0, 0.2), (20.0, 30.0, 0.14)):
        seen = np.clip(900 / (far * size), 0, 1)
        slope += (
            height
            * seen
            * look_up(ripples, x * size + speed * time, 0.8 * z * size + 2 * speed * time)
        )
    rise = abs(dy) + 0.05 + 0.1 * abs(slope)
    mirror = _evening_sky(dx + 0.02 * slope, rise, time)
    shine = 0.1 + 0.75 * np.exp(-abs(dy) * (6 + 2.5 * slope))
    sea = mirror * shine[..., None] + rgb(0.008, 0.018, 0.026)
    path = np.exp(-(((dx - SUN[0]) / (0.016 + 0.16 * abs(dy))) ** 2)) * (
        0.15 + np.exp(-abs(dy) / 0.1)
    )
    glitter = 5.5 * path * step(-0.25, 0.75, slope + 0.05 * np.exp(-abs(dy) / 0.02))
    sea += glitter[..., None] * rgb(1.35, 0.85, 0.35)
    picture = over(sky, sea, step(0.0006, -0.0006, dy))
    # a headland and a sailing boat against the light
    ridge = 0.075 * step(-0.04, -0.34, dx) + 0.006 * look_up(rock, dx * 900, 0 * dx) * step(
        -0.03, -0.1, dx
    )
    haze = 0.035 + 0.01 * look_up(rock, dx * 900, dy * 1500)
    land = step(ridge + 0.0006, ridge - 0.0006, dy) * step(-0.0012, 0, dy) * (dx < -0.05)
    picture = over(picture, haze[..., None] * rgb(1.5, 0.95, 0.9), land)
    u, v = (dx + 0.035 - 0.004 * time) / 0.03, (dy + 0.012) / 0.03
    v = v + 0.03 * u * np.sin(2 * time) + 0.015 * np.sin(3 * time)
    main = np.maximum(np.maximum(0.06 - u, 0.22 - v), u + 0.42 * v - 0.82)
    jib = np.maximum(np.maximum(u - 0.0, 0.2 - v), -u + 0.36 * v - 0.62)
    hull = np.maximum(np.maximum(abs(v - 0.08) - 0.08, abs(u) - 0.62 - 0.8 * v), -v)
    picture = over(picture, rgb(0.16, 0.09, 0.06), step(0.015, -0.015, np.minimum(main, jib)))
    return over(picture, rgb(0.015, 0.012, 0.014), step(0.015, -0.015, hull))


def _clouds(dx: Image, up: Image, time: float) -> Image:
    """How thick the clouds are: a flat layer that drifts to the right."""
    broad, small = noise(23, 1.75), noise(24, 1.2)
    far = 1 / (np.maximum(up, 0) + 0.09)
    u, v = dx * far, 2.2 * far
    thick = look_up(broad, 42 * u - 9 * time, 42 * v) + 0.3 * look_up(
        small, 130 * u - 28 * time, 130 * v
    )
    return np.maximum(thick + 0.05 + 0.5 * step(0.1, 0.35, up), 0) * step(-0.01, 0.05, up)


def _evening_sky(dx: Image, up: Image, time: float) -> Image:
    high, away = np.clip(up / 0.35, 0, 1), np.hypot(dx - SUN[0], 1.3 * (up - SUN[1]))
    sky = over(rgb(0.85, 0.36, 0.13), rgb(0.42, 0.3, 0.3), step(0, 0.45, high))
    sky = over(sky, rgb(0.11, 0.17, 0.32), step(0.2, 1.0, high))
    sky += np.exp(-away / 0.07)[..., None] * rgb(2.3, 1.25, 0.4)
    thick = _clouds(dx, up, time)
    toward = 0.012 * (SUN[0] - dx) / (away + 0.02), 0.02 * (SUN[1] - up) / (away + 0.02)
    edge = np.clip(1.0 + 1.1 * (thick - _clouds(dx + toward[0], up + toward[1], time)), 0.1, 2.5)
    lit = (0.3 + 2.2 * np.exp(-away / 0.11)) * edge
    cloud = lit[..., None] * rgb(0.85, 0.34, 0.16) + rgb(0.05, 0.045, 0.07)
    return over(sky, cloud, 0.92 * (1 - np.exp(-1.6 * thick)))


def _stage(rays: Rays, time: float) -> Image:
    dx, dy, dz = rays
    fabric, smoke = noise(31, 1.0), noise(32, 1.6)
    floor_far = STAGE_EYE / np.maximum(-dy, 1e-3)
    is_floor = step(CURTAIN_Z + 0.03, CURTAIN_Z - 0.03, floor_far)
    far = np.minimum(floor_far, CURTAIN_Z)
    x, y, z = far * dx, STAGE_EYE + far * dy, far * dz
    fold = np.sin(5.2 * x + 0.8 * np.sin(1.7 * x)) + 0.35 * np.sin(13.0 * x + 1)
    cloth = np.clip(0.5 + 0.33 * fold + 0.03 * look_up(fabric, x * 60, y * 8), 0.06, 1.5)
    boards = 0.5 + 0.08 * look_up(fabric, x * 12, z * 30) - 0.2 * inside(x % 0.4, 0, 0.025, 0.012)
    matter = over(
        cloth[..., None] * rgb(0.75, 0.09, 0.07), boards[..., None] * rgb(0.5, 0.4, 0.3), is_floor
    )
    light = np.zeros_like(matter) + rgb(0.014, 0.012, 0.016)
    beams = np.zeros_like(matter)
    drift = np.clip(1 + 0.3 * look_up(smoke, dx * 260 + 22 * time, dy * 260 + 7 * time), 0.2, 2)
    length = np.sqrt(dx**2 + dy**2 + 1)
    bulbs = []
    for left, swing, phase, colour in SPOTS:
        lamp = np.array([left, LAMP_Y, LAMP_Z])
        aim = np.array(
            [
                0.55 * left + swing * np.sin(1.5 * time + phase),
                0.0,
                8.6 + 0.5 * np.sin(time + phase),
            ]
        )
        axis = (aim - lamp) / np.linalg.norm(aim - lamp)
        ax, ay, az = (float(a) for a in axis)
        px, py, pz = x - left, y - LAMP_Y, z - LAMP_Z
        along = px * ax + py * ay + pz * az
        wide = np.sqrt(np.maximum(px**2 + py**2 + pz**2 - along**2, 0)) / np.maximum(along, 0.1)
        pool = step(0.2, 0.13, wide) + 0.12 * np.exp(-((wide / 0.4) ** 2))
        light += (pool * 75 / (along**2 + 2))[..., None] * colour
        # the beam in the smoke: nearest approach of the ray to the axis
        bx, by, bz = dx / length, dy / length, 1 / length
        cx, cy, cz = by * az - bz * ay, bz * ax - bx * az, bx * ay - by * ax
        cross = np.sqrt(cx**2 + cy**2 + cz**2) + 1e-4
        apart = abs(cx * left + cy * (LAMP_Y - STAGE_EYE) + cz * LAMP_Z) / cross
        slant = bx * ax + by * ay + bz * az
        ray_at = left * bx + (LAMP_Y - STAGE_EYE) * by + 8.3 * bz
        axis_at = left * ax + (LAMP_Y - STAGE_EYE) * ay + 8.3 * az
        down = (slant * ray_at - axis_at) / np.maximum(1 - slant**2, 1e-3)
        radius = 0.05 + 0.16 * np.maximum(down, 0)
        beam = np.exp(-((apart / radius) ** 2) * 1.6) / (radius + 0.18) * step(-0.05, 0.15, down)
        beam *= step(5.0, 4.0, down) * drift
        beams += 0.075 * beam[..., None] * colour
        at = np.hypot(dx * LAMP_Z - left, STAGE_EYE + dy * LAMP_Z - LAMP_Y)
        bulbs.append((at, colour))
    picture: Image = matter * light
    around = blur(light, 30, 30)
    for where, phase in ((-2.0, 0.5), (0.15, 2.4), (2.2, 3.6)):
        u, v = dx * 8.6 - where, STAGE_EYE + dy * 8.6
        bob = 0.1 * np.sin(4 * time + phase)
        body = person(u + bob * 0.1 * v, v, 0.3 * np.sin(4 * time + phase) + phase, 0.12)
        own = 0.07 + 0.6 * np.exp(-((body / 0.03) ** 2)) * step(0.3, 1.7, v)
        lit = own[..., None] * np.minimum(around, 2) * rgb(0.8, 0.7, 0.6)
        picture = over(picture, lit, step(0.008, -0.008, body))
    picture = picture + beams
    truss = inside(abs(STAGE_EYE + dy * LAMP_Z - LAMP_Y - 0.16), 0.06, 0.1, 0.01)
    picture = over(picture, rgb(0.01, 0.01, 0.012), truss)
    for at, colour in bulbs:
        picture = over(picture, rgb(0.008, 0.008, 0.01), step(0.22, 0.2, at))
        picture = over(picture, 18 * colour, step(0.13, 0.11, at))
    # the polished floor mirrors what stands at the lamps' distance, blurred upright
    rows = np.arange(len(dy))
    foot = int(np.argmin(abs(dy[:, 0] + STAGE_EYE / LAMP_Z)))
    mirror = blur(picture, 3, 14)[np.clip(2 * foot - rows, 0, len(rows) - 1)]
    shine = 0.16 * is_floor * (rows > foot - 8)[:, None]
    return over(picture, picture + mirror, shine)
