"""The paper's Table I for any set of trials: entry, path similarity, completion time, how sure they are, who is alike.

Knows laps and who drove them. Both figures are means over the entry's valid laps; an entry without a valid lap did not
finish (DNF). Order of rows and all figures do not depend on the order of the trials. Knows no file and no picture; how the
table is printed is `table_text`, `table_files` and `table_latex`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Protocol

from dnb_edge.score.compare import Comparison, Estimate, Sample, compare, estimate
from dnb_edge.values import EntryInfo, Lap


class Attempt(Protocol):
    """Anything with an entry's name and its laps, such as a `RunResult`."""

    @property
    def entry(self) -> str:
        """Who drove."""

    @property
    def laps(self) -> Sequence[Lap]:
        """All laps, valid or not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What one car did in one run."""

    entry: EntryInfo
    laps: tuple[Lap, ...]
    run: str = ""
    """Name of the recording; empty where there is none."""
    dnf: str | None = None
    """Why the car did not finish the run; None where it did."""
    session: str | None = None
    track: str | None = None
    """Digest of the track that was driven; None where nobody computed it. The next two likewise."""
    calibration: str | None = None
    rules: str | None = None

    @property
    def attempted_laps(self) -> int:
        """Complete laps, and the one in which the car's race ended if that is none of them."""
        ended_in_one = any(penalty.dnf for lap in self.laps for penalty in lap.penalties)
        return len(self.laps) + (self.dnf is not None and not ended_in_one)


class RowsBy(StrEnum):
    """What one row of the table stands for."""

    ENTRY = "entry"
    RUN = "run"


@dataclass(frozen=True, slots=True, kw_only=True)
class Alike:
    """Labels of the entries that were not shown to differ, by figure."""

    similarity_percent: tuple[str, ...] = ()
    completion_time_s: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class EntryRow:
    """One row of the table: all trials of one entry, or one of them. Figures are official ones, penalties included."""

    entry: str
    """Name of the entry."""
    runs: int
    laps: int
    valid_laps: int
    finished: bool
    """False where no lap is valid: the text says DNF."""
    similarity_percent: float | None
    """Mean over the valid laps that were scored, of the runs' means where there are several, 0..100; None without any."""
    completion_time_s: float | None
    """Mean over the valid laps, of the runs' means where there are several; None without any."""
    best_lap_s: float | None
    label: str
    """What the table calls it: the name, and what else tells it from others of that name."""
    version: str
    checkpoint_sha256: str | None
    run: str | None
    """Name of the recording in a table by runs."""
    attempted_laps: int
    success_rate: float | None
    """Valid laps for each attempted one, 0..1; None where none was attempted."""
    dnf_runs: int
    """Runs in which the car did not finish."""
    penalties: int
    penalty_s: float
    """Seconds of all penalties together."""
    similarity_sd_percent: float | None
    """Standard deviation of the valid laps; None with fewer than two."""
    similarity_ci95_low_percent: float | None
    """Lower end of the mean's 95 % confidence interval; None where there is none."""
    similarity_ci95_high_percent: float | None
    similarity_group: str | None = None
    """Letters: entries that share one cannot be told apart; None where there is nothing to compare."""
    completion_time_sd_s: float | None
    completion_time_ci95_low_s: float | None
    completion_time_ci95_high_s: float | None
    completion_time_group: str | None = None
    best_lap_sigma_s: float | None
    interval_over: str | None
    """What the intervals are taken over: `laps` of one run, or `runs`; None where there is no interval."""
    indistinguishable_from: Alike = Alike()
    sessions: tuple[str, ...]
    track: str | None
    """Digest of the track; the next two are of all its calibrations and rules."""
    calibrations: tuple[str, ...]
    rules: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultTable:
    """The rows, and what must be said of them, a sentence each."""

    rows: tuple[EntryRow, ...]
    notes: tuple[str, ...]


