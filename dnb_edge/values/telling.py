"""What is told while a race runs, and at its end: the running lap, the standings, the appliance itself.

Frozen, slotted, keyword-only; units in the names; frames of reference and clocks as in `dnb_edge.values`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

from dnb_edge.values.following import Observation, Target
from dnb_edge.values.frames import LostFrames, PointM
from dnb_edge.values.racing import Crossing, Incident, Lap, Score


@dataclass(frozen=True, slots=True, kw_only=True)
class EntryInfo:
    """Who or what drives: a network under test, or a person."""

    name: str
    version: str = ""
    checkpoint_sha256: str | None = None
    """SHA-256 of the network's weights, hexadecimal; None for people and where nobody told it."""
    notes: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Health:
    """How the appliance itself is doing. Fields that depend on the machine's speed are None for sources that are not live."""

    t_ns: int
    t_s: float
    frames: int
    detected_frames: int
    dropped_frames: int
    """Frames lost before the detector, from gaps in the source's sequence and full queues."""
    fps: float | None
    """Frames per second over the last period, by the frames' stamps."""
    latency_ms: float | None
    """Median time from a frame's stamp to its events, over the last period; None where the source is not live."""
    display: str
    """`none`, `online` or `offline`."""
    recording: str
    """`none`, `recording` or `failed`."""
    view_error_mean_px: float | None
    view_error_mean_m: float | None
    """Both: of the points that the view was calibrated by."""
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    """What is not wrong but wants somebody's hand, such as a car that has not moved yet; sentences."""
    picture: str | None = None
    """What is wrong with the picture: `black`, `overexposed`, `covered` or `frozen`; None where it shows something."""
    view_moved_m: float | None = None
    """How far the picture has moved from where it was calibrated, the greatest displacement over the track, metres; None
    where it is not known to have moved."""
    view_sigma_m: float | None = None
    """One standard deviation of the position that the map from picture to track gives, metres, where on the route it is
    greatest; None where the calibration does not tell it."""
    latency_p95_ms: float | None = None
    latency_p99_ms: float | None = None
    """Both: of the times from a frame's stamp to its events since the run began; None where the source is not live."""
    lost: tuple[LostFrames, ...] = ()
    """Frames that never came to the detector since the run began, by reason; a reason without frames is left out."""
    queued_frames: int | None = None
    """Most frames that waited for the detector in the last period; None where the source is not live."""
    disk_free_bytes: int | None = None
    """Room where the recording goes; None without one, and for files and the simulator."""
    temperature_c: float | None = None
    """The processor's, degrees Celsius; None where the machine does not tell."""
    throttled: bool | None = None
    """Whether heat or a weak supply slows the processor down; None where the machine does not tell."""
    memory_bytes: int | None = None
    """Resident memory of the appliance; None for sources that are not live."""
    saved_laps: int | None = None
    """Laps of the race, of all cars, that a disk has acknowledged; None without a recording, and for sources that are not
    live."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSummary:
    """The last event of a run."""

    frames: int
    detected_frames: int
    laps: int
    recording: str | None
    """Path of the finished recording; None where none was asked for."""
    bad_pictures: tuple[str, ...] = ()
    """What was wrong with the picture and for how long, such as `black for 2.4 s`; empty where it was good."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Running:
    """A car's running lap, told a few times a second."""

    t_ns: int
    t_s: float
    car: int
    target_id: int | None
    lap: int
    elapsed_s: float
    track_m: PointM
    s_m: float
    d_m: float
    speed_mps: float
    similarity_percent: float | None
    """Path similarity of the lap so far; None where laps are not scored or too little is driven."""
    delta_s: float | None
    """Time behind (positive) or ahead of the car's best valid lap at the same place of the route; None before there is one."""
    ghost_m: PointM | None
    """Where the car was in its best valid lap after the same time, track m; None before there is one or after its end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleReport:
    """What a vehicle said of itself. Nobody has checked it, nothing is timed by it, and some of it may be missing."""

    t_ns: int
    """When it came to this box, on the source's clock where that is CLOCK_MONOTONIC; else the stamp of the frame raced then."""
    t_s: float
    came_ns: int
    """When it came, CLOCK_MONOTONIC."""
    car: int
    """Number of the car, as it says."""
    seq: int | None
    """Its own count of its lines; None where it counts none."""
    inference_ms: float | None
    """How long its network took, as it says."""
    steering: float | None
    """-1 (full right) to 1 (full left); None where it does not tell. Likewise:"""
    throttle: float | None
    """-1 (full reverse) to 1 (full ahead)."""
    rate_hz: float | None
    """Lines of this car that were taken in the second before; None before there are two."""
    missing: int
    """Lines of this car that never came or were over the limit, so far, by its own count."""
    refused: int
    """Lines that were no telemetry, or too many, so far, whoever sent them."""


class RacePhase(StrEnum):
    """Where a race stands, for all cars together."""

    WAITING = "waiting"
    """For the cars: to be seen, or to stand on the grid."""
    COUNTDOWN = "countdown"
    RACING = "racing"
    GRACE = "grace"
    """The time is up; running laps may be finished."""
    FINISHED = "finished"


@dataclass(frozen=True, slots=True, kw_only=True)
class RaceState:
    """A change of the race's phase, or a second of its countdown."""

    t_ns: int
    t_s: float
    phase: RacePhase
    countdown_s: float | None = None
    """Time to the start, seconds; None outside countdowns, and where the start comes by chance."""
    remaining_s: float | None = None
    """Time left to race, seconds; None where there is no limit, or it does not run yet."""
    text: str = ""
    """What is awaited or why it changed, a sentence; may be empty."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """One car's line in the standings."""

    place: int
    """From 1; tied cars share the better place."""
    tied: bool
    """True where the difference to a neighbour is less than can be told: within the 95 % interval of their uncertainties."""
    car: int
    name: str
    laps: int
    """Complete laps, valid or not."""
    valid_laps: int
    value: float | None
    """What is ranked by, in the format's unit; None where the car has none yet."""
    sigma: float | None
    """One standard deviation of `value`; None where it is a count, or there is none."""
    best_lap_s: float | None
    last_lap_s: float | None
    gap: float | None
    """Behind the leader, in the unit of `value`; None for the leader, where there is no value, and where `gap_laps` says it."""
    interval: float | None
    """Behind the car one line above, likewise."""
    penalty_s: float = 0.0
    dnf: str | None = None
    """Why the car did not finish; None where it did or still may."""
    gap_laps: int | None = None
    """Laps behind the leader, where laps are compared first (`total_time`, `most_laps`). Times of different numbers of laps
    say nothing: under `total_time`, where this is not 0, `gap` is None."""
    interval_laps: int | None = None
    """Laps behind the car one line above, likewise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Standings:
    """Who leads, after each lap and at the end."""

    t_ns: int
    t_s: float
    rank_by: str
    """What the cars are ranked by: `best_lap`, `total_time` ...; see the rules."""
    unit: str
    """Of `value`, `gap` and `interval`: `s`, `laps`, `percent`, `m`."""
    final: bool
    rows: tuple[Standing, ...]


Event: TypeAlias = (
    Observation
    | Target
    | Crossing
    | Incident
    | Lap
    | Score
    | Running
    | RaceState
    | Standings
    | Health
    | VehicleReport
    | RunSummary
)
"""Anything that the core, the appliance or a vehicle says about a race."""
