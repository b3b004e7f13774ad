"""Before and after: how well a model does on held-out pictures, and whether it has become worse.

Knows models and labels; learns nothing. Each picture is looked at as the first that a detector sees, without a background,
which is the hardest way to find a car; the end of a drive also as in a race, following the car with a live background.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dnb_edge.detect.centre import CentreDetector, CentreDetectorSettings
from dnb_edge.detect.lean import LeanField
from dnb_edge.detect.onnx import CentreNetwork
from dnb_edge.detect.still import look_at_still
from dnb_edge.train.evaluate import Follower
from dnb_edge.train.teach_drive import Drive
from dnb_edge.train.teach_labels import CarLabel, LabelledPicture
from dnb_edge.values import Detection

LEAST_CONFIDENCE = CentreDetectorSettings().acquire_confidence
"""Confidence from which a find counts: that from which the detector reports it, as `model check` counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """How well a model does. Errors are in px of the pictures, None where nothing was found."""

    cars: int
    recall: float
    precision: float
    recall_at_no_false: float
    """Recall at a threshold above every false find."""
    error_p50_px: float | None
    error_p95_px: float | None
    followed: float | None = None
    """Share of the held-out pictures of drives in which the followed car was where its label is; None without a drive."""
    follow_error_p50_px: float | None = None
    follow_error_p95_px: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Find:
    confidence: float
    error_px: float | None
    """None for a false find."""


def _matched(found: Sequence[Detection], cars: Sequence[CarLabel]) -> list[_Find]:
    """Each find, surest first, with the nearest car that it hits and that no surer one has hit; doubtful cars hide theirs."""
    left = [car for car in cars if car.sure]
    doubtful = [car for car in cars if not car.sure]
    finds = []
    for one in sorted(found, key=lambda find: -find.confidence):
        hit = [car for car in left if car.is_hit_by(one.camera_px)]
        if hit:
            car = min(hit, key=lambda car: math.dist(car.ground_px, one.camera_px))
            left.remove(car)
            finds.append(_Find(confidence=one.confidence, error_px=math.dist(car.ground_px, one.camera_px)))
        elif not any(math.dist(car.ground_px, one.camera_px) <= car.length_px for car in doubtful):
            finds.append(_Find(confidence=one.confidence, error_px=None))
    return finds


def _percentile(values: Sequence[float], percent: float) -> float | None:
    return float(np.percentile(values, percent)) if len(values) else None


def figures(
    network: CentreNetwork, pictures: Sequence[LabelledPicture], drives: Sequence[HeldOutDrive] = ()
) -> Figures:
    """The model's figures on held-out pictures and on the ends of drives."""
    finds: list[_Find] = []
    cars = 0
    for picture in pictures:
        seen = _look_at(network, picture)
        cars += sum(car.sure for car in picture.cars)
        finds.extend(_matched(seen, picture.cars))
    sure = [find for find in finds if find.confidence >= LEAST_CONFIDENCE]
    errors = [find.error_px for find in sure if find.error_px is not None]
    highest_false = max((find.confidence for find in finds if find.error_px is None), default=0.0)
    above = sum(find.error_px is not None and find.confidence > highest_false for find in finds)
    followed = [error for drive in drives for error in drive.errors(network)]
    hits = [error for error in followed if error is not None]
    return Figures(
        cars=cars,
        recall=len(errors) / max(1, cars),
        precision=len(errors) / len(sure) if sure else 1.0,
        recall_at_no_false=above / max(1, cars),
        error_p50_px=_percentile(errors, 50),
        error_p95_px=_percentile(errors, 95),
        followed=len(hits) / len(followed) if followed else None,
        follow_error_p50_px=_percentile(hits, 50),
        follow_error_p95_px=_percentile(hits, 95),
    )


def _look_at(network: CentreNetwork, picture: LabelledPicture) -> tuple[Detection, ...]:
    """What is found in a picture: a whole round of looks at a still, the first frame's at one of a drive."""
    if picture.background is None:
        return look_at_still(network, picture.bgr)
    detector = CentreDetector(network, lean=picture.lean)
    return detector.detect(picture.bgr, sequence=0, t_ns=0, windows=()).detections


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeldOutDrive:
    """The end of a drive, to be followed as in a race."""

    drive: Drive
    first: int
    """Number of its first held-out picture."""
    cars: dict[int, tuple[CarLabel, ...]]
    """Labels of its held-out pictures, by number."""
    lean: LeanField | None = None
    """As in `LabelledPicture`."""

    def errors(self, network: CentreNetwork) -> list[float | None]:
        """Distance of the followed car from its label in each labelled picture, px; None where it was not there."""
        detector, follower = CentreDetector(network, lean=self.lean), Follower()
        out: list[float | None] = []
        for shot in self.drive():
            if shot.number < self.first:
                continue
            seen = detector.detect(
                shot.bgr, sequence=shot.number, t_ns=round(shot.t_s * 1e9), windows=follower.windows()
            )
            chosen = follower.take(seen.detections)
            cars = [car for car in self.cars.get(shot.number, ()) if car.sure]
            if cars:
                hits = [] if chosen is None else [car for car in cars if car.is_hit_by(chosen.camera_px)]
                apart = [math.dist(car.ground_px, chosen.camera_px) for car in hits if chosen is not None]
                out.append(min(apart, default=None))
        return out


_MORE_IS_BETTER = {"recall": 0.005, "precision": 0.005, "recall_at_no_false": 0.01, "followed": 0.005}
_LESS_IS_BETTER = ("error_p50_px", "error_p95_px", "follow_error_p50_px", "follow_error_p95_px")
_SAME_ERROR_PX, _SAME_ERROR_SHARE = 0.4, 0.05


def worse(before: Figures, after: Figures) -> list[str]:
    """What has become worse, a phrase each, beyond what chance does to so few pictures; none where nothing has."""
    reasons = []
    for name, slack in _MORE_IS_BETTER.items():
        old, new = getattr(before, name), getattr(after, name)
        if old is not None and (new is None or new < old - slack):
            reasons.append(f"{name} {old:.3f} -> {new if new is None else round(new, 3)}")
    for name in _LESS_IS_BETTER:
        old, new = getattr(before, name), getattr(after, name)
        if old is not None and (new is None or new > old + max(_SAME_ERROR_PX, _SAME_ERROR_SHARE * old)):
            reasons.append(f"{name} {old:.2f} -> {new if new is None else round(new, 2)}")
    # the errors of a model that finds more cars include those of the harder ones
    if after.recall > before.recall + 0.02:
        reasons = [reason for reason in reasons if not reason.startswith("error_")]
    return reasons
