"""A finished recording, raced again from its detections: what `score`, `table` and `report` all start from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dnb_edge.core import Core, CoreSetup
from dnb_edge.errors import InputError
from dnb_edge.record.header import RunHeader
from dnb_edge.record.reader import RecordedRun, read_run
from dnb_edge.report.run import RunResult
from dnb_edge.track.twin import load_twin
from dnb_edge.values import BgrImage, Event, Lap, Observation, RunSummary


@dataclass(frozen=True, slots=True, kw_only=True)
class Replayed:
    """All that the core says of one recording."""

    path: Path
    header: RunHeader
    setup: CoreSetup
    calibration: dict[str, Any]
    """The stored calibration error, by field name."""
    hashes: dict[str, str]
    """SHA-256 of the run's inputs, by what it is of."""
    events: tuple[Event, ...]
    """In order; the last is the run's summary."""
    warnings: tuple[str, ...]

    def result(self) -> RunResult:
        """The run as tables and reports want it; with the twin's picture where that still lies where the run found it."""
        return RunResult.from_events(
            self.events,
            entry=self.header.name,
            source_uri=self.header.source.uri,
            track=self.setup.track,
            recording=self.path.name,
            warnings=self.warnings,
            calibration=self.calibration,
            config=self.header.config,
            hashes=self.hashes,
            versions=self.header.versions,
            twin=_twin(self.header.config),
        )


def replay(path: Path) -> Replayed:
    """Races the recording at `path` again. Raises `InputError` where it cannot be read or holds no setup."""
    run = read_run(path)
    try:
        setup = CoreSetup.from_dict(run.header.setup["core"])
        calibration = dict(run.header.setup["calibration"])
        hashes = dict(run.header.setup["sha256"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: its setup cannot be read ({error}): it was made by another version") from error
    return Replayed(
        path=path,
        header=run.header,
        setup=setup,
        calibration=calibration,
        hashes=hashes,
        events=tuple(_race(run, setup)),
        warnings=run.warnings,
    )


def _race(run: RecordedRun, setup: CoreSetup) -> Iterator[Event]:
    core = Core(setup)
    frames, found, laps = 0, set(), 0
    for detections in run.detections():
        frames += 1
        for event in core.step(detections):
            laps += isinstance(event, Lap)
            if isinstance(event, Observation):
                found.add(event.t_ns)
            yield event
    for event in core.finish():
        laps += isinstance(event, Lap)
        yield event
    yield RunSummary(frames=frames, detected_frames=len(found), laps=laps, recording=str(run.path))


def _twin(config: dict[str, Any]) -> BgrImage | None:
    """The twin's picture; None where it has moved since the run, since no result depends on it."""
    try:
        return load_twin(Path(config["track"]["image"]))
    except (InputError, KeyError, TypeError):
        return None
