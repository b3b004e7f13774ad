"""What a car did: crossings, incidents, laps and their scores.

Frozen, slotted, keyword-only; units in the names; frames of reference and clocks as in `dnb_edge.values`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from dnb_edge.values.frames import PointM, PointPx


class Direction(StrEnum):
    """Sense in which a directed line is crossed."""

    FORWARD = "forward"
    REVERSE = "reverse"


class PassStatus(StrEnum):
    """What the race made of a crossing."""

    START = "start"
    """A lap began here."""
    LAP = "lap"
    """A lap ended, and the next began."""
    ARRIVED = "arrived"
    """A lap ended, and no other began: a finish line of its own, or the end of the car's race."""
    SECTOR = "sector"
    """A sector of the running lap ended."""
    IGNORED = "ignored"
    """It changed nothing; the reason says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """The interpolated instant at which the car's ground point crossed a line, and what the race made of it."""

    t_ns: int
    t_s: float
    line: str
    direction: Direction
    sigma_s: float
    """One standard deviation of the instant, seconds."""
    track_m: PointM
    target_id: int
    estimated: bool
    """True where the crossing fell into a gap without observations."""
    speed_mps: float | None = None
    """Speed across the line, metres per second; None in recordings from before crossings told it."""
    map_sigma_m: float = 0.0
    """One standard deviation of the map's place for the line, across it, metres. It is part of `sigma_s`, but the same at every
    crossing of this line: between two of equal speed it cancels."""
    status: PassStatus | None = None
    """None in recordings from before every pass had a status."""
    reason: str | None = None
    """Why it was ignored, a sentence; None where it was not."""
    car: int = 1
    """Number of the car in its race, from 1."""
    lap: int | None = None
    """Number of the lap that it ended or in which it lay; of the lap that it began where it ended none; None outside laps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SectorTime:
    """One sector of a lap: from one line to the next."""

    number: int
    """From 1, in the order of the lines along the route."""
    line: str
    """Name of the line that ended it."""
    time_s: float | None
    """None where one of its two lines was not crossed in its turn."""
    sigma_s: float | None


class IncidentKind(StrEnum):
    """What can happen to a car besides crossing lines."""

    OFF_TRACK = "off_track"
    """It left the lane, for longer than the rules allow."""
    WRONG_WAY = "wrong_way"
    """It drove against the route."""
    SHORT_CUT = "short_cut"
    """It left out a stretch of the route without having driven it."""
    STALLED = "stalled"
    """It stood."""
    LOST = "lost"
    """It was not seen."""
    LIFTED = "lifted"
    """It was picked up and put down elsewhere."""
    JUMP_START = "jump_start"
    """It moved before the start was given."""
    TOO_SLOW = "too_slow"
    """Its lap took longer than the rules allow."""
    MISSED_LINE = "missed_line"
    """A line was not crossed, or not in its turn."""
    COLLISION = "collision"
    """It hit a thing that stands on the track."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Incident:
    """Something that happened to a car, with its evidence. What it costs is the rule set's business."""

    number: int
    """From 1, for each car in the order in which they ended."""
    kind: IncidentKind
    car: int
    target_id: int | None
    lap: int | None
    """Number of the running lap when it began; None outside laps."""
    start_t_ns: int
    end_t_ns: int
    start_s: float
    """Its start, seconds from the first frame."""
    lasted_s: float
    greatest_m: float | None
    """How far at most, metres: beyond the lane, back along the route, or the stretch left out; None where that says nothing."""
    worst_t_ns: int
    """Stamp of the frame in which it was greatest: where to look in the recording."""
    track_m: PointM
    """Where the car was then, track m."""
    camera_px: PointPx | None
    """The same in the picture; None where the car was not seen."""
    s_m: float | None
    text: str
    """The incident as a sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Penalty:
    """What an incident, or a judge, costs a lap."""

    offence: str
    """The kind of incident, or `judge`."""
    seconds: float = 0.0
    """Added to the lap's time."""
    factor: float = 1.0
    """By which the lap's or the run's score is multiplied, 0..1."""
    invalid: bool = False
    dnf: bool = False
    """True where it ends the car's race."""
    reason: str
    incident: int | None = None
    """Number of the incident; None for a judge's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lap:
    """One complete lap, from start line to start line."""

    number: int
    start_t_ns: int
    end_t_ns: int
    start_s: float
    """Start of the lap, seconds from the first frame."""
    time_s: float
    sigma_s: float
    valid: bool
    reasons: tuple[str, ...]
    """Why the lap is not valid, as sentences; empty where it is."""
    similarity_percent: float | None
    """Path similarity by the run's metric, 0..100; None where the lap could not be scored."""
    observed_fraction: float
    """Share of the lap's frames in which the car was seen, 0..1."""
    target_id: int | None = None
    """The target that drove it; None in recordings from before laps told it."""
    suspect: tuple[str, ...] = ()
    """Why its numbers may be wrong though the drive was valid (the camera was bumped), as sentences; empty where nothing is
    known against them."""
    car: int = 1
    """Number of the car in its race, from 1."""
    sectors: tuple[SectorTime, ...] = ()
    """In the order of the route; empty where the track has no sector lines."""
    penalties: tuple[Penalty, ...] = ()
    penalty_s: float = 0.0
    """Seconds that the penalties add."""
    penalty_factor: float = 1.0
    """By which the penalties multiply a score, 0..1."""
    official_time_s: float | None = None
    """`time_s` and the penalties' seconds; None in recordings from before there were penalties."""
    estimated: bool = False
    """True where its start or its end fell into a gap without observations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """How well one lap's path matches the route."""

    lap: int
    metric: str
    """The metric behind `similarity_percent`: `dtw` or `frechet`."""
    similarity_percent: float
    dtw_mean_m: float
    """DTW distance divided by the number of points of the route, metres; with `score.symmetric`, of path and route."""
    frechet_m: float
    clamp_m: float | None
    baseline_m: float
    completion_time_s: float
    lateral_mean_m: float
    lateral_max_m: float
    path_length_m: float
    route_length_m: float
    target_id: int | None = None
    """The target that drove the lap; None in recordings from before scores told it."""
    car: int = 1
    """Number of the car in its race, from 1."""
    lateral_p95_m: float | None = None
    """95th percentile of the distance from the centreline; None in older recordings."""
    lateral_max_s_m: float | None = None
    """Where along the route, s_m, the car was farthest from the centreline."""
    lateral_bias_m: float | None = None
    """Mean of d_m, metres: positive where it kept to the left."""
    speed_mean_mps: float | None = None
    speed_max_mps: float | None = None
