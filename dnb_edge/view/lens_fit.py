"""A lens from many views of a board: how well it fits, how well it is known, and what the views lack.

Knows when views are too few, too alike or bad, and says so in words. Every view counts in the fit as it is; a bad one is
named, never dropped. Knows no file and no camera.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.values import Points
from dnb_edge.view.boards import Board, BoardSight
from dnb_edge.view.lens import Lens, LensModel
from dnb_edge.view.lens_solve import Numbers, Seen, Solution, lens_sigmas, solve

COEFFICIENTS = {LensModel.PINHOLE: (5, 4, 2), LensModel.FISHEYE: (4, 2)}
"""How many distortion coefficients are fitted unless told otherwise; the next number where the lens that comes out folds
over in a part of the picture where no corner was seen. Pinhole: k1 k2 p1 p2 k3, OpenCV's own default. With four, lenses wider
than some 80 degrees keep errors near the rim; eight are not determined by usual views: numerator and denominator grow against
each other and mean nothing outside the corners seen."""
FEWEST_VIEWS = 6
GOOD_VIEWS = 15
GRID = 3
"""Coverage is counted in GRID x GRID cells of the picture."""

_ALIKE_DEG = 6.0
_LITTLE_TILT_DEG = 20.0
_VAGUE_SHARE = 0.05
_UNSURE_SHARE = 0.01
_BAD_RATIO = 2.0
_BAD_PX = 0.3
_LITTLE_SHARE = 0.5
_HIGH_RMS_PX = 0.5
"""In pictures 1280 px wide: sharp pictures of a flat board reach half of it."""
_TILT = "tilt the board by 30 to 45 degrees to different sides in at least five views"
_PLACES = (("top left", "top", "top right"), ("left", "middle", "right"), ("bottom left", "bottom", "bottom right"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LensView:
    """One picture with the corners found in it."""

    name: str
    sight: BoardSight


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ViewFit:
    """How one view agrees with the fitted lens."""

    name: str
    camera_px: Points
    """(n, 2) corners as found."""
    off_px: Points
    """(n, 2) where the lens puts them less where they were found, camera px."""
    tilt_deg: float
    """Between the board's normal and the camera's axis."""
    distance_m: float
    bad: bool
    """Disagrees with the others by far more than they do among themselves."""

    @property
    def rms_px(self) -> float:
        """Root of the mean squared length of `off_px`."""
        return _rms([self.off_px])

    @property
    def max_px(self) -> float:
        """Longest of `off_px`."""
        return float(np.linalg.norm(self.off_px, axis=1).max())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coverage:
    """Where in the picture corners were seen."""

    counts: NDArray[np.int64]
    """(GRID, GRID) views with a corner in the cell; rows from the top."""
    share: float
    """0..1, of the picture inside the convex hull of all corners."""

    @property
    def empty(self) -> tuple[str, ...]:
        """Cells without any corner, in words."""
        return tuple(_PLACES[row][column] for row, column in np.argwhere(self.counts == 0).tolist())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LensFit:
    """A lens, and all that is known of how good it is."""

    lens: Lens
    rms_px: float
    """Over all corners of all views."""
    views: tuple[ViewFit, ...]
    sigmas: dict[str, float]
    """Of each of the lens's numbers, by name: fx_px, fy_px, cx_px, cy_px, k1 ...; the same units."""
    tilt_spread_deg: float
    """Largest angle between the boards of two views."""
    coverage: Coverage
    rms_without_bad_px: float | None
    """What the RMS would be without the bad views; None where there are none, or too few others."""
    notes: tuple[str, ...]
    """What would make the calibration better, each one line."""

    @property
    def bad_views(self) -> tuple[str, ...]:
        """Names of the bad ones."""
        return tuple(view.name for view in self.views if view.bad)


