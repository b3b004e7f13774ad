"""A finished recording, raced again from its detections: what `score`, `table`, `report` and `judge` all start from.

A judge's edits that lie beside the recording are laid over its laps, unless somebody does not want them.
"""

from __future__ import annotations

import gc
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dnb_edge.archive.overlay import Overlaid, RaceFacts, laid_over
from dnb_edge.archive.rescore import changes_text
from dnb_edge.core import Core, CoreSetup
from dnb_edge.core.views import ViewLog
from dnb_edge.errors import InputError
from dnb_edge.race.edit import Edit
from dnb_edge.race.marshal import Marshalled, Told
from dnb_edge.record.edits import RunIdentity, read_edits
from dnb_edge.record.header import RunHeader
from dnb_edge.record.identity import identity_of
from dnb_edge.record.reader import RecordedRun, read_run
from dnb_edge.report.run import RulesInForce, RunResult, Sightings
from dnb_edge.report.table import printable
from dnb_edge.track.twin import load_twin
from dnb_edge.values import BgrImage, Event, Lap, Observation, RunSummary, Target

"""The option of every verb that shows laps of a recording."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Replayed:
    """All that the core says of one recording."""

    path: Path
    header: RunHeader
    setup: CoreSetup
    """Under which it was raced now."""
    recorded_setup: CoreSetup
    """Under which it was raced live: the same object where nothing was changed."""
    calibration: dict[str, Any]
    """The stored calibration error, by field name."""
    hashes: dict[str, str]
    """SHA-256 of the run's inputs, by what it is of."""
    events: tuple[Event, ...]
    """In order; the last is the run's summary. A judge's edits are laid over them where there are any and they are wanted."""
    warnings: tuple[str, ...]
    run: RunIdentity
    """What tells this recording from others."""
    facts: RaceFacts
    raw_laps: tuple[Lap, ...] = ()
    """As the race made them, without edits."""
    edits: tuple[Edit, ...] = ()
    """All that were read; empty where they are not wanted."""
    marshalled: Marshalled | None = None
    """What the edits came to; None where there are none."""
    sightings: Sightings | None = None
    """Where the observations are that are not among `events`; None where they are all there."""

    def overlaid(self, edits: Sequence[Edit]) -> Overlaid:
        """This race, replayed without edits, after `edits`."""
        return laid_over(self.events, edits, self.setup, self.facts)

    def result(self) -> RunResult:
        """The run as tables and reports want it; with the twin's picture where that still lies where the run found it."""
        return RunResult.from_events(
            self.events,
            entry=self.header.name,
            source_uri=self.header.source.uri,
            track=self.setup.track,
            recording=self.path.name,
            warnings=self.warnings,
            raw_laps=() if self.marshalled is None else self.raw_laps,
            edits=self.edits,
            marshalled=self.marshalled,
            driver=self.header.driver,
            session=self.header.session,
            rules=RulesInForce(
                name=self.setup.rules,
                version=self.setup.rules_version,
                digest=self.setup.rules_digest,
                changed=None if self.setup is self.recorded_setup else changes_text(self.recorded_setup, self.setup),
            ),
            calibration=self.calibration,
            config=self.header.config,
            digests=identity_of(self.setup).to_dict(),
            hashes=self.hashes,
            versions=self.header.versions,
            twin=_twin(self.header.config),
            sightings=self.sightings,
        )


