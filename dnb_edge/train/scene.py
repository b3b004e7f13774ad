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

from dnb_edge.train.assets import NO_ASSETS, Assets
from dnb_edge.train.camera import View
from dnb_edge.train.cars import any_car
from dnb_edge.train.clutter import any_mover, any_static
from dnb_edge.train.effects import Camera, uneven_light
from dnb_edge.train.floors import laid_texture, light_patches, paint_lanes, photo_crop, procedural_texture, track_walls
from dnb_edge.train.meshes import Mesh
from dnb_edge.train.render import (
    Body,
    Canvas,
    Light,
    Picture,
    blank,
    body_of,
    darken,
    draw,
    flatten,
    floor_shadows,
    lay_over,
    visible_share,
)
from dnb_edge.train.solids import Solid
from dnb_edge.train.stage import Stage, random_light, random_stage
from dnb_edge.values import BgrImage

Rng = np.random.Generator
FloatArray = NDArray[np.float64]

SCENE_PX = 192
"""Side of a sample; training cuts and scales smaller windows from it."""
MAX_CARS = 4
LABEL_FIELDS = 6
"""u, v (ground point, px), length (longest side of the upright box, px), cosine and sine of the heading, 1 car or 0 ignore."""
_MESH_CARS = 0.35
_MESH_CLUTTER = 0.35


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """A scene with its labels."""

    image: BgrImage
    """Shape (192, 192, 3)."""
    background: BgrImage
    """The same view without what moved, as a background model would hold it; sometimes with a ghost of a car."""
    labels: NDArray[np.float32]
    """Shape (n, 6): see LABEL_FIELDS."""
    lean: NDArray[np.float32]
    """Shape (2, 3): the lean at px (u, v) is lean @ (u, v, 1), very nearly; see `dnb_edge.detect.lean`."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedCar:
    """A car on the floor: where it is at the middle of the exposure, and how it moves in it."""

    body: Body
    ground_m: tuple[float, float]
    yaw_rad: float
    travel_m: float = 0.0
    """Way driven from one frame to the next."""
    exposure: float = 0.0
    """Exposure time as a share of the time from one frame to the next."""

    @property
    def ahead(self) -> FloatArray:
        """Unit vector (3,) along the nose."""
        return np.array([math.cos(self.yaw_rad), math.sin(self.yaw_rad), 0.0])


def label_of(car: PlacedCar, view: View) -> NDArray[np.float32]:
    """The label row (6,) of a car, its last field 1."""
    place = np.array([*car.ground_m, 0.0])
    corners = view.project(car.body.corners_m.reshape(-1, 3))
    extent = corners.max(axis=0) - corners.min(axis=0)
    ground = view.project(place[None])[0]
    nose = view.project((place + 0.02 * car.ahead)[None])[0] - ground
    nose /= np.linalg.norm(nose) + 1e-9
    return np.array([*ground, float(extent.max()), nose[0], -nose[1], 1.0], dtype=np.float32)


def exposed(car: PlacedCar, view: View, frame_rows_px: float) -> list[Body]:
    """The car at several instants of its exposure, each row at its own time of a rolling shutter's readout."""
    if car.travel_m == 0.0:
        return [car.body]
    corners = car.body.corners_m
    rows = view.project(corners.reshape(-1, 3))[:, 1].reshape(corners.shape[:2])
    row = view.project(np.array([[*car.ground_m, 0.0]]))[0, 1]
    delay = 0.9 * (rows - row) / frame_rows_px
    blur_px = car.travel_m * car.exposure * view.px_per_m(np.array([*car.ground_m, 0.0]))
    count = int(np.clip(math.ceil(blur_px / 1.5), 1, 6))
    instants = (np.arange(count) + 0.5) / count - 0.5
    return [
        Body(
            corners_m=corners + ((delay + instant * car.exposure) * car.travel_m)[..., None] * car.ahead,
            colours_bgr=car.body.colours_bgr,
            two_sided=car.body.two_sided,
        )
        for instant in instants
    ]


def stand(floor: Picture, standing: Canvas, view: View, light: Light, things: Sequence[Body]) -> tuple[Picture, Canvas]:
    """The floor with the things' shadows too, and a canvas with the things drawn among what stood there."""
    picture, canvas = floor.copy(), standing.copy()
    if things:
        darken(picture, floor_shadows(things, view, light))
    for thing in things:
        draw(canvas, thing, view, light)
    return picture, canvas


