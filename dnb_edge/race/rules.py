"""The rules of a race, as a user can set them: what makes a lap, how a race starts and ends, who wins, what offences cost.

Knows numbers, words, their limits and which of them contradict one another, nothing else. Everything here goes into the
recording and, under its own section's name, into the configuration.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from dnb_edge.values import IncidentKind, PointM

MOST_S = 1e6
"""No time in the rules is longer, seconds (eleven days): what is longer is a slip, and nanoseconds of it overflow."""

MOST_M = 1e3
"""No length in the rules is greater, metres."""

MOST = 1_000_000
"""No count in the rules is greater."""


def _check(section: str, rules: object, names: Sequence[str], *, most: float, positive: bool = False) -> None:
    """Raises `ValueError` for the first of `names` that is given and negative (or 0 where `positive`), or above `most`."""
    for name in names:
        value, key = getattr(rules, name), f"{section}.{name}" if section else name
        if value is None:
            continue
        if not (value > 0 if positive else value >= 0):
            raise ValueError(f"{key}: {value} must {'be positive' if positive else 'not be negative'}")
        if value > most:
            raise ValueError(f"{key}: {value} is too much, at most {most:g}")


class Footprint(StrEnum):
    """Which part of the car must be beyond the lane's edge for it to be off the track."""

    CENTRE = "centre"
    """Its ground point."""
    ANY_WHEEL = "any_wheel"
    """Any corner of its footprint."""
    ALL_WHEELS = "all_wheels"
    """All four corners."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A round thing that stands on or beside the lane and must not be hit."""

    at_m: PointM
    """Its centre [x, y] on the track plane, metres from the twin's lower left corner."""
    radius_m: float
    """Its radius at the height of the car, metres."""

    def __post_init__(self) -> None:
        if not all(abs(part) <= MOST_M for part in self.at_m):
            raise ValueError(f"at_m: {list(self.at_m)} is further away than {MOST_M:g}")
        _check("", self, ("radius_m",), most=MOST_M, positive=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class LapRules:
    """What makes a lap, and what counts as an incident."""

    laps: int | None = None
    """Number of complete laps after which the run is finished; None to go on until stopped."""
    min_lap_s: float = 2.0
    """A forward crossing earlier than this after the lap's start is no lap, seconds."""
    max_lap_s: float | None = None
    """A lap that takes longer is too slow, seconds; None for no limit."""
    min_progress: float = 0.7
    """Share of the route that a lap must have driven along the route, 0..1."""
    max_gap_s: float = 1.0
    """A car that is unseen for longer is lost, seconds."""
    off_lane: Footprint = Footprint.CENTRE
    """Which part of the car must be outside: `centre`, `any_wheel` or `all_wheels`; the last two need the car's size."""
    car_length_m: float | None = None
    """Length of the car's footprint, metres."""
    car_width_m: float | None = None
    """Width of the car's footprint, metres."""
    off_lane_margin_m: float = 0.05
    """How far that part may lie beyond the lane's edge, metres."""
    off_lane_s: float = 0.3
    """A car that is further out for longer is off the track, seconds."""
    wrong_way_m: float = 0.3
    """A car that drives so far against the route goes the wrong way, metres."""
    short_cut_m: float = 0.5
    """A car that gets so much further along the route than it drove took a short cut, metres."""
    stalled_s: float = 5.0
    """A car that stands for so long has stalled, seconds."""
    lifted_m: float = 0.4
    """A car that comes back after a gap so far from where it can have driven was lifted, metres."""
    obstacles: tuple[Obstacle, ...] = ()
    """What stands on or beside the lane and must not be hit; needs the car's size."""
    collision_m: float = 0.01
    """A car whose footprint comes nearer than this to an obstacle hits it, metres: so well is its place known, about."""

    def __post_init__(self) -> None:
        if self.laps is not None and self.laps < 1:
            raise ValueError(f"race.laps: {self.laps} is too few, at least 1 is needed")
        if not 0 <= self.min_progress <= 1:
            raise ValueError(f"race.min_progress: {self.min_progress} must lie between 0 and 1")
        _check("race", self, ("max_gap_s", "stalled_s", "max_lap_s"), most=MOST_S, positive=True)
        _check("race", self, ("min_lap_s", "off_lane_s"), most=MOST_S)
        _check("race", self, ("collision_m",), most=MOST_M)
        lengths = ("car_length_m", "car_width_m", "wrong_way_m", "short_cut_m", "lifted_m")
        _check("race", self, lengths, most=MOST_M, positive=True)
        _check("race", self, ("laps",), most=MOST)
        if not abs(self.off_lane_margin_m) <= MOST_M:
            raise ValueError(f"race.off_lane_margin_m: {self.off_lane_margin_m:g} is more than {MOST_M:g}")
        if self.max_lap_s is not None and self.max_lap_s <= self.min_lap_s:
            raise ValueError(f"race.max_lap_s: {self.max_lap_s} must be more than min_lap_s, {self.min_lap_s}")
        if self.off_lane is not Footprint.CENTRE and (self.car_length_m is None or self.car_width_m is None):
            raise ValueError(f"race.off_lane: {self.off_lane.value} needs car_length_m and car_width_m")
        if self.obstacles and (self.car_length_m is None or self.car_width_m is None):
            raise ValueError("race.obstacles: whether the car hits one needs car_length_m and car_width_m")


class StartMode(StrEnum):
    """How a race begins."""

    ROLLING = "rolling"
    """With each car's first crossing of the start line."""
    GRID = "grid"
    """The cars stand before the start line; a countdown ends in the start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StartRules:
    """How a race starts."""

    mode: StartMode = StartMode.ROLLING
    """`rolling`: each car's first crossing of the start line; `grid`: standing cars and a countdown."""
    grid_m: float = 1.0
    """Length of the grid: the stretch of the route before the start line on which the cars stand, metres."""
    still_s: float = 2.0
    """Time for which all cars must have stood on the grid for the countdown to begin, seconds."""
    countdown_s: float = 3.0
    """Length of the countdown, seconds."""
    random_s: float = 0.0
    """Up to so much longer, by chance, so that nobody can guess the start, seconds."""
    seed: int = 1
    """Seed of that chance: the same seed gives the same race again."""
    jump_m: float = 0.03
    """A car that has moved further before the start has jumped it, metres."""

    def __post_init__(self) -> None:
        _check("start", self, ("grid_m", "jump_m"), most=MOST_M, positive=True)
        _check("start", self, ("still_s",), most=MOST_S, positive=True)
        _check("start", self, ("countdown_s", "random_s"), most=MOST_S)


class Ranking(StrEnum):
    """What cars are ranked by."""

    BEST_LAP = "best_lap"
    """The fastest valid lap, penalties included."""
    BEST_CONSECUTIVE = "best_consecutive"
    """The least sum of `best_of` valid laps in a row."""
    BEST_AVERAGE = "best_average"
    """The mean of the `best_of` fastest valid laps."""
    TOTAL_TIME = "total_time"
    """Most complete laps first, valid or not, then the time from the start to the end of the last, penalties included."""
    MOST_LAPS = "most_laps"
    """Most valid laps first, then the time from the start to the end of the last of them, penalties included."""
    SIMILARITY = "similarity"
    """The mean path similarity of the valid laps, as in the paper, each times its penalties' factors."""
    DRIVING_SCORE = "driving_score"
    """Completion of the wanted laps in percent (the valid ones, and what was driven of an unfinished one), times the penalties'
    factors."""
    SURVIVAL = "survival"
    """How long the car drove until an incident ended its race; then how far."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FormatRules:
    """When a race ends and who has won it. The wanted number of laps is `race.laps`."""

    time_limit_s: float | None = None
    """Time after which no new lap begins, seconds from the start (grid) or from a car's first crossing (rolling)."""
    grace_lap: bool = True
    """Whether a lap that runs when the time is up may be finished and counts."""
    rank_by: Ranking = Ranking.BEST_LAP
    """What cars are ranked by: `best_lap`, `best_consecutive`, `best_average`, `total_time`, `most_laps`, `similarity`,
    `driving_score` or `survival`."""
    best_of: int = 3
    """Number of laps for `best_consecutive` and `best_average`."""
    warm_up_laps: int = 0
    """So many laps at the beginning are shown but not ranked."""

    def __post_init__(self) -> None:
        _check("format", self, ("time_limit_s",), most=MOST_S, positive=True)
        _check("format", self, ("best_of",), most=MOST, positive=True)
        _check("format", self, ("warm_up_laps",), most=MOST)


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """What one incident of a kind costs. All of it may be zero: then it is told and nothing more."""

    seconds: float = 0.0
    """Added to the lap's time, seconds."""
    factor: float = 1.0
    """By which the score is multiplied, 0..1."""
    invalid: bool = False
    """Whether the lap is not valid."""
    dnf: bool = False
    """Whether the car's race is over."""
    free: int = 0
    """So many of the kind cost nothing, for each car and run."""

    def __post_init__(self) -> None:
        _check("", self, ("seconds",), most=MOST_S)
        _check("", self, ("free",), most=MOST)
        if not 0 <= self.factor <= 1:
            raise ValueError(f"factor: {self.factor} must lie between 0 and 1")


@dataclass(frozen=True, slots=True, kw_only=True)
class PenaltyRules:
    """What each kind of incident costs."""

    off_track: Effect = Effect(invalid=True)
    """Outside the lane by more than `race.off_lane_margin_m` for longer than `race.off_lane_s`."""
    wrong_way: Effect = Effect()
    """Against the route for more than `race.wrong_way_m`."""
    short_cut: Effect = Effect(invalid=True)
    """Further along the route than was driven, by more than `race.short_cut_m`."""
    stalled: Effect = Effect()
    """Standing for `race.stalled_s`."""
    lost: Effect = Effect(invalid=True)
    """Unseen for longer than `race.max_gap_s`."""
    lifted: Effect = Effect(invalid=True)
    """Come back more than `race.lifted_m` from where it can have driven."""
    jump_start: Effect = Effect(invalid=True)
    """Moved by more than `start.jump_m` before the start; it is charged to the first lap."""
    too_slow: Effect = Effect(invalid=True)
    """A lap that took longer than `race.max_lap_s`."""
    missed_line: Effect = Effect(invalid=True)
    """A sector line, or the start line, that was not crossed in its turn."""
    collision: Effect = Effect(invalid=True)
    """Nearer than `race.collision_m` to one of `race.obstacles`."""

    def of(self, kind: IncidentKind) -> Effect:
        """What an incident of `kind` costs."""
        effect: Effect = getattr(self, kind.value)
        return effect


@dataclass(frozen=True, slots=True, kw_only=True)
class CarSetup:
    """One car that takes part, and how it is told from the others."""

    name: str
    """What standings and boards call it."""
    marker_id: int | None = None
    """Number of its roof marker."""
    colour_bgr: tuple[float, float, float] | None = None
    """Its colour, 0..255 each."""


_LIMITED = (Ranking.TOTAL_TIME, Ranking.MOST_LAPS)
_OF_SEVERAL = (Ranking.BEST_CONSECUTIVE, Ranking.BEST_AVERAGE)
_GRID_ONLY = ("grid_m", "still_s", "countdown_s", "random_s", "jump_m")


def check_together(laps: LapRules, start: StartRules, ending: FormatRules, penalties: PenaltyRules) -> None:
    """Raises `ValueError`, a line that opens with the key, where rules that are right one by one contradict one another."""
    ranking, wanted = ending.rank_by, laps.laps
    if ranking in _LIMITED and wanted is None and ending.time_limit_s is None:
        raise ValueError(
            f"format.rank_by: {ranking.value} needs an end to the race: set race.laps or format.time_limit_s"
        )
    if ranking is Ranking.DRIVING_SCORE and wanted is None:
        raise ValueError("format.rank_by: driving_score is a share of the wanted laps: set race.laps")
    if ranking is Ranking.SURVIVAL and not any(penalties.of(kind).dnf for kind in IncidentKind):
        raise ValueError("format.rank_by: survival needs something to survive: set dnf: true for a kind in penalties")
    if ranking is Ranking.SURVIVAL and wanted is not None:
        raise ValueError(
            "race.laps: the slowest would be longest at them and win by survival: leave it out, and set format.time_limit_s "
            "or another format.rank_by"
        )
    if wanted is not None and ending.warm_up_laps >= wanted:
        raise ValueError(
            f"format.warm_up_laps: {ending.warm_up_laps} leaves none of race.laps, {wanted}, to be ranked: set fewer"
        )
    ranked = None if wanted is None else wanted - ending.warm_up_laps
    if ranking in _OF_SEVERAL and ranked is not None and ending.best_of > ranked:
        raise ValueError(f"format.best_of: only {ranked} laps are ranked: set at most as many, or more race.laps")
    if start.mode is StartMode.ROLLING:
        standard = StartRules()
        for name in _GRID_ONLY:
            if getattr(start, name) != getattr(standard, name):
                raise ValueError(
                    f"start.{name}: a rolling start has no grid and no countdown: set start.mode: grid, or leave it out"
                )


def rules_digest(sections: Mapping[str, Mapping[str, Any]]) -> str:
    """Twelve hexadecimal digits that stand for a set of rules: equal rules have equal ones.

    `sections` are the rules as plain JSON types by section (`race`, `start`, `format`, `penalties`, `score`). Order and the
    spelling of numbers (3 or 3.0) do not matter. Raises `ValueError` for a number that is none.
    """
    text = json.dumps(_canonical(sections), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _canonical(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _canonical(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_canonical(item) for item in value]
    if isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return value
