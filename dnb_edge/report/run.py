"""A finished run as the report and the result table see it: its events gathered, nothing computed anew.

Knows events, the track and where a lap's path starts and ends. Knows no recording, no picture and no page: the command
line fills a `RunResult` from a live run or from a recording alike.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dnb_edge.race.edit import Edit
from dnb_edge.race.marshal import Marshalled
from dnb_edge.report.health import HealthHistory
from dnb_edge.report.vehicle import VehicleTold
from dnb_edge.track.model import FINISH_LINE, START_LINE, Track
from dnb_edge.values import (
    BgrImage,
    Crossing,
    EntryInfo,
    Event,
    Health,
    Incident,
    Lap,
    Observation,
    Points,
    RunSummary,
    Score,
    Standings,
    path_points,
)

Stamps: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StampedPath:
    """A lap's driven path with the instants of its points."""

    t_ns: Stamps
    """(n,), rising."""
    track_m: Points
    """(n, 2), track m."""


class Sightings:
    """Where and when cars were seen: what a path needs of observations, in a fiftieth of their room."""

    _NOBODY = -1
    """Stands for no target in the column; the ids of targets are not negative."""

    def __init__(self, observations: Iterable[Observation] = ()) -> None:
        """Takes in the `observations`."""
        self._t_ns, self._target = array("q"), array("q")
        self._x_m, self._y_m = array("d"), array("d")
        for observation in observations:
            self.add(observation)

    def __len__(self) -> int:
        """Number of observations."""
        return len(self._t_ns)

    def add(self, observation: Observation) -> None:
        """Takes in one more."""
        x_m, y_m = observation.track_m
        self._t_ns.append(observation.t_ns)
        self._x_m.append(x_m)
        self._y_m.append(y_m)
        self._target.append(self._NOBODY if observation.target_id is None else observation.target_id)

    @property
    def frames(self) -> int:
        """In how many frames anything was seen."""
        return len(np.unique(np.frombuffer(self._t_ns, dtype=np.int64))) if self._t_ns else 0

    def sorted(self) -> SortedSightings:
        """The same as arrays in the order of time; of one instant in that of their taking in."""
        t_ns = np.array(self._t_ns, dtype=np.int64)
        track_m = np.empty((len(t_ns), 2))
        track_m[:, 0], track_m[:, 1] = self._x_m, self._y_m
        target_id = np.array(self._target, dtype=np.int64)
        if (np.diff(t_ns) < 0).any():
            order = np.argsort(t_ns, kind="stable")
            t_ns, track_m, target_id = t_ns[order], track_m[order], target_id[order]
        return SortedSightings(t_ns=t_ns, track_m=track_m, target_id=target_id, known=target_id != self._NOBODY)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SortedSightings:
    """What was seen, in the order of time."""

    t_ns: Stamps
    """(n,)."""
    track_m: Points
    """(n, 2), track m."""
    target_id: NDArray[np.int64]
    """(n,), where `known`."""
    known: NDArray[np.bool_]
    """(n,), whether it is known what target it was."""

    def of_targets(self, targets: Iterable[int]) -> SortedSightings:
        """What was seen of these targets."""
        mine = self.known & np.isin(self.target_id, list(targets))
        return SortedSightings(
            t_ns=self.t_ns[mine], track_m=self.track_m[mine], target_id=self.target_id[mine], known=self.known[mine]
        )

    def between(self, start_t_ns: int, end_t_ns: int, drivers: Iterable[int]) -> StampedPath:
        """The path of what was seen later than the one instant and earlier than the other, each instant once; of no other
        targets than `drivers`, as far as the targets are known, and of all where there are none."""
        first = int(np.searchsorted(self.t_ns, start_t_ns, side="right"))
        part = slice(first, max(first, int(np.searchsorted(self.t_ns, end_t_ns, side="left"))))
        t_ns, track_m = self.t_ns[part], self.track_m[part]
        wanted = list(drivers)
        if wanted:
            mine = ~self.known[part] | np.isin(self.target_id[part], wanted)
            t_ns, track_m = t_ns[mine], track_m[mine]
        new = np.diff(t_ns, prepend=t_ns[:1] - 1) > 0
        return StampedPath(t_ns=t_ns[new], track_m=track_m[new])