def add_cars(
    floor: Picture, standing: Canvas, view: View, light: Light, cars: Sequence[PlacedCar], *, frame_rows_px: float
) -> tuple[Picture, list[float]]:
    """The picture of the cars among what stands there already, and the visible share of each car."""
    picture = floor.copy()
    if cars:
        darken(picture, floor_shadows([car.body for car in cars], view, light))
    moments = [exposed(car, view, frame_rows_px) for car in cars]
    count = max([1, *(len(moment) for moment in moments)])
    canvases: list[Canvas] = []
    for number in range(count):
        canvas = standing.copy()
        for moment in moments:
            draw(canvas, moment[number * len(moment) // count], view, light)
        canvases.append(canvas)
    lay_over(picture, *flatten(canvases, view))
    middle = canvases[count // 2]
    shares = [visible_share(middle, moment[(count // 2) * len(moment) // count], view) for moment in moments]
    return picture, shares


def mesh_body(mesh: Mesh, rng: Rng, *, scale: float = 1.0) -> Body:
    """A real mesh at `scale`; one without colours of its own, or now and then any, is painted anew."""
    colours = mesh.colours_bgr
    if mesh.recolour or rng.random() < 0.3:
        tint = rng.uniform(0.0, 255.0, 3) if rng.random() < 0.5 else np.full(3, rng.uniform(20.0, 240.0))
        share = 0.85 if mesh.recolour else 0.6
        colours = colours * (1.0 - share) + share * tint * (0.35 + 0.65 * colours.mean(axis=1, keepdims=True) / 255.0)
    return Body(corners_m=mesh.corners_m * scale, colours_bgr=colours, two_sided=True)


def car_body(rng: Rng, length_m: float, assets: Assets) -> Body:
    """Any car, drawn or a real mesh."""
    if assets.vehicles and rng.random() < _MESH_CARS:
        return mesh_body(assets.vehicles[int(rng.integers(len(assets.vehicles)))], rng, scale=length_m)
    return body_of(any_car(rng, length_m))


def thing_body(rng: Rng, make: Callable[[Rng], list[Solid]], assets: Assets) -> Body:
    """A thing that `make` draws, or a real mesh."""
    if assets.clutter and rng.random() < _MESH_CLUTTER:
        return mesh_body(assets.clutter[int(rng.integers(len(assets.clutter)))], rng)
    return body_of(make(rng))


def base_picture(view: View, car_length_m: float, assets: Assets, rng: Rng) -> Picture:
    """The bare floor with its lanes, or a photograph."""
    if assets.photos and rng.random() < 0.3:
        picture = photo_crop(assets.photos, SCENE_PX, rng)
        if rng.random() < 0.3:
            paint_lanes(picture, view, car_length_m, rng)
        return picture
    if assets.textures and rng.random() < 0.3:
        texture = photo_crop(assets.textures, 512, rng) * np.exp(rng.normal(0, 0.15, 3)).astype(np.float32)
    else:
        texture = procedural_texture(rng)
    picture = laid_texture(texture, view, rng)
    if rng.random() < 0.85:
        paint_lanes(picture, view, car_length_m, rng)
    picture *= uneven_light(SCENE_PX, rng)
    return picture


def _things(count: int, make: Callable[[Rng], list[Solid]], view: View, assets: Assets, rng: Rng) -> list[Body]:
    out = []
    for _ in range(count):
        place = view.floor_point((float(rng.uniform(-20, SCENE_PX + 20)), float(rng.uniform(-20, SCENE_PX + 20))))
        body = thing_body(rng, make, assets).moved(
            float(rng.uniform(0, 2 * math.pi)), (float(place[0]), float(place[1]))
        )
        if _share_of_picture(body, view) < 0.4 or rng.random() < 0.15:
            out.append(body)
    return out


def _share_of_picture(body: Body, view: View) -> float:
    """The part of the picture that the upright box round a body takes, about."""
    pixels = np.clip(view.project(body.corners_m.reshape(-1, 3)), 0.0, SCENE_PX)
    return float(np.prod((pixels.max(axis=0) - pixels.min(axis=0)) / SCENE_PX))


def place_car(
    view: View, body: Body, ground_px: tuple[float, float], yaw_rad: float, rng: Rng, length_m: float
) -> PlacedCar:
    """Stand a car on the floor where `ground_px` sees it, at rest or on its way."""
    place = view.floor_point(ground_px)
    ground = (float(place[0]), float(place[1]))
    driving = rng.random() < 0.45
    return PlacedCar(
        body=body.moved(yaw_rad, ground),
        ground_m=ground,
        yaw_rad=yaw_rad,
        travel_m=length_m * float(np.exp(rng.uniform(math.log(0.05), math.log(1.6)))) if driving else 0.0,
        exposure=float(rng.uniform(0.1, 1.0)),
    )


def _cars(stage: Stage, length_m: float, assets: Assets, rng: Rng) -> tuple[list[PlacedCar], list[PlacedCar]]:
    """The scene's cars, and the ghosts that an imperfect background shows instead."""
    cars: list[PlacedCar] = []
    ghosts: list[PlacedCar] = []
    view = stage.view
    count = int(rng.choice([0, 1, 2, 3], p=[0.16, 0.54, 0.22, 0.08]))
    while len(cars) < count and rng.random() > 0.02:
        length = length_m * float(np.exp(rng.normal(0, 0.1)))
        body = car_body(rng, length, assets)
        ground = (float(rng.uniform(10, SCENE_PX - 10)), float(rng.uniform(10, SCENE_PX - 10)))
        yaw = float(rng.uniform(0, 2 * math.pi))
        placed = place_car(view, body, ground, yaw, rng, length)
        size = float(label_of(placed, view)[2])
        if size > 0.5 * SCENE_PX or any(math.dist(placed.ground_m, other.ground_m) < 0.8 * length for other in cars):
            continue
        cars.append(placed)
        if rng.random() < 0.3:
            shift = rng.normal(0, 1.2, 2) * size
            near = (ground[0] + float(shift[0]), ground[1] + float(shift[1]))
            ghosts.append(place_car(view, body, near, yaw + float(rng.normal(0, 0.4)), rng, length))
        elif rng.random() < 0.12:
            ghosts.append(placed)
    return cars, ghosts


def lean_plane(view: View) -> NDArray[np.float32]:
    """The lean over the picture as the plane (2, 3) that fits it best."""
    at = np.linspace(0.0, SCENE_PX - 1.0, 4)
    u, v = np.meshgrid(at, at)
    points = np.column_stack([u.ravel(), v.ravel()])
    plane, *_ = np.linalg.lstsq(np.column_stack([points, np.ones(len(points))]), view.lean(points), rcond=None)
    return np.asarray(plane.T, dtype=np.float32)


def make_sample(rng: Rng, assets: Assets = NO_ASSETS) -> Sample:
    """Compose and photograph one scene."""
    car_length = float(np.exp(rng.uniform(math.log(0.09), math.log(0.55))))
    stage, light = random_stage(rng, car_length_m=car_length, size_px=SCENE_PX), random_light(rng)
    view = stage.view
    base = base_picture(view, car_length, assets, rng)
    static = _things(int(rng.choice([0, 1, 2, 3, 5], p=[0.15, 0.25, 0.25, 0.2, 0.15])), any_static, view, assets, rng)
    if rng.random() < 0.12:
        static.append(body_of(track_walls(view, car_length, rng)))
    movers = _things(int(rng.choice([0, 1, 2], p=[0.55, 0.33, 0.12])), any_mover, view, assets, rng)
    left_behind = [mover for mover in movers if rng.random() < 0.25]
    moved_away = _things(int(rng.random() < 0.15), any_mover, view, assets, rng)
    cars, ghosts = _cars(stage, car_length, assets, rng)
    rows = stage.frame_rows_px
    floor, standing = stand(base, blank(view), view, light, static)
    image, visible = add_cars(*stand(floor, standing, view, light, movers), view, light, cars, frame_rows_px=rows)
    behind, _ = add_cars(
        *stand(floor, standing, view, light, [*left_behind, *moved_away]), view, light, ghosts, frame_rows_px=rows
    )
    if rng.random() < 0.3:  # window light, glare, a shadow's edge; now and then one that has moved since
        patches = light_patches(view, rng)
        image *= patches
        behind *= light_patches(view, rng) if rng.random() < 0.25 else patches
    labels = np.zeros((0, LABEL_FIELDS), dtype=np.float32)
    if cars:
        labels = np.stack([label_of(car, view) for car in cars])
        labels[:, 5] = np.array(visible) > 0.5
    camera = Camera(rng, blur_px=stage.blur_px, shaken=rng.random() < 0.08)
    return Sample(
        image=camera.develop(image, rng),
        background=camera.develop(behind, rng, noise=float(rng.uniform(0.05, 0.5))),
        labels=labels,
        lean=lean_plane(view),
    )
