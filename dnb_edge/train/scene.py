"""One training sample: a picture of a floor with cars and clutter, the picture of its background, and where the cars stand.

Knows how a scene is composed; draws everything from one seeded generator, so that a seed and a number give the same sample
for ever. Labels are projected ground points, exact by construction. Opens no file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.train.camera import View, look_at_floor
from dnb_edge.train.cars import any_car
from dnb_edge.train.clutter import any_mover, any_static
from dnb_edge.train.effects import Camera, uneven_light
from dnb_edge.train.floors import laid_texture, paint_lanes, photo_crop, procedural_texture
from dnb_edge.train.render import Light, Sprite, darken, draw, lay_over, motion_blurred, shadow_mask
from dnb_edge.train.solids import Solid, turned
from dnb_edge.values import BgrImage

Rng = np.random.Generator
Picture = NDArray[np.float32]

SCENE_PX = 224
"""Side of a sample; training cuts and scales smaller windows from it."""
MAX_CARS = 4
LABEL_FIELDS = 6
"""u, v (ground point, px), length (longest side of the upright box, px), cosine and sine of the heading, 1 car or 0 ignore."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """A scene with its labels."""

    image: BgrImage
    """Shape (224, 224, 3)."""
    background: BgrImage
    """The same view without what moved, as a background model would hold it; sometimes with a ghost of a car."""
    labels: NDArray[np.float32]
    """Shape (n, 6): see LABEL_FIELDS."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Placed:
    """An object in the scene: its shadow, its sprite, and its label where it is a car."""

    sprite: Sprite
    shadow: Picture
    solids: tuple[Solid, ...]
    label: NDArray[np.float32] | None = None


def _random_view(rng: Rng, car_length_m: float) -> View:
    elevation = math.radians(float(rng.uniform(18, 88) if rng.random() < 0.3 else rng.uniform(28, 75)))
    length_px = float(np.exp(rng.uniform(math.log(17.0), math.log(58.0))))
    roll = float(rng.normal(0, 0.25)) if rng.random() < 0.75 else float(rng.uniform(-math.pi, math.pi))
    shear = np.eye(2) + rng.normal(0, 0.06, (2, 2))
    distance = max(float(rng.uniform(1.5, 6.0)), 7.0 * car_length_m)
    px_per_m = length_px / car_length_m
    distance = max(distance, 1.4 * SCENE_PX / px_per_m)
    return look_at_floor(
        size_px=SCENE_PX, elevation_rad=elevation, distance_m=distance, px_per_m=px_per_m, roll_rad=roll, shear=shear
    )


def _random_light(rng: Rng) -> Light:
    tilt, azimuth = math.radians(float(rng.uniform(0, 60))), float(rng.uniform(0, 2 * math.pi))
    direction = np.array([math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)])
    return Light(
        direction=direction,
        ambient=float(rng.uniform(0.35, 0.8)),
        shadow_strength=float(rng.uniform(0.1, 0.75)),
        shadow_blur_px=float(np.exp(rng.uniform(math.log(0.6), math.log(5.0)))),
    )


def _contact_light(light: Light) -> Light:
    """A lamp straight above: its shadow is the dark just under a body."""
    return Light(
        direction=np.array([0.0, 0.0, 1.0]),
        ambient=1.0,
        shadow_strength=0.55,
        shadow_blur_px=min(1.5, light.shadow_blur_px),
    )


def _in_front(solids: Sequence[Solid], view: View) -> bool:
    """True where every corner is at least 0.2 m before the camera: nothing nearer can be drawn."""
    depth_m = np.concatenate([solid.vertices_m for solid in solids]) @ view.matrix[2, :3] + view.matrix[2, 3]
    return bool(depth_m.min() > 0.2)


def place_car(
    view: View, light: Light, car: Sequence[Solid], ground_px: tuple[float, float], yaw_rad: float, rng: Rng
) -> _Placed | None:
    """Stand a car on the floor where `ground_px` sees it; None where it is out of the picture."""
    place = view.floor_point(ground_px)
    solids = tuple(turned(solid, yaw_rad, shift_m=(float(place[0]), float(place[1]), 0.0)) for solid in car)
    sprite = draw(solids, view, light, rng) if _in_front(solids, view) else None
    if sprite is None:
        return None
    corners = view.project(np.concatenate([solid.vertices_m for solid in solids]))
    extent = corners.max(axis=0) - corners.min(axis=0)
    nose = (
        view.project(place[None] + 0.05 * np.array([[math.cos(yaw_rad), math.sin(yaw_rad), 0.0]]))[0]
        - view.project(place[None])[0]
    )
    nose /= np.linalg.norm(nose) + 1e-9
    shadow = np.maximum(shadow_mask(solids, view, light), shadow_mask(solids, view, _contact_light(light)))
    label = np.array([*view.project(place[None])[0], float(extent.max()), nose[0], -nose[1], 1.0], dtype=np.float32)
    if rng.random() < 0.3:
        reach = float(rng.uniform(1.0, 2.0 + 0.25 * float(extent.max())))
        sprite = motion_blurred(sprite, (float(nose[0]) * reach, float(nose[1]) * reach), view.size_px)
    return _Placed(sprite=sprite, shadow=shadow, solids=solids, label=label)