@dataclass(frozen=True, slots=True, kw_only=True)
class RulesInForce:
    """By which rules the laps of a result were judged."""

    name: str
    """The rule set's."""
    version: str
    digest: str
    """Stands for all rules in force."""
    changed: str | None = None
    """What was changed since the run itself, in words; None where nothing was."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RunResult:
    """One run of one entry. `paths_m` goes with `laps`, one for one, and `stamps_ns` with `paths_m`."""

    entry: str
    """Who drove: the name in the result table."""
    source_uri: str
    track: Track
    laps: tuple[Lap, ...] = ()
    scores: tuple[Score, ...] = ()
    """At most one a lap, joined to it by `Score.lap` and the car."""
    crossings: tuple[Crossing, ...] = ()
    paths_m: tuple[Points, ...] = ()
    """The driven path of each lap, (n, 2), track m; (0, 2) where it was not seen."""
    stamps_ns: tuple[Stamps, ...] = ()
    """When the points of each path were passed, (n,), rising; empty altogether where that is not known."""
    driver: EntryInfo | None = None
    """The entry with all that is known of it; None where there is no more than its name."""
    session: str | None = None
    rules: RulesInForce | None = None
    """None where they are not known."""
    raw_laps: tuple[Lap, ...] = ()
    """As the race made them, before a judge's edits; empty where there are none of those."""
    edits: tuple[Edit, ...] = ()
    """A judge's, all of them; they are laid over `laps` already."""
    marshalled: Marshalled | None = None
    """What the edits came to, lap by lap; None where there are none."""
    incidents: tuple[Incident, ...] = ()
    thumbnails: Mapping[tuple[int, int], bytes] = field(default_factory=dict)
    """JPEG pictures of incidents, by (car, number)."""
    standings: Standings | None = None
    """The last ones."""
    frames: int | None = None
    detected_frames: int | None = None
    recording: str | None = None
    """Name of the recording; None where there is none."""
    warnings: tuple[str, ...] = ()
    """What a reader of the results must know, a sentence each."""
    calibration: Mapping[str, Any] = field(default_factory=dict)
    """The transformation error as `calibrate keypoints --json` prints it; empty where it is not known."""
    config: Mapping[str, Any] = field(default_factory=dict)
    """The configuration in force, plain JSON types."""
    digests: Mapping[str, str] = field(default_factory=dict)
    """Of track, calibration and rules: runs are compared where they are the same."""
    hashes: Mapping[str, str] = field(default_factory=dict)
    """SHA-256, hexadecimal, by what it is of (model, recording, ...)."""
    versions: Mapping[str, str] = field(default_factory=dict)
    """Versions of the software that took part, by name."""
    twin: BgrImage | None = None
    """The twin's picture, at the scale of `track.scale`."""
    health: HealthHistory | None = None
    """How the appliance did; None where it told nothing."""
    vehicles: tuple[VehicleTold, ...] = ()
    """What cars told of themselves."""
    began: str | None = None
    """When the first frame was, in words; None where no clock told."""
    chosen: tuple[tuple[int, int], ...] = ()
    """Laps that somebody wants to look at, by (car, number)."""

    def __post_init__(self) -> None:
        if len(self.paths_m) != len(self.laps):
            raise ValueError(f"run of {self.entry!r}: {len(self.laps)} laps with {len(self.paths_m)} paths")
        if self.stamps_ns and [*map(len, self.stamps_ns)] != [*map(len, self.paths_m)]:
            raise ValueError(f"run of {self.entry!r}: the stamps do not go with the paths, point by point")

    @classmethod
    def from_events(
        cls,
        events: Iterable[Event],
        *,
        entry: str,
        source_uri: str,
        track: Track,
        sightings: Sightings | None = None,
        **facts: Any,
    ) -> Self:
        """The result of a run that said `events`; `facts` are further fields (`twin`, `config`, ...).

        Observations that are not among the events any more are in `sightings`.
        """
        seen = Sightings() if sightings is None else sightings
        kept: list[Event] = []
        for event in events:
            if isinstance(event, Observation):
                seen.add(event)
            else:
                kept.append(event)
        laps = tuple(event for event in kept if isinstance(event, Lap))
        crossings = tuple(event for event in kept if isinstance(event, Crossing))
        gathered: dict[str, Any] = {
            "warnings": tuple(dict.fromkeys(text for one in kept if isinstance(one, Health) for text in one.warnings))
        }
        for event in kept:
            if isinstance(event, RunSummary):
                gathered |= {
                    "frames": event.frames,
                    "detected_frames": event.detected_frames,
                    "recording": event.recording,
                }
        paths = stamped_paths(laps, seen, crossings)
        return cls(
            entry=entry,
            source_uri=source_uri,
            track=track,
            laps=laps,
            scores=tuple(event for event in kept if isinstance(event, Score)),
            crossings=crossings,
            incidents=tuple(event for event in kept if isinstance(event, Incident)),
            standings=next((event for event in reversed(kept) if isinstance(event, Standings)), None),
            paths_m=tuple(path.track_m for path in paths),
            stamps_ns=tuple(path.t_ns for path in paths),
            **(gathered | facts),
        )

    def score_of(self, lap: Lap) -> Score | None:
        """The score of `lap`; None where it was not scored."""
        mine = (score for score in self.scores if (score.lap, score.target_id) == (lap.number, lap.target_id))
        return next(mine, None)

    @property
    def several_cars(self) -> bool:
        """Whether laps are of more than one car, so that a lap's number alone does not name it."""
        return len({lap.car for lap in self.laps}) > 1


