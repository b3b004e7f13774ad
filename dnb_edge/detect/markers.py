"""The marker detector: printed ArUco or AprilTag squares on the cars' roofs, read by OpenCV, say which car is where.

Knows frames, search windows and how the marker is mounted; nothing of metres on the floor, laps or targets. A detection's
`camera_px` is the point straight above the car's ground point at the marker's height: `view` brings it down. With windows it
reads those, enlarged so that the marker has about the same size in each; without, and now and then, the whole frame and one
enlarged tile of it in turn. State: a count of frames, the tile in turn, and the markers read last.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.detect.codes import DICTIONARIES, CodeBook, Reading
from dnb_edge.values import BgrImage, Detection, FrameDetections, SearchWindow

_MARKER_IN_WINDOW_PX = 60.0
"""Side that a marker has in an enlarged window: sub-pixel corners gain up to here."""

_MOST_ENLARGED = 4.0
_WINDOW_LENGTHS = 1.1
"""Half the side of a window in lengths of the car: the roof is not seen where the ground point is expected."""

_WIDEST_WHOLE_PX = 1920
_TILES = (3, 2)
_TILE_OVERLAP = 0.12
_TILE_WIDTH_PX = 1280
_TILE_ENLARGED = 2.5
_SAME_PLACE = 0.4
"""Two readings within as many car lengths are of one marker: two cars do not fit there."""

_SIGMA_LEAST_PX = 0.1
_SIGMA_SIDE = 0.0025
_SIGMA_BLUR_PX = 1.6
_SIGMA_BENT = 0.01
"""What a marker's corners are worth, measured on rendered frames: at best, as a share of the side, and without confidence; and
what a side of the marker further on is wrong by, as a share of it."""

_PLACE_SIGMA_LEAST_PX = 0.5
"""Least sigma of a car's place: blur of motion, a rolling shutter, a roof that tilts and a shaking camera move all four
corners alike, which the corners themselves cannot show; a gate that believed them to a tenth of a pixel would drop good reads.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkerSettings:
    """Which markers the cars carry, and how they are mounted."""

    dictionary: str = "4X4_50"
    """Family of the markers: 4X4_50 to 7X7_1000, APRILTAG_16h5, APRILTAG_25h9, APRILTAG_36h10, APRILTAG_36h11 and so on."""
    marker_size_m: float = 0.07
    """Side of the marker's black square, metres; keep a white border of at least one cell round it."""
    marker_height_m: float = 0.1
    """Height of the marker above the floor, metres."""
    marker_ahead_m: float = 0.0
    """How far the marker's centre lies ahead of the car's centre, towards the nose, metres; negative: behind it."""
    car_length_m: float = 0.235
    """Length of the car, metres."""
    ids: tuple[int, ...] = ()
    """Numbers of the markers that are cars; none: all of the family."""
    full_look_every: int = 15
    """While cars are followed, the whole frame is looked at every n-th frame too; 0: never."""
    missing_look_every: int = 5
    """The same while one of `ids` is not seen; 0: never."""
    least_confidence: float = 0.6
    """Share of a square's light and dark that the code must explain for it to count as read, 0..1."""

    def __post_init__(self) -> None:
        """Raises `ValueError` naming the setting that makes no sense."""
        if self.dictionary not in DICTIONARIES:
            raise ValueError(f"dictionary: {self.dictionary!r} is not known: choose one of {', '.join(DICTIONARIES)}")
        for name in ("marker_size_m", "marker_height_m", "car_length_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name}: {value} must be positive")
        if not abs(self.marker_ahead_m) <= self.car_length_m:
            raise ValueError(f"marker_ahead_m: {self.marker_ahead_m} lies beyond a car of {self.car_length_m} m")
        codes = DICTIONARIES[self.dictionary].codes
        unknown = [number for number in self.ids if not 0 <= number < codes]
        if unknown:
            raise ValueError(f"ids: {unknown[0]} is not a marker of {self.dictionary}, which has 0 to {codes - 1}")
        for name in ("full_look_every", "missing_look_every"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name}: {getattr(self, name)} must not be negative")
        if not 0.0 < self.least_confidence < 1.0:
            raise ValueError(f"least_confidence: {self.least_confidence} must lie between 0 and 1")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """A rectangle of the frame and how much it is enlarged for reading."""

    left_px: int
    top_px: int
    right_px: int
    bottom_px: int
    scale: float


