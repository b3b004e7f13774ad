"""Held-out footage: whole frames of a car that drives round a lane under a real camera, with its exact ground point in each.

Knows how to film a scene of `scene.py`'s parts; judges nothing. A seed gives the same frames for ever; its caller keeps seeds
apart from those of the training samples. Frames of one clip come one after the other, so that following can be measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.train.assets import NO_ASSETS, Assets
from dnb_edge.train.camera import View, overhead_view
from dnb_edge.train.clutter import any_mover, any_static
from dnb_edge.train.effects import Camera, uneven_light
from dnb_edge.train.floors import laid_texture, photo_crop, procedural_texture
from dnb_edge.train.render import (
    Body,
    Light,
    Picture,
    blank,
    darken,
    draw,
    flatten,
    floor_shadows,
    lay_over,
    silhouette,
)
from dnb_edge.train.scene import PlacedCar, car_body, exposed, label_of, thing_body
from dnb_edge.train.stage import random_light
from dnb_edge.values import BgrImage

Rng = np.random.Generator
FloatArray = NDArray[np.float64]

FRAME_PX = (1280, 720)
FPS = 30.0
_TILE_PX = 160


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What a clip is filmed with."""

    camera_height_m: float | None = None
    """None: anything between 1.5 and 4 m."""
    car_length_m: tuple[float, float] = (0.12, 0.4)
    movers: float = 0.4
    """Share of clips in which something else moves too."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilmedFrame:
    """One frame with the truth."""

    image: BgrImage
    """Shape (720, 1280, 3)."""
    ground_px: tuple[float, float]
    length_px: float
    """Longest side of the car's upright box, camera px."""
    heading_rad: float
    """atan2 of (-v, u)."""
    ground_m: tuple[float, float]
    """The same point on the floor, metres."""
    view: View
    path_m: FloatArray
    """The lane's middle, closed, shape (n, 2), driven in this order."""
    lane_m: float
    """Width of the lane."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Set:
    """A clip's unchanging part."""

    view: View
    light: Light
    floor: Picture
    things: tuple[Body, ...]
    path_m: FloatArray
    """Closed, shape (n, 2)."""
    lane_m: float
    car: Body
    car_length_m: float


def _closed_path(rng: Rng, view: View, car_length_m: float) -> FloatArray | None:
    """A smooth loop on the floor that the camera sees whole; None where this draw has none of a size worth driving."""
    centre = view.floor_point(
        (view.width_px * float(rng.uniform(0.42, 0.58)), view.height_px * float(rng.uniform(0.45, 0.62)))
    )
    angles = np.arange(720) * (2 * math.pi / 720)
    wobble = 1.0 + sum(
        float(rng.uniform(0.0, 0.22 / k)) * np.cos(k * angles + float(rng.uniform(0, 6.28))) for k in (2, 3)
    )
    for reach in np.linspace(2.4, 0.3, 22):
        shape = np.column_stack(
            [np.cos(angles) * reach * float(view.eye_m[2]) * 0.55, np.sin(angles) * reach * float(view.eye_m[2]) * 0.4]
        )
        path: FloatArray = centre[:2] + shape * wobble[:, None]
        pixels = view.project(np.column_stack([path, np.zeros(len(path))]))
        margin = 0.06 * view.width_px
        inside = (pixels > margin).all() and (pixels < (view.width_px - margin, view.height_px - margin)).all()
        if inside and reach * float(view.eye_m[2]) * 0.4 > 1.5 * car_length_m:
            return path
    return None


def _camera(rng: Rng, conditions: Conditions) -> View:
    # a plain lens: the appliance's map knows no other
    field = math.radians(float(rng.uniform(55.0, 90.0)))
    return overhead_view(
        width_px=FRAME_PX[0],
        height_px=FRAME_PX[1],
        camera_height_m=conditions.camera_height_m or float(rng.uniform(1.5, 4.0)),
        pitch_rad=math.radians(float(rng.uniform(35.0, 90.0))),
        field_of_view_rad=field,
        roll_rad=float(rng.normal(0.0, 0.05)),
    )


