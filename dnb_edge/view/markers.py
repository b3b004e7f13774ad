"""Floor markers in a picture: which printed squares lie there, and where exactly their corners are.

Knows families of printed codes, pixels and a lens; knows no floor and no pose (see `marker_solve`). OpenCV finds and reads the
squares; `marker_edges` then places each by all its edges. Floor markers lie still on the ground, unlike the roof markers of
cars, which `detect` reads.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage
from dnb_edge.view.lens import Lens
from dnb_edge.view.marker_edges import MarkerFit, fit_markers

GreyImage: TypeAlias = NDArray[np.uint8]
"""A picture, shape (height, width), uint8."""

SMALLEST_CELL_PX = 2.5
"""Below this size of a marker's cells, camera px, blur covers them and the edges cannot be placed."""

_SMALLEST_FOUND_PX = 9.0
_WIDE_PICTURE_PX = 2000
_SHAKEN_PX = 0.5
_SETTINGS = ((0.125, 0.03), (0.05, 0.03), (0.05, 0.05))
"""Of OpenCV's detector: how near squares are one, as a share of their rim, and how crooked their sides may be."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkersSeen:
    """What one picture shows."""

    markers: tuple[MarkerFit, ...]
    """The markers whose edges were placed, by number."""
    too_small: tuple[tuple[int, float], ...]
    """Number and side, camera px, of those that were read but are too small to be placed."""
    unclear: tuple[int, ...]
    """Numbers of those that were read but whose edges are blurred, glaring or covered."""
    unread: int
    """Square outlines that no code of the family explains."""


def family_names() -> tuple[str, ...]:
    """Every family of codes that this OpenCV knows; of two spellings of an AprilTag family the one with a small h."""
    names = (name.removeprefix("DICT_") for name in dir(cv2.aruco) if name.startswith("DICT_"))
    return tuple(sorted(name for name in names if not ("APRILTAG" in name and "H" in name)))


def marker_cells(family: str, number: int) -> NDArray[np.bool_]:
    """The printed code, (n, n), True where it is white; its outermost cells are black.

    Raises `InputError` for an unknown family or a number that it has not.
    """
    codes = _codes(family)
    if not 0 <= number < len(codes.bytesList):
        raise InputError(f"{family} has the markers 0 to {len(codes.bytesList) - 1}, not {number}")
    return np.asarray(cv2.aruco.generateImageMarker(codes, number, int(codes.markerSize) + 2) > 127)


def find_markers(
    grey: GreyImage, *, family: str, lens: Lens | None = None, numbers: Sequence[int] | None = None
) -> MarkersSeen:
    """The markers of `family` in the picture `grey`; of `numbers` only, where they are given. `lens`: for the picture's size.

    Raises `InputError` for an unknown family and where one number is seen twice.
    """
    read, unread = _read(grey, family)
    found = [(number, corners) for number, corners in read if numbers is None or number in numbers]
    _check_repeated(found)
    cells = len(marker_cells(family, 0))
    small = [(number, _side_px(corners)) for number, corners in found if _side_px(corners) < SMALLEST_CELL_PX * cells]
    large = {number: corners for number, corners in found if _side_px(corners) >= SMALLEST_CELL_PX * cells}
    fits = fit_markers(grey, {n: (marker_cells(family, n), corners) for n, corners in large.items()}, lens)
    return MarkersSeen(
        markers=tuple(sorted(fits, key=lambda fit: fit.number)),
        too_small=tuple(sorted(small)),
        unclear=tuple(sorted(set(large) - {fit.number for fit in fits})),
        unread=unread,
    )


def grey_of(picture: BgrImage) -> GreyImage:
    """The grey levels of a picture."""
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def averaged(frames: Sequence[MarkersSeen]) -> tuple[tuple[MarkerFit, ...], tuple[str, ...]]:
    """The markers placed in at least half of the frames of a camera that stands still, and notes on what was odd."""
    by_number: dict[int, list[MarkerFit]] = {}
    for frame in frames:
        for fit in frame.markers:
            by_number.setdefault(fit.number, []).append(fit)
    fits, notes, shaken = [], [], 0.0
    for number, seen in sorted(by_number.items()):
        if len(seen) < len(frames):
            notes.append(
                f"marker {number} is placed in {len(seen)} of {len(frames)} pictures: does somebody stand in the view?"
            )
        if 2 * len(seen) < len(frames):
            continue
        corners = np.array([fit.camera_px for fit in seen])
        shaken = max(shaken, float(corners.std(axis=0).max()))
        fits.append(
            MarkerFit(
                number=number,
                camera_px=corners.mean(axis=0),
                noise_px2=np.mean([fit.noise_px2 for fit in seen], axis=0) / len(seen),
                floor_px=float(np.mean([fit.floor_px for fit in seen])),
                side_px=float(np.mean([fit.side_px for fit in seen])),
            )
        )
    if shaken > _SHAKEN_PX:
        notes.append(f"the picture shook by {shaken:.1f} px while the markers were read: keep camera and floor still")
    return tuple(fits), tuple(notes)


def advice(seen: MarkersSeen, grey: GreyImage, *, family: str) -> str:
    """Why fewer markers than wanted were placed in a picture, and what to do; one sentence."""
    if seen.too_small:
        number, side_px = min(seen.too_small, key=lambda one: one[1])
        wanted = SMALLEST_CELL_PX * len(marker_cells(family, 0))
        return (
            f"marker {number} is {side_px:.0f} px large in the picture and must be {wanted:.0f} at least: print larger ones, "
            "lay them nearer to the camera or take larger pictures"
        )
    if seen.unclear:
        return (
            f"marker {', '.join(map(str, seen.unclear))} is read but its edges are not clear: focus, avoid glare and shadows "
            "on the sheets, and leave their white border free"
        )
    others = families_in(grey, but=family)
    if others:
        most = max(others, key=lambda name: others[name])
        return f"there are {others[most]} markers of the family {most}: give --family as printed on the sheets"
    return (
        "lay the sheets of `calibrate markers --print` in view, flat, whole and evenly lit, each at least "
        f"{SMALLEST_CELL_PX * len(marker_cells(family, 0)):.0f} px large in the picture"
    )


def families_in(grey: GreyImage, *, but: str) -> dict[str, int]:
    """How many markers of each other common family the picture shows; families without any are left out."""
    counts = {}
    # One family of each size of code: the smaller ones of a size are the beginning of the largest.
    for family in ("4X4_1000", "5X5_1000", "6X6_1000", "7X7_1000", "ARUCO_ORIGINAL", "APRILTAG_16h5", "APRILTAG_36h11"):
        if family.partition("_")[0] == but.partition("_")[0] and "APRILTAG" not in family:
            continue
        if family != but:
            counts[family] = len(_read(grey, family)[0])
    return {family: count for family, count in counts.items() if count}


def _codes(family: str) -> Any:
    if family not in family_names():
        raise InputError(f"unknown family of markers {family}: such as 4X4_50, 5X5_100 or APRILTAG_36h11")
    return cv2.aruco.getPredefinedDictionary(int(getattr(cv2.aruco, f"DICT_{family}")))


def _read(grey: GreyImage, family: str) -> tuple[list[tuple[int, NDArray[np.float64]]], int]:
    """Number and rough corners (4, 2), camera px, of every code that is read, and how many squares were not.

    The sheet's rim is a square round the marker, and OpenCV takes squares that are near one another for one, by rules that miss
    the marker now and then: what any of several settings reads counts.
    """
    found: list[tuple[int, NDArray[np.float64]]] = []
    unread = 0
    looks = [(grey, 1.0, *setting) for setting in _SETTINGS]
    if max(grey.shape) <= _WIDE_PICTURE_PX:
        # Enlarged, small markers are read that blur would hide.
        larger = np.asarray(cv2.resize(grey, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
        looks.append((larger, 2.0, *_SETTINGS[0]))
    for seen, scale, apart, smooth in looks:
        squares, numbers, others = _detector(family, seen, apart=apart, smooth=smooth).detectMarkers(seen)
        unread = len(others) if unread == 0 else min(unread, len(others))
        for square, number in zip(squares, () if numbers is None else np.ravel(numbers).tolist(), strict=True):
            corners = (_corners(square) + 0.5) / scale - 0.5
            if not any(int(number) == other and _overlap(corners, there) for other, there in found):
                found.append((int(number), corners))
    return found, unread


def _detector(family: str, grey: GreyImage, *, apart: float, smooth: float) -> cv2.aruco.ArucoDetector:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_CONTOUR
    parameters.minMarkerDistanceRate = apart
    parameters.polygonalApproxAccuracyRate = smooth
    parameters.minMarkerPerimeterRate = 4.0 * _SMALLEST_FOUND_PX / max(grey.shape)
    if max(grey.shape) > _WIDE_PICTURE_PX:
        parameters.adaptiveThreshWinSizeMax = 53
    return cv2.aruco.ArucoDetector(_codes(family), parameters)


def _check_repeated(found: list[tuple[int, NDArray[np.float64]]]) -> None:
    twice = sorted(number for number, times in Counter(number for number, _ in found).items() if times > 1)
    if twice:
        raise InputError(
            f"marker {', '.join(map(str, twice))} is seen more than once: lay each number down once, and take copies away"
        )


def _overlap(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    apart = float(np.linalg.norm(one.mean(axis=0) - other.mean(axis=0)))
    return apart < 0.5 * max(_side_px(one), _side_px(other))


def _side_px(corners: NDArray[np.float64]) -> float:
    """The shorter of a square's two mean sides, camera px: foreshortening makes that one hard to read."""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    return float(min(sides[0] + sides[2], sides[1] + sides[3])) / 2.0


def _corners(square: NDArray[Any]) -> NDArray[np.float64]:
    return np.asarray(square, dtype=np.float64).reshape(4, 2)
