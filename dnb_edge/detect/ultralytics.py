"""A detector for users' own models: ONNX files that Ultralytics exported (YOLOv8, YOLO11, YOLO26; detect and OBB).

Knows frames and settings; nothing of metres, laps or who is who. The model finds boxes; the ground point is a place in the box
that the user chooses with `shift_ratio`, and its sigma a share of the box's length.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from dnb_edge.detect.onnx import OpenModel
from dnb_edge.detect.sense import AxisSeen, AxisSense
from dnb_edge.detect.ultralytics_decode import Boxes, decode, letterbox, prepare, upright_height_px
from dnb_edge.detect.ultralytics_file import read_layout
from dnb_edge.errors import InputError
from dnb_edge.values import BgrImage, Detection, FrameDetections, SearchWindow

CORNER_TO_CENTRE_PX = 0.5
"""Ultralytics counts from the corner of the top left pixel, camera px from its centre."""
LONG_RATIO = 1.15
"""A rotated box has an axis where its longer side is as many times its shorter one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UltralyticsSettings:
    """What counts as a car, and where in its box it touches the ground."""

    classes: tuple[str | int, ...] | None = None
    """Names or numbers of the classes that are cars; None: all."""
    min_confidence: float = 0.25
    """Only what is surer counts, 0..1."""
    iou: float = 0.7
    """Of boxes of one class that overlap by more, 0..1, the surest stays; idle where NMS is inside the model."""
    shift_ratio: float = 0.0
    """The ground point lies as many box heights below the box's centre: 0 the centre, 0.5 its lower edge."""
    point_height_m: float = 0.0
    """How far above the floor that point lies, metres: 0 where the ratio already brings it down to the floor."""
    sigma_ratio: float = 0.05
    """One standard deviation of the ground point, as a share of the box's longest side. The model does not tell it: 0.05 is
    3 px for a box of 60 px."""
    most_detections: int = 300
    """At most as many boxes a frame."""

    def __post_init__(self) -> None:
        for name in ("min_confidence", "iou"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"detector.{name}: {getattr(self, name)} is not between 0 and 1")
        if not self.sigma_ratio > 0.0:
            raise ValueError(f"detector.sigma_ratio: {self.sigma_ratio} must be positive")
        if not (math.isfinite(self.point_height_m) and self.point_height_m >= 0.0):
            raise ValueError(f"detector.point_height_m: {self.point_height_m} is not a height above the floor")
        if not math.isfinite(self.shift_ratio):
            raise ValueError(f"detector.shift_ratio: {self.shift_ratio} is not a number")


class UltralyticsDetector:
    """Finds cars with a network that Ultralytics exported. Implements `detect.protocol.Detector`.

    It looks at the whole frame every time: search windows are not used, since such a model knows cars at the size that they
    have in whole pictures. State: where the last frame's rotated boxes were, which tells forward from backward.
    """

    def __init__(self, model: OpenModel, settings: UltralyticsSettings | None = None) -> None:
        """Raises InputError where the file is no such model, or has none of the wanted classes."""
        self._model = model
        self._settings = settings or UltralyticsSettings()
        self.layout = read_layout(model)
        """What the file says of itself."""
        self._classes = _class_numbers(self._settings.classes, self.layout.names, str(model.path))
        self._sense = AxisSense()

    def detect(self, image: BgrImage, *, sequence: int, t_ns: int, windows: Sequence[SearchWindow]) -> FrameDetections:  # noqa: ARG002
        """Cars in the whole of `image`, (h, w, 3), strongest first; `windows` change nothing.

        Boxes whose ground point lies outside the picture are left out. Raises WorkError where the network fails.
        """
        height_px, width_px = image.shape[:2]
        found = _found(self.boxes(image), self._settings)
        found = [
            (one, axis)
            for one, axis in found
            if -0.5 <= one.camera_px[0] <= width_px - 0.5 and -0.5 <= one.camera_px[1] <= height_px - 0.5
        ]
        seen = [AxisSeen(camera_px=one.camera_px, length_px=one.length_px, axis_rad=axis) for one, axis in found]
        headings = self._sense.headings(seen)
        detections = tuple(replace(one, heading_rad=to) for (one, _), to in zip(found, headings, strict=True))
        return FrameDetections(sequence=sequence, t_ns=t_ns, detections=detections, full_frame=True)

    def boxes(self, image: BgrImage) -> Boxes:
        """The boxes of the wanted classes in `image`, strongest first, as Ultralytics itself would give them."""
        box = letterbox(self.layout, image.shape[1], image.shape[0])
        return decode(
            self._model.run(prepare(image, box, self.layout.dtype)),
            self.layout,
            box,
            least_confidence=self._settings.min_confidence,
            iou=self._settings.iou,
            classes=self._classes,
            most=self._settings.most_detections,
        )


def _found(boxes: Boxes, settings: UltralyticsSettings) -> list[tuple[Detection, float | None]]:
    """A detection without its heading, and its axis as atan2 of (-v, u), for each box that has an area."""
    found = []
    for number in range(len(boxes.confidences)):
        (u, v), (width, height) = boxes.centres_px[number].tolist(), boxes.sizes_px[number].tolist()
        if width <= 0.0 or height <= 0.0:
            continue
        angle = 0.0 if boxes.angles_rad is None else float(boxes.angles_rad[number])
        down = settings.shift_ratio * upright_height_px(width, height, angle)
        length = max(width, height)
        detection = Detection(
            camera_px=(u - CORNER_TO_CENTRE_PX, v + down - CORNER_TO_CENTRE_PX),
            sigma_px=settings.sigma_ratio * length,
            length_px=length,
            confidence=min(1.0, float(boxes.confidences[number])),
            height_m=settings.point_height_m,
        )
        has_axis = boxes.angles_rad is not None and length >= LONG_RATIO * min(width, height)
        axis = -angle if width >= height else -angle - math.pi / 2
        found.append((detection, axis if has_axis else None))
    return found


def _class_numbers(wanted: Sequence[str | int] | None, names: Sequence[str], path: str) -> tuple[int, ...] | None:
    """The numbers of the wanted classes. Raises InputError for one that the model does not know."""
    if wanted is None:
        return None
    numbers = []
    for one in wanted:
        known = [number for number, name in enumerate(names) if one in (number, name)]
        if not known:
            some = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
            raise InputError(
                f"detector.classes: {one!r} is no class of {path}, which knows {some} (0 to {len(names) - 1})"
            )
        numbers.extend(known)
    return tuple(numbers)
