"""From the solved markers to a calibration: which twin the floor is tied to, and how well.

Knows a solution and either some markers' measured places on the track, or nothing of the track at all: then the markers
themselves make the floor's axes, and the twin is the floor seen from straight above. Knows no file and no picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Points
from dnb_edge.view.calibration import Calibration, CalibrationMethod, Covariance9
from dnb_edge.view.ground import GroundMap, Matrix3
from dnb_edge.view.homography import CalibrationError
from dnb_edge.view.marker_solution import MarkerSolution, MeasuredPoint, fit_frame, to_frame
from dnb_edge.view.marker_start import CORNERS, local_points
from dnb_edge.view.pose import CameraPose

FloatArray = NDArray[np.float64]

USUAL_METRES_PER_PX = 0.002

_MARGIN_M = 0.3
_MARGIN_SHARE = 0.25
_SURE = 3.5
"""So many sigmas are a contradiction."""
_LEAST_APART = 0.005
"""Lengths that differ by less than this share are never one."""
_ONE_RATIO = 0.008
"""Where all lengths differ by one ratio within this, it is the prints' size."""
_STEPS = np.array([1e-5, 1e-5, 1e-5, 1e-5, 1e-2, 1e-2, 1e-4, 1e-5, 1e-5, 1e-5])
_GRID = 7


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkerLayout:
    """Where some markers lie on the track, as somebody measured it."""

    points: tuple[MeasuredPoint, ...]
    """Their places are track m."""
    scale: TwinScale | None
    """The twin's; None where it has none yet."""
    source: str
    """Where it is from, as messages call it."""


def check_layout(layout: MarkerLayout, solution: MarkerSolution, *, tied: bool = False) -> None:
    """Raises `InputError` where the layout's lengths contradict those of `solution`, or where fewer than two markers of the
    layout are seen. `tied`: the solution was made with the layout, which then had its say on how high the camera is.
    """
    seen = [point for point in layout.points if point.number in solution.numbers]
    if len({point.number for point in seen}) < 2:
        raise InputError(
            f"{layout.source}: {len({point.number for point in seen})} of its markers seen, two are needed: the picture shows "
            f"{_list(solution.numbers)}"
        )
    places = {point: local_points([point.local], _place(solution, point.number), solution.size_m)[0] for point in seen}
    vague = 0.0 if tied else _SURE * solution.height_sigma_m / solution.height_m
    pairs, worst, most = [], None, 1.0
    for one, other in combinations(seen, 2):
        told, found = math.dist(one.at_m, other.at_m), math.dist(places[one], places[other])
        if one.number == other.number or min(told, found) < solution.size_m:
            continue
        allowed = max(_SURE * math.hypot(one.sigma_m, other.sigma_m), _LEAST_APART * found) + vague * found
        pairs.append((told, found))
        if abs(told - found) / allowed > most:
            worst, most = (one.number, other.number, told, found), abs(told - found) / allowed
    if worst is not None:
        raise InputError(f"{layout.source}: {_contradiction(worst, np.array(pairs), solution.size_m)}")


def _contradiction(worst: tuple[int, int, float, float], pairs: FloatArray, size_m: float) -> str:
    one, other, told, found = worst
    ratios = pairs[:, 0] / pairs[:, 1]
    ratio = float(np.median(ratios))
    said = f"markers {one} and {other} are {told:.3f} m apart by the layout, {found:.3f} m by the picture"
    if len(pairs) > 1 and float(np.abs(ratios / ratio - 1.0).max()) < _ONE_RATIO:
        return (
            f"{said}: the sheets were printed at {ratio:.0%} (print again at 100 %, or measure a square's side and give "
            f"--size-mm, {1000.0 * ratio * size_m:.1f} by this), or every length of the layout is wrong"
        )
    return f"{said}: measure again, and check each marker's number; or the sheets were printed at {told / found:.0%}"


def _place(solution: MarkerSolution, number: int) -> FloatArray:
    return np.asarray(solution.places[solution.numbers.index(number)])


def layout_calibration(solution: MarkerSolution, layout: MarkerLayout) -> Calibration:
    """The calibration to the layout's track, from a solution that was made with the layout's points."""
    scale = layout.scale
    if scale is None:
        _, _, _, top = _extent(to_frame(_all_corners(solution), solution.frame))
        scale = TwinScale(metres_per_px=USUAL_METRES_PER_PX, height_px=math.ceil(max(top, 0.1) / USUAL_METRES_PER_PX))
    missing = sorted({point.number for point in layout.points} - set(solution.numbers))
    notes = [f"{_list(missing)} of the layout not seen"] if missing else []
    return _calibration(solution, solution.frame, scale, measured=True, notes=notes)


