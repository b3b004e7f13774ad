"""One recording of an archive scored again, as a worker does it: rows of plain values, whatever the recording is.

Knows what of a race goes into an archive's results. Knows nothing of who shares out the work, and of no file of results.
"""

from __future__ import annotations

import math
import resource
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dnb_edge import __version__, wire
from dnb_edge.archive.lots import Lot, at_hand
from dnb_edge.archive.replayed import Replayed, replay
from dnb_edge.archive.rescore import Loaded, changed
from dnb_edge.archive.trials import Raced, raced
from dnb_edge.errors import DnbEdgeError, InputError
from dnb_edge.record.reader import RecordedRun, read_run
from dnb_edge.report.table import Trial, official_percent, official_s
from dnb_edge.values import EntryInfo, Incident, Lap, RunSummary, Score

Row = dict[str, Any]

SCORE_FIELDS = (
    "metric",
    "dtw_mean_m",
    "frechet_m",
    "lateral_mean_m",
    "lateral_max_m",
    "lateral_p95_m",
    "speed_mean_mps",
    "speed_max_mps",
)
"""What a lap's row has of its score."""
LAP_FIELDS = (
    "start_t_ns",
    "end_t_ns",
    "start_s",
    "time_s",
    "sigma_s",
    "valid",
    "similarity_percent",
    "observed_fraction",
    "target_id",
    "penalty_s",
    "penalty_factor",
    "estimated",
)
"""What a lap's row has of the lap as it is."""


NOTHING = Loaded()
"""To be changed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """One combination of what is tried: the values by key, and what they change."""

    values: tuple[tuple[str, Any], ...] = ()
    """Plain values by key, in the order of the keys; empty where nothing is swept."""
    loaded: Loaded = NOTHING


@dataclass(frozen=True, slots=True, kw_only=True)
class LotJob:
    """A recording, and under what it is to be raced again."""

    lot: Lot
    settings: tuple[Setting, ...] = (Setting(),)
    edits: bool = True
    version: str = __version__
    """Of the software that asks: another one might compute other numbers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoredRun:
    """A recording under one combination."""

    run: Row
    laps: tuple[Row, ...] = ()
    trials: tuple[Trial, ...] = ()
    """For the table; laps without what no table tells."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoredLot:
    """All that a worker says of one recording."""

    runs: tuple[ScoredRun, ...]
    """One for each combination; a single one with an `error` where the recording cannot be read."""
    worker_peak_bytes: int
    """The most memory that the worker's process has had so far."""

    @property
    def errors(self) -> tuple[str, ...]:
        """What is the matter with it, a line each."""
        return tuple(dict.fromkeys(run.run["error"] for run in self.runs if run.run["error"] is not None))


def score_lot(job: LotJob) -> ScoredLot:
    """Races one recording again under each setting. What is wrong with it is in the result.

    Raises `InputError` where this worker is of another version than who asks.
    """
    if job.version != __version__:
        raise InputError(
            f"a worker has dnb-edge {__version__}, this is {job.version}: install the same on all machines"
        )
    runs: list[ScoredRun] = []
    scratch = ""
    try:
        with at_hand(job.lot) as path:
            scratch = str(path)
            read = read_run(path, keep_detections=True)
            for setting in job.settings:
                try:
                    runs.append(_scored(job, path, setting, read))
                except DnbEdgeError as error:
                    runs.append(failed(job.lot, _told(str(error), scratch, job.lot), setting))
    except DnbEdgeError as error:
        runs = [failed(job.lot, _told(str(error), scratch, job.lot))]
    # Linux tells kibibytes.
    return ScoredLot(runs=tuple(runs), worker_peak_bytes=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)


def failed(lot: Lot, error: str, setting: Setting | None = None) -> ScoredRun:
    """The row of a recording that could not be scored."""
    values = () if setting is None else setting.values
    return ScoredRun(run={"recording": lot.name, **dict(values), "error": error})


def _told(text: str, scratch: str, lot: Lot) -> str:
    """An error under the name by which the recording was asked for."""
    for path in (scratch, lot.path):
        if path:
            text = text.replace(path, lot.name)
    return text


