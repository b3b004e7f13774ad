"""Refining a calibration: the lane's edges in a picture of the empty track are laid on the twin's.

Knows a calibration, its keypoints where there are any, the twin's lane and one picture. Knows no file and asks nobody: it
says what was, what would be and whether that is better; taking it is the user's to decide. It changes nothing by itself.

The present map puts the twin's edges into the picture. Across each of some 1,000 places on them the lane's real edge is
sought, as far as three sigmas of the map there. The eight numbers of the homography are then fitted to the edges found and
to the keypoints together, each with its own sigma, and edges are sought again from there, less far, until nothing moves.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage, Points
from dnb_edge.view.calibration import Calibration, CalibrationMethod
from dnb_edge.view.homography import CalibrationError, fit_homography, ideal_pairs
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.pose import find_pose
from dnb_edge.view.refine_align import Scene, align, in_picture, known_points, outward
from dnb_edge.view.refine_edges import LaneEdges
from dnb_edge.view.refine_look import smoothed_lab
from dnb_edge.view.refine_overlap import Agreement, agreement
from dnb_edge.view.refine_solve import KnownPoints, PlaneToPicture, Solved, with_own_sigma

Floats = NDArray[np.float64]
T = TypeVar("T")

CLICK_SIGMA_PX = 1.5
"""Of a careful click along either axis, camera px of the picture that was clicked on."""

_TENSION = 3.0
"""Sigmas by which the edges' own map and the calibration may contradict each other; by chance they do once in 700 times."""

_NOISE = 2.0
"""Standard errors by which the errors at left-out keypoints must grow to count as worse."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Refinement:
    """What refining would change, and whether it should be taken."""

    calibration: Calibration
    """Refined, for the size of picture of the calibration it was made from."""
    before: Agreement
    after: Agreement
    better: bool
    reason: str
    """Why it is better, or not: one sentence."""
    reach_px: float
    """How far from where the calibration puts it the lane was sought, at most; camera px of the picture."""
    tension: float
    """By how many sigmas of a normal variable the map of the edges by themselves contradicts the keypoints' (or the given
    one): 0 where they differ by no more than they may."""
    moved_px: float
    """How far the refinement moves the lane's edges in the picture, across them, at most."""
    edges_twin_px: Points
    """Shape (n, 2): the twin's edges, as they were compared."""
    edges_before_px: Points
    edges_after_px: Points
    """The same in the picture by either map, camera px of the picture, shape (n, 2); may lie outside it."""


def refine(
    calibration: Calibration,
    edges: LaneEdges,
    picture: BgrImage,
    *,
    pairs: KeypointPairs | None = None,
    sigma_px: float = CLICK_SIGMA_PX,
    source: str = "picture",
) -> Refinement:
    """Aligns the lane's edges in `picture` with the twin's.

    `pairs` are the calibration's keypoints, camera px of its size of picture, clicked with `sigma_px` along either axis;
    without them the present map itself is held on to, as far as its covariance says. The picture may be of another size of
    the same aspect. `source` names it in errors. Raises `InputError` where the aspect is another one, no lane is found near
    where the calibration puts it, or calibration and keypoints do not say how far off the map may be.
    """
    height_px, width_px = picture.shape[:2]
    scaled = calibration.scaled_to(width_px, height_px)
    across = width_px / calibration.ground.width_px
    if pairs is not None:
        points = pairs.camera_array() * (across, height_px / calibration.ground.height_px)
        pairs = replace(pairs, camera_px=tuple((u, v) for u, v in points.tolist()))
    scene = Scene(
        plane=PlaneToPicture.about(scaled.ground, edges.points_px),
        edges=edges,
        lab=smoothed_lab(picture),
        source=source,
    )
    first = scene.plane.parameters(scaled.ground.camera_to_twin)
    aligned = align(scene, first, known_points(scene.plane, scaled, pairs, sigma_px * across))
    last = aligned.solved.p
    before, after = (agreement(scene, p, (first, last), aligned, scaled.ground.scale) for p in (first, last))
    if pairs is not None:
        left_out = _left_out(scene, pairs, sigma_px * across)
        before = before.with_keypoints(_keypoint_errors(scene.plane, first, pairs), left_out[0])
        after = after.with_keypoints(_keypoint_errors(scene.plane, last, pairs), left_out[1])
    better, reason = _verdict(before, after, aligned.solved.tension)
    on_before, on_after = (scene.plane.project(p, edges.points_px) for p in (first, last))
    seen = in_picture(on_before, (width_px, height_px)) & in_picture(on_after, (width_px, height_px))
    return Refinement(
        calibration=_calibration(calibration, scaled, scene.plane, aligned.solved, after, source),
        before=before,
        after=after,
        better=better,
        reason=reason,
        reach_px=float(aligned.reach_px.max()),
        tension=aligned.solved.tension,
        moved_px=float(np.abs(((on_after - on_before) * outward(scene, first)).sum(axis=1))[seen].max(initial=0.0)),
        edges_twin_px=edges.points_px,
        edges_before_px=on_before,
        edges_after_px=on_after,
    )


