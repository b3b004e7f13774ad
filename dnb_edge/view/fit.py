"""From keypoints to a calibration: the weighted fit, what it says of itself, and which keypoints contradict the others.

Knows pairs with names, their stated noise and the twin's scale. Knows no file and no picture. The mathematics of the fit is
`weighted`'s, that of the outliers `outliers`'; docs/adr/0025 has the reasons.

Every pair has a part in the map. One that is named as an outlier has it with a click's variance that is greater by its squared
distance from where the others put it, and no part in the estimate of the clicks' sigma.

The covariance is that of the stated noise times

    k2 (v0 + v) / (v0 + v - 2) (1 + n / 4 max(0, 1 - 4 / k2)),    k2 = (v0 + X2) / (v0 + v)

with X2 the sum of squared residuals in stated sigmas over the n keypoints that are no outliers, v = 2 n - 8 and v0 = 4. k2 is
the scaled inverse chi-square estimate of how much greater the variances are than stated; the second factor makes Student's
distribution of it; the third takes scatter beyond twice the stated sigma for faults of the drawing, which hold at each place
anew: a keypoint's own variance is n / 4 times the map's at it (8 freedoms over 2 n numbers).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.track.scale import TwinScale
from dnb_edge.view.calibration import Calibration, CalibrationMethod
from dnb_edge.view.ground import GroundMap
from dnb_edge.view.homography import CalibrationError, check_inside, fit_homography, ideal_pairs
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.lens import Lens
from dnb_edge.view.outliers import PRIOR_FREEDOM, find_outliers, find_swap, is_mirrored, variance_factor
from dnb_edge.view.pose import CameraPose, find_pose
from dnb_edge.view.weighted import Floats, NoFitError, WeightedFit, WeightedPoints, fit_weighted

CLICK_SIGMA_PX = 1.5
TWIN_SIGMA_PX = 0.5

_SLOPPY = 4.0
"""Variance factor up to which scatter is taken for careless clicks: twice the stated sigma."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlier:
    """A keypoint that the others contradict."""

    name: str
    apart_px: float
    """How far it lies from where the others put it, camera px (ideal px with a lens)."""
    apart_twin_px: float
    """The same on the twin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeypointFit:
    """A calibration by keypoints, and what came to light in making it."""

    calibration: Calibration
    outliers: tuple[Outlier, ...]
    suspects: tuple[str, ...]
    """Keypoints of which one is wrong, and it cannot be told which."""
    click_sigma_px: float
    """One standard deviation of a click along either axis, camera px, as estimated; the faults of the drawing are in it."""
    twin_sigma_px: float
    """The same of the twin's points, twin px."""
    caution: float
    """By what the covariance exceeds that of noise of the two sigmas: Student's factor and the drawing's (see above)."""
    misfit: bool
    """True where the keypoints scatter by more than twice the stated sigma."""


def fit_keypoints(
    pairs: KeypointPairs,
    scale: TwinScale,
    *,
    width_px: int,
    height_px: int,
    lens: Lens | None = None,
    click_sigma_px: float = CLICK_SIGMA_PX,
    twin_sigma_px: float = TWIN_SIGMA_PX,
) -> KeypointFit:
    """The most likely map of pairs clicked on a picture of the given size, where clicks and the twin's points are off by the
    given sigmas along either axis, with its covariance, pose and notes.

    Raises `InputError` where keypoints lie outside the picture, two seem exchanged, the twin is mirrored, or no map has all of
    them on the floor.
    """
    check_inside(pairs, width_px=width_px, height_px=height_px)
    lens = None if lens is None else lens.scaled_to(width_px, height_px)
    points = weighted_points(pairs, lens, click_sigma_px=click_sigma_px, twin_sigma_px=twin_sigma_px)
    _check_order(pairs, points)
    try:
        findings = find_outliers(points)
        outliers = tuple(_outlier(pairs, points, k, findings.outliers) for k in findings.outliers)
        clean = points.without(list(findings.outliers))
        freedom = 2 * len(clean) - 8
        factor = variance_factor(fit_weighted(clean).chi_squared, freedom)
        noisy = _with_wide_outliers(points, dict(zip(findings.outliers, outliers, strict=True)))
        fit = fit_weighted(noisy)
    except NoFitError as error:
        fit_homography(ideal_pairs(pairs, lens))
        raise InputError(
            f"{pairs.source}: no map has all keypoints on the floor: check that each camera point has its own twin point"
        ) from error
    ground = GroundMap(
        camera_to_twin=fit.camera_to_twin, scale=scale, width_px=width_px, height_px=height_px, lens=lens
    )
    student = (PRIOR_FREEDOM + freedom) / (PRIOR_FREEDOM + freedom - 2)
    local = 1.0 + 0.25 * len(clean) * max(0.0, 1.0 - _SLOPPY / factor)
    covariance = fit.covariance(factor * student * local)
    pose, pose_note = _pose(ground)
    if pose is not None:
        ground = replace(ground, camera_m=pose.position_m)
    calibration = Calibration(
        ground=ground,
        covariance=tuple(map(tuple, covariance.tolist())),
        error=_error(fit, noisy).in_metres(scale.metres_per_px),
        method=CalibrationMethod.KEYPOINTS,
        pose=pose,
    )
    root = factor**0.5
    found = KeypointFit(
        calibration=calibration,
        outliers=outliers,
        suspects=tuple(pairs.names[k] for k in findings.suspects),
        click_sigma_px=click_sigma_px * root,
        twin_sigma_px=twin_sigma_px * root,
        caution=student * local,
        misfit=factor > _SLOPPY,
    )
    notes = (*_notes(found, len(pairs), click_sigma_px), *pose_note)
    return replace(found, calibration=replace(calibration, notes=notes))


