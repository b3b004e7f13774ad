"""Pairs of points, clicked on a camera picture and on the twin, that tie the two together.

Knows points and their names, and reads .npy arrays of them. Knows no homography. (The YAML form of keypoints is read by
`config`.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tokenize import TokenError
from typing import Self

import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.values import PointPx, Points

MOST_POINTS = 1000
"""Each is left out once to see whether the others still fix the map: the time for it grows with their square."""

_FEWEST = 4
_THIN_RATIO = 0.01
"""Points whose spread across their main direction is below this share of the spread along it count as on one line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeypointPairs:
    """The same places on the floor in camera px and in twin px: at least four, no three of which carry the map alone."""

    camera_px: tuple[PointPx, ...]
    twin_px: tuple[PointPx, ...]
    names: tuple[str, ...]
    source: str = "keypoints"
    """The file or files that the pairs come from, for errors."""
    image_size_px: tuple[int, int] | None = None
    """Width and height of the picture on which the camera points were clicked; None where the file does not say."""

    def __post_init__(self) -> None:
        """Raises `InputError` for too few, unequal, repeated or collinear points, or numbers that are not finite."""
        counts = len(self.camera_px), len(self.twin_px)
        if counts[0] != counts[1]:
            raise InputError(
                f"{self.source}: {counts[0]} camera points but {counts[1]} twin points: give each camera point its twin"
            )
        if len(self.names) != counts[0]:
            raise InputError(
                f"{self.source}: {len(self.names)} names for {counts[0]} pairs of keypoints: name each pair"
            )
        twice = sorted({name for name in self.names if self.names.count(name) > 1})
        if twice:
            raise InputError(f"{self.source}: several keypoints are called {twice[0]}: give each a name of its own")
        if counts[0] < _FEWEST:
            raise InputError(f"{self.source}: {counts[0]} pairs of keypoints: a homography needs at least {_FEWEST}")
        for side, points in (("camera", self.camera_px), ("twin", self.twin_px)):
            _check(points, self.names, f"{self.source}: {side}")

    @classmethod
    def from_arrays(
        cls, camera_px: Points, twin_px: Points, *, source: str, names: tuple[str, ...] | None = None
    ) -> Self:
        """The pairs in two arrays (n, 2); without `names` they are called 1, 2, ..."""
        sides = [tuple((float(u), float(v)) for u, v in array) for array in (camera_px, twin_px)]
        given = names if names is not None else tuple(str(k) for k in range(1, len(sides[0]) + 1))
        return cls(camera_px=sides[0], twin_px=sides[1], names=given, source=source)

    def without(self, names: Sequence[str]) -> KeypointPairs:
        """The pairs but those of these names. Raises `InputError` for a name that no pair has, and where too few are left."""
        for name in names:
            if name not in self.names:
                raise InputError(f"{self.source}: no keypoint is called {name}: there are {', '.join(self.names)}")
        kept = [k for k, name in enumerate(self.names) if name not in names]
        return replace(
            self,
            camera_px=tuple(self.camera_px[k] for k in kept),
            twin_px=tuple(self.twin_px[k] for k in kept),
            names=tuple(self.names[k] for k in kept),
        )

    def __len__(self) -> int:
        return len(self.names)

    def camera_array(self) -> Points:
        """The camera px, shape (n, 2)."""
        return np.array(self.camera_px, dtype=np.float64)

    def twin_array(self) -> Points:
        """The twin px, shape (n, 2)."""
        return np.array(self.twin_px, dtype=np.float64)


def load_npy_pairs(camera: Path, twin: Path) -> KeypointPairs:
    """The pairs in two .npy files of shape (n, 2), row by row. Raises `InputError` naming the file at fault."""
    arrays = [_load_points(path) for path in (camera, twin)]
    return KeypointPairs.from_arrays(arrays[0], arrays[1], source=f"{camera} and {twin}")


def _load_points(path: Path) -> Points:
    try:
        # Mapped, since otherwise memory is taken for what the head claims, before it is found out that it is not there.
        array: NDArray[np.generic] = np.load(path, mmap_mode="r", allow_pickle=False)
    except OSError as error:
        raise InputError(f"{path}: cannot read the keypoints ({error.strerror or error}): check the path") from error
    except (
        ValueError,
        EOFError,
        TypeError,
        OverflowError,
        RecursionError,
        MemoryError,
        SyntaxError,
        TokenError,
    ) as error:
        # The head is a Python literal, and NumPy lets out whatever Python says of one that is none.
        raise InputError(f"{path}: not a .npy file of numbers: save the keypoints with numpy.save") from error
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "iuf":
        raise InputError(f"{path}: holds no array of numbers: save the keypoints with numpy.save, shape (n, 2)")
    if array.ndim != 2 or array.shape[1] != 2:
        raise InputError(f"{path}: keypoints of shape {array.shape}: it must be (n, 2), one row (u, v) for each point")
    if len(array) > MOST_POINTS:
        raise InputError(f"{path}: {len(array)} keypoints: {MOST_POINTS} are enough for any camera")
    return np.array(array, dtype=np.float64)


def _check(points: tuple[PointPx, ...], names: tuple[str, ...], where: str) -> None:
    for name, point in zip(names, points, strict=True):
        if not all(math.isfinite(x) for x in point):
            raise InputError(f"{where} keypoint {name} is {point}: it must be two finite numbers")
    first: dict[PointPx, str] = {}
    for name, point in zip(names, points, strict=True):
        if point in first:
            raise InputError(f"{where} keypoints {first[point]} and {name} are the same point {point}: click them anew")
        first[point] = name
    fault = _collinear(np.array(points, dtype=np.float64))
    if fault:
        raise InputError(f"{where} keypoints {fault}: choose points spread over the whole track")


def _collinear(points: Points) -> str | None:
    """Why the points (n, 2) fix no homography: all on one line, or all but one. None where they do."""
    if _on_a_line(points):
        return "lie on one line"
    for k in range(len(points)):
        if _on_a_line(np.delete(points, k, axis=0)):
            return "all but one lie on one line"
    return None


def _on_a_line(points: Points) -> bool:
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] <= _THIN_RATIO * spread[0])
