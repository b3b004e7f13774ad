"""A replayed recording as the result table wants it: one trial a car, and the conditions under which they drove.

Knows who drove which car; knows nothing of means.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from dnb_edge.archive.replayed import Replayed
from dnb_edge.core import CoreSetup
from dnb_edge.record.identity import Identity, identity_of
from dnb_edge.report.table import Trial
from dnb_edge.values import EntryInfo, Lap, Standings


@dataclass(frozen=True, slots=True, kw_only=True)
class Raced:
    """What `table` keeps of one recording."""

    path: Path
    session: str | None
    setup: CoreSetup
    identity: Identity
    trials: tuple[Trial, ...]
    warnings: tuple[str, ...] = ()
    """What a reader of the figures must know, a sentence each."""


def raced(replayed: Replayed) -> Raced:
    """The trials of one recording, without warm-up laps: a car that its setup names is an entry of that name; the only car is
    the run's entry."""
    identity = identity_of(replayed.setup)
    warm_up = replayed.setup.format.warm_up_laps
    laps = [event for event in replayed.events if isinstance(event, Lap) and event.number > warm_up]
    dnf = _dnf(replayed)
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
            )
            for number in cars
        )
    return Raced(
        path=replayed.path,
        session=replayed.header.session,
        setup=replayed.setup,
        identity=identity,
        trials=trials,
        warnings=replayed.warnings,
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
