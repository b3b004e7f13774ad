"""Simulated cars with a printed marker on the roof, as a camera sees them, with the truth of where each car stands."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from dnb_edge.sim.camera import PinholeCamera, mast_camera
from dnb_edge.sim.car import car_mesh, posed
from dnb_edge.sim.driver import Pose
from dnb_edge.sim.solids import draw_mesh
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import BgrImage, PointM, PointPx
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.pose import with_camera

_ENLARGED = 3
_CELL_PX = 8
_SCALE = TwinScale(metres_per_px=0.002, height_px=1000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Roof:
    """The marker of one car and how it is mounted."""

    marker_id: int = 7
    dictionary: str = "4X4_50"
    size_m: float = 0.07
    height_m: float = 0.115
    ahead_m: float = 0.0


def camera_over(
    height_m: float, pitch_deg: float, *, size_px: tuple[int, int] = (1280, 720), hfov_deg: float = 70.0
) -> PinholeCamera:
    """A camera whose axis meets the floor at (1.5, 1) m."""
    back_m = height_m / math.tan(math.radians(pitch_deg)) if pitch_deg < 90.0 else 0.0
    position_m = (1.5, 1.0 - back_m, height_m)
    return mast_camera(position_m=position_m, pitch_deg=pitch_deg, roll_deg=1.0, size_px=size_px, hfov_deg=hfov_deg)


def ground_of(camera: PinholeCamera) -> GroundMap:
    """The exact ground map of `camera`, its place known."""
    scale = _SCALE.metres_per_px
    to_twin = np.array([[1 / scale, 0.0, 0.0], [0.0, -1 / scale, _SCALE.height_px], [0.0, 0.0, 1.0]])
    matrix = to_twin @ np.linalg.inv(camera.floor_homography())
    a, b, c, d, e, f, g, h, i = (matrix / matrix[2, 2]).ravel().tolist()
    bare = GroundMap(
        camera_to_twin=(a, b, c, d, e, f, g, h, i), scale=_SCALE, width_px=camera.width_px, height_px=camera.height_px
    )
    height_m = float(camera.position_m[2])
    return with_camera(bare, height_m=height_m)


def floor_picture(camera: PinholeCamera, seed: int = 1) -> BgrImage:
    """An empty floor: clouds of several sizes, a dark lane, specks."""
    random = np.random.default_rng(seed)
    shape = (camera.height_px, camera.width_px)
    picture = np.full((*shape, 3), 150.0, dtype=np.float32)
    for cell, level in ((200, 14.0), (40, 6.0), (8, 4.0)):
        grid = random.standard_normal((shape[0] // cell + 2, shape[1] // cell + 2)).astype(np.float32)
        picture += level * cv2.resize(grid, shape[::-1], interpolation=cv2.INTER_CUBIC)[..., None]
    lane = np.zeros(shape, dtype=np.uint8)
    axes = (round(0.3 * shape[1]), round(0.3 * shape[0]))
    cv2.ellipse(lane, (shape[1] // 2, shape[0] // 2), axes, 0, 0, 360, 255, round(0.12 * shape[0]), cv2.LINE_AA)
    picture = np.where(lane[..., None] > 0, 62.0 + 0.3 * (picture - 150.0), picture)
    return np.clip(picture, 0, 255).astype(np.uint8)


def marker_print(roof: Roof) -> np.ndarray:
    """The printed marker with a white border of one cell, grey."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{roof.dictionary}"))
    cells = dictionary.markerSize + 2
    black = cv2.aruco.generateImageMarker(dictionary, roof.marker_id, cells * _CELL_PX)
    return cv2.copyMakeBorder(black, _CELL_PX, _CELL_PX, _CELL_PX, _CELL_PX, cv2.BORDER_CONSTANT, value=255)


def above_px(camera: PinholeCamera, track_m: PointM, height_m: float) -> PointPx:
    """Camera px of the point `height_m` straight above a floor point."""
    ((u, v),) = camera.project(np.array([[*track_m, height_m]])).tolist()
    return u, v


