"""The still part of the simulated picture: floor, clutter, light, as the camera sees them when no car is there.

Knows how to bring the floor into the camera's picture and to stand things beside the track. Knows no car and no time.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.circuit import Circuit, edge_line
from dnb_edge.sim.floor import draw_floor, smooth_noise
from dnb_edge.sim.solids import Mesh, Solid, box, cylinder, draw_mesh, draw_shadow, mesh
from dnb_edge.values import BgrImage

_SUPERSAMPLE = 2
_CARDBOARD = (112.0, 158.0, 196.0)
_CARDBOARD_TOP = (122.0, 170.0, 208.0)


def draw_room(circuit: Circuit, camera: PinholeCamera, seed: int) -> BgrImage:
    """The empty room as the camera sees it, without noise, shape (height_px, width_px, 3)."""
    random = np.random.default_rng([seed, 4])
    low, high = _visible_floor(camera)
    floor = draw_floor(circuit, low, high, seed)
    enlarge = np.array(
        [[_SUPERSAMPLE, 0.0, 0.5 * (_SUPERSAMPLE - 1)], [0.0, _SUPERSAMPLE, 0.5 * (_SUPERSAMPLE - 1)], [0.0, 0.0, 1.0]]
    )
    to_picture = enlarge @ camera.floor_homography() @ np.linalg.inv(floor.track_to_px)
    size = (camera.width_px * _SUPERSAMPLE, camera.height_px * _SUPERSAMPLE)
    big = cv2.warpPerspective(
        floor.bgr, to_picture, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    ).astype(np.uint8)
    _draw_cables(big, circuit, camera)
    things = [solid for solid in _clutter() if _may_stand(_corners(solid), circuit, camera)]
    if things:
        clutter = mesh(things)
        _darken(big, clutter, camera)
        draw_mesh(big, clutter, camera, offset_px=(0.0, 0.0), scale=_SUPERSAMPLE)
    small = cv2.resize(big, (camera.width_px, camera.height_px), interpolation=cv2.INTER_AREA)
    lit = cv2.GaussianBlur(small, (0, 0), 0.7).astype(np.float32) * _light((camera.height_px, camera.width_px), random)
    return np.asarray(np.clip(lit, 0.0, 255.0), dtype=np.uint8)


def _visible_floor(camera: PinholeCamera) -> tuple[tuple[float, float], tuple[float, float]]:
    """Corners (low, high) of the rectangle of floor that holds all the camera sees, track m."""
    w, h = camera.width_px, camera.height_px
    corners = np.array([[-1.0, -1.0, 1.0], [w, -1.0, 1.0], [w, h, 1.0], [-1.0, h, 1.0]])
    ground = corners @ np.linalg.inv(camera.floor_homography()).T
    if not np.all(ground[:, 2] / ground[0, 2] > 0.0):
        raise ValueError("the camera sees the horizon")
    points = ground[:, :2] / ground[:, 2:]
    low, high = points.min(axis=0) - 0.05, points.max(axis=0) + 0.05
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))


def _corners(solid: Solid) -> NDArray[np.float64]:
    return np.concatenate([face.corners_m for face in solid.faces])


def _may_stand(points_m: NDArray[np.float64], circuit: Circuit, camera: PinholeCamera) -> bool:
    """Whether a thing with these points (n, 3), world m, is ahead of the camera and leaves the lane and its tape free."""
    ahead_m = (points_m - camera.position_m) @ camera.rotation[2]
    if ahead_m.min() < 0.3:
        return False
    line = edge_line(circuit, 0.0, 0.02)
    reach_m = 0.5 * circuit.lane_width_m + 0.03
    return bool(np.linalg.norm(line[None] - points_m[:, None, :2], axis=2).min() > reach_m)


def _clutter() -> list[Solid]:
    """Things that lie about in a lab, all of them off the lane."""
    return [
        box((-0.36, 1.96, 0.14), (0.42, 0.34, 0.28), _CARDBOARD, top=_CARDBOARD_TOP),
        box((-0.36, 1.96, 0.2805), (0.05, 0.34, 0.001), (150.0, 190.0, 214.0), layer=1),
        box((3.36, 1.72, 0.10), (0.36, 0.30, 0.20), _CARDBOARD, top=_CARDBOARD_TOP),
        box((3.36, 1.72, 0.2005), (0.36, 0.05, 0.001), (150.0, 190.0, 214.0), layer=1),
        box((3.02, 0.16, 0.004), (0.30, 0.21, 0.008), (70.0, 66.0, 64.0)),
        box((1.42, 0.72, 0.0006), (0.21, 0.148, 0.0012), (232.0, 234.0, 234.0)),
        box((1.42, 0.735, 0.0014), (0.16, 0.008, 0.0006), (150.0, 150.0, 150.0), layer=1),
        box((1.42, 0.705, 0.0014), (0.16, 0.008, 0.0006), (150.0, 150.0, 150.0), layer=1),
        box((-0.12, 0.30, 0.0006), (0.148, 0.21, 0.0012), (226.0, 230.0, 232.0)),
        cylinder((2.22, 0.92, 0.012), 0.042, 0.024, 2, (214.0, 214.0, 210.0), cap=(96.0, 120.0, 140.0), sides=24),
        cylinder((0.78, 0.86, 0.05), 0.034, 0.10, 2, (170.0, 110.0, 60.0), cap=(70.0, 60.0, 50.0), sides=24),
        box((-0.55, 0.95, 0.02), (0.10, 0.26, 0.04), (62.0, 52.0, 158.0), top=(70.0, 60.0, 176.0)),
        box((1.46, 1.86, 0.015), (0.16, 0.05, 0.03), (70.0, 140.0, 60.0)),
        cylinder((3.34, 0.78, 0.22), 0.02, 0.44, 2, (178.0, 180.0, 182.0), sides=20),
        box((3.34, 0.78, 0.01), (0.30, 0.04, 0.02), (60.0, 58.0, 58.0)),
        box((3.34, 0.78, 0.012), (0.04, 0.30, 0.02), (60.0, 58.0, 58.0)),
    ]


def _draw_cables(big: BgrImage, circuit: Circuit, camera: PinholeCamera) -> None:
    """Two cables that lie in curves on the floor, with the thin shadow beside them."""
    t = np.linspace(0.0, 1.0, 120)
    black = np.column_stack((-0.9 + 1.0 * t, 0.62 + 0.10 * np.sin(7.0 * t) + 0.9 * t**2, np.zeros_like(t)))
    grey = np.column_stack((3.0 + 0.9 * t, 2.05 - 0.55 * t + 0.06 * np.sin(9.0 * t), np.zeros_like(t)))
    black[:, 0] -= 0.12
    for points, colour in ((black, (44.0, 42.0, 42.0)), (grey, (180.0, 130.0, 60.0))):
        if not _may_stand(points, circuit, camera):
            continue
        pixels = camera.project(points) * _SUPERSAMPLE
        shade = np.rint(pixels + np.array([4.0, 2.0])).astype(np.int32)
        layer = big.copy()
        cv2.polylines(layer, [shade], isClosed=False, color=(96.0, 98.0, 98.0), thickness=8, lineType=cv2.LINE_AA)
        big[:] = cv2.addWeighted(layer, 0.5, big, 0.5, 0.0)
        line = np.rint(pixels).astype(np.int32)
        cv2.polylines(big, [line], isClosed=False, color=colour, thickness=7, lineType=cv2.LINE_AA)


def _darken(big: BgrImage, things: Mesh, camera: PinholeCamera) -> None:
    """Soft shadows of `things` on the floor."""
    mask = np.zeros(big.shape[:2], dtype=np.uint8)
    draw_shadow(mask, things, camera, offset_px=(0.0, 0.0), scale=_SUPERSAMPLE)
    soft = cv2.GaussianBlur(mask, (0, 0), 9.0).astype(np.float32) / np.float32(255.0)
    big[:] = (big * (1.0 - 0.48 * soft[..., None])).astype(np.uint8)


def _light(shape: tuple[int, int], random: np.random.Generator) -> NDArray[np.float32]:
    """(h, w, 1) factor: window light from one side, two dull reflections, a slight vignette."""
    v, u = np.mgrid[0 : shape[0], 0 : shape[1]].astype(np.float32)
    x, y = u / shape[1] - 0.5, v / shape[0] - 0.5
    light = 1.04 + 0.10 * x - 0.12 * y
    for _ in range(3):
        cx, cy = random.uniform(-0.35, 0.35, 2)
        light += 0.09 * np.exp(-(((x - cx) / 0.16) ** 2 + ((y - cy) / 0.09) ** 2))
    light += 0.012 * smooth_noise(shape, 260, random)
    light *= 1.0 - 0.34 * (x**2 + 0.6 * y**2)
    return np.asarray(light[..., None], dtype=np.float32)