def _lane(picture: Picture, view: View, path_m: FloatArray, width_m: float, rng: Rng) -> None:
    """Paint a lane along the closed path: a filled band, edge lines, or both."""
    ahead = np.roll(path_m, -1, axis=0) - path_m
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]]) / (np.linalg.norm(ahead, axis=1, keepdims=True) + 1e-12)
    filled, lined = rng.random() < 0.5, rng.random() < 0.7
    bands = [(0.0, width_m)] if filled else []
    bands += [(side * width_m / 2, float(rng.uniform(0.015, 0.04))) for side in (-1, 1)] if lined or not filled else []
    for centre, width in bands:
        colour = np.full(3, rng.uniform(10, 245)) if rng.random() < 0.6 else rng.uniform(0, 255, 3)
        mask = np.zeros(picture.shape[:2], dtype=np.uint8)
        edges = [path_m + left * (centre + half * width) for half in (-0.5, 0.5)]
        for i in range(len(path_m)):
            j = (i + 1) % len(path_m)
            quad = np.array([edges[0][i], edges[0][j], edges[1][j], edges[1][i]])
            pixels = view.project(np.column_stack([quad, np.zeros(4)]))
            cv2.fillConvexPoly(mask, np.rint(pixels * 16).astype(np.int32), (255.0,), cv2.LINE_AA, 4)
        lay_over(
            picture,
            colour.astype(np.float32) * (mask / 255.0)[..., None].astype(np.float32),
            mask.astype(np.float32) / 255.0,
        )


def _stand(picture: Picture, view: View, light: Light, things: tuple[Body, ...]) -> None:
    """Stand the things on the floor, tile by tile, since a canvas of the whole frame would take gigabytes."""
    darken(picture, floor_shadows(things, view, light))
    for top in range(0, view.height_px, _TILE_PX):
        for left in range(0, view.width_px, _TILE_PX):
            width, height = min(_TILE_PX, view.width_px - left), min(_TILE_PX, view.height_px - top)
            centre = (left + (width - 1) / 2.0, top + (height - 1) / 2.0)
            tile = view.cropped(centre_px=centre, scale=1.0, size_px=(width, height))
            canvas = blank(tile)
            drawn = [draw(canvas, thing, tile, light) for thing in things]
            if any(drawn):
                colour, alpha = flatten([canvas], tile)
                lay_over(picture[top : top + height, left : left + width], colour, alpha)