def replay(
    path: Path,
    *,
    edits: bool = True,
    changed: Callable[[CoreSetup], CoreSetup] | None = None,
    tell_running: bool = False,
    unfinished: bool = False,
    compact: bool = False,
    read: RecordedRun | None = None,
) -> Replayed:
    """Races the recording at `path` again, under the setup that `changed` makes of the recorded one, or under that itself.

    With `tell_running` its events are all that the live run said; without, they lack the running laps, which take a fifth of
    the time and change nothing else. `unfinished`: what is there of a recording that is still being written, or was cut short.
    `compact`: observations in little room and no targets, so that a day of them fits in memory; not where there are edits.
    `read`: the recording as `read_run` gives it, where it is there already.

    Raises `InputError` where it or, if wanted, the file of a judge's edits beside it cannot be read, and what `changed` raises.
    """
    run = read if read is not None else read_run(path, keep_detections=True, tolerate_damage=unfinished)
    try:
        setup = CoreSetup.from_dict(run.header.setup["core"])
        calibration = dict(run.header.setup["calibration"])
        hashes = dict(run.header.setup["sha256"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: its setup cannot be read ({error}): it was made by another version") from error
    identity = RunIdentity.of(run.header, run.first_t_ns)
    log = read_edits(path, identity) if edits else None
    recorded = setup
    if changed is not None:
        setup = changed(recorded)
    sightings = Sightings() if compact and not (log and log.edits) else None
    events, facts = _race(run, setup, tell_running=tell_running, sightings=sightings)
    raced = Replayed(
        path=path,
        header=run.header,
        setup=setup,
        recorded_setup=recorded,
        calibration=calibration,
        hashes=hashes,
        events=events,
        warnings=run.warnings,
        run=identity,
        facts=facts,
        raw_laps=tuple(event for event in events if isinstance(event, Lap)),
        sightings=sightings,
    )
    if log is None:
        return raced
    raced = replace(raced, warnings=(*raced.warnings, *log.warnings))
    if not log.edits:
        return raced
    overlaid = raced.overlaid(log.edits)
    told = (*overlaid.marshalled.without_effect, *overlaid.marshalled.moved)
    return replace(
        raced,
        events=overlaid.events,
        edits=log.edits,
        marshalled=overlaid.marshalled,
        warnings=(*raced.warnings, *(edit_warning(one) for one in told)),
    )


def edit_warning(told: Told) -> str:
    """What is to be said of an edit, as a sentence with its number, author and subject."""
    edit = told.edit
    return f"edit {edit.number} ({edit.action.value} {edit.subject}, {printable(edit.author)}): {told.text}"


def _race(
    run: RecordedRun, setup: CoreSetup, *, tell_running: bool, sightings: Sightings | None
) -> tuple[tuple[Event, ...], RaceFacts]:
    """All that the core says, with the run's summary, and what there is to know of the frames; see `replay` on `sightings`."""
    core = Core(setup, tell_running=tell_running)
    events: list[Event] = []
    frames_t_ns = array("q")
    views = ViewLog(setup.track.centreline, camera_gap_s=setup.camera_gap_s)
    with _without_collector():
        for detections in run.race_detections():
            frames_t_ns.append(detections.t_ns)
            views.frame(detections.t_ns, detections.view_moved_m)
            told = core.step(detections)
            events += told if sightings is None else _set_apart(told, sightings)
        told = core.finish()
        events += told if sightings is None else _set_apart(told, sightings)
    found = {event.t_ns for event in events if isinstance(event, Observation)}
    laps = sum(isinstance(event, Lap) for event in events)
    summary = RunSummary(
        frames=len(frames_t_ns),
        detected_frames=len(found) if sightings is None else sightings.frames,
        laps=laps,
        recording=str(run.path),
    )
    return (*events, summary), RaceFacts(frames_t_ns=frames_t_ns, views=views, results=core.results())


def _set_apart(events: Sequence[Event], sightings: Sightings) -> Iterator[Event]:
    """The events but for observations, which go into `sightings`, and targets."""
    for event in events:
        if isinstance(event, Observation):
            sightings.add(event)
        elif not isinstance(event, Target):
            yield event


@contextmanager
def _without_collector() -> Iterator[None]:
    """Without the collector of cyclic garbage: the core makes next to none, and looking for it among all events takes a tenth
    of the time.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _twin(config: dict[str, Any]) -> BgrImage | None:
    """The twin's picture; None where it has moved since the run, since no result depends on it."""
    try:
        return load_twin(Path(config["track"]["image"]))
    except (InputError, KeyError, TypeError):
        return None