def weighted_points(
    pairs: KeypointPairs, lens: Lens | None, *, click_sigma_px: float, twin_sigma_px: float
) -> WeightedPoints:
    """The pairs with their noise. A click's sigma holds in camera px; the lens bends it as it bends the point."""
    camera = pairs.camera_array()
    click = np.tile(np.eye(2) * click_sigma_px**2, (len(pairs), 1, 1))
    if lens is not None:
        right, below = np.array([0.5, 0.0]), np.array([0.0, 0.5])
        across = lens.to_ideal_px(camera + right) - lens.to_ideal_px(camera - right)
        down = lens.to_ideal_px(camera + below) - lens.to_ideal_px(camera - below)
        bend = np.stack((across, down), axis=2)
        click = bend @ click @ bend.transpose(0, 2, 1)
    return WeightedPoints(
        ideal_px=camera if lens is None else lens.to_ideal_px(camera),
        twin_px=pairs.twin_array(),
        click_cov_px2=click,
        twin_var_px2=np.full(len(pairs), twin_sigma_px**2),
    )


def _check_order(pairs: KeypointPairs, points: WeightedPoints) -> None:
    """Raises `InputError` for pairs in the wrong order and for a twin seen from below."""
    swap = find_swap(points)
    if swap is not None:
        one, other = pairs.names[swap.first], pairs.names[swap.second]
        if len(points) == 4:
            raise InputError(
                f"{pairs.source}: keypoints {one} and {other} seem swapped, or the other two: no camera sees four such places "
                "in that order: click them anew, better with a fifth"
            )
        raise InputError(
            f"{pairs.source}: keypoints {one} and {other} seem swapped: exchanging them takes the mean error from "
            f"{swap.before_px:.0f} to {swap.after_px:.{1 if swap.after_px < 10 else 0}f} twin px"
        )
    if is_mirrored(points):
        raise InputError(
            f"{pairs.source}: the keypoints run the other way round on the twin than in the picture: one of the two is "
            "mirrored; mirror it back and click anew" + (", or two are swapped" if len(points) == 4 else "")
        )


def _outlier(pairs: KeypointPairs, points: WeightedPoints, k: int, outliers: tuple[int, ...]) -> Outlier:
    """What is wrong with place k. Raises `InputError` where the others have it beyond the horizon: no map has it then."""
    fit = fit_weighted(points.without(list(outliers)))
    alone, name = points.at(np.array([k])), pairs.names[k]
    (apart,), _ = fit.apart(alone)
    try:
        on_twin = _twin_distances(fit, alone)
    except NoFitError:
        on_twin = np.array([np.inf])
    if not (np.isfinite(apart).all() and np.isfinite(on_twin).all()):
        raise InputError(
            f"{pairs.source}: keypoint {name} lies beyond the horizon of the map that the others make: click it anew, or "
            f"leave it out with --without {name}"
        )
    return Outlier(name=name, apart_px=float(np.hypot(*apart)), apart_twin_px=float(on_twin[0]))


def _with_wide_outliers(points: WeightedPoints, outliers: dict[int, Outlier]) -> WeightedPoints:
    click = points.click_cov_px2.copy()
    for k, outlier in outliers.items():
        click[k] += outlier.apart_px**2 * np.eye(2)
    return replace(points, click_cov_px2=click)


def _error(fit: WeightedFit, points: WeightedPoints) -> CalibrationError:
    off = _twin_distances(fit, points)
    try:
        left_out = [
            float(_twin_distances(fit_weighted(points.without([k])), points.at(np.array([k])))[0])
            for k in range(len(points))
            if len(points) > 4
        ]
    except NoFitError:
        left_out = []
    return CalibrationError(
        per_point_px=tuple(off.tolist()),
        mean_px=float(off.mean()),
        sum_px=float(off.sum()),
        max_px=float(off.max()),
        leave_one_out_mean_px=float(np.mean(left_out)) if left_out else None,
    )


def _twin_distances(fit: WeightedFit, points: WeightedPoints) -> Floats:
    return np.asarray(np.hypot(*(fit.to_twin_px(points.ideal_px) - points.twin_px).T))


def _pose(ground: GroundMap) -> tuple[CameraPose | None, tuple[str, ...]]:
    try:
        return find_pose(ground), ()
    except InputError as error:
        return None, (f"the camera's place is not known: {str(error).removeprefix('view: ')}",)


def _notes(found: KeypointFit, count: int, stated_px: float) -> tuple[str, ...]:
    notes = [
        f"keypoint {outlier.name} lies {outlier.apart_px:.0f} px from where the other {count - len(found.outliers)} put it: "
        f"click it anew, or leave it out with --without {outlier.name}"
        for outlier in found.outliers
    ]
    if found.suspects:
        named = f"{', '.join(found.suspects[:-1])} and {found.suspects[-1]}"
        notes.append(
            f"one of the keypoints {named} is wrong, and {count} are too few to tell which: click them anew, or add one"
        )
    elif found.misfit:
        notes.append(
            f"the keypoints scatter by {found.click_sigma_px:.1f} px where clicks are off by {stated_px:g} px: the twin is not "
            "true to the track, the lens bends the picture, or many clicks are poor; sigma allows for it"
        )
    return tuple(notes)
