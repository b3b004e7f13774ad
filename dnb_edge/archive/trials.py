"""A replayed recording as the result table wants it: one trial a car, and the conditions under which they drove.

Knows who drove which car; knows nothing of means.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import parse_qs

from dnb_edge.archive.replayed import Replayed, replay
from dnb_edge.archive.vehicle_told import told_inference_ms
from dnb_edge.core import CoreSetup
from dnb_edge.record.header import RunHeader
from dnb_edge.record.identity import Identity, identity_of
from dnb_edge.record.reader import read_run
from dnb_edge.report.table import Trial
from dnb_edge.values import Clock, EntryInfo, Event, Incident, IncidentKind, Lap, Standings

USUAL_TASK = "lane-following"
"""What a run is about that names no task: to follow the lane, in reality as in simulation."""

_LOOP = "loop:"
"""How the URI of a closed-loop drive begins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Raced:
    """What `table` keeps of one recording."""

    path: Path
    session: str | None
    setup: CoreSetup
    identity: Identity
    trials: tuple[Trial, ...]
    task: str = USUAL_TASK
    """What was asked of the driver."""
    warnings: tuple[str, ...] = ()
    """What a reader of the figures must know, a sentence each."""


def raced_file(path: Path, *, edits: bool = True, changed: Callable[[CoreSetup], CoreSetup] | None = None) -> Raced:
    """The recording at `path`, raced again as `replay` does, with what vehicles told in it. Raises what that raises."""
    run = read_run(path, keep_detections=True)
    return raced(replay(path, edits=edits, changed=changed, read=run), told_inference_ms(run))


def raced(replayed: Replayed, told_ms: Mapping[int, Sequence[float]] | None = None) -> Raced:
    """The trials of one recording, without warm-up laps: a car that its setup names is an entry of that name; the only car is
    the run's entry. `told_ms`: inference times that vehicles told, by car."""
    told = told_ms or {}
    identity = identity_of(replayed.setup)
    warm_up = replayed.setup.format.warm_up_laps
    laps = [event for event in replayed.events if isinstance(event, Lap) and event.number > warm_up]
    dnf, hits = _dnf(replayed), _collisions(replayed.events, warm_up)
    driver = replayed.header.driver
    alone = Trial(
        entry=driver,
        laps=tuple(laps),
        run=replayed.path.name,
        dnf=dnf.get(1),
        session=replayed.header.session,
        track=identity.track,
        calibration=identity.calibration,
        rules=identity.rules,
        simulated=replayed.header.source.clock is Clock.SIMULATED,
        seed=_asked(replayed.header, "seed"),
        wanted_laps=_wanted_laps(replayed),
        collisions=hits.get(1, 0),
        told_inference_ms=tuple(told.get(1, ())),
    )
    names = {number: car.name for number, car in enumerate(replayed.setup.cars, start=1)}
    cars = sorted({lap.car for lap in laps} | set(dnf) | set(names))
    trials: tuple[Trial, ...] = (alone,)
    if replayed.setup.motion.cars > 1 and cars:
        trials = tuple(
            replace(
                alone,
                entry=_driver_of(driver, number, names.get(number)),
                laps=tuple(lap for lap in laps if lap.car == number),
                dnf=dnf.get(number),
                collisions=hits.get(number, 0),
                told_inference_ms=tuple(told.get(number, ())),
            )
            for number in cars
        )
    return Raced(
        path=replayed.path,
        session=replayed.header.session,
        setup=replayed.setup,
        identity=identity,
        trials=trials,
        task=_task(replayed.header),
        warnings=replayed.warnings,
    )


def told_apart(runs: Sequence[Raced]) -> list[Raced]:
    """The same runs, with as much of their paths in their trials' names as tells recordings of one file name apart."""
    names = dict(zip((run.path for run in runs), _short_names([run.path for run in runs]), strict=True))
    return [replace(run, trials=tuple(replace(trial, run=names[run.path]) for trial in run.trials)) for run in runs]


def _short_names(paths: Sequence[Path]) -> list[str]:
    """For each path the file name, with as many of its folders before it as no other path ends in."""
    whole = [path.resolve().parts for path in paths]
    takes = dict.fromkeys(whole, 1)
    alike = Counter(parts[-1:] for parts in takes)
    while doubled := [parts for parts, take in takes.items() if alike[parts[-take:]] > 1]:
        for parts in doubled:
            takes[parts] += 1
        alike = Counter(parts[-take:] for parts, take in takes.items())
    return ["/".join(parts[-takes[parts] :]) for parts in whole]


def _is_loop(header: RunHeader) -> bool:
    return header.source.uri.startswith(_LOOP)


def _task(header: RunHeader) -> str:
    """The task of a closed-loop drive, as its session or else its URI names it; the usual one for all other sources."""
    if not _is_loop(header):
        return USUAL_TASK
    return header.session or _asked(header, "task") or USUAL_TASK


def _asked(header: RunHeader, name: str) -> str | None:
    """What the URI of a closed-loop drive says; None of all other sources."""
    found = parse_qs(header.source.uri.rpartition("?")[2]).get(name) if _is_loop(header) else None
    return found[0] if found else None


def _wanted_laps(replayed: Replayed) -> int | None:
    """Of a closed-loop drive, without warm-up laps."""
    laps = replayed.setup.laps.laps
    return laps - replayed.setup.format.warm_up_laps if laps is not None and _is_loop(replayed.header) else None


def _collisions(events: Iterable[Event], warm_up: int) -> Counter[int]:
    """How often each car hit something, but in warm-up laps."""
    return Counter(
        event.car
        for event in events
        if isinstance(event, Incident)
        and event.kind is IncidentKind.COLLISION
        and (event.lap is None or event.lap > warm_up)
    )


def _driver_of(entry: EntryInfo, car: int, name: str | None) -> EntryInfo:
    """Who drives one of several cars. Version and checkpoint are the run's entry's, so only a car of its name has them."""
    if name is None:
        return replace(entry, name=f"{entry.name} car {car}")
    return entry if name == entry.name else EntryInfo(name=name)


def _dnf(replayed: Replayed) -> dict[int, str | None]:
    """For each car that took part, as the last standings have it: why it did not finish; None where it did."""
    last = next((event for event in reversed(replayed.events) if isinstance(event, Standings)), None)
    return {} if last is None else {row.car: row.dnf for row in last.rows}
