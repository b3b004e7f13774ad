"""How well detections match hand-drawn boxes: precision, recall and error over thresholds.

Pure: knows no file, no model and no picture.

A detection counts where its point lies inside a box, one detection a box: the surest detection chooses first, and takes the
nearest box of those it lies in. So a threshold only cuts the tail: what is matched above it does not depend on what is below.

The error is the distance from the detection's point to the box's centre. Our own network's point is where the middle of the
car stands on the floor; since what stands up leans up in the picture of a camera that looks down at a slant, that point lies a
little below the box's centre (about a tenth of the box's height), which `mean_offset_px` shows and no accuracy can remove.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from dnb_edge.values import Detection, PointPx

Box: TypeAlias = tuple[float, float, float, float]
"""Left, top, right, bottom, camera px."""

TABLE_STEP = 0.1
"""Step of the thresholds in the table."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Find:
    """One detection and the box that it was matched with."""

    camera_px: PointPx
    length_px: float
    confidence: float
    box: int | None
    """Number of its box in its picture; None where it lies in none that was left: a false one."""
    offset_px: PointPx | None
    """From the box's centre to the point, (u, v); None for a false one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """One picture: its labels and all that was found in it, surest first."""

    boxes: tuple[Box, ...]
    finds: tuple[Find, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates:
    """How well a detector does where only what is at least `confidence` sure counts."""

    confidence: float
    precision: float | None
    """Share of the finds that are cars; None where nothing was found."""
    recall: float | None
    """Share of the cars that were found; None where there are none."""

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall; 0 where either is 0 or unknown."""
        if not self.precision or not self.recall:
            return 0.0
        return 2.0 * self.precision * self.recall / (self.precision + self.recall)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Distances from points to the centres of their boxes, camera px."""

    p50: float
    p95: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """A detector on a set of labelled pictures."""

    at: Rates
    """At the confidence asked for."""
    images: int
    cars: int
    found: int
    false: int
    centre_error_px: Spread | None
    """Of the cars found at that confidence; None where there are none."""
    mean_offset_px: PointPx | None
    """Mean offset (u, v) of the same from the boxes' centres."""
    best: Rates | None
    """At the confidence with the highest F1; None where no car was found at any."""
    table: tuple[Rates, ...]
    """From the confidence asked for upwards."""


def judge(detections: Iterable[Detection], boxes: Sequence[Box]) -> Judged:
    """The detections in one picture, matched with its `boxes`."""
    left = dict(enumerate(boxes))
    finds = []
    for one in sorted(detections, key=lambda found: (-found.confidence, found.camera_px)):
        inside = [(math.dist(_centre(box), one.camera_px), number) for number, box in left.items() if _holds(box, one)]
        number = min(inside)[1] if inside else None
        offset = None
        if number is not None:
            centre = _centre(left.pop(number))
            offset = (one.camera_px[0] - centre[0], one.camera_px[1] - centre[1])
        finds.append(
            Find(
                camera_px=one.camera_px,
                length_px=one.length_px,
                confidence=one.confidence,
                box=number,
                offset_px=offset,
            )
        )
    return Judged(boxes=tuple(boxes), finds=tuple(finds))


def _holds(box: Box, found: Detection) -> bool:
    u, v = found.camera_px
    return box[0] <= u <= box[2] and box[1] <= v <= box[3]


def _centre(box: Box) -> PointPx:
    return (box[0] + box[2]) / 2.0, (box[1] + box[3]) / 2.0


def above(picture: Judged, confidence: float) -> Judged:
    """The picture with only those finds that are at least `confidence` sure."""
    return Judged(boxes=picture.boxes, finds=tuple(find for find in picture.finds if find.confidence >= confidence))


def rates(pictures: Sequence[Judged], confidence: float) -> Rates:
    """Precision and recall over all the pictures at one threshold."""
    hits = [find.box is not None for one in pictures for find in above(one, confidence).finds]
    cars = sum(len(one.boxes) for one in pictures)
    return Rates(
        confidence=confidence,
        precision=sum(hits) / len(hits) if hits else None,
        recall=sum(hits) / cars if cars else None,
    )


def figures(pictures: Sequence[Judged], confidence: float) -> Figures:
    """All figures over the pictures, where finds of at least `confidence` count."""
    counted = [find for one in pictures for find in above(one, confidence).finds]
    offsets = np.array([find.offset_px for find in counted if find.offset_px is not None], dtype=np.float64)
    errors = np.hypot(*offsets.T) if len(offsets) else None
    levels = [round(step * TABLE_STEP, 6) for step in range(1, round(1 / TABLE_STEP))]
    return Figures(
        at=rates(pictures, confidence),
        images=len(pictures),
        cars=sum(len(one.boxes) for one in pictures),
        found=len(offsets),
        false=len(counted) - len(offsets),
        centre_error_px=None
        if errors is None
        else Spread(p50=float(np.percentile(errors, 50)), p95=float(np.percentile(errors, 95))),
        mean_offset_px=None if errors is None else (float(offsets[:, 0].mean()), float(offsets[:, 1].mean())),
        best=_best(pictures),
        table=tuple(rates(pictures, level) for level in (confidence, *(one for one in levels if one > confidence))),
    )


def _best(pictures: Sequence[Judged]) -> Rates | None:
    """Rates at the find's confidence that gives the highest F1, the surest of those that are alike."""
    finds = sorted((find for one in pictures for find in one.finds), key=lambda find: -find.confidence)
    cars = sum(len(one.boxes) for one in pictures)
    best: Rates | None = None
    hits = 0
    for count, find in enumerate(finds, 1):
        hits += find.box is not None
        if count < len(finds) and finds[count].confidence == find.confidence:
            continue  # a threshold takes all that are alike
        now = Rates(confidence=find.confidence, precision=hits / count, recall=hits / cars if cars else None)
        if now.f1 > (0.0 if best is None else best.f1):
            best = now
    return best


def missed(picture: Judged) -> tuple[int, ...]:
    """Numbers of the boxes in which nothing was found."""
    hit = {find.box for find in picture.finds}
    return tuple(number for number in range(len(picture.boxes)) if number not in hit)


def worst(pictures: Sequence[Judged], confidence: float, most: int) -> list[int]:
    """Numbers of at most `most` pictures with a missed car or a false find, those with most of them first.

    Of pictures with as many, the one with the surer false find goes first.
    """
    ranked = []
    for number, picture in enumerate(pictures):
        kept = above(picture, confidence)
        false = [find.confidence for find in kept.finds if find.box is None]
        faults = len(missed(kept)) + len(false)
        if faults:
            ranked.append((-faults, -max(false, default=0.0), number))
    return [number for _, _, number in sorted(ranked)[:most]]
