"""What is drawn into the camera's picture: the lines, each car's ground point and way, its clock, its last and best lap.

Knows a `RunResult`, where each car was when, and the map from the floor to the picture. Knows no video and no file.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.race.standings import official_s
from dnb_edge.report.run import RunResult, SortedSightings
from dnb_edge.report.table import printable
from dnb_edge.track.line import DirectedLine
from dnb_edge.track.model import FINISH_LINE, START_LINE
from dnb_edge.values import BgrImage, Crossing, Lap, PassStatus, Points
from dnb_edge.view.ground import GroundMap

TRAIL_S = 3.0
"""So much of a car's way is drawn behind it."""

FRESH_S = 0.25
"""A car that was last seen longer ago than this is drawn hollow."""

GONE_S = 2.0
"""And after so long not at all."""

CAR_COLOURS = (
    (0, 140, 255),
    (255, 160, 40),
    (90, 200, 60),
    (200, 90, 220),
    (60, 220, 230),
    (230, 230, 60),
    (120, 120, 255),
)
"""By car, BGR: told apart on grey floors."""

_WHITE, _BLACK = (255, 255, 255), (0, 0, 0)
_SHIFT = 4
"""Fractional bits of the points that OpenCV draws."""

_STRIP = 0.17
"""What words take of the picture's height, about."""

_ON_ROUTE_M = 0.05
_FONT = cv2.FONT_HERSHEY_SIMPLEX


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CarRow:
    """One car over the run."""

    car: int
    name: str
    laps: tuple[Lap, ...]
    """By their end."""
    starts_t_ns: tuple[int, ...]
    """When its laps began, rising."""
    ends_t_ns: tuple[int, ...]
    """When a lap ended and none began, rising."""
    seen: SortedSightings
    """What was seen of it."""


