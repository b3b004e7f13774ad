"""Refining a calibration: the lane's edges in a picture of the empty track are laid on the twin's.

Knows a calibration, its keypoints where there are any, the twin's lane and one picture. Knows no file and asks nobody: it
says what was, what would be and whether that is better; taking it is the user's to decide. It changes nothing by itself.

The present map puts the twin's edges into the picture. Across each of some 1,600 places on them the lane's real edge is
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
from dnb_edge.view.refine_edges import LaneEdges
from dnb_edge.view.refine_look import FoundEdges, LanePicture, find_edges, learn_look, smoothed_lab
from dnb_edge.view.refine_overlap import Agreement, agreement
from dnb_edge.view.refine_solve import (
    FoundLines,
    KnownPoints,
    PlaneToPicture,
    Solved,
    click_sigma_px,
    solve,
    solve_points,
)

Floats = NDArray[np.float64]
T = TypeVar("T")

CLICK_SIGMA_PX = 1.5
"""Of a careful click along either axis, camera px of the picture that was clicked on."""

_LEAST_REACH_PX = 12.0
"""At 1280 px across; larger pictures reach as far in proportion. More than careful clicks need: that the camera was moved is
seen by edges that are found, but not where the clicks allow."""

_SIGMAS = 3.0
_MOST_REACH = 0.45
"""Of the lane's width there: beyond lies the next lane."""

_WINDOW = 0.06
"""Share of the lane's width there over which lane and floor beside an edge are looked at."""

_FEWEST_FOUND = 0.3
"""Share of the places in the picture at which an edge must be found."""

_FEWEST_HEARD = 0.5
"""Share of the edges found that must agree with the map fitted to them."""

_ROUNDS = 8
_LEARN_ROUNDS = 2
"""After the first so many fits the lane's look is learnt again, nearer to its edges."""

_STILL_PX = 0.02
_TENSION = 1.8
"""Of eight degrees of freedom chi squared is greater than so many sigmas squared, a degree, once in a thousand times."""

_NOISE = 2.0
"""Standard errors by which the errors at left-out keypoints must grow to count as worse."""

