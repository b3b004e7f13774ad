"""The search for the lane's edges in the picture and the fit to them, in turns, until nothing moves.

Knows the twin's edges, one picture and a map to start from. Knows no calibration's file, and does not judge whether the new map
is better.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage, Points
from dnb_edge.view.calibration import Calibration
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.refine_edges import LaneEdges
from dnb_edge.view.refine_look import FoundEdges, LanePicture, find_edges, learn_look
from dnb_edge.view.refine_solve import (
    FoundLines,
    KnownPoints,
    PlaneToPicture,
    Solved,
    solve,
    solve_points,
    with_own_sigma,
)

Floats = NDArray[np.float64]

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
_FARTHEST = 1.5
_BEYOND = 0.05
"""Share of the edges that may come to lie further away than so many times the reach: the clicks' own sigma is but estimated."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """What does not change while a map is fitted."""

    plane: PlaneToPicture
    edges: LaneEdges
    lab: BgrImage
    source: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Aligned:
    """What the fit came to."""

    solved: Solved
    look: LanePicture
    reach_px: Floats
    """Shape (n,): of the first search."""


def known_points(
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
    return with_own_sigma(plane, known)


def align(scene: Scene, first: Floats, known: KnownPoints) -> Aligned:
    """The joint fit, from the parameters `first` on. Raises `InputError` where there is no lane to align."""
    plane, edges = scene.plane, scene.edges
    wide_px = lane_px(scene, first)
    reach_px = first_reach = _reach_px(scene, first, known, wide_px)
    look = _learn(scene, first, first_reach, wide_px)
    found = search(scene, first, look, first_reach, wide_px)
    visible = in_picture(plane.project(first, edges.points_px), look.size_px)
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
            look = _learn(scene, p, np.full(len(edges), sure_px), wide_px)
        elif np.abs(moved).max() < _STILL_PX:
            break
        reach_px = np.clip(0.6 * reach_px, max(_least_reach_px(scene), 4.0 * solved.scale_px), first_reach)
        found = search(scene, p, look, reach_px, wide_px)
        if found.found.sum() < 60:
            break
    assert solved is not None, "there is one round at least"
    _check(scene, first, solved, first_reach)
    return Aligned(solved=solved, look=look, reach_px=first_reach)


def _check(scene: Scene, first: Floats, solved: Solved, reach_px: Floats) -> None:
    """Raises `InputError` where the fit is none: most edges disagree with it, or it lies beyond where they were sought."""
    points = scene.edges.points_px
    before, after = scene.plane.project(first, points), scene.plane.project(solved.p, points)
    seen = in_picture(before, (scene.lab.shape[1], scene.lab.shape[0]))
    across = outward(scene, first)
    too_far = np.abs(((after - before) * across).sum(axis=1)) > _FARTHEST * reach_px
    if np.mean(solved.weight > 0) < _FEWEST_HEARD or np.mean(too_far[seen]) > _BEYOND:
        raise _not_there(scene, reach_px, float(np.mean(solved.weight > 0)))


def _not_there(scene: Scene, reach_px: Floats, share: float) -> InputError:
    return InputError(
        f"{scene.source}: the lane's edges are not within {np.median(reach_px):.0f} px of where the calibration puts them "
        f"({share:.0%} found): give a picture from the calibrated place; where the camera was moved, calibrate anew"
    )


def _learn(scene: Scene, p: Floats, reach_px: Floats, wide_px: Floats) -> LanePicture:
    """The lane's look from places that are surely on it, and beside it, as far as the map is off by less than `reach_px`."""
    edges = scene.edges
    margin = np.minimum(reach_px / np.maximum(wide_px, 1.0), 0.3)
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


def search(scene: Scene, p: Floats, look: LanePicture, reach_px: Floats, wide_px: Floats) -> FoundEdges:
    """The lane's edges in the picture across where the parameters `p` put them, as far as `reach_px` (n,) to either side;
    `wide_px` (n,) is how wide the lane appears there.
    """
    window_px = np.clip(_WINDOW * wide_px, 3.0, 16.0)
    at_px = scene.plane.project(p, scene.edges.points_px)
    return find_edges(look, at_px, outward(scene, p), reach_px, window_px)


def _lines(scene: Scene, p: Floats, found: FoundEdges) -> FoundLines:
    has, edges = found.found, scene.edges
    across = outward(scene, p)[has]
    return FoundLines(
        twin_px=edges.points_px[has],
        on_px=scene.plane.project(p, edges.points_px[has]) + found.offset_px[has, None] * across,
        outward=across,
        slot=edges.slot[has],
    )


def outward(scene: Scene, p: Floats) -> Points:
    """Unit normals (n, 2) of the edges in the picture, camera px, from the lane to the floor."""
    edges, plane = scene.edges, scene.plane
    along = np.column_stack((-edges.outward[:, 1], edges.outward[:, 0]))
    ahead = plane.project(p, edges.points_px + along) - plane.project(p, edges.points_px - along)
    out = plane.project(p, edges.points_px + edges.outward) - plane.project(p, edges.points_px - edges.outward)
    normal = np.column_stack((-ahead[:, 1], ahead[:, 0]))
    normal *= np.where((normal * out).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-9)[:, None])


def lane_px(scene: Scene, p: Floats) -> Floats:
    """How wide the lane appears at each edge point (n,), across the edge, camera px."""
    edges, plane = scene.edges, scene.plane
    inner = plane.project(p, edges.points_px - 0.2 * edges.width_px * edges.outward)
    across = ((plane.project(p, edges.points_px) - inner) * outward(scene, p)).sum(axis=1)
    return np.asarray(np.maximum(1.0, 5.0 * np.abs(across)))


def _reach_px(scene: Scene, p: Floats, known: KnownPoints, wide_px: Floats) -> Floats:
    """How far to look across each edge point (n,), camera px: three sigmas of where the known points put it."""
    _, covariance = solve_points(scene.plane, p, known)
    slopes = np.einsum("nij,ni->nj", scene.plane.slopes(p, scene.edges.points_px), outward(scene, p))
    sigma = np.sqrt(np.maximum(0.0, np.einsum("nj,jk,nk->n", slopes, covariance, slopes)))
    most = _MOST_REACH * wide_px
    return np.asarray(np.minimum(np.maximum(_SIGMAS * sigma, _least_reach_px(scene)), np.maximum(most, 2.0)))


def _least_reach_px(scene: Scene) -> float:
    width_px: int = scene.lab.shape[1]
    return _LEAST_REACH_PX * max(1.0, width_px / 1280.0)


def in_picture(points: Points, size_px: tuple[int, int]) -> NDArray[np.bool_]:
    """Which of the camera px (n, 2) lie in a picture of that size, shape (n,)."""
    return np.asarray(((points >= 0) & (points <= np.array(size_px) - 1.0)).all(axis=1))
