"""What a camera would see of a track, before anything is mounted: coverage, millimetres a pixel, parallax.

Knows an ideal pinhole (square pixels, optical centre in the middle of the picture, no distortion), where it would stand and a
rectangle on the floor. Knows no clock, no car and no search; `mount_timing`, `mount_suggest` and `mount_plan` build on it.

Frame of reference, *plan m*: x to the right of the track's middle, y away from the camera counted from the track's near edge,
z up. The camera's foot, the floor point below it, is at (aside_m, -distance_m). A floor point r to the right of the foot
and a ahead of it, both seen along the camera's heading, lies at depth Z = a cos(pitch) + H sin(pitch) and appears at

    u = cx + f r / Z        v = cy + f (H cos(pitch) - a sin(pitch)) / Z

so one px is, on the floor, d(r, a)/d(u, v) = Z / (f H) [[H, -r cos(pitch)], [0, -Z]] (differentiate and invert).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.values import PointM, Points

CORNER_NAMES = ("near left", "near right", "far right", "far left")
"""As seen from the camera, in the order of `TrackArea.corners_m`."""

_EDGE_STEPS = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class Optics:
    """An ideal camera: angle of view and size of frame."""

    hfov_deg: float
    """Angle between the picture's left and right edges, degrees."""
    width_px: int
    height_px: int

    @property
    def focal_px(self) -> float:
        """Focal length, camera px."""
        return 0.5 * self.width_px / math.tan(math.radians(0.5 * self.hfov_deg))

    @property
    def vfov_deg(self) -> float:
        """Angle between the picture's upper and lower edges, degrees."""
        return math.degrees(2.0 * math.atan(0.5 * self.height_px / self.focal_px))


