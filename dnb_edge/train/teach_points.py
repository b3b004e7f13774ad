"""From paths to labels: where on the floor the car of each picture stands, how long it is and where it heads.

Knows the present network, looks and paths. What the label's ground point is (ADR 20):

1. *The present model's point*, where it knows the car. Its point in each picture is the median over six looks (three scales,
   each plain and mirrored), which takes out most of what depends on the pixel grid, and then lies on a smooth path through the
   pictures before and after, outliers dropped. What is left is the model's constant bias, and teaching does not add to it.
2. *The mask's point*, where the model does not know the car (it sees one in less than 40 % of the path) or where the mask says
   that it is wrong (the median of its points lies outside the middle half of the region's width, or outside the part of its
   height in which a footprint's centre can lie). The region's centroid would be too high, since what differs from the floor is
   the whole body: the point is the region's centre moved down by the same share as for hand-drawn boxes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.centre import CentreDetectorSettings
from dnb_edge.detect.decode import peaks
from dnb_edge.detect.lean import LeanField, lean_bytes
from dnb_edge.detect.looks import look_pixels, window_look
from dnb_edge.detect.onnx import CentreMaps, CentreNetwork
from dnb_edge.errors import InputError
from dnb_edge.train.teach_drive import Blob, BlobFinder, Drive, median_floor
from dnb_edge.train.teach_labels import GROUND_SHARE, CarLabel
from dnb_edge.train.teach_paths import Linker, Seen, moves_like_a_car, smoothed
from dnb_edge.values import BgrImage, PointPx

LANE_SHARE = 0.6
"""Share of a path that must lie on the lane, where the lane is known."""
AGREED_SHARE = 0.4
"""Share of a path in which the present model must see a car for its points to be the labels'."""
_MOST_BLOBS = 5
_LOOK_SCALES = (0.8, 1.0, 1.3)
_LEAST_CONFIDENCE = 0.1
_LEAST_LOOKS = 2
_LEAST_LENGTH_PX = 8.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriveLabels:
    """What a drive says of its own cars."""

    name: str
    floor: BgrImage
    """The view without cars."""
    cars: dict[int, tuple[CarLabel, ...]]
    """The cars of each picture that has any, by the picture's number."""
    times_s: dict[int, float]
    duration_s: float
    paths: int
    by_model: int
    """Paths whose ground points are the present model's."""
    lean: LeanField | None = None
    """How things lean in its pictures, where the calibration is known."""


class PointFinder:
    """Asks the present model where the car in a region stands."""

    def __init__(self, network: CentreNetwork, floor: BgrImage, lean: LeanField | None = None) -> None:
        self._network = network
        self._lean = lean
        self._floor = floor
        self._settings = CentreDetectorSettings()

    def __call__(self, picture: BgrImage, blob: Blob) -> tuple[PointPx, float] | None:
        """Ground point and length of the car in a region, px of the picture; None where the model sees none."""
        found: list[tuple[float, float, float]] = []
        for scale in _LOOK_SCALES:
            for mirrored in (False, True):
                peak = self._look(picture, blob, scale, mirrored=mirrored)
                if peak is not None:
                    found.append(peak)
        if len(found) < _LEAST_LOOKS:
            return None
        u, v, length = (float(value) for value in np.median(np.array(found), axis=0))
        return (u, v), length

    def _look(
        self, picture: BgrImage, blob: Blob, scale: float, *, mirrored: bool
    ) -> tuple[float, float, float] | None:
        settings = self._settings
        look = window_look(
            blob.centre_px,
            max(6.0, blob.length_px * scale),
            window_px=settings.window_px,
            window_length_px=settings.window_length_px,
        )
        pixels = look_pixels(picture, self._floor, look, 1.0)
        if mirrored:
            pixels = np.ascontiguousarray(pixels[:, ::-1])
        left, top, right, bottom = blob.box_px
        reach = 0.15 * blob.length_px
        for peak in peaks(self._maps(pixels, blob, mirrored=mirrored), least_confidence=_LEAST_CONFIDENCE, most=6):
            across = pixels.shape[1] - 1 - peak.u_px if mirrored else peak.u_px
            u, v = look.to_frame(across, peak.v_px)
            if left - reach <= u <= right + reach and top - reach <= v <= bottom + reach:
                return u, v, peak.length_px / look.scale
        return None

    def _maps(self, pixels: NDArray[np.uint8], blob: Blob, *, mirrored: bool) -> CentreMaps:
        """The network's answer, told the lean where that is known."""
        if self._lean is None:
            return self._network(pixels)
        lean = self._lean(np.array([blob.centre_px]))[0] * ((-1.0 if mirrored else 1.0), 1.0)
        leans = np.empty((1, *pixels.shape[:2], 2), dtype=np.uint8)
        leans[:] = lean_bytes(lean)
        return self._network.many(pixels[None], leans=leans)[0]


