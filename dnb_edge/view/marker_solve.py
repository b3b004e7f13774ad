"""The camera's pose from squares of one known size that lie anywhere on the floor, at places that nobody measured.

Knows which markers count, what is a pose and what must be refused; the least squares themselves are `marker_adjust`'s. Knows no
picture and no twin.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.view.lens import Lens, LensModel
from dnb_edge.view.marker_adjust import MarkerProblem, ideal_px
from dnb_edge.view.marker_edges import MarkerFit
from dnb_edge.view.marker_solution import MarkerSolution, MeasuredPoint, Optics
from dnb_edge.view.marker_start import likely_starts

FEWEST = 3

_STARTS = 3
_GOOD_MISFIT = 1.5
"""With this no other start can do better."""
_STEEPEST_DEG = 80.0
_VAGUEST_HEIGHT = 0.06
"""An estimated height of a greater sigma than this share of it is none."""
_WORST_MISFIT_PX = 1.5
_ODD_MISFIT = 3.0
_ODD_PX = 0.3
_BETTER = 0.5
"""A marker is set aside where the others alone fit better than this share of all together."""
_FIELDS_DEG = np.geomspace(20.0, 140.0, 15)


def solve_markers(
    markers: Sequence[MarkerFit],
    optics: Optics,
    *,
    size_m: float,
    height_m: float | None = None,
    measured: Sequence[MeasuredPoint] = (),
) -> MarkerSolution:
    """The pose from `markers`, all of side `size_m`. `height_m` is the camera's measured height; it counts for an unknown lens.

    A marker that is not like the others is set aside where three others are left. Raises `InputError` for fewer than three
    markers, and where they fit no camera or do not tell its height.
    """
    kept = list(markers)
    aside: tuple[int, ...] = ()
    solution = _solve(kept, optics, size_m, height_m, measured, aside)
    while _suspicious(solution):
        others = [[one for one in kept if one is not odd] for odd in kept] if len(kept) > FEWEST else []
        tried = [
            _solve(few, optics, size_m, height_m, measured, (*aside, odd.number))
            for few, odd in zip(others, kept, strict=False)
        ]
        best = min(tried, key=lambda one: one.misfit, default=None)
        if best is None or best.misfit > _BETTER * solution.misfit or 3 * len(best.aside) > len(markers):
            break
        solution, aside = best, best.aside
        kept = [one for one in kept if one.number not in aside]
    _check_pose(solution, height_m)
    return solution


def _solve(
    markers: Sequence[MarkerFit],
    optics: Optics,
    size_m: float,
    height_m: float | None,
    measured: Sequence[MeasuredPoint],
    aside: tuple[int, ...],
) -> MarkerSolution:
    if len(markers) < FEWEST:
        raise InputError(f"{_count(len(markers))}: lay at least {FEWEST} in view, better 4 to 8, spread over the floor")
    best: MarkerSolution | None = None
    for start in likely_starts(ideal_px(markers, optics), _lenses(optics), size_m)[:_STARTS]:
        problem = MarkerProblem(
            markers=tuple(markers),
            optics=optics,
            size_m=size_m,
            height_m=None if optics.lens is not None else height_m,
            measured=tuple(point for point in measured if point.number in {marker.number for marker in markers}),
            start=start,
        )
        solution = problem.solve(aside)
        if solution is not None and (best is None or solution.misfit < best.misfit):
            best = solution
        if best is not None and best.misfit < _GOOD_MISFIT:
            break
    if best is None:
        raise InputError(
            "the markers fit no camera above a floor: check that all lie flat and that --lens is this camera's"
        )
    return best


def _rms_px(solution: MarkerSolution) -> float:
    return float(np.sqrt((solution.residual_px**2).mean()))


def _suspicious(solution: MarkerSolution) -> bool:
    """Whether the corners fit so badly that a marker may be of another size, bent or moved."""
    return solution.misfit > _ODD_MISFIT and _rms_px(solution) > _ODD_PX


def _check_pose(solution: MarkerSolution, height_m: float | None) -> None:
    """Raises `InputError` where the solution is no camera, or says nothing of its height."""
    if _rms_px(solution) > _WORST_MISFIT_PX:
        raise InputError(
            "the markers do not lie as squares of one size on one flat floor: check that every sheet lies flat and was printed "
            "at one size, and that --lens is this camera's"
        )
    if solution.optics.lens is not None or height_m is not None:
        return
    vague = solution.height_sigma_m / solution.height_m
    if solution.pitch_deg > _STEEPEST_DEG or vague > _VAGUEST_HEIGHT:
        raise InputError(
            f"the camera looks {solution.pitch_deg:.0f} degrees down: without its lens the markers do not tell how high it is: "
            "measure the height from the floor to the lens and give --height, or calibrate the lens and give --lens"
        )


def _count(count: int) -> str:
    return (
        "no floor marker is seen" if count == 0 else f"only {count} floor marker{'s are' if count > 1 else ' is'} seen"
    )


def _lenses(optics: Optics) -> list[Lens]:
    """The lens, or lenses of all usual fields of view."""
    if optics.lens is not None:
        return [optics.lens]
    u, v = optics.middle_px()
    focals = 0.5 * optics.width_px / np.tan(0.5 * np.radians(_FIELDS_DEG))
    return [
        Lens(
            model=LensModel.PINHOLE, fx_px=focal, fy_px=focal, cx_px=u, cy_px=v, distortion=(0.0, 0.0, 0.0, 0.0),
            width_px=optics.width_px, height_px=optics.height_px,
        )
        for focal in focals.tolist()
    ]  # fmt: skip