_FARTHEST = 1.5
_BEYOND = 0.05
"""Share of the edges that may come to lie further away than so many times the reach: the clicks' own sigma is but estimated."""


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
    """By how many sigmas the map of the edges by themselves differs from the keypoints' (or the given one): about 1 where
    both are true."""
    moved_px: float
    """How far the refinement moves the lane's edges in the picture, across them, at most."""
    edges_twin_px: Points
    """Shape (n, 2): the twin's edges, as they were compared."""
    edges_before_px: Points
    edges_after_px: Points
    """The same in the picture by either map, camera px of the picture, shape (n, 2); may lie outside it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Scene:
    """What does not change while a map is fitted."""

    plane: PlaneToPicture
    edges: LaneEdges
    lab: BgrImage
    source: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Aligned:
    solved: Solved
    look: LanePicture
    reach_px: Floats
    """Shape (n,): of the first search."""


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
    scene = _Scene(
        plane=PlaneToPicture.about(scaled.ground, edges.points_px),
        edges=edges,
        lab=smoothed_lab(picture),
        source=source,
    )
    first = scene.plane.parameters(scaled.ground.camera_to_twin)
    aligned = _align(scene, first, _known(scene.plane, scaled, pairs, sigma_px * across))
    last = aligned.solved.p
    before, after = (
        agreement(scene.plane, p, (first, last), edges, aligned.look, aligned.reach_px, scaled.ground.scale)
        for p in (first, last)
    )
    if pairs is not None:
        left_out = _left_out(scene, pairs, sigma_px * across)
        before = before.with_keypoints(_keypoint_errors(scene.plane, first, pairs), left_out[0])
        after = after.with_keypoints(_keypoint_errors(scene.plane, last, pairs), left_out[1])
    better, reason = _verdict(before, after, aligned.solved.tension)
    on_before, on_after = (scene.plane.project(p, edges.points_px) for p in (first, last))
    seen = _in_picture(on_before, (width_px, height_px)) & _in_picture(on_after, (width_px, height_px))
    return Refinement(
        calibration=_calibration(calibration, scaled, scene.plane, aligned.solved, after, source),
        before=before,
        after=after,
        better=better,
        reason=reason,
        reach_px=float(aligned.reach_px.max()),
        tension=aligned.solved.tension,
        moved_px=float(np.abs(((on_after - on_before) * _outward(scene, first)).sum(axis=1))[seen].max(initial=0.0)),
        edges_twin_px=edges.points_px,
        edges_before_px=on_before,
        edges_after_px=on_after,
    )


def _known(
    plane: PlaneToPicture, calibration: Calibration, pairs: KeypointPairs | None, sigma_px: float
) -> KnownPoints:
    """What holds the map: the keypoints, their sigma by their own residuals, or the calibration with its covariance."""
    at = plane.parameters(calibration.ground.camera_to_twin)
    if pairs is None:
        if calibration.covariance is None:
            raise InputError("refine: the calibration does not say how far off it may be: give its keypoints too")
        information = plane.information(calibration.ground.camera_to_twin, np.array(calibration.covariance))
        none = np.empty((0, 2))
        return KnownPoints(twin_px=none, camera_px=none, sigma_px=sigma_px, at=at, information=information)
    known = KnownPoints(
        twin_px=pairs.twin_array(),
        camera_px=pairs.camera_array(),
        sigma_px=sigma_px,
        at=at,
        information=np.zeros((8, 8)),
    )
    own, _ = solve_points(plane, at, known)
    return replace(known, sigma_px=click_sigma_px(plane, own, known))


def _align(scene: _Scene, first: Floats, known: KnownPoints) -> _Aligned:
    """The joint fit, from the parameters `first` on. Raises `InputError` where there is no lane to align."""
    plane, edges = scene.plane, scene.edges
    lane_px = _lane_px(scene, first)
    reach_px = first_reach = _reach_px(scene, first, known, lane_px)
    look = _learn(scene, first, first_reach, lane_px)
    found = _search(scene, first, look, first_reach, lane_px)
    visible = _in_picture(plane.project(first, edges.points_px), look.size_px)
    if found.found.sum() < max(60, _FEWEST_FOUND * visible.sum()):
        raise _not_there(scene, first_reach, found.found.sum() / max(1, visible.sum()))
    p, solved = first, None
    for number in range(_ROUNDS):
        lines = _lines(scene, p, found)
        solved = solve(plane, p, known, lines)
        moved = plane.project(solved.p, lines.twin_px) - plane.project(p, lines.twin_px)
        p = solved.p
        if number < _LEARN_ROUNDS:
            sure_px = max(0.2 * _least_reach_px(scene), 3.0 * solved.scale_px)
            look = _learn(scene, p, np.full(len(edges), sure_px), lane_px)
        elif np.abs(moved).max() < _STILL_PX:
            break
        reach_px = np.clip(0.6 * reach_px, max(_least_reach_px(scene), 4.0 * solved.scale_px), first_reach)
        found = _search(scene, p, look, reach_px, lane_px)
        if found.found.sum() < 60:
            break
    assert solved is not None, "there is one round at least"
    _check(scene, first, solved, first_reach)
    return _Aligned(solved=solved, look=look, reach_px=first_reach)


def _check(scene: _Scene, first: Floats, solved: Solved, reach_px: Floats) -> None:
    """Raises `InputError` where the fit is none: most edges disagree with it, or it lies beyond where they were sought."""
    points = scene.edges.points_px
    before, after = scene.plane.project(first, points), scene.plane.project(solved.p, points)
    seen = _in_picture(before, (scene.lab.shape[1], scene.lab.shape[0]))
    outward = _outward(scene, first)
    too_far = np.abs(((after - before) * outward).sum(axis=1)) > _FARTHEST * reach_px
    if np.mean(solved.weight > 0) < _FEWEST_HEARD or np.mean(too_far[seen]) > _BEYOND:
        raise _not_there(scene, reach_px, float(np.mean(solved.weight > 0)))


def _not_there(scene: _Scene, reach_px: Floats, share: float) -> InputError:
    return InputError(
        f"{scene.source}: the lane's edges are not within {np.median(reach_px):.0f} px of where the calibration puts them "
        f"({share:.0%} found): give a picture from the calibrated place; where the camera was moved, calibrate anew"
    )


def _learn(scene: _Scene, p: Floats, reach_px: Floats, lane_px: Floats) -> LanePicture:
    """The lane's look from places that are surely on it, and beside it, as far as the map is off by less than `reach_px`."""
    edges = scene.edges
    margin = np.minimum(reach_px / np.maximum(lane_px, 1.0), 0.3)
    on, off = [], []
    for share in np.linspace(0.0, 1.0, 12):
        inwards = (margin + share * (0.5 - margin)) * edges.width_px
        outwards = (margin + share * 0.5) * edges.width_px
        on.append(edges.points_px - inwards[:, None] * edges.outward)
        off.append(edges.points_px + outwards[:, None] * edges.outward)
    lane, floor = np.concatenate(on), np.concatenate(off)
    lane, floor = lane[_on_mask(edges, lane)], floor[~_on_mask(edges, floor)]
    return learn_look(scene.lab, scene.plane.project(p, lane), scene.plane.project(p, floor), source=scene.source)


