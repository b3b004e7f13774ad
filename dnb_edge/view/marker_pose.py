"""One camera's pictures of floor markers to one solution: find, solve, and look again with the lens that was found.

Knows grey pictures; knows no file, no source and no twin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.view.marker_edges import MarkerFit
from dnb_edge.view.marker_floor import spread
from dnb_edge.view.marker_solution import MarkerSolution, MeasuredPoint, Optics
from dnb_edge.view.marker_solve import FEWEST, solve_markers
from dnb_edge.view.markers import GreyImage, MarkersSeen, advice, averaged, find_markers

_LEAST_SHARE = 0.04
"""Share of the picture that the markers must enclose."""
_SMALL_SHARE = 0.15
_THINNEST = 0.08
_USUAL_COUNT = 4
_HEIGHT_OFF = 0.03
"""By how much a measured height may differ from that of the markers and a known lens."""
_HEIGHT_SIGMA = 0.01
"""How well people measure a height, as a share of it, one standard deviation."""
_DOUBTED = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MarkerQuestion:
    """What is asked of the pictures."""

    family: str
    size_m: float
    """Side of the black square as printed."""
    numbers: tuple[int, ...] | None = None
    """The numbers that lie on the floor; None for all of the family."""
    height_m: float | None = None
    """The camera's height above the floor, where it was measured."""
    measured: tuple[MeasuredPoint, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MarkerPose:
    """The answer."""

    solution: MarkerSolution
    sides_px: dict[int, float]
    """Mean side of each marker by number, camera px."""
    notes: tuple[str, ...]


def pose_from_pictures(pictures: Sequence[GreyImage], optics: Optics, question: MarkerQuestion) -> MarkerPose:
    """The pose from one picture, or several of a camera that stands still.

    Raises `InputError` where fewer than three markers are placed, where they lie badly, and as `solve_markers` does.
    """
    fits, notes = _placed(pictures, optics, question)
    if optics.lens is None:
        # Over a marker an unknown lens bends the sides by more than their edges are placed: once more with what it seems to be.
        rough = _solved(fits, optics, replace(question, measured=()))
        fits, notes = _placed(pictures, replace(optics, lens=rough.lens), question)
    solution = _solved(fits, optics, question)
    _check_height(solution, question)
    notes = [*notes, *_doubted_height(fits, optics, question), *_check_spread(solution)]
    return MarkerPose(solution=solution, sides_px={fit.number: fit.side_px for fit in fits}, notes=tuple(notes))


def _placed(
    pictures: Sequence[GreyImage], optics: Optics, question: MarkerQuestion
) -> tuple[tuple[MarkerFit, ...], list[str]]:
    """The markers that are placed, and notes on the others."""
    frames = [
        find_markers(grey, family=question.family, lens=optics.lens, numbers=question.numbers) for grey in pictures
    ]
    fits, notes = averaged(frames)
    best = max(range(len(frames)), key=lambda k: len(frames[k].markers))
    if len(fits) < FEWEST:
        raise InputError(
            f"{len(fits) or 'no'} floor marker{'' if len(fits) == 1 else 's'} placed, {FEWEST} are needed and 4 to 8 better: "
            f"{advice(frames[best], pictures[best], family=question.family)}"
        )
    return fits, [*notes, *_left_out(frames[best], question)]


def _left_out(seen: MarkersSeen, question: MarkerQuestion) -> list[str]:
    notes = [f"marker {number} is too small ({side:.0f} px) to be placed" for number, side in seen.too_small]
    notes += [f"marker {number} is read but blurred, glaring or partly covered" for number in seen.unclear]
    told = {fit.number for fit in seen.markers} | {number for number, _ in seen.too_small} | set(seen.unclear)
    notes += [f"marker {number} is not seen" for number in question.numbers or () if number not in told]
    return notes


def _solved(fits: Sequence[MarkerFit], optics: Optics, question: MarkerQuestion) -> MarkerSolution:
    return solve_markers(fits, optics, size_m=question.size_m, height_m=question.height_m, measured=question.measured)


def _check_height(solution: MarkerSolution, question: MarkerQuestion) -> None:
    """Raises `InputError` where a measured height contradicts markers seen through a known lens."""
    if question.height_m is None or solution.optics.lens is None:
        return
    ratio = question.height_m / solution.height_m
    if abs(ratio - 1.0) > _HEIGHT_OFF:
        raise InputError(
            f"--height {question.height_m:g}: by the markers the camera stands {solution.height_m:.3f} m above the floor: "
            f"measure from the floor to the lens, or the sheets were printed at {ratio:.0%} (check the 100 mm bar), or "
            "--lens is another camera's"
        )


def _doubted_height(fits: Sequence[MarkerFit], optics: Optics, question: MarkerQuestion) -> list[str]:
    """A note where a measured height contradicts what the markers tell by themselves, through an unknown lens: the lens is bent
    to it then, and the pose with it."""
    if question.height_m is None or optics.lens is not None:
        return []
    try:
        alone = _solved(fits, optics, replace(question, height_m=None))
    except InputError:
        # Seen from straight above they do not tell it.
        return []
    sigma_m = math.hypot(alone.height_sigma_m, _HEIGHT_SIGMA * question.height_m)
    if abs(alone.height_m - question.height_m) <= _DOUBTED * sigma_m:
        return []
    told = f"{alone.height_m:.2f} +- {alone.height_sigma_m:.2f} m"
    remedy = "measure again, from the floor to the lens, and the sheets' 100 mm bar"
    return [f"--height {question.height_m:g}: by the markers alone it would be {told}: {remedy}"]


def _check_spread(solution: MarkerSolution) -> list[str]:
    """Notes on how the markers lie. Raises `InputError` where all lie on one line or in one part of the picture."""
    hull = cv2.convexHull(solution.corners_px.reshape(-1, 1, 2).astype(np.float32))
    share = float(cv2.contourArea(hull)) / (solution.optics.width_px * solution.optics.height_px)
    longest, shortest = spread(solution)
    if shortest < _THINNEST * longest:
        raise InputError(
            f"all markers lie on one line, {longest:.2f} m long: lay one or two at least {0.25 * longest:.2f} m beside it"
        )
    if share < _LEAST_SHARE:
        raise InputError(
            f"all markers lie in one part of the picture ({share:.0%} of it): spread them over the whole track, the farthest "
            "ones near the picture's corners"
        )
    notes = []
    if share < _SMALL_SHARE:
        notes.append(f"the markers enclose {share:.0%} of the picture only: beyond them the map is less sure")
    if len(solution.numbers) < _USUAL_COUNT:
        notes.append(f"{len(solution.numbers)} markers leave little to check them by: lay 4 to 8")
    return notes
