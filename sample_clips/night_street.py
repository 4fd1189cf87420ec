"""A pan over a wet street at night: lamps, lit windows, two cars."""

from collections.abc import Iterator

import numpy as np
from drawing import (
    FRAMES,
    WIDTH,
    Image,
    Rays,
    blur,
    enlarge,
    inside,
    look_up,
    noise,
    over,
    rgb,
    step,
    view_rays,
)

EYE, FACADE, KERB = (0.9, 1.6), 7.5, 4.6
LAMPS = [(side * 5.3, 4.7, 7.5 + 9.5 * i + 3 * (side > 0)) for i in range(9) for side in (-1, 1)]
LAMP_RADIANCE = np.random.default_rng(1).uniform(9, 27, len(LAMPS))
SODIUM = rgb(1.36, 0.95, 0.42)


def night_street() -> Iterator[Image]:
    """Yield a pan over a wet street; one car comes nearer, another drives away."""
    asphalt, ripples = noise(2, 0.7), noise(3, 1.6)
    light_map = _street_light_map()
    for n in range(FRAMES):
        rays = dx, dy, dz = view_rays(0.62, 0.57, yaw=0.2 - 0.34 * n / (FRAMES - 1))
        # left edge, distance, half width, headlights or tail lights
        cars = [(-2.2, 30 - 0.3 * n, rgb(26, 27, 28)), (2.5, 12 + 0.22 * n, rgb(8, 0.5, 0.2))]
        far = EYE[1] / np.maximum(-dy, 0.01)
        x, z = EYE[0] + far * dx, far * dz
        near = np.clip(9 / far, 0, 1)
        light = look_up(light_map, 8 * z, 8 * np.clip(x, -8, 8) + 64)[..., None] * SODIUM
        for car_x, car_z, colour in cars:
            ahead = (car_z - z) * (1 if colour[2] > 1 else -1)
            beam = np.exp(-0.5 * ((x - car_x) / (0.8 + 0.13 * abs(ahead))) ** 2)
            beam *= step(0.2, 3, ahead) / (3 + 0.1 * ahead**2)
            light += beam[..., None] * colour * 0.3
            light *= (
                1 - 0.8 * np.exp(-(((x - car_x) / 0.9) ** 4) - ((z - car_z) / 2) ** 4)[..., None]
            )
        grain = np.clip(1 + 0.3 * near * look_up(asphalt, x * 40, z * 40), 0.1, 2)
        pool = step(-0.4, 1.0, look_up(ripples, x * 18 + 90, z * 7))
        wave = 0.012 * near * look_up(ripples, x * 60, z * 25)
        bounced = (dx + wave)[::2, ::2], (abs(dy) + 0.5 * wave)[::2, ::2], dz[::2, ::2]
        mirror = _street_things(_street_sides(bounced, -EYE[1], light_map), bounced, -EYE[1], cars)
        wet = over(enlarge(blur(mirror, 1.5, 12)), enlarge(blur(mirror, 0.7, 2)), 0.75 * pool)
        shine = 0.09 + 0.5 * (1 - np.clip(-dy, 0, 1) / np.hypot(dx, dz)) ** 9
        kerb = step(KERB - 0.03, KERB + 0.03, abs(x))
        ground = light * (grain * (0.1 + 0.12 * kerb) * (1 - 0.4 * pool))[..., None]
        ground += wet * (shine * (1 - 0.7 * kerb))[..., None]
        ground = over(rgb(0.03, 0.025, 0.022), ground, np.exp(-far / 120))
        on_ground = step(0.0, -0.002, dy) * step(FACADE, FACADE - 0.05, abs(x))
        picture = over(_street_sides(rays, EYE[1], light_map), ground, on_ground)
        yield _street_things(picture, rays, EYE[1], cars)