class MarkerDetector:
    """Finds cars by the markers on their roofs. Implements `detect.protocol.Detector`."""

    def __init__(self, settings: MarkerSettings | None = None) -> None:
        self._settings = settings or MarkerSettings()
        mine = self._settings
        self._book = CodeBook(mine.dictionary, mine.ids, least_confidence=mine.least_confidence)
        self._frames = 0
        self._tile = 0
        self._seen: frozenset[int] = frozenset()

    def detect(self, image: BgrImage, *, sequence: int, t_ns: int, windows: Sequence[SearchWindow]) -> FrameDetections:
        """Cars in `image`, (h, w, 3): in the windows, or in the whole frame where there are none; surest first."""
        height, width = image.shape[:2]
        full_frame = not windows or self._due()
        self._frames += 1
        found: list[Detection] = []
        for window in windows:
            part = self._window(window, width, height)
            if part is not None:
                found += self._read(_grey(image, part), part, closely=True)
        if full_frame:
            for part in self._whole(width, height):
                found += self._read(_grey(image, part), part, closely=False)
        detections = _merged(found)
        self._seen = frozenset(one.marker_id for one in detections if one.marker_id is not None)
        return FrameDetections(sequence=sequence, t_ns=t_ns, detections=detections, full_frame=full_frame)

    def _due(self) -> bool:
        """Whether the whole frame is to be looked at although cars are followed."""
        settings = self._settings
        every = settings.full_look_every
        if settings.missing_look_every and not frozenset(settings.ids) <= self._seen:
            every = settings.missing_look_every
        return every > 0 and self._frames % every == every - 1

    def _window(self, window: SearchWindow, width: int, height: int) -> _Part | None:
        """The window's part of the frame; None where it lies outside."""
        u, v = window.camera_px
        reach = max(16.0, _WINDOW_LENGTHS * window.length_px)
        left, top = max(0, math.floor(u - reach)), max(0, math.floor(v - reach))
        right, bottom = min(width, math.ceil(u + reach)), min(height, math.ceil(v + reach))
        if right - left < 8 or bottom - top < 8:
            return None
        expected_px = window.length_px * self._settings.marker_size_m / self._settings.car_length_m
        scale = min(_MOST_ENLARGED, max(0.25, _MARKER_IN_WINDOW_PX / max(1.0, expected_px)))
        return _Part(left_px=left, top_px=top, right_px=right, bottom_px=bottom, scale=scale)

    def _whole(self, width: int, height: int) -> list[_Part]:
        """The whole frame, and the enlarged tile whose turn it is where that shows more."""
        scale = min(1.0, _WIDEST_WHOLE_PX / width)
        parts = [_Part(left_px=0, top_px=0, right_px=width, bottom_px=height, scale=scale)]
        columns, rows = _TILES
        tile_width, tile_height = (
            round(full / n * (1 + _TILE_OVERLAP)) for full, n in ((width, columns), (height, rows))
        )
        enlarged = min(_TILE_ENLARGED, _TILE_WIDTH_PX / tile_width)
        if enlarged > 1.2 * scale:
            column, row = self._tile % columns, self._tile // columns % rows
            left = round((width - tile_width) * column / (columns - 1))
            top = round((height - tile_height) * row / (rows - 1))
            parts.append(
                _Part(left_px=left, top_px=top, right_px=left + tile_width, bottom_px=top + tile_height, scale=enlarged)
            )
            self._tile += 1
        return parts

    def _read(self, grey: NDArray[np.uint8], part: _Part, *, closely: bool) -> list[Detection]:
        """The cars in one part; `closely` reads blurred codes as well."""
        return [self._detection(reading, part) for reading in self._book.read(grey, closely=closely)]

    def _detection(self, reading: Reading, part: _Part) -> Detection:
        settings = self._settings
        corners = (reading.corners_px + 0.5) / part.scale - 0.5 + (part.left_px, part.top_px)
        # Corners go round clockwise from the top left as printed; a marker's side in camera px, as two vectors.
        up = 0.5 * (corners[0] + corners[1] - corners[2] - corners[3])
        right = 0.5 * (corners[1] + corners[2] - corners[0] - corners[3])
        sides_ahead = settings.marker_ahead_m / settings.marker_size_m
        u, v = (_crossing_of_diagonals(corners) - sides_ahead * up).tolist()
        side_px = max(float(np.hypot(*up)), float(np.hypot(*right)))
        corner_sigma = corner_sigma_px(corners, reading.confidence)
        # The centre is the mean of four corners; `up` is the difference of two means of two, and perspective bends it.
        sigma_px = math.sqrt(corner_sigma**2 * (0.25 + sides_ahead**2) + (_SIGMA_BENT * sides_ahead * side_px) ** 2)
        return Detection(
            camera_px=(u, v),
            sigma_px=math.hypot(_PLACE_SIGMA_LEAST_PX, sigma_px),
            length_px=side_px * settings.car_length_m / settings.marker_size_m,
            confidence=reading.confidence,
            heading_rad=math.atan2(-up[1], up[0]),
            marker_id=reading.number,
            height_m=settings.marker_height_m,
        )