def _keypoint_errors(plane: PlaneToPicture, p: Floats, pairs: KeypointPairs) -> Floats:
    """How far the map puts each keypoint from where it lies on the twin, twin px, (n,)."""
    camera = pairs.camera_array()
    ideal = camera if plane.lens is None else plane.lens.to_ideal_px(camera)
    mapped = np.column_stack((ideal, np.ones(len(ideal)))) @ plane.camera_to_twin(p).T
    return np.asarray(np.linalg.norm(mapped[:, :2] / mapped[:, 2:] - pairs.twin_array(), axis=1))


def _left_out(scene: Scene, pairs: KeypointPairs, sigma_px: float) -> tuple[Floats | None, Floats | None]:
    """Error of each keypoint, twin px, by the plain fit to the others, and by the same refined; None where four are left
    out of too few. A fit that cannot be refined stays as it is, as it would with a user.
    """
    if len(pairs) < 6:
        return None, None
    plain, refined = [], []
    for k in range(len(pairs)):
        others = _without(pairs, k)
        p = scene.plane.parameters(fit_homography(ideal_pairs(others, scene.plane.lens)))
        plain.append(_keypoint_errors(scene.plane, p, pairs)[k])
        known = KnownPoints(
            twin_px=others.twin_array(), camera_px=others.camera_array(), sigma_px=sigma_px, at=p,
            information=np.zeros((8, 8)),
        )  # fmt: skip
        with suppress(InputError):
            p = align(scene, p, with_own_sigma(scene.plane, known)).solved.p
        refined.append(_keypoint_errors(scene.plane, p, pairs)[k])
    return np.array(plain), np.array(refined)


def _without(pairs: KeypointPairs, k: int) -> KeypointPairs:
    def others(items: tuple[T, ...]) -> tuple[T, ...]:
        return items[:k] + items[k + 1 :]

    return replace(pairs, camera_px=others(pairs.camera_px), twin_px=others(pairs.twin_px), names=others(pairs.names))


def _verdict(before: Agreement, after: Agreement, tension: float) -> tuple[bool, str]:
    """Whether to take it, and why."""
    if tension > _TENSION:
        return False, (
            f"the lane's edges contradict the calibration by {tension:.1f} sigmas: the camera was moved since, or the twin is "
            "not drawn as the lane lies"
        )
    was, now = before.left_out_px, after.left_out_px
    if was is not None and now is not None:
        worse = now - was
        noise = _NOISE * float(worse.std(ddof=1) / np.sqrt(len(worse)))
        if worse.mean() > noise:
            return False, (
                f"keypoints that were left out lie {now.mean():.1f} twin px from where it puts them, {was.mean():.1f} px "
                "without it"
            )
    if after.overlap < before.overlap and after.edge_median_px > before.edge_median_px:
        return False, f"the lanes overlap by {after.overlap:.1%}, {before.overlap:.1%} without it"
    return True, (
        f"the lanes overlap by {after.overlap:.1%} instead of {before.overlap:.1%}"
        + (
            ""
            if was is None or now is None
            else f"; keypoints that were left out lie {now.mean():.1f} twin px off instead of {was.mean():.1f}"
        )
    )


def _calibration(
    given: Calibration, scaled: Calibration, plane: PlaneToPicture, solved: Solved, after: Agreement, source: str
) -> Calibration:
    """The refined calibration, for the size of picture of the one it was made from."""
    h = plane.camera_to_twin(solved.p)
    a, b, c, d, e, f, g, i, j = h.ravel().tolist()
    ground = replace(scaled.ground, camera_to_twin=(a, b, c, d, e, f, g, i, j))
    pose = scaled.pose
    with suppress(InputError):
        pose = find_pose(ground)
    if pose is not None:
        ground = replace(ground, camera_m=pose.position_m)
    metres = scaled.ground.scale.metres_per_px
    note = (
        f"refined by the lane's edges in {PurePath(source).name}: drawn and laid lane still differ by "
        f"{after.edge_median_m * 1000:.1f} mm (median) and {after.edge_p95_m * 1000:.1f} mm (95 %)"
    )
    refined = replace(
        scaled,
        ground=ground,
        covariance=tuple(map(tuple, plane.covariance9(solved.p, solved.covariance).tolist())),
        error=_error(given.error, after, metres),
        method=CalibrationMethod.REFINED,
        pose=pose,
        notes=(*given.notes, note),
    )
    return refined.scaled_to(given.ground.width_px, given.ground.height_px)


def _error(given: CalibrationError, after: Agreement, metres_per_px: float) -> CalibrationError:
    """The keypoints' error under the refined map; the given one where no keypoints tell it."""
    if after.keypoints_px is None:
        return given
    errors = after.keypoints_px
    return CalibrationError(
        per_point_px=tuple(errors.tolist()),
        mean_px=float(errors.mean()),
        sum_px=float(errors.sum()),
        max_px=float(errors.max()),
        leave_one_out_mean_px=None if after.left_out_px is None else float(after.left_out_px.mean()),
    ).in_metres(metres_per_px)