@dataclass(frozen=True, slots=True, kw_only=True)
class Stand:
    """Where a camera stands and how it looks."""

    height_m: float
    """Of the optical centre above the floor."""
    pitch_deg: float
    """Of the optical axis below the horizon; 90 is straight down."""
    distance_m: float
    """On the floor, from the track's near edge back to the camera's foot; negative where the foot is beyond that edge."""
    aside_m: float = 0.0
    """Of the camera's foot to the right of the track's middle."""
    turn_deg: float = 0.0
    """Of the camera's heading to the right of straight across the track."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackArea:
    """The rectangle on the floor that has to be seen."""

    width_m: float
    """Across the line of sight."""
    depth_m: float
    """Along the line of sight."""

    @property
    def area_m2(self) -> float:
        """Square metres."""
        return self.width_m * self.depth_m

    def corners_m(self, margin_m: float = 0.0) -> Points:
        """(4, 2), plan m, in the order of `CORNER_NAMES`, `margin_m` outside the track."""
        x, near, far = 0.5 * self.width_m + margin_m, -margin_m, self.depth_m + margin_m
        return np.array([[-x, near], [x, near], [x, far], [-x, far]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """Millimetres on the floor that one camera px covers at one floor point."""

    at_m: PointM
    """Plan m."""
    across_mm: float
    """Of a step across the camera's heading."""
    along_mm: float
    """Of a step along it: on a slanting view the coarser one."""
    worst_mm: float
    """In the direction in which it is most: largest singular value of d(floor)/d(px)."""
    finest_mm: float
    """In the direction in which it is least."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """How much of the track is inside the picture."""

    share: float
    """0..1 of the track's area."""
    cut_off: tuple[str, ...]
    """Corners outside the picture, by `CORNER_NAMES`."""
    spare_px: float | None
    """From the outermost corner to the picture's edge, camera px; negative where it is cut off, None behind the camera."""
    seen_m: tuple[PointM, ...]
    """Corners of the part of the track that is seen, plan m; empty where nothing is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MountedCamera:
    """An ideal camera in its place."""

    optics: Optics
    stand: Stand

    def ahead_m(self, plan_m: Points) -> Points:
        """(n, 2) plan m as (n, 2) metres (to the right of, ahead of) the camera's foot along its heading."""
        turn = math.radians(self.stand.turn_deg)
        x, y = plan_m[:, 0] - self.stand.aside_m, plan_m[:, 1] + self.stand.distance_m
        return np.column_stack((x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)))

    def to_plan_m(self, ahead_m: Points) -> Points:
        """The inverse of `ahead_m`."""
        turn = math.radians(self.stand.turn_deg)
        right, ahead = ahead_m[:, 0], ahead_m[:, 1]
        x, y = right * math.cos(turn) + ahead * math.sin(turn), ahead * math.cos(turn) - right * math.sin(turn)
        return np.column_stack((x + self.stand.aside_m, y - self.stand.distance_m))

    def depth_m(self, plan_m: Points) -> NDArray[np.float64]:
        """(n,) metres along the optical axis to floor points (n, 2); zero or less behind the camera."""
        pitch = math.radians(self.stand.pitch_deg)
        depth: NDArray[np.float64] = self.ahead_m(plan_m)[:, 1] * math.cos(pitch) + self.stand.height_m * math.sin(
            pitch
        )
        return depth

    def to_camera_px(self, plan_m: Points) -> Points:
        """(n, 2) camera px of floor points (n, 2), plan m. Raises `ValueError` for a point behind the camera."""
        depth = self.depth_m(plan_m)
        if not (depth > 0).all():
            raise ValueError("a floor point lies behind the camera")
        pitch, optics = math.radians(self.stand.pitch_deg), self.optics
        right, ahead = self.ahead_m(plan_m).T
        down = self.stand.height_m * math.cos(pitch) - ahead * math.sin(pitch)
        u = 0.5 * (optics.width_px - 1) + optics.focal_px * right / depth
        v = 0.5 * (optics.height_px - 1) + optics.focal_px * down / depth
        return np.column_stack((u, v))

    def floor_per_px_m(self, plan_m: Points) -> NDArray[np.float64]:
        """(n, 2, 2) d(right, ahead)/d(u, v), metres a camera px, at floor points (n, 2) ahead of the camera."""
        depth, height = self.depth_m(plan_m), self.stand.height_m
        right = self.ahead_m(plan_m)[:, 0]
        out = np.zeros((len(plan_m), 2, 2))
        out[:, 0, 0] = height
        out[:, 0, 1] = -right * math.cos(math.radians(self.stand.pitch_deg))
        out[:, 1, 1] = -depth
        return np.asarray(out * (depth / (self.optics.focal_px * height))[:, None, None])

    def resolution(self, plan_m: PointM) -> Resolution:
        """Millimetres a px at one floor point ahead of the camera."""
        step = self.floor_per_px_m(np.array([plan_m]))[0] * 1000.0
        px_a_mm = np.linalg.inv(step)
        worst, finest = np.linalg.svd(step, compute_uv=False).tolist()
        across, along = (1.0 / np.linalg.norm(px_a_mm, axis=0)).tolist()
        return Resolution(at_m=plan_m, across_mm=across, along_mm=along, worst_mm=worst, finest_mm=finest)

    def view_edges(self) -> NDArray[np.float64]:
        """(5, 3) half-planes a x + b y + c >= 0, plan m, whose intersection is the floor in the picture.

        Left, right, upper and lower edge of the picture, and what is ahead of the camera: each is linear in the floor point.
        """
        pitch, optics = math.radians(self.stand.pitch_deg), self.optics
        sin, cos, height = math.sin(pitch), math.cos(pitch), self.stand.height_m
        half_width, half_height = 0.5 * optics.width_px / optics.focal_px, 0.5 * optics.height_px / optics.focal_px
        depth, down = np.array([0.0, cos, height * sin]), np.array([0.0, -sin, height * cos])
        right = np.array([1.0, 0.0, 0.0])
        edges = np.vstack(
            (right + half_width * depth, half_width * depth - right, down + half_height * depth,
             half_height * depth - down, depth)
        )  # fmt: skip
        turn = math.radians(self.stand.turn_deg)
        to_ahead = np.array(
            [
                [math.cos(turn), -math.sin(turn)],
                [math.sin(turn), math.cos(turn)],
            ]
        )
        normals = edges[:, :2] @ to_ahead
        foot = np.array([self.stand.aside_m, -self.stand.distance_m])
        return np.column_stack((normals, edges[:, 2] - normals @ foot))

    def seen_part(self, polygon_m: Points) -> Points:
        """(k, 2) plan m: the part of a convex floor polygon (n, 2) that is in the picture; (0, 2) where none is."""
        part = np.asarray(polygon_m, dtype=np.float64)
        for edge in self.view_edges():
            part = clipped(part, edge)
        return part

    def coverage(self, track: TrackArea) -> Coverage:
        """How much of the track is in the picture, by clipping its rectangle with the picture's edges: exact."""
        corners = track.corners_m()
        sides = np.column_stack((corners, np.ones(4))) @ self.view_edges().T
        seen = self.seen_part(corners)
        return Coverage(
            share=min(1.0, polygon_area_m2(seen) / track.area_m2),
            cut_off=tuple(name for name, side in zip(CORNER_NAMES, sides, strict=True) if side.min() < -1e-12),
            spare_px=self.spare_px(corners),
            seen_m=tuple((float(x), float(y)) for x, y in seen),
        )

    def spare_px(self, plan_m: Points) -> float | None:
        """From the outermost of the floor points (n, 2) to the picture's edge; None where one is behind the camera."""
        if not (self.depth_m(plan_m) > 0).all():
            return None
        u, v = self.to_camera_px(plan_m).T
        right, bottom = self.optics.width_px - 0.5, self.optics.height_px - 0.5
        return float(np.min([u + 0.5, right - u, v + 0.5, bottom - v]))

    def middle_m(self, seen_m: Points) -> tuple[PointM, PointM]:
        """(near, far), plan m: the ends of the line of sight within a convex floor polygon (k, 2).

        Where the line of sight passes beside it, the polygon's nearest and furthest corner along the heading.
        """
        ahead = self.ahead_m(seen_m)
        on_line = np.vstack((clipped(clipped(ahead, (1.0, 0.0, 0.0)), (-1.0, 0.0, 0.0)), np.empty((0, 2))))
        line = on_line if len(on_line) else ahead
        ends = self.to_plan_m(line[[np.argmin(line[:, 1]), np.argmax(line[:, 1])]])
        (x0, y0), (x1, y1) = ends.tolist()
        return (x0, y0), (x1, y1)

    def parallax_m(self, plan_m: PointM, height_m: float) -> float:
        """How far from its ground point a thing `height_m` up seems to stand when it is taken to lie on the floor.

        The thing appears at floor point p' = `plan_m` and stands at p = c + (1 - h/H) (p' - c), c being the camera's foot: the
        error is h/H |p' - c|.
        """
        foot = (self.stand.aside_m, -self.stand.distance_m)
        return height_m / self.stand.height_m * math.dist(plan_m, foot)