def label_drive(
    name: str,
    drive: Drive,
    network: CentreNetwork,
    *,
    lane: Callable[[int, int], NDArray[np.bool_]] | None = None,
    lean: Callable[[int, int], LeanField | None] | None = None,
    tell: Callable[[float], None] = lambda _: None,
) -> DriveLabels:
    """Label a drive by what moves in it. `lane(width, height)` is the mask of the lane in its pictures, where it is known, and
    `lean(width, height)` how things lean there.

    `tell` hears the share of the drive that is done. Raises InputError where nothing moves, or nothing as a car does.
    """
    floor, duration_s = median_floor(drive, name)
    height, width = floor.shape[:2]
    field = None if lean is None else lean(width, height)
    find_blobs, find_point = BlobFinder(floor), PointFinder(network, floor, field)
    linker = Linker()
    times_s: dict[int, float] = {}
    blobs: dict[int, tuple[Blob, ...]] = {}
    for shot in drive():
        found = find_blobs(shot.bgr)[:_MOST_BLOBS]
        seen = []
        for blob in found:
            point = find_point(shot.bgr, blob)
            at, length = point if point is not None else (None, None)
            seen.append(Seen(number=shot.number, t_s=shot.t_s, blob=blob, model_px=at, model_length_px=length))
        linker.take(shot.t_s, seen)
        times_s[shot.number], blobs[shot.number] = shot.t_s, found
        tell(shot.t_s / max(duration_s, 1e-9))
    if not any(blobs.values()):
        raise InputError(f"{name}: nothing moves in this drive: record one in which the car drives")
    chosen = choose_paths(linker.paths(), None if lane is None else lane(width, height))
    if not chosen:
        where = "on the lane" if lane is not None else "in this drive"
        raise InputError(
            f"{name}: nothing moves as a car does {where}: drive some laps at an even pace, with the camera standing still"
        )
    labelled = [labels_of(path, number) for number, path in enumerate(chosen)]
    return DriveLabels(
        name=name,
        floor=floor,
        cars=_by_picture(chosen, [labels for labels, _ in labelled], blobs),
        times_s=times_s,
        duration_s=duration_s,
        paths=len(chosen),
        by_model=sum(by_model for _, by_model in labelled),
        lean=field,
    )


def agreed_share(path: Sequence[Seen]) -> float:
    """Share of a path in which the present model sees a car."""
    return sum(one.model_px is not None for one in path) / len(path)


def choose_paths(paths: Sequence[Sequence[Seen]], lane: NDArray[np.bool_] | None) -> list[Sequence[Seen]]:
    """The paths of cars: those that move as one and lie on the lane.

    Where the lane is not known, people and cables move too: then those that the present model takes for cars; where it takes
    none for one, all that move as a car does, and the contact sheet is there to reject the rest.
    """
    moving = [path for path in paths if moves_like_a_car(path)]
    if lane is not None:
        return [path for path in moving if _lane_share(path, lane) >= LANE_SHARE]
    known = [path for path in moving if agreed_share(path) >= AGREED_SHARE]
    return known or moving


