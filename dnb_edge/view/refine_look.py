"""How the lane looks in the picture, and where along a line across its edge the lane ends.

Knows colours, and which camera px should be lane and which floor by the present map. The lane's colour in the picture is
learnt from there, so that it need not be the twin's. Knows no map and no twin.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage, Points

Floats = NDArray[np.float64]

_BINS = (48, 64, 64)
"""Of lightness and the two opponent colours."""

_LEAST_SHARE = 4e-5
"""A colour that fewer samples have (share of them, per cell) says nothing."""

_SOFT_BINS = 1.0
"""Standard deviation of the histograms' smoothing, bins."""

_STRONGEST = 3.0
"""A pixel's colour says at most so much for lane or floor (natural logarithm of the odds)."""

_TOLD_APART = 0.65
"""Share of the samples that their colour must put on the right side, mean of lane and floor; guessing gives a half."""

_STEP_PX = 0.5
_SURE = 0.6
"""Mean log-odds either side of an edge that is believed."""

_NEAR = 1.0
"""By how much an edge at the end of the reach counts less than one in its middle (log-odds)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LanePicture:
    """A picture in which the lane can be told from the floor."""

    lab: BgrImage
    """The picture as lightness and two opponent colours, slightly blurred, shape (height, width, 3)."""
    odds: NDArray[np.float32]
    """Shape `_BINS`: log-odds of a colour for lane, positive, or floor, negative."""
    told_apart: float
    """Share of lane and of floor that their colours tell, 0.5..1."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return self.lab.shape[1], self.lab.shape[0]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundEdges:
    """The lane's edge along each of n lines across it."""

    found: NDArray[np.bool_]
    """Shape (n,): where there is one within the reach."""
    offset_px: Floats
    """Shape (n,): how far outwards from the line's middle it lies, camera px; 0 where none was found."""


def smoothed_lab(picture: BgrImage) -> BgrImage:
    """The picture as `LanePicture.lab` holds it."""
    lab = cv2.cvtColor(cv2.GaussianBlur(picture, (0, 0), 0.8), cv2.COLOR_BGR2LAB)
    return np.asarray(lab, dtype=np.uint8)


def learn_look(lab: BgrImage, lane_px: Points, floor_px: Points, *, source: str) -> LanePicture:
    """Learns the lane's colours from places on it and beside it, camera px (n, 2) each.

    Raises `InputError` where too few of them are in the picture or the two look alike; `source` names the picture.
    """
    counts = []
    for points in (lane_px, floor_px):
        inside = points[_within(points, (lab.shape[1], lab.shape[0]), 1.0)]
        if len(inside) < 200:
            raise InputError(
                f"{source}: by the calibration hardly any of the lane is in it: give a picture of this camera, of the place "
                "that was calibrated"
            )
        cells = _cells(lab, inside)
        histogram = np.bincount(cells, minlength=int(np.prod(_BINS))).reshape(_BINS).astype(np.float64)
        counts.append((cells, _blurred(histogram / len(inside))))
    (lane_cells, lane), (floor_cells, floor) = counts
    odds = np.clip(np.log((lane + _LEAST_SHARE) / (floor + _LEAST_SHARE)), -_STRONGEST, _STRONGEST)
    flat = odds.ravel()
    told_apart = 0.5 * float(np.mean(flat[lane_cells] > 0) + np.mean(flat[floor_cells] < 0))
    if told_apart < _TOLD_APART:
        raise InputError(
            f"{source}: the lane cannot be told from the floor in it where the calibration puts it: give a picture of this "
            "camera with the lane in sight and well lit, or calibrate anew"
        )
    return LanePicture(lab=lab, odds=odds.astype(np.float32), told_apart=told_apart)


def odds_everywhere(picture: LanePicture, *, width_px: int, height_px: int) -> NDArray[np.float32]:
    """Log-odds for lane all over the picture at another size, shape (height_px, width_px)."""
    small = cv2.resize(picture.lab, (width_px, height_px), interpolation=cv2.INTER_AREA)
    return np.asarray(
        picture.odds.ravel()[_cells_of(np.asarray(small, dtype=np.uint8).reshape(-1, 3))].reshape(height_px, width_px)
    )


def find_edges(picture: LanePicture, at_px: Points, outward: Points, reach_px: Floats, window_px: Floats) -> FoundEdges:
    """The lane's edge along the lines through `at_px` (n, 2), camera px, with directions `outward` (n, 2), unit vectors.

    Along each line, as far as `reach_px` (n,) to either side, the place is sought where lane turns into floor: the greatest
    difference of the mean log-odds over `window_px` (n,) before and behind. Then, to a fraction of a pixel, where the colour
    is half-way between both. Lines that leave the picture have none.
    """
    count = len(at_px)
    none = FoundEdges(found=np.zeros(count, dtype=np.bool_), offset_px=np.zeros(count))
    if count == 0:
        return none
    far = float(np.max(reach_px + window_px)) + 2.0
    t = np.arange(-np.ceil(far / _STEP_PX), np.ceil(far / _STEP_PX) + 1) * _STEP_PX
    along = at_px[:, None, :] + t[None, :, None] * outward[:, None, :]
    inside = _within(at_px, picture.size_px, 1.0)
    colours = _colours(picture.lab, along)
    odds = picture.odds.ravel()[_cells_of(colours.reshape(-1, 3))].reshape(count, len(t)).astype(np.float64)
    before, behind = _means_beside(odds, window_px)
    score = before - behind - _NEAR * (t[None, :] / reach_px[:, None]) ** 2
    score[np.abs(t)[None, :] > reach_px[:, None]] = -np.inf
    best = np.argmax(score, axis=1)
    rows = np.arange(count)
    ends = (reach_px + window_px)[:, None] * outward
    inside &= _within(at_px + ends, picture.size_px, 1.0) & _within(at_px - ends, picture.size_px, 1.0)
    found = inside & (before[rows, best] > _SURE) & (behind[rows, best] < -_SURE)
    offset = _half_level(colours, t, best, window_px)
    return FoundEdges(found=found, offset_px=np.where(found, offset, 0.0))