class Overlay:
    """Draws what was known at an instant."""

    def __init__(self, result: RunResult, ground: GroundMap, seen: SortedSightings) -> None:
        """`seen` are all observations of the run, and `ground` the map for frames of the recorded size."""
        self._ground = ground
        self._result = result
        self.cars = _cars(result, seen)
        track = result.track
        self._lines = [(line.name, self._on_picture(_along(line))) for line in track.lines]
        route_m = track.centreline.points_m
        if track.centreline.closed:
            route_m = np.concatenate((route_m, route_m[:1]))
        self._route = self._on_picture(route_m)
        rows = np.concatenate([piece[:, 1] for piece in self._route] or [np.zeros(0)]) / ground.height_px
        # The words lie where less of the route is.
        self._free_below = bool((rows > 1.0 - _STRIP).sum() < (rows < _STRIP).sum())

    def draw(self, image: BgrImage, t_ns: int) -> BgrImage:
        """A copy of `image`, a frame of the size that the map is for or a smaller one, with what was known at `t_ns`."""
        drawn = image.copy()
        scale = image.shape[1] / self._ground.width_px
        wide = max(1, round(image.shape[1] / 480))
        self._draw_track(drawn, scale, wide)
        for place, car in enumerate(self.cars):
            self._draw_car(drawn, car, t_ns, CAR_COLOURS[place % len(CAR_COLOURS)], scale)
        _draw_board(drawn, [_words(car, t_ns, several=len(self.cars) > 1) for car in self.cars], below=self._free_below)
        return drawn

    def place_px(self, car: int, t_ns: int) -> tuple[float, float] | None:
        """Where the car's ground point is drawn at `t_ns`, camera px; None where it is not."""
        row = next(one for one in self.cars if one.car == car)
        at = int(np.searchsorted(row.seen.t_ns, t_ns, side="right")) - 1
        if at < 0 or t_ns - int(row.seen.t_ns[at]) > GONE_S * 1e9:
            return None
        x_m, y_m = row.seen.track_m[at].tolist()
        return self._ground.point_to_camera_px((x_m, y_m))

    def _on_picture(self, points_m: Points) -> list[Points]:
        """A line on the floor as it is seen, camera px, in pieces: what lies behind the camera is left out."""
        pieces: list[list[tuple[float, float]]] = [[]]
        for x_m, y_m in points_m.tolist():
            seen_px = self._ground.point_to_camera_px((x_m, y_m))
            if seen_px is None:
                pieces.append([])
            else:
                pieces[-1].append(seen_px)
        return [np.array(piece) for piece in pieces if len(piece) > 1]

    def _draw_track(self, image: BgrImage, scale: float, wide: int) -> None:
        for piece in self._route:
            _polyline(image, piece * scale, (190, 190, 190), wide)
        for name, pieces in self._lines:
            is_end = name in (START_LINE, FINISH_LINE)
            for piece in pieces:
                _polyline(image, piece * scale, _BLACK, 2 * wide + 2)
                _polyline(image, piece * scale, _WHITE if is_end else (0, 220, 255), 2 * wide)

    def _draw_car(self, image: BgrImage, car: CarRow, t_ns: int, colour: tuple[int, int, int], scale: float) -> None:
        at_px = self.place_px(car.car, t_ns)
        if at_px is None:
            return
        seen = car.seen
        first, last = np.searchsorted(seen.t_ns, (t_ns - round(TRAIL_S * 1e9), t_ns), side="right").tolist()
        wide = max(2, round(image.shape[1] / 320))
        for piece in self._on_picture(seen.track_m[first:last]):
            _polyline(image, piece * scale, colour, wide)
        centre = _fixed(np.array(at_px) * scale)
        radius = max(4, round(image.shape[1] / 130)) << _SHIFT
        fresh = t_ns - int(seen.t_ns[last - 1]) <= FRESH_S * 1e9
        if fresh:
            cv2.circle(image, centre, radius, colour, -1, cv2.LINE_AA, _SHIFT)
        cv2.circle(image, centre, radius, _BLACK if fresh else colour, max(1, wide // 2), cv2.LINE_AA, _SHIFT)


def _cars(result: RunResult, seen: SortedSightings) -> tuple[CarRow, ...]:
    """The cars that took part, in order; a car's sightings are those of the targets that crossed lines as it."""
    by_car: dict[int, list[Crossing]] = {}
    for crossing in result.crossings:
        by_car.setdefault(crossing.car, []).append(crossing)
    numbers = sorted({lap.car for lap in result.laps} | set(by_car)) or [1]
    names = {row.car: row.name for row in result.standings.rows} if result.standings is not None else {}
    rows = []
    for car in numbers:
        crossings = by_car.get(car, [])
        targets = sorted({crossing.target_id for crossing in crossings})
        begins = {PassStatus.START, PassStatus.LAP}
        laps = [lap for lap in result.laps if lap.car == car]
        starts = {one.t_ns for one in crossings if one.status in begins} | {lap.start_t_ns for lap in laps}
        ends = {one.t_ns for one in crossings if one.status is PassStatus.ARRIVED} - starts
        rows.append(
            CarRow(
                car=car,
                name=names.get(car, f"car {car}") if len(numbers) > 1 else result.entry,
                laps=tuple(sorted(laps, key=lambda lap: lap.end_t_ns)),
                starts_t_ns=tuple(sorted(starts)),
                ends_t_ns=tuple(sorted(ends)),
                seen=seen if len(numbers) == 1 else seen.of_targets(targets),
            )
        )
    return tuple(rows)


def _words(car: CarRow, t_ns: int, *, several: bool) -> str:
    """The car's line on the board: name, running lap with its clock, last and best lap, similarity of the last one."""
    done = [lap for lap in car.laps if lap.end_t_ns <= t_ns]
    parts = [printable(car.name)[:24]] if several or not done else []
    begun = bisect_right(car.starts_t_ns, t_ns)
    ended = bisect_right(car.ends_t_ns, t_ns)
    running = begun > 0 and (ended == 0 or car.ends_t_ns[ended - 1] < car.starts_t_ns[begun - 1])
    if running:
        number = 1 + max((lap.number for lap in done), default=0)
        parts.append(f"lap {number}  {(t_ns - car.starts_t_ns[begun - 1]) * 1e-9:.2f} s")
    if done:
        last = done[-1]
        parts.append(f"last {official_s(last):.3f}" + ("" if last.valid else " not valid"))
        valid = [official_s(lap) for lap in done if lap.valid]
        if valid:
            parts.append(f"best {min(valid):.3f}")
        if last.similarity_percent is not None:
            parts.append(f"{last.similarity_percent * last.penalty_factor:.1f} %")
    return "   ".join(parts)


def _draw_board(image: BgrImage, lines: Sequence[str], *, below: bool) -> None:
    """Words on a dark strip along the top or the bottom, as large as they fit."""
    high = max(18, round(image.shape[0] / 22))
    deep = min(high * len(lines) + high // 3, image.shape[0])
    top = image.shape[0] - deep if below else 0
    strip = image[top : top + deep]
    strip[:] = strip // 4
    for row, words in enumerate(lines):
        colour = CAR_COLOURS[row % len(CAR_COLOURS)] if len(lines) > 1 else _WHITE
        size = _font_size(words, high, image.shape[1])
        at = (high // 3, top + round(high * (row + 0.85)))
        cv2.putText(image, _ascii(words), at, _FONT, size, colour, max(1, high // 18), cv2.LINE_AA)


def _font_size(words: str, high: int, wide: int) -> float:
    """Scale of OpenCV's font, whose letters are 22 px high at 1, for a line of `high` px that is no wider than `wide` px."""
    size = 0.62 * high / 22
    (needed, _), _ = cv2.getTextSize(_ascii(words), _FONT, size, 1)
    return size * min(1.0, 0.94 * wide / max(needed, 1))


def _ascii(words: str) -> str:
    """OpenCV's font has no other letters."""
    return words.encode("ascii", "replace").decode()


def _along(line: DirectedLine) -> Points:
    """Points along a line, so that a bent picture of it is bent."""
    ends = np.array([line.start_m, line.end_m])
    count = max(2, round(float(np.hypot(*(ends[1] - ends[0]))) / _ON_ROUTE_M))
    return np.asarray(ends[0] + np.linspace(0.0, 1.0, count)[:, None] * (ends[1] - ends[0]))


def _fixed(point_px: NDArray[np.float64]) -> tuple[int, int]:
    u, v = np.round(np.clip(point_px, -1e5, 1e5) * (1 << _SHIFT)).astype(int).tolist()
    return u, v


def _polyline(image: BgrImage, points_px: Points, colour: tuple[int, int, int], wide: int) -> None:
    for start, end in pairwise(points_px):
        cv2.line(image, _fixed(start), _fixed(end), colour, wide, cv2.LINE_AA, _SHIFT)