def _street_light_map() -> Image:
    """Sum the light of all lamps, 8 texels a metre, columns along z.

    Rows: the ground (x from -8 to 8 m), then the left and right house fronts (y from 0 to 20 m).
    """
    rows, z = np.mgrid[0:448, 0:1024].astype(np.float32) / 8
    ground, side = rows < 16, np.where(rows < 36, -1, 1)
    x = np.where(ground, rows - 8, side * FACADE)
    y = np.where(ground, 0, (rows - 16) % 20)
    total = np.full_like(x, 0.02)
    for (lamp_x, lamp_y, lamp_z), radiance in zip(LAMPS, LAMP_RADIANCE, strict=True):
        square = (lamp_x - x) ** 2 + (lamp_y - y) ** 2 + (lamp_z - z) ** 2 + 0.3
        facing = np.maximum(np.where(ground, lamp_y, side * (x - lamp_x)), 0)
        total += float(radiance) * 0.5 * facing / square**1.5
    return np.asarray(total, np.float32)


def _street_sides(rays: Rays, eye_y: float, light_map: Image) -> Image:
    """Sky and house fronts, with lit and dark windows."""
    dx, dy, dz = rays
    side = np.where(dx > 0, 1, -1).astype(np.float32)
    plaster = noise(4, 1.2)
    far = np.minimum((side * FACADE - EYE[0]) / np.where(abs(dx) < 0.02, side * 0.02, dx), 400)
    y, z = eye_y + far * dy, np.maximum(far * dz, 0)
    pixel = 0.62 / WIDTH
    soft_z, soft_y = np.clip(z * z / FACADE * pixel, 0.02, 0.6), np.clip(far * pixel, 0.02, 0.6)
    random = np.random.default_rng(8)
    house = np.clip(z // 11, 0, 30).astype(np.int64) * 2 + (side > 0)
    paint = random.uniform(0.1, 0.34, 64)[house].astype(np.float32)
    roof = np.array([10.1, 13.4, 16.7])[random.integers(0, 3, 64)][house].astype(np.float32)
    stain = 1 + 0.16 * look_up(plaster, z * 30, y * 30) - 0.25 * inside(y % 3.3, 0, 0.16, soft_y)
    light = look_up(light_map, 8 * np.minimum(z, 127), 8 * np.clip(y, 0.1, 19.8) + 208 + 80 * side)
    tint = rgb(1, 0.97, 0.95) + random.uniform(-0.15, 0.15, (64, 1)) * rgb(1, 0.1, -1.2)
    front = (
        (light * paint * np.clip(stain, 0.2, 2))[..., None]
        * SODIUM
        * tint.astype(np.float32)[house]
    )
    row, column = (
        np.clip(y // 3.3, 0, 5).astype(np.int64),
        np.clip(z // 2.75, 0, 120).astype(np.int64),
    )
    cell = (column * 6 + row) * 2 + (side > 0)
    shop = (row == 0) & (random.random(64)[house] < 0.45)
    chance = random.random(1500)[cell]
    level = np.where(chance < 0.27, random.uniform(1.1, 3.0, 1500)[cell], 0.012)
    level = np.where(shop, random.uniform(0.9, 2.2, 64)[house], level).astype(np.float32)
    warm = random.uniform(0, 1, 1500)[np.where(shop, house, cell)].astype(np.float32)
    colour = over(rgb(1.35, 0.94, 0.42), rgb(0.98, 1.0, 1.02), 0.7 * warm**3)
    u, v = z % 2.75, y % 3.3
    pane = np.where(shop, inside(u, 0.12, 2.63, soft_z), inside(u, 0.75, 2.0, soft_z))
    pane *= np.where(shop, inside(v, 0.5, 2.6, soft_y), inside(v, 1.05, 2.75, soft_y))
    bars = inside(u, 1.34, 1.41, soft_z) + inside(v, 2.2, 2.27, soft_y)
    curtain = 0.62 + 0.38 * step(0.25, 0.6, abs(u - 1.375)) + 0.1 * look_up(plaster, z * 90, y * 20)
    shelf = random.uniform(0.7, 1.3, 99).astype(np.float32)[(z // 0.48).astype(np.int64) % 99]
    goods = step(shelf + soft_y, shelf - soft_y, v) * inside(z % 0.48, 0.04, 0.44, soft_z)
    display = (1.2 - 0.6 * goods) * (0.5 + 0.3 * v) * (0.8 + 0.2 * step(0, 0.6, abs(u - 1.375)))
    curtain = np.where(shop, display, curtain * (step(0.2, 1.7, v) * 0.35 + 0.65))
    glow = level * np.clip(curtain, 0.1, 1.4) * np.clip(1 - 0.8 * bars * ~shop, 0.1, 1)
    front = over(front, glow[..., None] * colour, pane)
    front = over(rgb(0.028, 0.023, 0.02), front, np.exp(-far / 90))
    height = np.clip(dy / 0.4, 0, 1)
    sky = over(rgb(0.026, 0.021, 0.022), rgb(0.004, 0.006, 0.012), height**0.6)
    sky *= 1 + 0.2 * look_up(plaster, dx / dz * 160 + 50, dy * 300)[..., None]
    return over(sky, front, step(roof + soft_y, roof - soft_y, y))


def _street_things(
    picture: Image, rays: Rays, eye_y: float, cars: list[tuple[float, float, Image]]
) -> Image:
    """Lamp posts, lamps and cars on top of a picture."""
    dx, dy, dz = rays
    length, flat = np.sqrt(dx**2 + dy**2 + dz**2), np.hypot(dx, dz)
    things = [(z, i) for i, (_, _, z) in enumerate(LAMPS)] + [
        (car[1], -1 - i) for i, car in enumerate(cars)
    ]
    for z, i in sorted(things, reverse=True):
        soft = z * 0.62 / WIDTH
        if i < 0:
            x, _, colour = cars[-1 - i]
            u, v = abs(EYE[0] + z / dz * dx - x), eye_y + z / dz * dy
            body = np.hypot(np.maximum(u - 0.72, 0), np.maximum(abs(v - 0.62) - 0.22, 0)) - 0.16
            cabin = (
                np.hypot(
                    np.maximum(u - 0.75 + 0.45 * (v - 0.8), 0), np.maximum(abs(v - 1.0) - 0.33, 0)
                )
                - 0.08
            )
            wheel = np.hypot(np.maximum(abs(u - 0.68) - 0.06, 0), np.maximum(v - 0.3, 0)) - 0.05
            cover = step(soft, -soft, np.minimum(np.minimum(body, cabin), wheel)) * (v > 0)
            shade = (
                0.012 + 0.05 * step(0.7, 0.98, v) * step(1.1, 0.95, v) + 0.02 * step(1.25, 1.4, v)
            )
            picture = over(picture, shade[..., None] * rgb(1, 0.9, 0.75), cover)
            lights = step(0.1 + soft, 0.1 - soft, np.hypot((u - 0.66) / 1.3, v - 0.68))
            picture = over(picture, colour, lights)
            continue
        lamp_x, lamp_y, _ = LAMPS[i]
        aside = (lamp_x - EYE[0]) * dz - z * dx
        y = eye_y + dy * ((lamp_x - EYE[0]) * dx + z * dz) / flat**2
        post = step(0.06 + soft, 0.06 - soft, abs(aside) / flat) * inside(y, 0, lamp_y, soft)
        picture = over(picture, (0.012 + 0.05 * step(3.4, 4.6, y))[..., None] * SODIUM, post)
        ahead = ((lamp_x - EYE[0]) * dx + (lamp_y - eye_y) * dy + z * dz) / length
        square = (lamp_x - EYE[0]) ** 2 + (lamp_y - eye_y) ** 2 + z**2 - ahead**2
        globe = step(0.2 + soft, 0.2 - soft, np.sqrt(np.maximum(square, 0)))
        picture = over(picture, float(LAMP_RADIANCE[i]) * SODIUM, globe)
    return picture