def _means_beside(odds: Floats, window_px: Floats) -> tuple[Floats, Floats]:
    """Mean log-odds over each line's window before and behind every sample of it, each of `odds`' shape."""
    count, length = odds.shape
    total = np.concatenate((np.zeros((count, 1)), np.cumsum(odds, axis=1)), axis=1)
    steps = np.maximum(2, np.rint(window_px / _STEP_PX)).astype(np.int64)[:, None]
    k, rows = np.arange(length)[None, :], np.arange(count)[:, None]
    low, high = np.maximum(0, k - steps), np.minimum(length, k + 1 + steps)
    before = (total[rows, k] - total[rows, low]) / np.maximum(1, k - low)
    behind = (total[rows, high] - total[rows, k + 1]) / np.maximum(1, high - k - 1)
    return before, behind


def _half_level(colours: Floats, t: Floats, best: NDArray[np.int64], window_px: Floats) -> Floats:
    """Offset (n,) at which the colour, going outwards, first passes half-way from the lane's to the floor's near `best`."""
    count, length = colours.shape[:2]
    rows = np.arange(count)[:, None]
    near = np.maximum(3, np.rint(0.5 * window_px / _STEP_PX)).astype(np.int64)
    reach = int(near.max())
    k = np.arange(-2 * reach, 2 * reach + 1)[None, :]
    at = np.clip(best[:, None] + k, 0, length - 1)
    around = colours[rows, at]
    inner = (k >= -2 * near[:, None]) & (k <= -near[:, None])
    outer = (k <= 2 * near[:, None]) & (k >= near[:, None])
    lane = (around * inner[..., None]).sum(axis=1) / inner.sum(axis=1)[:, None]
    floor = (around * outer[..., None]).sum(axis=1) / outer.sum(axis=1)[:, None]
    across = floor - lane
    apart = np.maximum((across**2).sum(axis=1), 1e-9)
    share = ((around - lane[:, None]) * across[:, None]).sum(axis=2) / apart[:, None]
    rising = (share[:, :-1] < 0.5) & (share[:, 1:] >= 0.5) & (np.abs(k[:, :-1]) <= near[:, None])
    nearest = np.where(rising, np.abs(k[:, :-1] + 0.5), np.inf).argmin(axis=1)
    has = rising.any(axis=1)
    low, high = share[rows[:, 0], nearest], share[rows[:, 0], nearest + 1]
    fraction = np.clip((0.5 - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    exact = (best + k[0, nearest] + fraction) * _STEP_PX + t[0]
    return np.asarray(np.where(has, exact, t[best]))


def _colours(lab: BgrImage, points: NDArray[np.float64]) -> Floats:
    """(n, m, 3) colours at points (n, m, 2), bilinear."""
    at = points.astype(np.float32)
    rows = [
        cv2.remap(lab, part[..., 0], part[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        for part in np.array_split(at, max(1, at.shape[0] // 4000))
    ]
    return np.concatenate(rows).astype(np.float64)


def _cells(lab: BgrImage, points: Points) -> NDArray[np.int64]:
    """The histogram's cell of the colour at each of the points (n, 2) inside the picture."""
    at = np.rint(points).astype(np.int64)
    return _cells_of(lab[np.clip(at[:, 1], 0, lab.shape[0] - 1), np.clip(at[:, 0], 0, lab.shape[1] - 1)])


def _cells_of(colours: NDArray[np.uint8] | Floats) -> NDArray[np.int64]:
    """The histogram's cell of each colour (n, 3), 0..255."""
    steps = np.array(_BINS) / 256.0
    a, b, c = np.minimum((colours * steps).astype(np.int64), np.array(_BINS) - 1).T
    return np.asarray((a * _BINS[1] + b) * _BINS[2] + c)


def _blurred(histogram: Floats) -> Floats:
    """The histogram smoothed along its three axes."""
    smooth = histogram
    for axis, count in enumerate(histogram.shape):
        apart = np.arange(count)[:, None] - np.arange(count)[None, :]
        kernel = np.exp(-0.5 * (apart / _SOFT_BINS) ** 2)
        kernel /= kernel.sum(axis=0)
        smooth = np.moveaxis(np.tensordot(kernel, smooth, axes=(1, axis)), 0, axis)
    return smooth


def _within(points: Points, size_px: tuple[int, int], margin_px: float) -> NDArray[np.bool_]:
    """Which of the points (n, 2) lie in the picture, `margin_px` from its rim at least."""
    most = np.array(size_px) - 1.0 - margin_px
    return np.asarray(((points >= margin_px) & (points <= most)).all(axis=1))
