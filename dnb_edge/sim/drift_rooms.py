"""Rooms for trying the drift watch: several floors under several cameras, and what the camera sees after it was bumped.

Knows floors, cameras and the homography that a moved camera puts between two pictures of one floor. Knows no time, no people
and no watch. Pictures are grey, since the watch looks at nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.camera import PinholeCamera, mast_camera
from dnb_edge.sim.circuit import LANE_WIDTH_M, TWIN_SCALE, demo_circuit, edge_line
from dnb_edge.sim.floor import smooth_noise
from dnb_edge.sim.solids import box, draw_mesh, mesh
from dnb_edge.values import Points
from dnb_edge.view.drift_judge import WatchedTrack, watched_track
from dnb_edge.view.ground import GroundMap

GreyImage = NDArray[np.uint8]

_FLOOR_M_PER_PX = 0.003
_LOW_M, _HIGH_M = np.array([-2.6, -1.6]), np.array([5.6, 6.4])
_FINER = 2
_REST = 0.08
"""The room is drawn so much larger on each side than the picture, as a share of its width: a bumped camera sees it."""


class FloorKind(StrEnum):
    """What the floor is made of."""

    CONCRETE = "concrete"
    TILES = "tiles"
    PLANKS = "planks"
    CARPET = "carpet"
    LINO = "lino"
    """Nearly without texture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bump:
    """How a camera has been moved."""

    pan_deg: float = 0.0
    tilt_deg: float = 0.0
    roll_deg: float = 0.0
    shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def times(self, factor: float) -> Bump:
        """The same, so many times as large."""
        x, y, z = self.shift_m
        return Bump(
            pan_deg=self.pan_deg * factor,
            tilt_deg=self.tilt_deg * factor,
            roll_deg=self.roll_deg * factor,
            shift_m=(x * factor, y * factor, z * factor),
        )


CAMERAS: tuple[Callable[[], PinholeCamera], ...] = (
    lambda: mast_camera(position_m=(1.5, -0.42, 2.2), pitch_deg=61.0, yaw_deg=1.5, roll_deg=-0.8, hfov_deg=70.0),
    lambda: mast_camera(position_m=(1.4, -1.5, 2.15), pitch_deg=41.0, yaw_deg=2.0, hfov_deg=66.0),
    lambda: mast_camera(position_m=(1.5, 1.0, 2.9), pitch_deg=89.0, yaw_deg=1.0, hfov_deg=66.0, size_px=(640, 480)),
    lambda: mast_camera(
        position_m=(-0.5, -0.7, 2.1), pitch_deg=50.0, yaw_deg=38.0, roll_deg=1.5, hfov_deg=80.0, size_px=(640, 360)
    ),
)
"""The demo's, the paper's (2.15 m high, 41 degrees), one straight above, one in a corner."""