def put_car(
    picture: BgrImage,
    camera: PinholeCamera,
    *,
    track_m: PointM,
    heading_rad: float,
    roof: Roof | None,
    blur_px: float = 0.0,
    seed: int = 1,
) -> None:
    """Draws a car into `picture`, smeared by `blur_px` along its way; with its marker where it has a roof."""
    middle = above_px(camera, track_m, 0.1)
    # Pixels for a metre along the way, to make the smear as long as asked for.
    ahead = (track_m[0] + 0.05 * math.cos(heading_rad), track_m[1] + 0.05 * math.sin(heading_rad))
    px_per_m = math.dist(above_px(camera, ahead, 0.1), middle) / 0.05
    reach = round(0.25 * float(camera.matrix[0, 0]) / float(camera.distance_m(np.array([[*track_m, 0.0]]))[0])) + 8
    left, top = max(0, round(middle[0]) - reach), max(0, round(middle[1]) - reach)
    right, bottom = min(camera.width_px, round(middle[0]) + reach), min(camera.height_px, round(middle[1]) + reach)
    if right - left < 4 or bottom - top < 4:
        return
    enlarged = ((right - left) * _ENLARGED, (bottom - top) * _ENLARGED)
    under = np.asarray(cv2.resize(picture[top:bottom, left:right], enlarged), dtype=np.uint8)
    steps = max(1, math.ceil(blur_px))
    total = np.zeros(under.shape, dtype=np.float32)
    for along_px in np.linspace(-0.5, 0.5, steps) * blur_px if steps > 1 else (0.0,):
        shift_m = float(along_px) / px_per_m
        at_m = (track_m[0] + shift_m * math.cos(heading_rad), track_m[1] + shift_m * math.sin(heading_rad))
        layer = under.copy()
        pose = Pose(track_m=at_m, heading_rad=heading_rad, speed_mps=0.0)
        draw_mesh(layer, posed(car_mesh(seed), pose), camera, offset_px=(left, top), scale=_ENLARGED)
        if roof is not None:
            _put_marker(layer, camera, at_m, heading_rad, roof, (left, top))
        total += layer
    small = cv2.resize(total / steps, (right - left, bottom - top), interpolation=cv2.INTER_AREA)
    picture[top:bottom, left:right] = np.clip(small, 0, 255).astype(np.uint8)


def _put_marker(
    layer: BgrImage,
    camera: PinholeCamera,
    track_m: PointM,
    heading_rad: float,
    roof: Roof,
    corner_px: tuple[int, int],
) -> None:
    printed = marker_print(roof)
    side = printed.shape[0]
    half_m = 0.5 * roof.size_m * side / (side - 2 * _CELL_PX)
    ahead = np.array([math.cos(heading_rad), math.sin(heading_rad)])
    right = np.array([ahead[1], -ahead[0]])
    centre = np.array(track_m) + roof.ahead_m * ahead
    corners = [centre + half_m * (a * ahead + b * right) for a, b in ((1, -1), (1, 1), (-1, 1), (-1, -1))]
    pixels = camera.project(np.column_stack((corners, np.full(4, roof.height_m))))
    target = ((pixels - np.array(corner_px) + 0.5) * _ENLARGED - 0.5).astype(np.float32)
    source = np.array(
        [[-0.5, -0.5], [side - 0.5, -0.5], [side - 0.5, side - 0.5], [-0.5, side - 0.5]], dtype=np.float32
    )
    matrix = cv2.getPerspectiveTransform(source, target)
    size = (layer.shape[1], layer.shape[0])
    ink = cv2.warpPerspective(printed, matrix, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    cover = np.zeros(layer.shape[:2], dtype=np.uint8)
    cv2.fillConvexPoly(cover, np.rint(target * 16).astype(np.int32), 255, cv2.LINE_AA, 4)
    share = (cover.astype(np.float32) / 255.0)[..., None]
    # A print in room light: neither black nor white are full.
    grey = 35.0 + ink.astype(np.float32)[..., None] * (190.0 / 255.0)
    layer[:] = np.clip(layer * (1.0 - share) + grey * share, 0, 255).astype(np.uint8)


def developed(picture: BgrImage, seed: int, *, noise: float = 2.5, quality: int = 88) -> BgrImage:
    """`picture` through a lens that is not quite sharp, a sensor with noise, and the camera's JPEG."""
    random = np.random.default_rng(seed)
    soft = cv2.GaussianBlur(picture, (0, 0), 0.6).astype(np.float32)
    noisy = soft + noise * random.standard_normal(soft.shape[:2], dtype=np.float32)[..., None]
    done, code = cv2.imencode(".jpg", np.clip(noisy, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality])
    assert done
    return np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), dtype=np.uint8)