def _on_mask(edges: LaneEdges, twin_px: Points) -> NDArray[np.bool_]:
    height, width = edges.mask.shape
    at = np.rint(twin_px).astype(np.int64)
    inside = (at >= 0).all(axis=1) & (at < (width, height)).all(axis=1)
    return np.asarray(inside & edges.mask[np.clip(at[:, 1], 0, height - 1), np.clip(at[:, 0], 0, width - 1)])


def _search(scene: _Scene, p: Floats, look: LanePicture, reach_px: Floats, lane_px: Floats) -> FoundEdges:
    window_px = np.clip(_WINDOW * lane_px, 3.0, 16.0)
    at_px = scene.plane.project(p, scene.edges.points_px)
    return find_edges(look, at_px, _outward(scene, p), reach_px, window_px)


def _lines(scene: _Scene, p: Floats, found: FoundEdges) -> FoundLines:
    has, edges = found.found, scene.edges
    outward = _outward(scene, p)[has]
    return FoundLines(
        twin_px=edges.points_px[has],
        on_px=scene.plane.project(p, edges.points_px[has]) + found.offset_px[has, None] * outward,
        outward=outward,
        slot=edges.slot[has],
    )


def _outward(scene: _Scene, p: Floats) -> Points:
    """Unit normals (n, 2) of the edges in the picture, camera px, from the lane to the floor."""
    edges, plane = scene.edges, scene.plane
    along = np.column_stack((-edges.outward[:, 1], edges.outward[:, 0]))
    ahead = plane.project(p, edges.points_px + along) - plane.project(p, edges.points_px - along)
    out = plane.project(p, edges.points_px + edges.outward) - plane.project(p, edges.points_px - edges.outward)
    normal = np.column_stack((-ahead[:, 1], ahead[:, 0]))
    normal *= np.where((normal * out).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-9)[:, None])


def _lane_px(scene: _Scene, p: Floats) -> Floats:
    """How wide the lane appears at each edge point (n,), across the edge, camera px."""
    edges, plane = scene.edges, scene.plane
    inner = plane.project(p, edges.points_px - 0.2 * edges.width_px * edges.outward)
    across = ((plane.project(p, edges.points_px) - inner) * _outward(scene, p)).sum(axis=1)
    return np.asarray(np.maximum(1.0, 5.0 * np.abs(across)))


def _reach_px(scene: _Scene, p: Floats, known: KnownPoints, lane_px: Floats) -> Floats:
    """How far to look across each edge point (n,), camera px: three sigmas of where the known points put it."""
    _, covariance = solve_points(scene.plane, p, known)
    slopes = np.einsum("nij,ni->nj", scene.plane.slopes(p, scene.edges.points_px), _outward(scene, p))
    sigma = np.sqrt(np.maximum(0.0, np.einsum("nj,jk,nk->n", slopes, covariance, slopes)))
    most = _MOST_REACH * lane_px
    return np.asarray(np.minimum(np.maximum(_SIGMAS * sigma, _least_reach_px(scene)), np.maximum(most, 2.0)))


def _least_reach_px(scene: _Scene) -> float:
    width_px: int = scene.lab.shape[1]
    return _LEAST_REACH_PX * max(1.0, width_px / 1280.0)


def _in_picture(points: Points, size_px: tuple[int, int]) -> NDArray[np.bool_]:
    return np.asarray(((points >= 0) & (points <= np.array(size_px) - 1.0)).all(axis=1))


def _keypoint_errors(plane: PlaneToPicture, p: Floats, pairs: KeypointPairs) -> Floats:
    """How far the map puts each keypoint from where it lies on the twin, twin px, (n,)."""
    camera = pairs.camera_array()
    ideal = camera if plane.lens is None else plane.lens.to_ideal_px(camera)
    mapped = np.column_stack((ideal, np.ones(len(ideal)))) @ plane.camera_to_twin(p).T
    return np.asarray(np.linalg.norm(mapped[:, :2] / mapped[:, 2:] - pairs.twin_array(), axis=1))


def _left_out(scene: _Scene, pairs: KeypointPairs, sigma_px: float) -> tuple[Floats | None, Floats | None]:
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
        own, _ = solve_points(scene.plane, p, known)
        known = replace(known, sigma_px=click_sigma_px(scene.plane, own, known))
        with suppress(InputError):
            p = _align(scene, p, known).solved.p
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
        f"refined by the lane's edges in {PurePath(source).name}: drawn and laid lane differ by {after.edge_median_m * 1000:.1f} mm (median)"
        f" and {after.edge_p95_m * 1000:.1f} mm (95 %) still"
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