def edge_points_m(polygon_m: Points) -> Points:
    """(m, 2): the corners of a polygon (k, 2) and points between them, where resolution has its extremes."""
    share = np.arange(_EDGE_STEPS)[:, None] / _EDGE_STEPS
    sides = [a + (b - a) * share for a, b in zip(polygon_m, np.roll(polygon_m, -1, axis=0), strict=True)]
    return np.concatenate(sides)


def clipped(polygon_m: Points, edge: NDArray[np.float64] | tuple[float, float, float]) -> Points:
    """(k, 2): the part of a convex polygon (n, 2) where a x + b y + c >= 0 (Sutherland and Hodgman)."""
    a, b, c = edge
    out: list[tuple[float, float]] = []
    points = [(float(x), float(y)) for x, y in polygon_m]
    for k, here in enumerate(points):
        before = points[k - 1]
        side, side_before = a * here[0] + b * here[1] + c, a * before[0] + b * before[1] + c
        if (side >= 0) != (side_before >= 0):
            t = side_before / (side_before - side)
            out.append((before[0] + t * (here[0] - before[0]), before[1] + t * (here[1] - before[1])))
        if side >= 0:
            out.append(here)
    return np.array(out, dtype=np.float64).reshape(-1, 2)


def polygon_area_m2(polygon_m: Points) -> float:
    """Area of a polygon (k, 2), by the shoelace formula."""
    x, y = polygon_m[:, 0], polygon_m[:, 1]
    return 0.5 * abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))