def own_calibration(solution: MarkerSolution, *, metres_per_px: float) -> tuple[Calibration, tuple[float, float]]:
    """The calibration to a floor whose axes the markers make, and the size of its twin, metres.

    x runs along the markers' extent, to the right as the picture shows it, y away from the camera. The twin holds all markers
    with some floor about them.
    """
    frame = _own_axes(solution)
    x0, y0, x1, y1 = _extent(to_frame(_all_corners(solution), frame))
    origin = frame[:2] + turned(np.array([[x0, y0]]), float(frame[2]))[0]
    frame = np.array([origin[0], origin[1], frame[2]])
    height_px = math.ceil((y1 - y0) / metres_per_px)
    scale = TwinScale(metres_per_px=metres_per_px, height_px=height_px)
    return _calibration(solution, frame, scale, measured=False, notes=[]), (x1 - x0, height_px * metres_per_px)


def twin_size_m(solution: MarkerSolution, calibration: Calibration) -> tuple[float, float]:
    """Width and height, metres, of the twin that holds all markers with some floor about them, to the given twin's height."""
    _, _, right, _ = _extent(calibration.ground.to_track_m(solution.corners_px.reshape(-1, 2)))
    scale = calibration.ground.scale
    return max(right, scale.metres_per_px), scale.height_px * scale.metres_per_px


def turned(points: Points, angle_rad: float) -> Points:
    """Points (n, 2) turned anticlockwise."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.asarray(points @ np.array([[c, s], [-s, c]]))


def spread(solution: MarkerSolution) -> tuple[float, float]:
    """Extent of the markers' middles along their longest and their shortest direction, metres."""
    middles = solution.places[:, :2].astype(np.float32)
    _, (one, other), _ = cv2.minAreaRect(middles)
    return max(float(one), float(other)), min(float(one), float(other))


def _own_axes(solution: MarkerSolution) -> FloatArray:
    """A frame (3,) below the camera whose x lies along the markers' extent and within 45 degrees of the picture's right."""
    _, _, angle_deg = cv2.minAreaRect(solution.places[:, :2].astype(np.float32))
    right = math.atan2(float(solution.rotation[0, 1]), float(solution.rotation[0, 0]))
    quarter = math.pi / 2.0
    along = math.radians(float(angle_deg))
    return np.array([0.0, 0.0, along + quarter * round((right - along) / quarter)])


def _extent(corners_m: Points) -> tuple[float, float, float, float]:
    """The rectangle (x0, y0, x1, y1) about points (n, 2) with its margin."""
    low, high = corners_m.min(axis=0), corners_m.max(axis=0)
    margin = max(_MARGIN_M, _MARGIN_SHARE * float((high - low).max()))
    (x0, y0), (x1, y1) = (low - margin).tolist(), (high + margin).tolist()
    return x0, y0, x1, y1


def _all_corners(solution: MarkerSolution) -> Points:
    square = [(float(x), float(y)) for x, y in CORNERS]
    return np.concatenate([local_points(square, place, solution.size_m) for place in solution.places])


def _calibration(
    solution: MarkerSolution, frame: FloatArray, scale: TwinScale, *, measured: bool, notes: list[str]
) -> Calibration:
    corners_px = solution.corners_px.reshape(-1, 2)
    middle = solution.lens.to_ideal_px(corners_px).mean(axis=0)
    matrix = _camera_to_twin(solution.floor_homography(), frame, scale, middle)
    x, y = to_frame(np.zeros((1, 2)), frame)[0].tolist()
    ground = GroundMap(
        camera_to_twin=matrix,
        scale=scale,
        width_px=solution.optics.width_px,
        height_px=solution.optics.height_px,
        camera_m=(x, y, solution.height_m),
        lens=solution.lens,
    )
    apart = scale.to_twin_px(ground.to_track_m(corners_px)) - scale.to_twin_px(to_frame(_all_corners(solution), frame))
    errors = np.hypot(apart[:, 0], apart[:, 1])
    error = CalibrationError(
        per_point_px=tuple(errors.tolist()),
        mean_px=float(errors.mean()),
        sum_px=float(errors.sum()),
        max_px=float(errors.max()),
        leave_one_out_mean_px=None,
    )
    if solution.optics.lens is None:
        notes = [*notes, "the lens was estimated from the markers: calibrate it for a better height"]
    notes = [f"marker {number} set aside: it does not lie like the others" for number in solution.aside] + notes
    return Calibration(
        ground=ground,
        covariance=_covariance(solution, ground, frame, measured=measured),
        error=error.in_metres(scale.metres_per_px),
        method=CalibrationMethod.MARKERS,
        pose=CameraPose(
            position_m=(x, y, solution.height_m), focal_px=solution.lens.fx_px, pitch_deg=solution.pitch_deg
        ),
        notes=tuple(notes),
    )