@dataclass(frozen=True, eq=False)
class DriftRoom:
    """One room under one camera."""

    name: str
    camera: PinholeCamera
    watched: WatchedTrack
    lane_px: Points
    """(n, 2) the route in the picture, in the order of driving: cars follow it."""
    wide: GreyImage
    """The empty room, `_FINER` times as fine as the picture and wider by `_REST` on each side."""

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of its pictures."""
        return self.camera.width_px, self.camera.height_px

    @cached_property
    def still(self) -> GreyImage:
        """The empty room as the camera sees it in its place."""
        return self.picture(None)

    def picture(self, bump: Bump | None) -> GreyImage:
        """The empty room as the camera sees it after `bump`. Exact for turns, and on the floor for shifts."""
        rest = _rest_px(self.camera)
        # Px of the picture on the wide one, whose px are finer: their centres do not fall together.
        fine = np.array([[_FINER, 0, (_FINER - 1) / 2], [0, _FINER, (_FINER - 1) / 2], [0, 0, 1.0]])
        shift = np.array([[1, 0, rest], [0, 1, rest], [0, 0, 1.0]])
        to_wide = fine @ shift
        if bump is not None:
            to_wide = to_wide @ np.linalg.inv(bump_homography(self.camera, bump))
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        seen = cv2.warpPerspective(self.wide, to_wide, self.size_px, flags=flags, borderMode=cv2.BORDER_REFLECT)
        return np.asarray(seen, dtype=np.uint8)

    def displacement_m(self, bump: Bump) -> float:
        """How far the bump puts the farthest point of the track from where it is, metres: what the watch should say."""
        to_bumped = bump_homography(self.camera, bump)
        seen = _through(to_bumped, self.watched.camera_px)
        back = np.linalg.inv(self.camera.floor_homography())
        off = _through(back, seen) - _through(back, self.watched.camera_px)
        return float(np.linalg.norm(off, axis=1).max())

    def bump_of(self, kind: Bump, share: float) -> Bump:
        """A bump of that kind which puts the track off by `share` of its span."""
        wanted_m, bump = share * self.watched.span_m, kind.times(1e-3)
        for _ in range(6):
            bump = bump.times(wanted_m / self.displacement_m(bump))
        return bump


def drift_room(floor: FloorKind, camera: PinholeCamera, seed: int) -> DriftRoom:
    """A room with that floor under that camera; things stand about where `seed` puts them."""
    random = np.random.default_rng([seed, 11])
    circuit = demo_circuit()
    route_m = edge_line(circuit, 0.0, 0.02)
    matrix = np.linalg.inv(camera.floor_homography())
    scale = TWIN_SCALE.metres_per_px
    to_twin = np.array([[1 / scale, 0, 0], [0, -1 / scale, TWIN_SCALE.height_px], [0, 0, 1.0]]) @ matrix
    to_twin *= np.sign((to_twin @ (camera.width_px / 2, camera.height_px / 2, 1.0))[2])
    a, b, c, d, e, f, g, h, i = to_twin.ravel().tolist()
    ground = GroundMap(
        camera_to_twin=(a, b, c, d, e, f, g, h, i),
        scale=TWIN_SCALE,
        width_px=camera.width_px,
        height_px=camera.height_px,
    )
    return DriftRoom(
        name=f"{floor.value}, {camera.width_px}x{camera.height_px}, {camera.position_m[2]:g} m",
        camera=camera,
        watched=watched_track(ground, route_m),
        lane_px=_through(camera.floor_homography(), route_m),
        wide=_wide_picture(_floor(floor, route_m, random), camera, random),
    )


def bump_homography(camera: PinholeCamera, bump: Bump) -> NDArray[np.float64]:
    """(3, 3) camera px of a floor point before the bump to those after it."""
    pan, tilt, roll = (np.radians(angle) for angle in (bump.pan_deg, bump.tilt_deg, bump.roll_deg))
    turn, *_ = cv2.Rodrigues(np.array([tilt, pan, roll]))
    moved = replace(
        camera, rotation=np.asarray(turn) @ camera.rotation, position_m=camera.position_m + np.array(bump.shift_m)
    )
    return np.asarray(moved.floor_homography() @ np.linalg.inv(camera.floor_homography()))


def _rest_px(camera: PinholeCamera) -> int:
    return round(_REST * camera.width_px)


def _through(matrix: NDArray[Any], points: Points) -> Points:
    homogeneous = np.column_stack((points, np.ones(len(points)))) @ matrix.T
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


def _wide_picture(floor: NDArray[np.float32], camera: PinholeCamera, random: np.random.Generator) -> GreyImage:
    """The floor with boxes on it under an even light, as a camera with a larger and finer sensor sees it."""
    rest = _rest_px(camera)
    matrix = camera.matrix.copy()
    matrix[:2, 2] += rest
    wide = replace(camera, matrix=matrix, width_px=camera.width_px + 2 * rest, height_px=camera.height_px + 2 * rest)
    to_floor_px = np.array([[1, 0, -_LOW_M[0]], [0, 1, -_LOW_M[1]], [0, 0, _FLOOR_M_PER_PX]]) / _FLOOR_M_PER_PX
    fine = np.array([[_FINER, 0, (_FINER - 1) / 2], [0, _FINER, (_FINER - 1) / 2], [0, 0, 1.0]])
    to_picture = fine @ wide.floor_homography() @ np.linalg.inv(to_floor_px)
    size = (wide.width_px * _FINER, wide.height_px * _FINER)
    big = cv2.warpPerspective(floor, to_picture, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    colour = np.repeat(np.clip(big, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    draw_mesh(colour, mesh(_boxes(random)), wide, offset_px=(0.0, 0.0), scale=_FINER)
    return np.asarray(cv2.GaussianBlur(colour[..., 0], (0, 0), 0.45 * _FINER), dtype=np.uint8)


def _boxes(random: np.random.Generator) -> list:  # type: ignore[type-arg]
    boxes = []
    for x, y in ((-0.35, 1.9), (3.3, 1.6), (3.1, 0.1), (-0.5, 0.4), (1.45, 0.7), (2.2, 0.8), (1.5, 2.1), (0.3, 2.2)):
        if random.uniform() < 0.3:
            continue
        width, depth, height = random.uniform(0.06, 0.35, 3) * (1.0, 1.0, 0.5)
        shade = float(random.uniform(40, 220))
        place = (x + random.uniform(-0.1, 0.1), y + random.uniform(-0.1, 0.1), height / 2)
        boxes.append(box(place, (width, depth, height), (shade, shade, shade)))
    return boxes or [box((3.3, 1.6, 0.1), (0.3, 0.3, 0.2), (120.0, 120.0, 120.0))]


def _floor(kind: FloorKind, route_m: Points, random: np.random.Generator) -> NDArray[np.float32]:
    """The floor from straight above, grey levels; one px is `_FLOOR_M_PER_PX`."""
    width, height = np.ceil((_HIGH_M - _LOW_M) / _FLOOR_M_PER_PX).astype(int).tolist()
    picture = _FLOORS[kind]((height, width), random)
    points = np.rint((route_m - _LOW_M) / _FLOOR_M_PER_PX * 16).astype(np.int32)
    tape = round((LANE_WIDTH_M + 0.05) / _FLOOR_M_PER_PX)
    lane = round(LANE_WIDTH_M / _FLOOR_M_PER_PX)
    for shade, thickness in ((float(random.uniform(200, 235)), tape), (float(random.uniform(50, 90)), lane)):
        mask = np.zeros((height, width), dtype=np.uint8)
        cv2.polylines(mask, [points], True, (255,), thickness, cv2.LINE_AA, 4)  # noqa: FBT003 OpenCV's own order
        texture = shade + 2.0 * smooth_noise((height, width), 40, random)
        picture += mask.astype(np.float32) / np.float32(255.0) * (texture - picture)
    return picture


def _concrete(shape: tuple[int, int], random: np.random.Generator) -> NDArray[np.float32]:
    clouds = sum(a * smooth_noise(shape, cell, random) for a, cell in ((5.0, 300), (3.0, 90), (2.0, 25), (2.0, 7)))
    return np.asarray(160.0 + clouds, dtype=np.float32)


def _tiles(shape: tuple[int, int], random: np.random.Generator) -> NDArray[np.float32]:
    """Square tiles of 30 cm, all nearly alike: a floor that repeats itself."""
    side = round(0.3 / _FLOOR_M_PER_PX)
    rows, columns = (n // side + 2 for n in shape)
    shades = cv2.resize(
        random.normal(175.0, 2.5, (rows, columns)), None, fx=side, fy=side, interpolation=cv2.INTER_NEAREST
    )
    picture = np.asarray(shades, dtype=np.float32)[: shape[0], : shape[1]].copy()
    picture[np.arange(shape[0]) % side < 2] -= 45.0
    picture[:, np.arange(shape[1]) % side < 2] -= 45.0
    return np.asarray(picture + 1.0 * smooth_noise(shape, 6, random), dtype=np.float32)


def _planks(shape: tuple[int, int], random: np.random.Generator) -> NDArray[np.float32]:
    picture = np.empty(shape, dtype=np.float32)
    across, along = round(0.1 / _FLOOR_M_PER_PX), round(1.1 / _FLOOR_M_PER_PX)
    for top in range(0, shape[0], across):
        left = -int(random.integers(along))
        while left < shape[1]:
            board = picture[top : top + across, max(0, left) : left + along]
            board[:] = random.normal(135.0, 9.0)
            board[:1] -= 35.0
            board[:, :1] -= 35.0
            left += along
    grain = cv2.resize(smooth_noise((shape[0], max(2, shape[1] // 20)), 3, random), (shape[1], shape[0]))
    return np.asarray(picture + 5.0 * grain, dtype=np.float32)


def _carpet(shape: tuple[int, int], random: np.random.Generator) -> NDArray[np.float32]:
    return np.asarray(
        110.0 + 9.0 * smooth_noise(shape, 2.5, random) + 4.0 * smooth_noise(shape, 60, random), dtype=np.float32
    )


def _lino(shape: tuple[int, int], random: np.random.Generator) -> NDArray[np.float32]:
    return np.asarray(
        185.0 + 2.0 * smooth_noise(shape, 250, random) + 0.6 * smooth_noise(shape, 8, random), dtype=np.float32
    )


_FLOORS: dict[FloorKind, Callable[[tuple[int, int], np.random.Generator], NDArray[np.float32]]] = {
    FloorKind.CONCRETE: _concrete,
    FloorKind.TILES: _tiles,
    FloorKind.PLANKS: _planks,
    FloorKind.CARPET: _carpet,
    FloorKind.LINO: _lino,
}