def _scored(job: LotJob, path: Path, setting: Setting, read: RecordedRun) -> ScoredRun:
    change = None if setting.loaded == NOTHING else lambda setup: changed(setup, setting.loaded, path)
    replayed = replay(path, edits=job.edits, changed=change, compact=True, read=read)
    made = raced(replayed)
    keys = {"recording": job.lot.name, **dict(setting.values)}
    return ScoredRun(
        run=_run_row(keys, replayed, made, read),
        laps=tuple(_lap_rows(keys, replayed, made)),
        trials=tuple(replace(trial, laps=tuple(map(_lean, trial.laps))) for trial in made.trials),
    )


def _lean(lap: Lap) -> Lap:
    return replace(lap, sectors=(), reasons=(), suspect=())


def _conditions(made: Raced) -> Row:
    identity = made.identity
    return {
        "session": made.session,
        "task": made.task,
        "track": identity.track,
        "calibration": identity.calibration,
        "rules": identity.rules,
        "rule_set": made.setup.rules,
    }


def _run_row(keys: Row, replayed: Replayed, made: Raced, read: RecordedRun) -> Row:
    laps = [event for event in replayed.events if isinstance(event, Lap)]
    counted = [lap for trial in made.trials for lap in trial.laps]
    valid = [lap for lap in counted if lap.valid]
    summary = replayed.events[-1]
    assert isinstance(summary, RunSummary)
    first_t_ns, last_t_ns, offset_ns = read.first_t_ns, read.last_t_ns, replayed.header.wall_offset_ns
    incidents = Counter(event.kind.value for event in replayed.events if isinstance(event, Incident))
    return {
        **keys,
        "error": None,
        **_entry(replayed.header.driver),
        **_conditions(made),
        "source": replayed.header.source.uri,
        "started_unix_ns": None if first_t_ns is None or offset_ns is None else first_t_ns + offset_ns,
        "duration_s": None if first_t_ns is None or last_t_ns is None else (last_t_ns - first_t_ns) * 1e-9,
        "frames": summary.frames,
        "detected_frames": summary.detected_frames,
        "cars": len(made.trials),
        "laps": len(laps),
        "warm_up_laps": len(laps) - len(counted),
        "valid_laps": len(valid),
        "attempted_laps": sum(trial.attempted_laps for trial in made.trials),
        "best_lap_s": min(map(official_s, valid), default=None),
        "completion_time_s": _mean([official_s(lap) for lap in valid]),
        "similarity_percent": _mean([one for lap in valid if (one := official_percent(lap)) is not None]),
        "penalties": sum(len(lap.penalties) for lap in counted),
        "penalty_s": math.fsum(lap.penalty_s for lap in counted),
        "incidents": [f"{kind} {count}" for kind, count in sorted(incidents.items())],
        "dnf": [trial.dnf for trial in made.trials if trial.dnf is not None],
        "edits": len(replayed.edits),
        "lost_messages": read.lost_messages,
        "warnings": [_told_warning(text, replayed.path) for text in replayed.warnings],
    }


def _mean(values: Sequence[float]) -> float | None:
    return math.fsum(values) / len(values) if values else None


def _told_warning(text: str, path: Path) -> str:
    return text.replace(str(path), path.name)


def _entry(entry: EntryInfo) -> Row:
    return {"entry": entry.name, "version": entry.version, "checkpoint_sha256": entry.checkpoint_sha256}


def _lap_rows(keys: Row, replayed: Replayed, made: Raced) -> Sequence[Row]:
    entries = {lap.car: trial.entry for trial in made.trials for lap in trial.laps}
    scores = {(event.car, event.lap): event for event in replayed.events if isinstance(event, Score)}
    warm_up = replayed.setup.format.warm_up_laps
    rows = []
    for lap in (event for event in replayed.events if isinstance(event, Lap)):
        score = scores.get((lap.car, lap.number))
        rows.append(
            {
                **keys,
                **_entry(entries.get(lap.car, replayed.header.driver)),
                **_conditions(made),
                "car": lap.car,
                "lap": lap.number,
                "warm_up": lap.number <= warm_up,
                **{name: getattr(lap, name) for name in LAP_FIELDS},
                "official_time_s": official_s(lap),
                "official_percent": official_percent(lap),
                "reasons": list(lap.reasons),
                "suspect": list(lap.suspect),
                "penalties": [wire.to_dict(penalty) for penalty in lap.penalties],
                "sectors": [wire.to_dict(sector) for sector in lap.sectors],
                **{name: None if score is None else getattr(score, name) for name in SCORE_FIELDS},
            }
        )
    return rows