def _camera_to_twin(floor: FloatArray, frame: FloatArray, scale: TwinScale, middle: FloatArray) -> Matrix3:
    """Ideal px -> twin px from foot m -> ideal px, with a third coordinate of 1 at the ideal px `middle` (2,)."""
    c, s = math.cos(float(frame[2])), math.sin(float(frame[2]))
    x, y = frame[:2].tolist()
    to_track = np.array([[c, s, -c * x - s * y], [-s, c, s * x - c * y], [0.0, 0.0, 1.0]])
    step = scale.metres_per_px
    to_twin = np.array([[1.0 / step, 0.0, 0.0], [0.0, -1.0 / step, scale.height_px], [0.0, 0.0, 1.0]])
    return _normalised(to_twin @ to_track @ np.linalg.inv(floor), middle)


def _normalised(matrix: FloatArray, middle: FloatArray) -> Matrix3:
    a, b, c, d, e, f, g, h, i = (matrix / (matrix[2] @ (middle[0], middle[1], 1.0))).ravel().tolist()
    return a, b, c, d, e, f, g, h, i


def _covariance(solution: MarkerSolution, ground: GroundMap, frame: FloatArray, *, measured: bool) -> Covariance9:
    """Covariance of `ground.camera_to_twin`, by first-order propagation of the pose's, the lens's and the measured frame's.

    Without measured places the twin's place on the floor is nobody's but ours: only its shape can be wrong, so every change
    is taken after the floor was laid back onto the markers' middles.
    """
    corners = solution.corners_px.reshape(-1, 2)
    (u0, v0), (u1, v1) = corners.min(axis=0), corners.max(axis=0)
    u, v = np.meshgrid(np.linspace(u0, u1, _GRID), np.linspace(v0, v1, _GRID))
    grid = np.column_stack((u.ravel(), v.ravel()))
    grid = grid[ground.sees_ground(grid)]
    middles = solution.corners_px.mean(axis=1)
    ideal = solution.lens.to_ideal_px(grid)
    centre = solution.lens.to_ideal_px(corners).mean(axis=0)
    there = ground.to_track_m(middles)

    def matrix(change: FloatArray) -> FloatArray:
        floor = np.asarray(np.linalg.inv(solution.floor_homography(change[:7])), dtype=np.float64)
        lens = solution.lens_at(change[:7])
        moved = frame + change[7:] if measured else fit_frame(_foot_m(floor, lens.to_ideal_px(middles)), there)
        track = to_frame(_foot_m(floor, lens.to_ideal_px(grid)), moved)
        fitted, _ = cv2.findHomography(ideal, ground.scale.to_twin_px(track), 0)
        return np.array(_normalised(np.asarray(fitted, dtype=np.float64), centre))

    columns = []
    for k, step in enumerate(_STEPS):
        change = np.zeros(len(_STEPS))
        change[k] = step
        columns.append((matrix(change) - matrix(-change)) / (2.0 * step))
    jacobian = np.column_stack(columns)
    kept = [*range(7), *range(len(solution.covariance) - 3, len(solution.covariance))]
    total = jacobian @ solution.covariance[np.ix_(kept, kept)] @ jacobian.T
    return tuple(map(tuple, (0.5 * (total + total.T)).tolist()))


def _foot_m(floor: FloatArray, ideal_px: Points) -> Points:
    homogeneous = np.column_stack((ideal_px, np.ones(len(ideal_px)))) @ floor.T
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


def _list(numbers: tuple[int, ...] | list[int]) -> str:
    """Such as 'markers 1, 2 and 5'."""
    words = [str(number) for number in numbers]
    named = ", ".join(words) if len(words) < 3 else f"{', '.join(words[:-1])} and {words[-1]}"
    return f"marker{'' if len(words) == 1 else 's'} {named}"