def result_table(trials: Iterable[Trial], by: RowsBy = RowsBy.ENTRY) -> ResultTable:
    """One row an entry (or a run), sorted by name, version and run; entries are alike in name, version and checkpoint."""
    groups: dict[tuple[object, ...], list[Trial]] = {}
    for trial in sorted(trials, key=_order):
        groups.setdefault(_key(trial, by), []).append(trial)
    members = [tuple(group) for group in groups.values()]
    labels = _labels([group[0].entry for group in members])
    if by is RowsBy.RUN:
        labels = [f"{label} ({group[0].run})" for label, group in zip(labels, members, strict=True)]
    similarities = [estimate(_similarities(trial) for trial in group) for group in members]
    times = [estimate(_times(trial) for trial in group) for group in members]
    rows = [
        _row(group, label, similarity, time, by)
        for group, label, similarity, time in zip(members, labels, similarities, times, strict=True)
    ]
    by_similarity, by_time = _compared(similarities, best=-1), _compared(times, best=1)
    told = (
        replace(
            row,
            similarity_group=by_similarity.letters[i] if by_similarity.p else None,
            completion_time_group=by_time.letters[i] if by_time.p else None,
            indistinguishable_from=Alike(
                similarity_percent=tuple(labels[j] for j in by_similarity.alike(i)),
                completion_time_s=tuple(labels[j] for j in by_time.alike(i)),
            ),
        )
        for i, row in enumerate(rows)
    )
    notes = (*_notes(by_similarity, labels, "path similarity"), *_notes(by_time, labels, "completion time"))
    return ResultTable(rows=tuple(told), notes=notes)


def entry_rows(attempts: Iterable[Attempt]) -> tuple[EntryRow, ...]:
    """The rows for attempts of which no more than name and laps is known."""
    return result_table(
        Trial(entry=EntryInfo(name=attempt.entry), laps=tuple(attempt.laps)) for attempt in attempts
    ).rows


def official_s(lap: Lap) -> float:
    """The lap's time with its penalties; seconds."""
    return lap.time_s if lap.official_time_s is None else lap.official_time_s


def official_percent(lap: Lap) -> float | None:
    """The lap's path similarity times its penalties' factors, 0..100; None where it was not scored."""
    return None if lap.similarity_percent is None else lap.similarity_percent * lap.penalty_factor


def printable(text: str) -> str:
    """`text` on one line and without control characters: any space as a plain one, anything else unprintable as `?`."""
    return "".join(char if char.isprintable() else " " if char.isspace() else "?" for char in text)


def _valid(trial: Trial) -> list[Lap]:
    return [lap for lap in trial.laps if lap.valid]


def _similarities(trial: Trial) -> Sample:
    return Sample(values=tuple(percent for lap in _valid(trial) if (percent := official_percent(lap)) is not None))


def _times(trial: Trial) -> Sample:
    laps = _valid(trial)
    return Sample(values=tuple(map(official_s, laps)), sigmas=tuple(lap.sigma_s for lap in laps))


def _key(trial: Trial, by: RowsBy) -> tuple[object, ...]:
    entry = (trial.entry.name, trial.entry.version, trial.entry.checkpoint_sha256)
    return entry if by is RowsBy.ENTRY else (*entry, trial.run)


def _order(trial: Trial) -> tuple[object, ...]:
    entry = trial.entry
    texts = (entry.name, entry.version, entry.checkpoint_sha256 or "", trial.run)
    return tuple((_natural(text), text) for text in texts)


def _natural(text: str) -> list[tuple[str, int]]:
    """Sorts `driver 10` behind `driver 2`."""
    parts = re.split(r"([0-9]{1,18})", text)
    return [(word.casefold(), int(number)) for word, number in zip(parts[::2], [*parts[1::2], "0"], strict=True)]


def _labels(entries: Sequence[EntryInfo]) -> list[str]:
    """The name, with the version where several of one name take part, with the checkpoint where even that does not tell."""
    labels = []
    for entry in entries:
        label = entry.name
        of_name = [other for other in entries if other.name == entry.name]
        if len({other.version for other in of_name}) > 1 and entry.version:
            label += f" {entry.version}"
        if len({other.checkpoint_sha256 for other in of_name if other.version == entry.version}) > 1:
            label += f" [{(entry.checkpoint_sha256 or 'no checkpoint')[:13]}]"
        labels.append(label)
    return labels


