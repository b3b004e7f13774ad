"""The pure core: detections in, events out. Live, over a file and over a recording it is the same object.

Knows everything from pixels on the track plane to scores, and nothing that can differ between two runs over the same
detections: it reads no clock, opens no file and knows no thread. All that it depends on is in `CoreSetup`, which goes into
the recording, so a recording can be scored again bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from dnb_edge import wire
from dnb_edge.motion.follow import Followed, Follower, MotionSettings
from dnb_edge.motion.kalman import predict
from dnb_edge.race.crossing import CrossingSettings, LineWatch
from dnb_edge.race.fix import Fix, Progress
from dnb_edge.race.laps import DrivenLap, LapMachine, LapRules, LapState
from dnb_edge.score.similarity import ScoreSettings, score_lap
from dnb_edge.track.model import START_LINE, Track
from dnb_edge.values import (
    Crossing,
    Detection,
    Event,
    FrameDetections,
    Lap,
    Observation,
    Score,
    SearchWindow,
    TargetState,
)
from dnb_edge.view.ground import GroundMap


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
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """The setup that `to_dict` wrote. Raises `InputError` or `ValueError` where a member is missing or wrong."""
        try:
            return cls(
                track=Track.from_dict(data["track"]),
                ground=GroundMap.from_dict(data["ground"]),
                motion=wire.from_dict(MotionSettings, data["motion"]),
                crossing=wire.from_dict(CrossingSettings, data["crossing"]),
                laps=wire.from_dict(LapRules, data["laps"]),
                score=wire.from_dict(ScoreSettings, data["score"]),
                not_scored_because=data["not_scored_because"],
                birth_margin_m=data["birth_margin_m"],
            )
        except KeyError as error:
            raise ValueError(f"the setup has no member {error}") from error


class Core:
    """Feed it each frame's detections in order; it returns the events that they cause, in order."""

    def __init__(self, setup: CoreSetup) -> None:
        self._setup = setup
        self._follower = Follower(setup.motion)
        self._progress = Progress(setup.track.centreline)
        self._lines = [LineWatch(line, setup.crossing) for line in (setup.track.start_line, *setup.track.sector_lines)]
        self._laps = LapMachine(setup.laps, setup.track.centreline.length_m)
        self._first_t_ns: int | None = None
        self._last_t_ns: int | None = None

    @property
    def finished(self) -> bool:
        """Whether the wanted number of laps is complete."""
        return self._laps.state is LapState.FINISHED

    @property
    def lap_state(self) -> LapState:
        """Where the car is in its run."""
        return self._laps.state

    def step(self, found: FrameDetections) -> list[Event]:
        """Takes one frame's detections. Raises `ValueError` where its stamp is not later than the one before."""
        if self._last_t_ns is not None and found.t_ns <= self._last_t_ns:
            raise ValueError(f"frame {found.sequence}: stamp {found.t_ns} ns is not later than {self._last_t_ns} ns")
        if self._first_t_ns is None:
            self._first_t_ns = found.t_ns
        self._last_t_ns = found.t_ns
        t_s = (found.t_ns - self._first_t_ns) * 1e-9
        observations = [
            observation
            for detection in found.detections
            if (observation := self._observe(detection, found.t_ns, t_s)) is not None
        ]
        on_lane = [self._on_lane(observation) for observation in observations]
        known = {target.target_id for target in self._follower.followed if target.state is not TargetState.TENTATIVE}
        events: list[Event] = []
        fixes: list[Fix] = []
        fixed_t_ns = self._progress.last_t_ns
        for target in self._follower.step(found.t_ns, observations, on_lane):
            if target.state is not TargetState.CONFIRMED and target.target_id not in known:
                continue
            seen = self._seen(target, new=target.target_id not in known, t_ns=found.t_ns)
            # There is one car: what a new target did while an older one was still seen belongs to nobody.
            seen = [observation for observation in seen if observation.t_ns > fixed_t_ns]
            events += seen
            events.append(target.as_value(t_s))
            for observation in seen:
                # The filter's estimate is of this frame only; what was seen before the confirmation is taken as observed.
                now = observation.t_ns == found.t_ns
                track_m = target.estimate.track_m if now else observation.track_m
                fixes.append(self._progress.fix(observation, target_id=target.target_id, track_m=track_m))
        return events + self._race(found.t_ns, fixes)

    def finish(self) -> list[Event]:
        """Says that no frame will follow; returns the events that were still waiting for one."""
        crossings = [crossing for line in self._lines for crossing in line.finish()]
        return self._crossed(crossings)

    def windows(self, t_ns: int) -> tuple[SearchWindow, ...]:
        """Where the followed cars are expected in the frame stamped `t_ns`; empty where the whole picture is to be searched."""
        windows = []
        for target in self._follower.followed:
            if target.state is not TargetState.CONFIRMED or t_ns < target.estimate.t_ns:
                continue
            ahead = predict(target.estimate, t_ns, self._setup.motion.acceleration_sigma_mps2)
            camera_px = self._setup.ground.point_to_camera_px(ahead.track_m)
            if camera_px is not None:
                windows.append(
                    SearchWindow(target_id=target.target_id, camera_px=camera_px, length_px=target.length_px)
                )
        return tuple(windows)

    def _observe(self, detection: Detection, t_ns: int, t_s: float) -> Observation | None:
        """The detection on the track plane; None at or beyond the horizon."""
        ground, height_m = self._setup.ground, detection.height_m
        track_m = ground.point_below_m(detection.camera_px, height_m)
        if track_m is None:
            return None
        below_px = ground.point_to_camera_px(track_m) if height_m > 0.0 else None
        jacobian = ground.jacobian(detection.camera_px) * ground.share_at(height_m)
        covariance = jacobian @ jacobian.T * detection.sigma_px**2
        return Observation(
            t_ns=t_ns,
            t_s=t_s,
            camera_px=below_px if below_px is not None else detection.camera_px,
            track_m=track_m,
            covariance_m2=(float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])),
            confidence=detection.confidence,
            length_px=detection.length_px,
        )

    def _on_lane(self, observation: Observation) -> bool:
        route = self._setup.track.centreline
        (s_m,), (d_m,) = (values.tolist() for values in route.locate(np.array([observation.track_m])))
        return route.outside_by_m(s_m, d_m) <= self._setup.birth_margin_m

    def _seen(self, target: Followed, *, new: bool, t_ns: int) -> list[Observation]:
        """The observations of a confirmed target that nobody has been told of: on confirmation, all since its birth."""
        if new:
            return list(target.pending)
        return [target.last] if target.last.t_ns == t_ns else []

    def _race(self, t_ns: int, fixes: list[Fix]) -> list[Event]:
        self._laps.frame(t_ns)
        crossings: list[Crossing] = []
        for fix in fixes:
            self._laps.fix(fix)
            for line in self._lines:
                crossings += line.feed(fix)
        for line in self._lines:
            crossings += line.tick(t_ns)
        return self._crossed(crossings)

    def _crossed(self, crossings: list[Crossing]) -> list[Event]:
        events: list[Event] = []
        for crossing in sorted(crossings, key=lambda crossing: crossing.t_ns):
            events.append(crossing)
            driven = self._laps.crossed(crossing) if crossing.line == START_LINE else None
            if driven is not None:
                events += self._scored(driven)
        return events

    def _scored(self, driven: DrivenLap) -> list[Lap | Score]:
        if self._setup.not_scored_because is not None:
            return [driven.lap]
        score = score_lap(
            np.array(driven.path_m),
            self._setup.track.centreline,
            self._setup.score,
            lap=driven.lap.number,
            completion_time_s=driven.lap.time_s,
        )
        return [replace(driven.lap, similarity_percent=score.similarity_percent), score]