def _lane_share(path: Sequence[Seen], lane: NDArray[np.bool_]) -> float:
    height, width = lane.shape
    inside = 0
    for one in path:
        u, v = (round(value) for value in one.blob.foot_px)
        inside += bool(lane[min(max(v, 0), height - 1), min(max(u, 0), width - 1)])
    return inside / len(path)


def mask_point(blob: Blob) -> PointPx:
    """The ground point by the region alone: its centre, moved down as for hand-drawn boxes."""
    u, v = blob.centre_px
    return u, v + GROUND_SHARE * (blob.box_px[3] - blob.box_px[1])


def model_is_right(path: Sequence[Seen]) -> bool:
    """True where the present model knows the car of this path, and its points are where the mask lets a footprint be."""
    if agreed_share(path) < AGREED_SHARE:
        return False
    places = []
    for one in path:
        if one.model_px is not None:
            left, top, right, bottom = one.blob.box_px
            places.append(((one.model_px[0] - left) / (right - left), (one.model_px[1] - top) / (bottom - top)))
    across, down = (float(value) for value in np.median(np.array(places), axis=0))
    return 0.25 <= across <= 0.75 and 0.35 <= down <= 0.95


def labels_of(path: Sequence[Seen], number: int) -> tuple[list[CarLabel | None], bool]:
    """A label for each picture of a path, None where there is no sure one; and whether the points are the model's."""
    by_model = model_is_right(path)
    used = [one for one in path if one.model_px is not None] if by_model else list(path)
    points = np.array([one.model_px if by_model and one.model_px is not None else mask_point(one.blob) for one in used])
    times = np.array([one.t_s for one in path])
    fit = smoothed(np.array([one.t_s for one in used]), points, times)
    lengths = smoothed(times, np.log([[one.blob.length_px] for one in path])).points[:, 0]
    ratio = 1.0
    if by_model:
        # a shadow makes the region longer than the car: then the model's length is the better one
        ratios = [one.model_length_px / one.blob.length_px for one in used if one.model_length_px is not None]
        ratio = float(np.median(ratios)) if not 0.7 <= float(np.median(ratios)) <= 1.4 else 1.0
    labels: list[CarLabel | None] = []
    for index in range(len(path)):
        length = float(np.exp(lengths[index])) * ratio
        label = CarLabel(
            ground_px=(float(fit.points[index, 0]), float(fit.points[index, 1])),
            length_px=length,
            heading_rad=_heading(fit.speeds[index], length),
            path=number,
        )
        labels.append(label if fit.supported[index] and length >= _LEAST_LENGTH_PX else None)
    return labels, by_model


def _heading(speed_px: NDArray[np.float64], length_px: float) -> float | None:
    """Direction of travel in the picture; None below half a length a second, where it is noise."""
    if float(np.hypot(*speed_px)) < 0.5 * length_px:
        return None
    return math.atan2(-float(speed_px[1]), float(speed_px[0]))


def _by_picture(
    paths: Sequence[Sequence[Seen]], labels: Sequence[Sequence[CarLabel | None]], blobs: dict[int, tuple[Blob, ...]]
) -> dict[int, tuple[CarLabel, ...]]:
    """The labels of each picture that shows all its cars; other regions that differ are neither car nor floor."""
    found: dict[int, list[CarLabel]] = {}
    known: dict[int, list[Blob]] = {}
    left_out: set[int] = set()
    for path, own in zip(paths, labels, strict=True):
        numbers = {one.number for one in path}
        left_out |= {number for number in range(path[0].number, path[-1].number) if number not in numbers}
        for one, label in zip(path, own, strict=True):
            known.setdefault(one.number, []).append(one.blob)
            if label is None:
                left_out.add(one.number)
            else:
                found.setdefault(one.number, []).append(label)
    out: dict[int, tuple[CarLabel, ...]] = {}
    for number, cars in sorted(found.items()):
        if number in left_out:
            continue
        others = [blob for blob in blobs[number] if blob not in known[number]]
        doubtful = [CarLabel(ground_px=mask_point(one), length_px=one.length_px, sure=False) for one in others]
        out[number] = (*cars, *doubtful)
    return out