def _things(rng: Rng, view: View, assets: Assets, path_m: FloatArray, clear_m: float) -> tuple[Body, ...]:
    """Clutter everywhere but on the lane, and nothing that hides a part of it: what the camera cannot see tells nothing."""
    out: list[Body] = []
    small = view.cropped(
        centre_px=((view.width_px - 1) / 2.0, (view.height_px - 1) / 2.0),
        scale=0.25,
        size_px=(view.width_px // 4, view.height_px // 4),
    )
    lane = np.column_stack([path_m[::6], np.full(len(path_m[::6]), 0.3 * clear_m)])
    at = np.clip(np.rint(small.project(lane)).astype(int), 0, (small.width_px - 1, small.height_px - 1))
    for _ in range(int(rng.integers(4, 16))):
        place = view.floor_point((float(rng.uniform(0, view.width_px)), float(rng.uniform(0, view.height_px))))
        body = thing_body(rng, any_static, assets)
        reach = float(np.linalg.norm(body.corners_m[:, :, :2], axis=2).max())
        apart = float(np.linalg.norm(path_m - place[:2], axis=1).min())
        standing = body.moved(float(rng.uniform(0, 2 * math.pi)), (float(place[0]), float(place[1])))
        if apart > reach + clear_m and reach < 1.5 and not silhouette(standing, small)[at[:, 1], at[:, 0]].any():
            out.append(standing)
    return tuple(out)


def _build(rng: Rng, conditions: Conditions, assets: Assets) -> _Set:
    length_m = float(rng.uniform(*conditions.car_length_m))
    path: FloatArray | None = None
    while path is None:
        view = _camera(rng, conditions)
        path = _closed_path(rng, view, length_m)
    light = random_light(rng)
    real = bool(assets.textures) and rng.random() < 0.4
    texture = photo_crop(assets.textures, 512, rng) if real else procedural_texture(rng)
    floor = laid_texture(texture, view, rng)
    floor *= cv2.resize(uneven_light(256, rng), FRAME_PX, interpolation=cv2.INTER_CUBIC)[:, :, None]
    lane_m = length_m * float(rng.uniform(1.0, 1.8))
    _lane(floor, view, path, lane_m, rng)
    things = _things(rng, view, assets, path, 0.7 * length_m)
    _stand(floor, view, light, things)
    return _Set(
        view=view,
        light=light,
        floor=floor,
        things=things,
        path_m=path,
        lane_m=lane_m,
        car=car_body(rng, length_m, assets),
        car_length_m=length_m,
    )


def _filmed(stage: _Set, car: PlacedCar, movers: tuple[Body, ...]) -> Picture:
    """The floor with the car and what else moves, drawn into the parts of the frame that they fill."""
    picture = stage.floor.copy()
    for bodies, moments in (
        (movers, [[mover] for mover in movers]),
        ((car.body,), [exposed(car, stage.view, FRAME_PX[1])]),
    ):
        for body, moment in zip(bodies, moments, strict=True):
            _draw_part(picture, stage, body, moment)
    return picture


def _draw_part(picture: Picture, stage: _Set, body: Body, moment: list[Body]) -> None:
    pixels = stage.view.project(body.corners_m.reshape(-1, 3))
    reach = 1.3 * float((pixels.max(axis=0) - pixels.min(axis=0)).max()) + 24.0
    middle = (pixels.max(axis=0) + pixels.min(axis=0)) / 2.0
    left, top = (max(0, int(middle[i] - reach)) for i in (0, 1))
    right, bottom = (min(FRAME_PX[i], int(middle[i] + reach)) for i in (0, 1))
    if right - left < 4 or bottom - top < 4:
        return
    centre = ((left + right - 1) / 2.0, (top + bottom - 1) / 2.0)
    view = stage.view.cropped(centre_px=centre, scale=1.0, size_px=(right - left, bottom - top))
    part = picture[top:bottom, left:right]
    darken(part, floor_shadows([body], view, stage.light))
    standing = blank(view)
    for thing in stage.things:
        draw(standing, thing, view, stage.light)
    canvases = []
    for one in moment:
        canvas = standing.copy()
        draw(canvas, one, view, stage.light)
        canvases.append(canvas)
    lay_over(part, *flatten(canvases, view))


def film(
    seed: int, *, frames: int, conditions: Conditions | None = None, assets: Assets = NO_ASSETS
) -> Iterator[FilmedFrame]:
    """A clip of `frames` frames at 30 a second: one car drives round its lane at 0.5 to 2.5 m/s."""
    conditions = conditions or Conditions()
    rng = np.random.default_rng([seed, 7])
    stage = _build(rng, conditions, assets)
    step = np.linalg.norm(np.roll(stage.path_m, -1, axis=0) - stage.path_m, axis=1)
    along = np.concatenate([[0.0], np.cumsum(step)])
    closed = np.vstack([stage.path_m, stage.path_m[:1]])
    speed = float(rng.uniform(0.5, 2.5)) * min(1.0, stage.car_length_m / 0.25)
    exposure, start = float(rng.uniform(0.1, 0.7)), float(rng.uniform(0, along[-1]))
    mover = thing_body(rng, any_mover, NO_ASSETS) if rng.random() < conditions.movers else None
    mover_start, mover_way = (
        stage.view.floor_point((float(rng.uniform(0, FRAME_PX[0])), float(rng.uniform(0, 200)))) for _ in (0, 1)
    )
    camera = Camera(rng)
    for number in range(frames):
        s = (start + speed * number / FPS) % along[-1]
        at = np.array([np.interp(s, along, closed[:, i]) for i in (0, 1)])
        ahead = np.array([np.interp((s + 0.02) % along[-1], along, closed[:, i]) for i in (0, 1)]) - at
        yaw = math.atan2(ahead[1], ahead[0])
        ground = (float(at[0]), float(at[1]))
        car = PlacedCar(
            body=stage.car.moved(yaw, ground), ground_m=ground, yaw_rad=yaw, travel_m=speed / FPS, exposure=exposure
        )
        movers: tuple[Body, ...] = ()
        if mover is not None:
            way = mover_start + (mover_way - mover_start) * (number / max(1, frames))
            movers = (mover.moved(0.3, (float(way[0]), float(way[1]))),)
        label = label_of(car, stage.view)
        yield FilmedFrame(
            image=camera.develop(_filmed(stage, car, movers), rng),
            ground_px=(float(label[0]), float(label[1])),
            length_px=float(label[2]),
            heading_rad=math.atan2(float(label[4]), float(label[3])),
            ground_m=ground,
            view=stage.view,
            path_m=stage.path_m,
            lane_m=stage.lane_m,
        )