def fit_lens(
    board: Board,
    views: Sequence[LensView],
    *,
    size_px: tuple[int, int],
    model: LensModel = LensModel.PINHOLE,
    coefficients: int | None = None,
) -> LensFit:
    """The lens that sees `board` where `views` show it, in pictures of `size_px` (width, height): plain least squares.

    Raises `InputError` where the views are too few or so alike that they do not determine the focal length.
    """
    if len(views) < FEWEST_VIEWS:
        raise InputError(
            f"lens: the board was found in {len(views)} pictures, {FEWEST_VIEWS} are the least and {GOOD_VIEWS} good: "
            f"take {FEWEST_VIEWS - len(views)} more at least, with the board elsewhere and tilted differently"
        )
    seen = [Seen(board_m=board.points_m[view.sight.ids], camera_px=view.sight.camera_px) for view in views]
    counts = COEFFICIENTS[model] if coefficients is None else (coefficients,)
    known = _known(seen, size_px, model, counts)
    found, count = known.found, len(known.found.lens) - 4
    bad = _bad(solve(seen, size_px, model, count, robust=True), seen)
    fits = tuple(_view_fits(views, found, seen, bad))
    good = [view for view, is_bad in zip(seen, bad, strict=True) if not is_bad]
    enough = any(bad) and len(good) >= FEWEST_VIEWS
    without = _rms(solve(good, size_px, model, count).off_px(good)) if enough else None
    coverage = _coverage(seen, size_px)
    rms_px = _rms([fit.off_px for fit in fits])
    named = dict(zip(lens_names(model)[: 4 + count], known.sigmas.tolist(), strict=True))
    return LensFit(
        lens=known.lens,
        rms_px=rms_px,
        views=fits,
        sigmas=named,
        tilt_spread_deg=known.spread_deg,
        coverage=coverage,
        rms_without_bad_px=without,
        notes=(*_notes(known, rms_px, fits, without, coverage), *_left_out(model, count, counts)),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Known:
    """A solution that is a lens."""

    found: Solution
    lens: Lens
    sigmas: Numbers
    """(4 + k,) of `found.lens`."""
    spread_deg: float


def _known(seen: Sequence[Seen], size_px: tuple[int, int], model: LensModel, counts: Sequence[int]) -> _Known:
    """With the first of `counts` coefficients that give a lens. Raises `InputError` where the views do not tell the lens."""
    for count in counts:
        found = solve(seen, size_px, model, count)
        spread_deg, sigmas = _tilt_spread_deg(found), lens_sigmas(found, seen)
        _check_determined(found, sigmas, spread_deg)
        assert sigmas is not None
        try:
            return _Known(found=found, lens=_lens(found, size_px), sigmas=sigmas, spread_deg=spread_deg)
        except InputError:
            if count == counts[-1]:
                raise
    raise ValueError("no number of coefficients to try")


def _left_out(model: LensModel, count: int, counts: Sequence[int]) -> list[str]:
    if count == counts[0]:
        return []
    names = ", ".join(lens_names(model)[4 + count : 4 + counts[0]])
    note = f"{names} left out: with them the lens would fold the picture over where no corner was seen"
    return [f"{note}: hold the board nearer to the picture's corners"]


def _check_determined(found: Solution, sigmas: Numbers | None, spread_deg: float) -> None:
    if spread_deg < _ALIKE_DEG:
        raise InputError(
            f"lens: the board has nearly the same tilt in all {len(found.poses)} views (within {spread_deg:.0f} degrees), "
            f"which leaves the focal length open: {_TILT}"
        )
    vague = 1.0 if sigmas is None else float((sigmas[:2] / np.abs(found.lens[:2])).max())
    if vague > _VAGUE_SHARE or not np.all(np.isfinite(found.lens)):
        known = "not at all" if vague >= 1.0 else f"only to {100 * vague:.0f} %"
        raise InputError(f"lens: these views determine the focal length {known}: {_TILT}, and fill the picture")


def _lens(found: Solution, size_px: tuple[int, int]) -> Lens:
    fx, fy, cx, cy = found.lens[:4].tolist()
    return Lens(
        model=found.model, fx_px=fx, fy_px=fy, cx_px=cx, cy_px=cy, distortion=tuple(found.distortion.tolist()),
        width_px=size_px[0], height_px=size_px[1],
    )  # fmt: skip


def lens_names(model: LensModel) -> tuple[str, ...]:
    """Names of a lens's numbers: focal lengths and centre, then the distortion in its order."""
    bent = ("k1", "k2", "k3", "k4") if model is LensModel.FISHEYE else ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    return ("fx_px", "fy_px", "cx_px", "cy_px", *bent)


def _bad(robust: Solution, seen: Sequence[Seen]) -> list[bool]:
    """Which views disagree with a lens that the bad ones could not pull along."""
    each = np.array([_rms([off]) for off in robust.off_px(seen)])
    return [bool(bad) for bad in each > max(_BAD_PX, _BAD_RATIO * float(np.median(each)))]


def _view_fits(views: Sequence[LensView], found: Solution, seen: Sequence[Seen], bad: Sequence[bool]) -> list[ViewFit]:
    fits = []
    for view, off, pose, shown, is_bad in zip(views, found.off_px(seen), found.poses, seen, bad, strict=True):
        turn = _rotation(pose)
        middle = turn[:, :2] @ shown.board_m.mean(axis=0) + pose[3:]
        fits.append(
            ViewFit(
                name=view.name,
                camera_px=view.sight.camera_px,
                off_px=off,
                tilt_deg=math.degrees(math.acos(min(1.0, abs(float(turn[2, 2]))))),
                distance_m=float(np.linalg.norm(middle)),
                bad=is_bad,
            )
        )
    return fits


def _rotation(pose: Numbers) -> Numbers:
    return np.asarray(cv2.Rodrigues(pose[:3])[0], dtype=np.float64)


def _tilt_spread_deg(found: Solution) -> float:
    normals = np.array([_rotation(pose)[:, 2] for pose in found.poses])
    nearest = np.abs(normals @ normals.T).min()
    return math.degrees(math.acos(min(1.0, float(nearest))))


def _coverage(seen: Sequence[Seen], size_px: tuple[int, int]) -> Coverage:
    counts = np.zeros((GRID, GRID), dtype=np.int64)
    for view in seen:
        counts += cells_of(view.camera_px, size_px)
    corners = np.concatenate([view.camera_px for view in seen]).astype(np.float32)
    return Coverage(counts=counts, share=float(cv2.contourArea(cv2.convexHull(corners))) / (size_px[0] * size_px[1]))


def cells_of(camera_px: Points, size_px: tuple[int, int]) -> NDArray[np.int64]:
    """(GRID, GRID) 1 where the cell of the picture holds one of the corners (n, 2), else 0; rows from the top."""
    cells = np.zeros((GRID, GRID), dtype=np.int64)
    places = np.clip((camera_px + 0.5) / size_px * GRID, 0, GRID - 1).astype(int)
    cells[places[:, 1], places[:, 0]] = 1
    return cells


def _notes(
    known: _Known, rms_px: float, fits: Sequence[ViewFit], without_px: float | None, coverage: Coverage
) -> list[str]:
    notes = []
    bad = [fit for fit in fits if fit.bad]
    if bad:
        names = ", ".join(f"{fit.name} ({fit.rms_px:.2f} px)" for fit in bad)
        then = "" if without_px is None else f"; without them the RMS is {without_px:.2f} px"
        notes.append(
            f"these views disagree with the others: {names}{then}: look at them, take them out if they are blurred"
        )
    elif rms_px > _HIGH_RMS_PX * known.lens.width_px / 1280:
        worst = " and ".join(fit.name for fit in sorted(fits, key=lambda fit: -fit.rms_px)[:2])
        notes.append(
            f"an RMS of {rms_px:.2f} px is much, and not one view's doing (largest: {worst}): is the board flat and stiff, did "
            "it or the camera move?"
        )
    if len(fits) < GOOD_VIEWS:
        notes.append(f"{len(fits)} views: {GOOD_VIEWS} or more make the calibration surer")
    if coverage.empty:
        notes.append(f"no corner at the {', '.join(coverage.empty)} of the picture: the lens is a guess there")
    elif coverage.share < _LITTLE_SHARE:
        notes.append(
            f"the corners span {100 * coverage.share:.0f} % of the picture, outside of them the lens is a guess: hold the "
            "board nearer to the picture's edges"
        )
    unsure = float((known.sigmas[:2] / known.found.lens[:2]).max())
    if known.spread_deg < _LITTLE_TILT_DEG or unsure > _UNSURE_SHARE:
        notes.append(f"the focal length is known to {100 * unsure:.1f} %: {_TILT}")
    return notes


def _rms(off_px: Sequence[Points]) -> float:
    return float(np.sqrt(np.mean(np.sum(np.concatenate(list(off_px)) ** 2, axis=1))))