def lap_paths(
    laps: Sequence[Lap], observations: Iterable[Observation], crossings: Sequence[Crossing] = ()
) -> tuple[Points, ...]:
    """The points of `stamped_paths`."""
    return tuple(path.track_m for path in stamped_paths(laps, observations, crossings))


def stamped_paths(
    laps: Sequence[Lap], observations: Sightings | Iterable[Observation], crossings: Sequence[Crossing] = ()
) -> tuple[StampedPath, ...]:
    """The driven path of each lap in the order of time: from the crossing that began the lap, over what was seen of the car, to
    the crossing that ended it, each instant once.

    Where the crossings say which target drove the lap, other targets' observations are left out.
    """
    at = {(crossing.car, crossing.t_ns): crossing for crossing in crossings if crossing.line in _LAP_LINES}
    seen = (observations if isinstance(observations, Sightings) else Sightings(observations)).sorted()
    paths = []
    for lap in laps:
        ends = [at.get((lap.car, t_ns)) for t_ns in (lap.start_t_ns, lap.end_t_ns)]
        paths.append(_path(seen, lap, ends))
    return tuple(paths)


_LAP_LINES = (START_LINE, FINISH_LINE)
"""Lines at which laps begin and end."""


def _path(seen: SortedSightings, lap: Lap, ends: Sequence[Crossing | None]) -> StampedPath:
    """The path over what was seen in `lap` and the crossings at its `ends`, as far as they are known."""
    drivers = {crossing.target_id for crossing in ends if crossing is not None}
    path = seen.between(lap.start_t_ns, lap.end_t_ns, drivers)
    first, last = ends
    return StampedPath(
        t_ns=np.concatenate([_stamp(first), path.t_ns, _stamp(last)]),
        track_m=np.concatenate([_place(first), path.track_m, _place(last)]),
    )


def _stamp(crossing: Crossing | None) -> Stamps:
    return np.array([] if crossing is None else [crossing.t_ns], dtype=np.int64)


def _place(crossing: Crossing | None) -> Points:
    return path_points([] if crossing is None else [crossing.track_m])