def corner_sigma_px(corners_px: NDArray[np.float64], confidence: float) -> float:
    """One standard deviation of a marker's corners (4, 2) along either axis, camera px.

    From how far they are from a parallelogram (c0 - c1 + c2 - c3 has four times a corner's variance along each axis), never
    less than corners are worth at best; what a blurred code lost in confidence it lost in place too.
    """
    closure = corners_px[0] - corners_px[1] + corners_px[2] - corners_px[3]
    residual = float(closure @ closure) / 8.0
    side_px = float(np.linalg.norm(corners_px - np.roll(corners_px, 1, axis=0), axis=1).max())
    parts = (_SIGMA_LEAST_PX, _SIGMA_SIDE * side_px, _SIGMA_BLUR_PX * (1.0 - confidence))
    return math.sqrt(0.25 * residual + sum(part**2 for part in parts))


def _crossing_of_diagonals(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where the printed square's centre is seen: perspective moves the mean of the corners, not this."""
    a, b, c, d = corners
    across, down = c - a, d - b
    turn = across[0] * down[1] - across[1] * down[0]
    between = b - a
    along = (between[0] * down[1] - between[1] * down[0]) / turn
    return np.asarray(a + along * across)


def _grey(image: BgrImage, part: _Part) -> NDArray[np.uint8]:
    """The part in grey at the part's scale."""
    grey = cv2.cvtColor(image[part.top_px : part.bottom_px, part.left_px : part.right_px], cv2.COLOR_BGR2GRAY)
    if part.scale != 1.0:
        size = (round(grey.shape[1] * part.scale), round(grey.shape[0] * part.scale))
        grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA if part.scale < 1.0 else cv2.INTER_CUBIC)
    return np.asarray(grey, dtype=np.uint8)


def _merged(found: Sequence[Detection]) -> tuple[Detection, ...]:
    """The detections, surest first, one for each place."""
    kept: list[Detection] = []
    for one in sorted(found, key=lambda one: (-one.confidence, one.camera_px)):
        if all(math.dist(other.camera_px, one.camera_px) > _SAME_PLACE * other.length_px for other in kept):
            kept.append(one)
    return tuple(kept)