def _place_thing(view: View, light: Light, thing: Sequence[Solid], rng: Rng) -> _Placed | None:
    place = view.floor_point((float(rng.uniform(-20, SCENE_PX + 20)), float(rng.uniform(-20, SCENE_PX + 20))))
    yaw = float(rng.uniform(0, 2 * math.pi))
    solids = tuple(turned(solid, yaw, shift_m=(float(place[0]), float(place[1]), 0.0)) for solid in thing)
    sprite = draw(solids, view, light, rng) if _in_front(solids, view) else None
    if sprite is None:
        return None
    return _Placed(sprite=sprite, shadow=shadow_mask(solids, view, light), solids=solids)


def _compose(base: Picture, objects: Sequence[_Placed]) -> tuple[Picture, list[float]]:
    """The picture with all objects, far ones first, and the visible share of each in the given order."""
    picture = base.copy()
    for thing in objects:
        darken(picture, thing.shadow)
    order = sorted(range(len(objects)), key=lambda number: -objects[number].sprite.distance_m)
    coverage: dict[int, Picture] = {}
    for number in order:
        sprite = objects[number].sprite
        lay_over(picture, sprite)
        rows = slice(sprite.y_px, sprite.y_px + sprite.alpha.shape[0])
        columns = slice(sprite.x_px, sprite.x_px + sprite.alpha.shape[1])
        for hidden in coverage.values():
            hidden[rows, columns] *= 1.0 - sprite.alpha
        if objects[number].label is not None:
            mask = np.zeros(picture.shape[:2], dtype=np.float32)
            mask[rows, columns] = sprite.alpha
            coverage[number] = mask
    visible = [
        float(coverage[n].sum() / (objects[n].sprite.alpha.sum() + 1e-6)) if n in coverage else 1.0
        for n in range(len(objects))
    ]
    return picture, visible


def _base(
    view: View, car_length_m: float, photos: Sequence[BgrImage], textures: Sequence[BgrImage], rng: Rng
) -> Picture:
    """The bare floor with its lanes, or a photograph."""
    if photos and rng.random() < 0.3:
        picture = photo_crop(photos, SCENE_PX, rng)
        if rng.random() < 0.3:
            paint_lanes(picture, view, car_length_m, rng)
        return picture
    if textures and rng.random() < 0.3:
        texture = photo_crop(textures, 512, rng) * np.exp(rng.normal(0, 0.15, 3)).astype(np.float32)
    else:
        texture = procedural_texture(rng)
    picture = laid_texture(texture, view, rng)
    if rng.random() < 0.85:
        paint_lanes(picture, view, car_length_m, rng)
    picture *= uneven_light(SCENE_PX, rng)
    return picture


def _many(count: int, make: Callable[[Rng], list[Solid]], view: View, light: Light, rng: Rng) -> list[_Placed]:
    made = (_place_thing(view, light, make(rng), rng) for _ in range(count))
    return [thing for thing in made if thing is not None]


def _cars(view: View, light: Light, length_m: float, rng: Rng) -> tuple[list[_Placed], list[_Placed]]:
    """The scene's cars, and the ghosts that an imperfect background shows instead."""
    cars: list[_Placed] = []
    ghosts: list[_Placed] = []
    count = int(rng.choice([0, 1, 2, 3], p=[0.14, 0.56, 0.22, 0.08]))
    while len(cars) < count and rng.random() > 0.02:
        car = any_car(rng, length_m * float(np.exp(rng.normal(0, 0.1))))
        ground = (float(rng.uniform(12, SCENE_PX - 12)), float(rng.uniform(12, SCENE_PX - 12)))
        yaw = float(rng.uniform(0, 2 * math.pi))
        placed = place_car(view, light, car, ground, yaw, rng)
        if placed is None or placed.label is None or placed.label[2] > 0.5 * SCENE_PX:
            continue
        cars.append(placed)
        if rng.random() < 0.3:
            shift = rng.normal(0, 1.2, 2) * float(placed.label[2])
            ghost = place_car(
                view,
                light,
                car,
                (ground[0] + float(shift[0]), ground[1] + float(shift[1])),
                yaw + float(rng.normal(0, 0.4)),
                rng,
            )
            if ghost is not None:
                ghosts.append(ghost)
        elif rng.random() < 0.12:
            ghosts.append(placed)
    return cars, ghosts


def make_sample(rng: Rng, photos: Sequence[BgrImage] = (), textures: Sequence[BgrImage] = ()) -> Sample:
    """Compose and photograph one scene."""
    car_length = float(np.exp(rng.uniform(math.log(0.09), math.log(0.55))))
    view, light = _random_view(rng, car_length), _random_light(rng)
    base = _base(view, car_length, photos, textures, rng)
    static = _many(int(rng.choice([0, 1, 2, 3, 5], p=[0.2, 0.3, 0.25, 0.15, 0.1])), any_static, view, light, rng)
    movers = _many(int(rng.choice([0, 1, 2], p=[0.55, 0.33, 0.12])), any_mover, view, light, rng)
    left_behind = [mover for mover in movers if rng.random() < 0.25]
    moved_away = _many(int(rng.random() < 0.15), any_mover, view, light, rng)
    cars, ghosts = _cars(view, light, car_length, rng)
    image, visible = _compose(base, [*static, *movers, *cars])
    behind, _ = _compose(base, [*static, *left_behind, *moved_away, *ghosts])
    labels = np.zeros((0, LABEL_FIELDS), dtype=np.float32)
    if cars:
        labels = np.stack([car.label for car in cars if car.label is not None])
        labels[:, 5] = np.array(visible[len(static) + len(movers) :]) > 0.5
    camera = Camera(rng)
    return Sample(
        image=camera.develop(image, rng),
        background=camera.develop(behind, rng, noise=float(rng.uniform(0.05, 0.5))),
        labels=labels,
    )
