"""A dim room with a bright window; somebody walks past it."""

from collections.abc import Iterator

import numpy as np
from drawing import (
    FRAMES,
    RATE,
    Image,
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

ROOM_EYE, WALL_Z, WALK_Z = 1.42, 5.0, 3.9
WINDOW = (-1.55, 0.75, 0.85, 2.4)  # left, right, bottom, top on the back wall
TABLE = (0.2, 1.5, 2.75, 3.55, 0.74)  # left, right, near, far, height
DAYLIGHT, LAMPLIGHT = rgb(0.9, 1.0, 1.12), rgb(1.3, 0.95, 0.55)


def bright_window() -> Iterator[Image]:
    """Yield a dim room with a bright window, which somebody walks past."""
    dx, dy, _ = view_rays(0.56, 0.46)
    wood, fine = noise(11, 1.1), noise(12, 0.6)
    # where each ray meets the box of the room: floor, ceiling, side walls, back wall
    limits = np.where(dy < 0, -ROOM_EYE, 2.85 - ROOM_EYE), np.where(dx < 0, -2.5, 2.5)
    meets = [
        limit / np.where(abs(d) < 1e-4, 1e-4, d) for limit, d in zip(limits, (dy, dx), strict=True)
    ]
    far = np.minimum(np.minimum(meets[0], meets[1]), WALL_Z).astype(np.float32)
    x, y, z = far * dx, ROOM_EYE + far * dy, far
    on_back, floor = far > WALL_Z - 1e-3, (y < 1e-3).astype(np.float32)
    normal = [np.where(on_back, 0, n) for n in (-np.sign(x) * (abs(x) > 2.499), np.sign(0.1 - y))]
    normal[1] = normal[1] * (normal[0] == 0)
    # the table top lies in front of all that
    left, right, near, back, height = TABLE
    top_far = (height - ROOM_EYE) / np.minimum(dy, -1e-4)
    top_x = top_far * dx
    top = inside(top_x, left, right, 0.004) * inside(top_far, near, back, 0.008)
    x, y, z = (np.where(top > 0.5, a, b) for a, b in ((top_x, x), (height, y), (top_far, z)))
    normal = [np.where(top > 0.5, 0, normal[0]), np.where(top > 0.5, 1, normal[1])]
    # daylight through 4 x 2 parts of the window, each of which the walker may hide
    parts = []
    for part_x in (-1.26, -0.69, -0.11, 0.46):
        for part_y in (1.2, 2.0):
            to_x, to_y, to_z = part_x - x, part_y - y, WALL_Z - z
            square = to_x**2 + to_y**2 + to_z**2 + 0.05
            light = (
                np.maximum(normal[0] * to_x + normal[1] * to_y, 0) * np.maximum(to_z, 0) / square**2
            )
            share = np.maximum(WALK_Z - z, 0) / np.maximum(to_z, 0.01)
            parts.append((1.1 * light, x + share * to_x, y + share * to_y, z < WALK_Z))
    lamp = ((left + right) / 2 + 0.1, 1.26, 3.2)
    lamp_square = (x - lamp[0]) ** 2 + (y - lamp[1]) ** 2 + (z - lamp[2]) ** 2 + 0.02
    warm = (0.3 / lamp_square)[..., None] * LAMPLIGHT
    planks = 1 + 0.2 * look_up(wood, z * 12, x * 160) - 0.6 * inside(x % 0.16, 0, 0.006, 0.004)
    boards = (np.clip(planks, 0.3, 1.6) * 0.26)[..., None] * rgb(1.15, 0.92, 0.7)
    grain = np.clip(1 + 0.22 * look_up(wood, x * 60, z * 400), 0.3, 1.7)
    table = (0.2 * grain)[..., None] * rgb(1.25, 0.85, 0.55)
    paint = (0.5 + 0.012 * look_up(fine, (x + z) * 150, y * 150))[..., None] * rgb(1, 0.96, 0.9)
    albedo = over(over(paint, boards, floor), table, top)
    ambient = 0.03 + 0.012 * step(3, 0, y) + 0.012 * step(1, 5, z)
    back_wall = _back_wall(WALL_Z * dx, ROOM_EYE + WALL_Z * dy, dx, dy)
    gloss = blur(_back_wall(WALL_Z * dx, -ROOM_EYE - WALL_Z * dy, dx, -dy), 5, 9)
    polish = _back_wall(WALL_Z * dx, 2 * height - ROOM_EYE - WALL_Z * dy, dx, -dy)
    polish = blur(polish, 2, 3)
    rim = 0.05 * np.minimum(blur(back_wall, 12, 12)[..., 1], 3)
    slant = np.clip(1 + dy / np.sqrt(1 + dx**2 + dy**2), 0, 1)
    for n in range(FRAMES):
        walker_x, phase = -2.1 + 3.1 * n / (FRAMES - 1), 2 * np.pi * 0.95 * n / RATE
        light = np.zeros_like(x)
        for part, at_x, at_y, behind in parts:
            hidden = np.exp(-(((at_x - walker_x) / 0.24) ** 4)) * step(1.85, 1.65, at_y) * behind
            light += part * (1 - hidden)
        lit = albedo * ((light + ambient)[..., None] * DAYLIGHT + warm)
        wall = np.where((back_wall > 0.4).any(2, keepdims=True), 0, warm) * back_wall * 8
        picture = np.where((on_back & (top < 0.5))[..., None], back_wall + wall, lit)
        # the walker hides the window and its reflections
        u, v = dx * WALK_Z - walker_x, ROOM_EYE + dy * WALK_Z
        body = person(u, abs(v), phase, 0.46)
        cover = step(0.012, -0.012, body)
        shine = (0.05 + 0.5 * slant**6) * floor * (1 - top)
        picture = picture + gloss * (shine * (1 - blur(cover * (v < 0), 4, 6)))[..., None]
        cloth = (
            0.014
            + 0.0025 * look_up(wood, u * 90, v * 30)
            + 0.006 * step(0.1, -0.1, u)
            + rim * np.exp(-((body / 0.012) ** 2))
        )
        picture = over(picture, np.maximum(cloth, 0.008)[..., None] * DAYLIGHT, cover * (v >= 0))
        u, v = dx * WALK_Z - walker_x, 2 * height - ROOM_EYE - dy * WALK_Z
        hides = step(0.03, -0.03, person(u, v, phase, 0.46))
        picture = over(picture, lit, top)
        picture = picture + polish * (top * (0.06 + 0.6 * slant**6) * (1 - hides))[..., None]
        yield _room_things(picture, dx, dy, lamp, top)


def _back_wall(x: Image, y: Image, dx: Image, dy: Image) -> Image:
    """Paint the wall opposite, the window, what is outside, the curtains and a painting."""
    fine, leaves, cloud = noise(12, 0.6), noise(13, 1.15), noise(14, 1.7)
    left, right, bottom, top = WINDOW
    middle = (left + right) / 2
    edge = np.maximum(abs(x - middle) - 1.15, abs(y - 1.6) - 0.8)
    wall = (
        0.03 + 0.05 * np.exp(-np.maximum(edge, 0) / 0.25) + 0.0012 * look_up(fine, x * 150, y * 150)
    )
    picture = (
        wall[..., None] * rgb(1, 0.97, 0.93) * (1 - 0.45 * inside(y, -1, 0.12, 0.005))[..., None]
    )
    # outside
    sky = over(7.6 * rgb(0.98, 1, 1.02), 4.2 * rgb(0.72, 0.95, 1.4), step(-0.05, 0.24, dy))
    sky = over(sky, 8 * rgb(1, 1, 1), 0.8 * step(-0.3, 1.6, look_up(cloud, dx * 500, dy * 1200)))
    hill = 0.0 + 0.012 * look_up(cloud, dx * 260, np.zeros_like(dx))
    sky = over(sky, 2.4 * rgb(0.85, 1, 1.1), step(hill + 0.003, hill - 0.003, dy))
    meadow = 1.0 + 0.25 * look_up(leaves, dx * 900, dy * 3000)
    sky = over(sky, meadow[..., None] * rgb(0.85, 1.1, 0.4), step(-0.028, -0.034, dy))
    crown = 0.13 - np.hypot((dx + 0.2) * 1.0, (dy - 0.1) * 1.15)
    rough = look_up(leaves, dx * 420, dy * 420)
    foliage = step(-0.006, 0.006, crown + 0.035 * rough) * step(-1.5, -1.1, rough + 8 * crown)
    green = np.clip(0.5 + 0.3 * look_up(leaves, dx * 700 + 99, dy * 700) + 2 * (dy - 0.08), 0.08, 2)
    trunk = inside(dx + 0.2 + 0.08 * dy, -0.009, 0.009, 0.002) * inside(dy, -0.045, 0.08, 0.004)
    sky = over(sky, rgb(0.22, 0.17, 0.12), trunk)
    sky = over(sky, green[..., None] * rgb(0.6, 1.0, 0.25), foliage)
    pane = inside(x, left, right, 0.004) * inside(y, bottom, top, 0.004)
    pane *= 1 - np.maximum(
        inside(x, middle - 0.025, middle + 0.025, 0.004), inside(y, 1.93, 1.97, 0.004)
    )
    frame = inside(x, left - 0.07, right + 0.07, 0.004) * inside(
        y, bottom - 0.07, top + 0.07, 0.004
    )
    picture = over(over(picture, 0.14 * rgb(1, 0.98, 0.95), frame), sky, pane)
    # curtains let light through where there is window behind them
    aside = abs(x - middle) - 0.98 - 0.03 * np.sin(3 * y)
    fold = 0.6 + 0.28 * np.sin(aside * 75 + 2 * np.sin(y)) + 0.12 * np.sin(aside * 31 + 1)
    through = 0.05 + 0.55 * step(0.2, 0.1, aside) * inside(y, bottom, top, 0.02)
    curtain = inside(aside, 0, 0.42, 0.006) * inside(y, 0.45, 2.55, 0.006)
    picture = over(picture, (fold * through)[..., None] * rgb(1.1, 1.0, 0.85), curtain)
    # painting
    u, v = (x - 1.9) / 0.36, (y - 1.85) / 0.27
    border = np.maximum(abs(u) - 1, (abs(v) - 1) * 0.75)
    art = over(
        rgb(0.055, 0.065, 0.075), rgb(0.05, 0.03, 0.015), step(0.1, -0.1, v + 0.25 * np.sin(2 * u))
    )
    art *= np.clip(1 + 0.3 * look_up(leaves, u * 60, v * 40), 0.3, 2)[..., None]
    picture = over(picture, rgb(0.035, 0.022, 0.01), step(0.13, 0.11, border))
    return over(picture, art, step(0.02, 0.0, border))


def _room_things(
    picture: Image, dx: Image, dy: Image, lamp: tuple[float, float, float], top: Image
) -> Image:
    """Add the table's edge and legs, and the lamp that stands on it."""
    left, right, near, back, height = TABLE
    for z in (back, near):
        x, y = dx * z, ROOM_EYE + dy * z
        legs = inside(abs(x - (left + right) / 2), 0.5, 0.555, 0.004) * inside(
            y, 0, height - 0.02, 0.004
        )
        picture = over(picture, rgb(0.016, 0.011, 0.007), legs * (1 - top))
    rim = inside(x, left, right, 0.004) * inside(y, height - 0.045, height, 0.003)
    picture = over(picture, rgb(0.03, 0.02, 0.012), rim)
    u, v = dx * lamp[2] - lamp[0], ROOM_EYE + dy * lamp[2]
    foot = step(0.004, -0.004, np.hypot(u / 0.08, (v - height - 0.01) / 0.02) * 0.02 - 0.02)
    foot = np.maximum(foot, inside(u, -0.011, 0.011, 0.003) * inside(v, height, 1.12, 0.003))
    picture = over(picture, rgb(0.03, 0.022, 0.014), foot)
    width = 0.185 - 0.3 * (v - 1.12)
    shade = inside(u / width, -1, 1, 0.02) * inside(v, 1.12, 1.38, 0.004)
    glow = 0.34 + 0.42 * np.exp(-((u / 0.11) ** 2) - ((v - 1.22) / 0.09) ** 2)
    return over(picture, glow[..., None] * LAMPLIGHT, shade)
