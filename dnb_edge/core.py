"""The pure core: detections in, events out. Live, over a file and over a recording it is the same object.

Knows everything from pixels on the track plane to scores, and nothing that can differ between two runs over the same
detections: it reads no clock, opens no file and knows no thread. All that it depends on is in `CoreSetup`, which goes into
the recording, so a recording can be scored again bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from dnb_edge import wire
from dnb_edge.motion.appearance import Sighting
from dnb_edge.motion.follow import Follower
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.motion.target import Followed
from dnb_edge.race.car import CarRace, Passed
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.fix import Fix
from dnb_edge.race.laps import DrivenLap
from dnb_edge.race.rules import CarSetup, FormatRules, LapRules, PenaltyRules, StartRules
from dnb_edge.score.similarity import ScoreSettings, score_lap
from dnb_edge.track.model import Track
from dnb_edge.values import (
    Detection,
    Event,
    FrameDetections,
    Lap,
    Observation,
    PointM,
    Score,
    SearchWindow,
    TargetState,
)
from dnb_edge.view.calibration import Covariance9
from dnb_edge.view.ground import GroundMap

_BEFORE = {"regain_s": 0.0}
"""Settings of recordings from before these settings existed: what the core did then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CoreSetup:
    """Everything that decides what the core makes of detections."""

    track: Track
    ground: GroundMap
    motion: MotionSettings
    crossing: CrossingSettings
    laps: LapRules
    score: ScoreSettings
    not_scored_because: str | None = None
    """Why laps get no similarity (the calibration is too wrong, say); None where they get one."""
    birth_margin_m: float = 0.1
    """How far beyond the lane's edge an observation still counts as on the lane, metres."""
    start: StartRules = field(default_factory=StartRules)
    format: FormatRules = field(default_factory=FormatRules)
    penalties: PenaltyRules = field(default_factory=PenaltyRules)
    rules: str = "practice"
    """Name of the rule set."""
    cars: tuple[CarSetup, ...] = ()
    """The cars that take part, in the order of their numbers; empty: numbered as they first cross the start line."""
    map_covariance: Covariance9 | None = None
    """Covariance of the map's homography, as in `Calibration`, for frames of `ground`'s size; None where it is not known."""
    row_s: float = 0.0
    """Time from one row of the picture to the next (rolling shutter), seconds; 0 where all are seen at once or nobody knows."""

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON types; `from_dict` gives back an equal setup, bit for bit."""
        return {
            "track": self.track.to_dict(),
            "ground": self.ground.to_dict(),
            "motion": wire.to_dict(self.motion),
            "crossing": wire.to_dict(self.crossing),
            "laps": wire.to_dict(self.laps),
            "score": wire.to_dict(self.score),
            "not_scored_because": self.not_scored_because,
            "birth_margin_m": self.birth_margin_m,
            "start": wire.to_dict(self.start),
            "format": wire.to_dict(self.format),
            "penalties": wire.to_dict(self.penalties),
            "rules": self.rules,
            "cars": [wire.to_dict(car) for car in self.cars],
            "map_covariance": self.map_covariance,
            "row_s": self.row_s,
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """The setup that `to_dict` wrote. Raises `InputError` or `ValueError` where a member is missing or wrong."""
        try:
            return cls(
                track=Track.from_dict(data["track"]),
                ground=GroundMap.from_dict(data["ground"]),
                motion=wire.from_dict(MotionSettings, _BEFORE | data["motion"]),
                crossing=wire.from_dict(CrossingSettings, data["crossing"]),
                laps=wire.from_dict(LapRules, data["laps"]),
                score=wire.from_dict(ScoreSettings, data["score"]),
                not_scored_because=data["not_scored_because"],
                birth_margin_m=data["birth_margin_m"],
                start=wire.from_dict(StartRules, data.get("start", {})),
                format=wire.from_dict(FormatRules, data.get("format", {})),
                penalties=wire.from_dict(PenaltyRules, data.get("penalties", {})),
                rules=data.get("rules", "practice"),
                cars=tuple(wire.from_dict(CarSetup, car) for car in data.get("cars", ())),
                map_covariance=_matrix(data.get("map_covariance")),
                row_s=data.get("row_s", 0.0),
            )
        except KeyError as error:
            raise ValueError(f"the setup has no member {error}") from error


class Core:
    """Feed it each frame's detections in order; it returns the events that they cause, in order."""

    def __init__(self, setup: CoreSetup) -> None:
        self._setup = setup
        self._follower = Follower(setup.motion, setup.track.centreline)
        self._cars = [CarRace.begin(setup.track, setup.crossing, setup.laps) for _ in range(setup.motion.cars)]
        self._seats: dict[int, int] = {}
        self._first_t_ns: int | None = None
        self._last_t_ns: int | None = None
        # Stamps at which it changed how far the camera was known to have moved, and to what.
        self._views: list[tuple[int, float | None]] = [(0, None)]

    @property
    def finished(self) -> bool:
        """Whether as many cars as are wanted have completed the wanted number of laps."""
        return all(car.finished for car in self._cars)

    def step(self, found: FrameDetections) -> list[Event]:
        """Takes one frame's detections. Raises `ValueError` where its stamp is not later than the one before."""
        if self._last_t_ns is not None and found.t_ns <= self._last_t_ns:
            raise ValueError(f"frame {found.sequence}: stamp {found.t_ns} ns is not later than {self._last_t_ns} ns")
        if self._first_t_ns is None:
            self._first_t_ns = found.t_ns
        self._last_t_ns = found.t_ns
        if found.view_moved_m != self._views[-1][1]:
            self._views.append((found.t_ns, found.view_moved_m))
        t_s = (found.t_ns - self._first_t_ns) * 1e-9
        sightings = [
            sighting
            for detection in found.detections
            if (sighting := self._sighting(detection, found.t_ns, t_s)) is not None
        ]
        known = {target.target_id for target in self._follower.followed if target.state is not TargetState.TENTATIVE}
        targets = [
            target
            for target in self._follower.step(found.t_ns, sightings)
            if target.state is TargetState.CONFIRMED or target.target_id in known
        ]
        events: list[Event] = []
        fixes: dict[int, list[Fix]] = {}
        waiting = set()
        for target in targets:
            seat = self._seat(target.target_id)
            car = self._cars[seat]
            seen = car.news([] if _is_held(target) else target.pending)
            events += seen
            events.append(target.as_value(t_s))
            fixes[seat] = fixes.get(seat, []) + car.fixes(
                seen, target_id=target.target_id, t_ns=found.t_ns, track_m=target.estimate.track_m
            )
            if _is_held(target):
                waiting.add(seat)
        for seat, car in enumerate(self._cars):
            events += self._scored(car.frame(found.t_ns, fixes.get(seat, []), more_may_come=seat in waiting))
        return events

    def finish(self) -> list[Event]:
        """Says that no frame will follow; returns the events that were still waiting for one."""
        return [event for car in self._cars for event in self._scored(car.finish())]

    def windows(self, t_ns: int) -> tuple[SearchWindow, ...]:
        """Where the cars are expected in the frame stamped `t_ns`, one window each; none while no car is known."""
        if self._last_t_ns is None or t_ns < self._last_t_ns:
            return ()
        windows = []
        for expected in self._follower.expected(t_ns):
            camera_px = self._setup.ground.point_to_camera_px(expected.track_m)
            if camera_px is not None:
                windows.append(
                    SearchWindow(
                        target_id=expected.target_id,
                        camera_px=camera_px,
                        length_px=expected.length_px,
                    )
                )
        return tuple(windows)

    def parked(self) -> tuple[PointM, ...]:
        """Places, track m, where something that looks like a car has stood for a while and never moved."""
        return tuple(target.first.track_m for target in self._follower.parked)

    def notes(self) -> tuple[str, ...]:
        """What the core would like to be told or shown, a sentence each: parked things, as long as a car is wanted."""
        wanted = self._setup.motion.cars - sum(
            target.state is not TargetState.TENTATIVE for target in self._follower.followed
        )
        if wanted <= 0:
            return ()
        return tuple(
            f"something like a car stands at ({x:.2f}, {y:.2f}) m and has not moved: it counts once it drives"
            for x, y in self.parked()
        )

    def _suspect(self, lap: Lap) -> tuple[str, ...]:
        """Why the numbers of a lap may be wrong though it was driven well."""
        untils = [*(t_ns for t_ns, _ in self._views[1:]), lap.end_t_ns + 1]
        moved = [
            moved_m
            for (from_t_ns, moved_m), until_t_ns in zip(self._views, untils, strict=True)
            if moved_m is not None and from_t_ns <= lap.end_t_ns and until_t_ns > lap.start_t_ns
        ]
        if not moved:
            return ()
        # Farther than the track is wide nobody measures: then nothing of the view was in its place.
        if max(moved) >= float(np.ptp(self._setup.track.centreline.points_m, axis=0).max()):
            return ("the camera showed another place than when it was calibrated",)
        return (f"the camera had moved by {max(moved) * 1e3:.0f} mm since it was calibrated",)

    def _seat(self, target_id: int) -> int:
        """Which of the cars a target is; with one car in the race, every target is that car."""
        if len(self._cars) == 1:
            return 0
        return self._seats.setdefault(target_id, len(self._seats))

    def _sighting(self, detection: Detection, t_ns: int, t_s: float) -> Sighting | None:
        """The detection on the track plane; None at or beyond the horizon."""
        ground, height_m = self._setup.ground, detection.height_m
        track_m = ground.point_below_m(detection.camera_px, height_m)
        if track_m is None:
            return None
        below_px = ground.point_to_camera_px(track_m) if height_m > 0.0 else detection.camera_px
        jacobian = ground.jacobian(detection.camera_px) * ground.share_at(height_m)
        covariance = jacobian @ jacobian.T * detection.sigma_px**2
        observation = Observation(
            t_ns=t_ns,
            t_s=t_s,
            camera_px=below_px if below_px is not None else detection.camera_px,
            track_m=track_m,
            covariance_m2=(float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])),
            confidence=detection.confidence,
            length_px=detection.length_px,
        )
        return Sighting(
            observation=observation,
            on_lane=self._on_lane(observation),
            length_m=detection.length_px * math.sqrt(abs(float(np.linalg.det(jacobian)))),
            marker_id=detection.marker_id,
            colour_bgr=detection.colour_bgr,
            heading_rad=_heading_on_track(detection.heading_rad, jacobian),
        )

    def _on_lane(self, observation: Observation) -> bool:
        route = self._setup.track.centreline
        (s_m,), (d_m,) = (values.tolist() for values in route.locate(np.array([observation.track_m])))
        return route.outside_by_m(s_m, d_m) <= self._setup.birth_margin_m

    def _scored(self, passed: Sequence[Passed]) -> list[Event]:
        events: list[Event] = []
        for one in passed:
            events += self._marked_lap(one) if isinstance(one, DrivenLap) else [one]
        return events

    def _marked_lap(self, driven: DrivenLap) -> list[Lap | Score]:
        lap = replace(driven.lap, suspect=self._suspect(driven.lap))
        return self._scored_lap(replace(driven, lap=lap))

    def _scored_lap(self, driven: DrivenLap) -> list[Lap | Score]:
        if self._setup.not_scored_because is not None:
            return [driven.lap]
        score = score_lap(
            np.array(driven.path_m),
            self._setup.track.centreline,
            self._setup.score,
            lap=driven.lap.number,
            completion_time_s=driven.lap.time_s,
            lap_route_m=self._setup.track.lap_route_m(),
        )
        lap = replace(driven.lap, similarity_percent=score.similarity_percent)
        return [lap, replace(score, target_id=lap.target_id)]


def _matrix(rows: Sequence[Sequence[float]] | None) -> Covariance9 | None:
    return None if rows is None else tuple(tuple(row) for row in rows)


def _is_held(target: Followed) -> bool:
    """Whether what was seen of the target must wait; a lost one waits for nothing more."""
    return target.held and target.state is not TargetState.LOST


def _heading_on_track(heading_rad: float | None, jacobian: NDArray[np.float64]) -> float | None:
    """The direction on the track plane, atan2(dy, dx), of one in the picture, atan2(-v, u)."""
    if heading_rad is None:
        return None
    x, y = (jacobian @ (math.cos(heading_rad), -math.sin(heading_rad))).tolist()
    return math.atan2(y, x)