def _row(
    trials: Sequence[Trial], label: str, similarity: Estimate | None, time: Estimate | None, by: RowsBy
) -> EntryRow:
    laps = [lap for trial in trials for lap in trial.laps]
    valid = [lap for lap in laps if lap.valid]
    attempted = sum(trial.attempted_laps for trial in trials)
    best = min(valid, key=lambda lap: (official_s(lap), lap.sigma_s), default=None)
    entry = trials[0].entry
    interval_over = None
    if time is not None and time.error is not None:
        interval_over = "runs" if time.runs > 1 else "laps"
    return EntryRow(
        entry=entry.name,
        runs=len(trials),
        laps=len(laps),
        valid_laps=len(valid),
        finished=bool(valid),
        similarity_percent=None if similarity is None else similarity.mean,
        completion_time_s=None if time is None else time.mean,
        best_lap_s=None if best is None else official_s(best),
        label=label,
        version=entry.version,
        checkpoint_sha256=entry.checkpoint_sha256,
        run=trials[0].run if by is RowsBy.RUN else None,
        attempted_laps=attempted,
        success_rate=len(valid) / attempted if attempted else None,
        dnf_runs=sum(trial.dnf is not None for trial in trials),
        penalties=sum(len(lap.penalties) for lap in laps),
        penalty_s=math.fsum(lap.penalty_s for lap in laps),
        similarity_sd_percent=None if similarity is None else similarity.sd,
        similarity_ci95_low_percent=None if similarity is None else _end(similarity.low, most=100.0),
        similarity_ci95_high_percent=None if similarity is None else _end(similarity.high, most=100.0),
        completion_time_sd_s=None if time is None else time.sd,
        completion_time_ci95_low_s=None if time is None else _end(time.low),
        completion_time_ci95_high_s=None if time is None else _end(time.high),
        best_lap_sigma_s=None if best is None else best.sigma_s,
        interval_over=interval_over,
        sessions=_all_of(trial.session for trial in trials),
        track=trials[0].track,
        calibrations=_all_of(trial.calibration for trial in trials),
        rules=_all_of(trial.rules for trial in trials),
    )


def _end(value: float | None, *, most: float = math.inf) -> float | None:
    """An interval's end, within what can be at all: no figure is negative, no similarity above 100."""
    return None if value is None else min(max(value, 0.0), most)


def _all_of(texts: Iterable[str | None]) -> tuple[str, ...]:
    return tuple(sorted({text for text in texts if text is not None}))


def _compared(estimates: Sequence[Estimate | None], *, best: int) -> Comparison:
    """The comparison of all rows, with letters from the best on: -1 where more is better, 1 where less is."""

    def rank(i: int) -> tuple[float, int]:
        one = estimates[i]
        return (math.inf if one is None else best * one.mean, i)

    order = sorted(range(len(estimates)), key=rank)
    ranked = compare([estimates[i] for i in order])
    letters = dict(zip(order, ranked.letters, strict=True))
    p = {(min(order[i], order[j]), max(order[i], order[j])): value for (i, j), value in ranked.p.items()}
    return Comparison(
        p=p,
        untested=frozenset(order[i] for i in ranked.untested),
        letters=tuple(letters[i] for i in range(len(estimates))),
        groups=tuple(frozenset(order[i] for i in group) for group in ranked.groups),
    )


def _notes(comparison: Comparison, labels: Sequence[str], figure: str) -> list[str]:
    notes = []
    for group in comparison.groups:
        if len(group) > 1:
            *most, last = (labels[i] for i in sorted(group))
            least = comparison.least_p(group)
            p = f"p = {least:.2f}" + (" or more" if len(most) > 1 and least < 0.995 else "")
            notes.append(f"{', '.join(most)} and {last} cannot be told apart by {figure} ({p})")
    compared = sum(letters is not None for letters in comparison.letters)
    if comparison.untested and len(comparison.untested) + compared > 1:
        names = ", ".join(labels[i] for i in sorted(comparison.untested))
        notes.append(f"One valid lap tells no spread, so not compared by {figure}: {names}")
    return notes
