"""Blobs to paths: what belongs together over time, and what of it moves as a car does.

Knows boxes and seconds; nothing of pictures and networks. Pure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dnb_edge.train.teach_drive import Blob
from dnb_edge.values import PointPx

_LOST_AFTER_S = 0.5
_LEAST_SEEN = 6
_LEAST_S = 0.8
_TRAVEL_LENGTHS = 3.0
_ROUGH_LENGTHS = 0.25
_UNSTEADY = 0.25
_SPAN_S = 0.2
_LEAST_SUPPORT = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """One blob of a path, with what the present model says of it."""

    number: int
    """The picture's place in the drive."""
    t_s: float
    blob: Blob
    model_px: PointPx | None = None
    """The present model's ground point in it; None where it sees no car there."""
    model_length_px: float | None = None


@dataclass(slots=True, kw_only=True)
class _Growing:
    seen: list[Seen] = field(default_factory=list)

    def expected(self, t_s: float) -> PointPx:
        """Where it would be at constant velocity."""
        last, before = self.seen[-1], self.seen[max(0, len(self.seen) - 4)]
        (u, v), (u0, v0) = last.blob.centre_px, before.blob.centre_px
        share = (t_s - last.t_s) / (last.t_s - before.t_s) if last.t_s > before.t_s else 0.0
        return u + (u - u0) * share, v + (v - v0) * share


class Linker:
    """Links the blobs of picture after picture to paths."""

    def __init__(self) -> None:
        self._growing: list[_Growing] = []
        self._done: list[tuple[Seen, ...]] = []
        self._gap_s = 0.0
        self._last_s: float | None = None

    def take(self, t_s: float, seen: Sequence[Seen]) -> None:
        """The blobs of the next picture: each goes on with the nearest fitting path, or begins one."""
        if self._last_s is not None:
            self._gap_s = max(0.8 * self._gap_s, t_s - self._last_s)
        self._last_s = t_s
        pairs = []
        for index, path in enumerate(self._growing):
            at = path.expected(t_s)
            for number, one in enumerate(seen):
                cost = _cost(path.seen[-1], at, one)
                if cost is not None:
                    pairs.append((cost, index, number))
        paths: set[int] = set()
        taken: set[int] = set()
        for _, index, number in sorted(pairs):
            if index not in paths and number not in taken:
                self._growing[index].seen.append(seen[number])
                paths.add(index)
                taken.add(number)
        self._growing.extend(_Growing(seen=[one]) for number, one in enumerate(seen) if number not in taken)
        patience_s = max(_LOST_AFTER_S, 2.5 * self._gap_s)
        self._done.extend(tuple(path.seen) for path in self._growing if t_s - path.seen[-1].t_s > patience_s)
        self._growing = [path for path in self._growing if t_s - path.seen[-1].t_s <= patience_s]

    def paths(self) -> list[tuple[Seen, ...]]:
        """All paths so far, in the order of their beginnings."""
        return sorted([*self._done, *(tuple(path.seen) for path in self._growing)], key=lambda path: path[0].number)


def _cost(last: Seen, at: PointPx, one: Seen) -> float | None:
    """Distance in lengths from where the path is expected; None where the blob does not fit it."""
    length = max(last.blob.length_px, one.blob.length_px)
    step = math.dist(at, last.blob.centre_px)
    apart = math.dist(at, one.blob.centre_px)
    ratio = one.blob.area_px / last.blob.area_px
    if apart > 0.8 * length + 0.6 * step or not 1 / 3 < ratio < 3:
        return None
    return apart / length


def moves_like_a_car(path: Sequence[Seen]) -> bool:
    """True for a path that is long enough, leads somewhere, runs smoothly, and whose blob keeps its size."""
    if len(path) < _LEAST_SEEN or path[-1].t_s - path[0].t_s < _LEAST_S:
        return False
    centres = np.array([one.blob.centre_px for one in path])
    lengths = np.array([one.blob.length_px for one in path])
    length = float(np.median(lengths))
    if float(np.hypot(*np.ptp(centres, axis=0))) < _TRAVEL_LENGTHS * length:
        return False
    times = np.array([one.t_s for one in path])
    smooth = smoothed(times, centres)
    logs = np.log(lengths)[:, None]
    steady = smoothed(times, logs)
    rough = [math.dist(a, b) for a, b in zip(centres, smooth.points, strict=True)]
    unsteady = np.abs(logs[:, 0] - steady.points[:, 0])
    return float(np.median(rough)) <= _ROUGH_LENGTHS * length and float(np.median(unsteady)) <= _UNSTEADY


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Smooth:
    """Values on a smooth path, one for each time asked for."""

    points: NDArray[np.float64]
    """Shape (n, k)."""
    speeds: NDArray[np.float64]
    """Per second, shape (n, k)."""
    supported: NDArray[np.bool_]
    """True where enough values lay near the path, shape (n,); elsewhere `points` is a guess."""


def smoothed(
    times_s: NDArray[np.float64], values: NDArray[np.float64], at_s: NDArray[np.float64] | None = None
) -> Smooth:
    """A local quadratic fit through `values` (n, k), outliers dropped, at `at_s` (by default at the values' own times).

    The fit spans 0.2 s to either side, or three pictures where those are few a second. It is made by least absolute distances
    first; a value further than three times the median from that is dropped, and the rest fitted by least squares.
    """
    at = times_s if at_s is None else at_s
    gap = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.0
    half = max(_SPAN_S, 3.01 * gap)
    fits = [_local(times_s, values, float(t), half) for t in at]
    return Smooth(
        points=np.array([fit[0] for fit in fits]).reshape(len(at), values.shape[1]),
        speeds=np.array([fit[1] for fit in fits]).reshape(len(at), values.shape[1]),
        supported=np.array([fit[2] for fit in fits], dtype=bool),
    )


def _local(
    times: NDArray[np.float64], values: NDArray[np.float64], t: float, half: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], bool]:
    near = np.flatnonzero(np.abs(times - t) <= half)
    if len(near) < _LEAST_SUPPORT:
        nearest = int(np.argmin(np.abs(times - t)))
        return values[nearest], np.zeros(values.shape[1]), False
    offset = (times[near] - t) / half
    basis = np.column_stack((np.ones_like(offset), offset, offset**2))
    by_time = np.maximum(1.0 - np.abs(offset) ** 3, 0.02)
    weight = by_time
    for _ in range(
        8
    ):  # least absolute distances, by least squares with weights: an outlier pulls no harder than its neighbours
        residual = np.linalg.norm(values[near] - basis @ _solved(basis, values[near], weight), axis=1)
        weight = by_time / np.maximum(residual, 1e-3 + 0.1 * float(np.median(residual)))
    kept = residual <= 3.0 * max(float(np.median(residual)), 1e-6) + 1e-9
    if int(kept.sum()) < _LEAST_SUPPORT:
        kept = np.ones(len(near), dtype=bool)
    coefficients = _solved(basis[kept], values[near][kept], by_time[kept])
    return coefficients[0], coefficients[1] / half, int(kept.sum()) >= max(_LEAST_SUPPORT, len(near) // 2)


def _solved(
    basis: NDArray[np.float64], values: NDArray[np.float64], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    root = np.sqrt(weight)[:, None]
    return np.asarray(np.linalg.lstsq(basis * root, values * root, rcond=None)[0], dtype=np.float64)
