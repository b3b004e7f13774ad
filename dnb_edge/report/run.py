"""A finished run as the report and the result table see it: its events gathered, nothing computed anew.

Knows events, the track and where a lap's path starts and ends. Knows no recording, no picture and no page: the command
line fills a `RunResult` from a live run or from a recording alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

from dnb_edge.race.edit import Edit
from dnb_edge.race.marshal import Marshalled
from dnb_edge.track.model import START_LINE, Track
from dnb_edge.values import (
    BgrImage,
    Crossing,
    Event,
    Health,
    Incident,
    Lap,
    Observation,
    PointM,
    Points,
    RunSummary,
    Score,
    Standings,
    path_points,
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RunResult:
    """One run of one entry. `paths_m` goes with `laps`, one for one."""

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
    hashes: Mapping[str, str] = field(default_factory=dict)
    """SHA-256, hexadecimal, by what it is of (model, recording, ...)."""
    versions: Mapping[str, str] = field(default_factory=dict)
    """Versions of the software that took part, by name."""
    twin: BgrImage | None = None
    """The twin's picture, at the scale of `track.scale`."""

    def __post_init__(self) -> None:
        if len(self.paths_m) != len(self.laps):
            raise ValueError(f"run of {self.entry!r}: {len(self.laps)} laps with {len(self.paths_m)} paths")

    @classmethod
    def from_events(cls, events: Iterable[Event], *, entry: str, source_uri: str, track: Track, **facts: Any) -> Self:
        """The result of a run that said `events`; `facts` are further fields (`twin`, `config`, ...)."""
        kept = tuple(events)
        laps = tuple(event for event in kept if isinstance(event, Lap))
        crossings = tuple(event for event in kept if isinstance(event, Crossing))
        observations = tuple(event for event in kept if isinstance(event, Observation))
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
        return cls(
            entry=entry,
            source_uri=source_uri,
            track=track,
            laps=laps,
            scores=tuple(event for event in kept if isinstance(event, Score)),
            crossings=crossings,
            incidents=tuple(event for event in kept if isinstance(event, Incident)),
            standings=next((event for event in reversed(kept) if isinstance(event, Standings)), None),
            paths_m=lap_paths(laps, observations, crossings),
            **(gathered | facts),
        )

    def score_of(self, lap: Lap) -> Score | None:
        """The score of `lap`; None where it was not scored."""
        mine = (score for score in self.scores if (score.lap, score.target_id) == (lap.number, lap.target_id))
        return next(mine, None)


def lap_paths(
    laps: Sequence[Lap], observations: Sequence[Observation], crossings: Sequence[Crossing] = ()
) -> tuple[Points, ...]:
    """The driven path of each lap, (n, 2), track m, in the order of time: from the crossing that began the lap, over
    what was seen of the car, to the crossing that ended it.

    Where the crossings say which target drove the lap, other targets' observations are left out.
    """
    at = {crossing.t_ns: crossing for crossing in crossings if crossing.line == START_LINE}
    return tuple(_path(lap, observations, at.get(lap.start_t_ns), at.get(lap.end_t_ns)) for lap in laps)


def _path(lap: Lap, observations: Sequence[Observation], start: Crossing | None, end: Crossing | None) -> Points:
    drivers = {crossing.target_id for crossing in (start, end) if crossing is not None}
    seen = [
        (observation.t_ns, observation.track_m)
        for observation in observations
        if lap.start_t_ns < observation.t_ns < lap.end_t_ns
        and (not drivers or observation.target_id is None or observation.target_id in drivers)
    ]
    points: list[PointM] = [track_m for _, track_m in sorted(seen)]
    if start is not None:
        points.insert(0, start.track_m)
    if end is not None:
        points.append(end.track_m)
    return path_points(points)
