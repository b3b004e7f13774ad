"""A recording as its report shows it: raced again in little memory, with its health, its interruptions and its incidents'
pictures.

Knows recordings; knows no page. The command line and the pages make their reports through it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from dnb_edge.archive.replayed import Replayed, replay
from dnb_edge.archive.rescore import Wanted
from dnb_edge.errors import InputError
from dnb_edge.record.reader import iter_frames, iter_told
from dnb_edge.report.evidence import thumbnails
from dnb_edge.report.health import HealthFold, HealthHistory, interruptions
from dnb_edge.report.run import RunResult, Sightings, SortedSightings
from dnb_edge.report.vehicle import vehicles_told
from dnb_edge.values import Health, Observation, VehicleReport

_UNTOLD_GAP_S = 1.0
"""What counts as an interruption where the race has no such rule, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reported:
    """A recording, raced again, and what its report shows of it."""

    replayed: Replayed
    result: RunResult

    def sightings(self) -> SortedSightings:
        """All that was seen of cars, in the order of time."""
        apart = self.replayed.sightings
        if apart is None:
            apart = Sightings(event for event in self.replayed.events if isinstance(event, Observation))
        return apart.sorted()


def reported(
    path: Path, *, edits: bool = True, wanted: Wanted | None = None, laps: Sequence[tuple[int, int]] = ()
) -> Reported:
    """The recording at `path` with a judge's edits, unless they are not wanted, under the setup that `wanted` makes of the
    recorded one; `laps` are looked at more closely, by (car, number).

    Raises `InputError` where it cannot be read, and where one of `laps` is not there.
    """
    raced = replay(path, edits=edits, changed=None if wanted is None else wanted.change(path), compact=True)
    told = vehicles_told(iter_told(path, VehicleReport))
    result = replace(raced.result(), health=health_of(raced), vehicles=told, began=began(raced), chosen=tuple(laps))
    known = {(lap.car, lap.number) for lap in result.laps}
    for car, number in laps:
        if (car, number) not in known:
            raise InputError(f"{path}: there is no lap {number} of car {car}: it has {len(known)} laps")
    if result.incidents:
        result = replace(result, thumbnails=thumbnails(result.incidents, iter_frames(path)))
    return Reported(replayed=raced, result=result)


def health_of(raced: Replayed) -> HealthHistory | None:
    """How the appliance did while `raced` was recorded; None where nobody told."""
    fold = HealthFold()
    for health in iter_told(raced.path, Health):
        fold.add(health)
    gap_s = raced.setup.camera_gap_s
    return fold.history(interruptions(raced.facts.frames_t_ns, longer_than_s=_UNTOLD_GAP_S if gap_s is None else gap_s))


def began(raced: Replayed) -> str | None:
    """When the first frame was, UTC, to a second; None where the source's clock is not that of a day."""
    frames, offset_ns = raced.facts.frames_t_ns, raced.header.wall_offset_ns
    if offset_ns is None or not frames:
        return None
    try:
        moment = datetime.fromtimestamp((frames[0] + offset_ns) / 1e9, tz=UTC)
    except (OverflowError, ValueError, OSError):
        # A recording from elsewhere may say anything.
        return None
    return moment.strftime("%Y-%m-%d %H:%M:%S UTC")
