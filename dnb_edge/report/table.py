"""The paper's Table I for any set of trials: entry, success, path similarity, completion time, how sure they are, who is alike.

Knows laps and who drove them, in reality or in simulation. Similarity and time are means over the entry's valid laps; an entry
without a valid lap did not finish (DNF). Order of rows and all figures do not depend on the order of the trials. Knows no file
and no picture; how the table is printed is `table_text`, `table_files` and `table_latex`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Protocol

from dnb_edge.report.entrants import Entrant, OrderKey, labels, order_key
from dnb_edge.report.inference import Inference, told_inference
from dnb_edge.report.table_compare import FigureOrder, alike_notes, by_means, by_shares, order_note, pair_note
from dnb_edge.score.compare import Estimate, Sample, estimate
from dnb_edge.score.share import Share, Tally, share
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
    simulated: bool = False
    """True where the car and its camera were computed."""
    seed: str | None = None
    """Two entries' trials of one seed were driven under the very same conditions, and are a pair; None in reality."""
    wanted_laps: int | None = None
    """Laps that the drive was to have, where it ends by itself: what is missing of them failed. None where people end runs."""
    collisions: int = 0
    """Of the car, with what stood in its way."""
    inference: Inference | None = None
    """Of the network that drove, as a benchmark measured it; None for people and where nobody did."""
    told_inference_ms: tuple[float, ...] = ()
    """What the vehicle said of itself in the run, picture by picture."""

    @property
    def entrant(self) -> Entrant:
        """Who drove, in which world."""
        return Entrant(entry=self.entry, simulated=self.simulated)

    @property
    def attempted_laps(self) -> int:
        """Complete laps, and the one in which the car's race ended if that is none of them; the wanted ones at least."""
        ended_in_one = any(penalty.dnf for lap in self.laps for penalty in lap.penalties)
        return max(len(self.laps) + (self.dnf is not None and not ended_in_one), self.wanted_laps or 0)


class RowsBy(StrEnum):
    """What one row of the table stands for."""

    ENTRY = "entry"
    RUN = "run"


@dataclass(frozen=True, slots=True, kw_only=True)
class Alike:
    """Labels of the entries that were not shown to differ, by figure."""

    similarity_percent: tuple[str, ...] = ()
    completion_time_s: tuple[str, ...] = ()
    success_rate: tuple[str, ...] = ()


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
    simulated: bool = False
    conditions: str | None = None
    """Heading of its group, where runs under several conditions are told; rows of two groups are never compared."""
    clean_laps: int = 0
    """Valid laps without a penalty."""
    collisions: int = 0
    success_ci95_low: float | None = None
    """Lower end of the success rate's 95 % confidence interval, 0..1."""
    success_ci95_high: float | None = None
    success_group: str | None = None
    inference_p50_ms: float | None = None
    """Median time for one picture; None for people and where nobody measured it. The next two likewise."""
    inference_p95_ms: float | None = None
    inference_p99_ms: float | None = None
    inference_source: str | None = None
    success_rank: int | None = None
    """Place by success rate, from 1, equal ones sharing the lesser; None where there is nothing to rank."""
    success_rank_low: int | None = None
    """Within this and the next it is in 95 % of the resamples."""
    success_rank_high: int | None = None
    success_rank_share: float | None = None
    """Resamples in which it has its rank, 0..1. The other figures' ranks likewise."""
    similarity_rank: int | None = None
    similarity_rank_low: int | None = None
    similarity_rank_high: int | None = None
    similarity_rank_share: float | None = None
    completion_time_rank: int | None = None
    completion_time_rank_low: int | None = None
    completion_time_rank_high: int | None = None
    completion_time_rank_share: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultTable:
    """The rows, and what must be said of them, a sentence each."""

    rows: tuple[EntryRow, ...]
    notes: tuple[str, ...]
    conditions: str | None = None
    """Heading, where the table is one of several groups."""
    orders: tuple[FigureOrder, ...] = ()
    """The rows by success rate, path similarity and completion time."""


def result_table(trials: Iterable[Trial], by: RowsBy = RowsBy.ENTRY, *, conditions: str | None = None) -> ResultTable:
    """One row an entry (or a run), sorted by name, version and run; entries are alike in name, version, checkpoint, world."""
    groups: dict[tuple[object, ...], list[Trial]] = {}
    for trial in sorted(trials, key=_order):
        groups.setdefault(_key(trial, by), []).append(trial)
    members = list(groups.values())
    names = labels([group[0].entrant for group in members])
    if by is RowsBy.RUN:
        names = [f"{name} ({group[0].run})" for name, group in zip(names, members, strict=True)]
    percents = [[_similarities(trial) for trial in group] for group in members]
    times_s = [[_times(trial) for trial in group] for group in members]
    tallies = [[_tally(trial) for trial in group] for group in members]
    similarities, times = [estimate(runs) for runs in percents], [estimate(runs) for runs in times_s]
    shares = [share(runs) for runs in tallies]
    orders = {
        "success": by_shares("success rate", shares, tallies),
        "similarity": by_means("path similarity", similarities, percents, most_is_best=True),
        "completion_time": by_means("completion time", times, times_s, most_is_best=False),
    }
    rows = tuple(
        replace(
            _row(group, names[i], similarities[i], times[i], by),
            conditions=conditions,
            **_compared(i, names, shares[i], orders),
        )
        for i, group in enumerate(members)
    )
    means = (orders["similarity"], orders["completion_time"])
    notes = [note for order in means for note in alike_notes(order, names)]
    if len({one.share for one in shares if one is not None}) > 1:
        notes += alike_notes(orders["success"], names)
    notes += [note for order in orders.values() for note in order_note(order, names)] + pair_note(times_s)
    return ResultTable(rows=rows, notes=tuple(notes), conditions=conditions, orders=tuple(orders.values()))


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
    percents = (official_percent(lap) for lap in _valid(trial))
    return Sample(values=tuple(percent for percent in percents if percent is not None), pair=trial.seed)


def _times(trial: Trial) -> Sample:
    laps = _valid(trial)
    return Sample(values=tuple(map(official_s, laps)), sigmas=tuple(lap.sigma_s for lap in laps), pair=trial.seed)


def _tally(trial: Trial) -> Tally:
    return Tally(successes=len(_valid(trial)), attempts=trial.attempted_laps, pair=trial.seed)


def _key(trial: Trial, by: RowsBy) -> tuple[object, ...]:
    return trial.entrant.key if by is RowsBy.ENTRY else (*trial.entrant.key, trial.run)


def _order(trial: Trial) -> tuple[OrderKey, bool, OrderKey]:
    entry = trial.entry
    texts = order_key(entry.name, entry.version, entry.checkpoint_sha256 or "")
    return (texts, trial.simulated, order_key(trial.run))


def _row(
    trials: Sequence[Trial], label: str, similarity: Estimate | None, time: Estimate | None, by: RowsBy
) -> EntryRow:
    laps = [lap for trial in trials for lap in trial.laps]
    valid = [lap for lap in laps if lap.valid]
    attempted = sum(trial.attempted_laps for trial in trials)
    best = min(valid, key=lambda lap: (official_s(lap), lap.sigma_s), default=None)
    entry = trials[0].entry
    inference = next((trial.inference for trial in trials if trial.inference is not None), None)
    if inference is None:
        inference = told_inference(time_ms for trial in trials for time_ms in trial.told_inference_ms)
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
        simulated=trials[0].simulated,
        clean_laps=sum(not lap.penalties for lap in valid),
        collisions=sum(trial.collisions for trial in trials),
        inference_p50_ms=None if inference is None else inference.p50_ms,
        inference_p95_ms=None if inference is None else inference.p95_ms,
        inference_p99_ms=None if inference is None else inference.p99_ms,
        inference_source=None if inference is None else inference.source,
    )


def _compared(i: int, names: Sequence[str], success: Share | None, orders: Mapping[str, FigureOrder]) -> dict[str, Any]:
    """Members of the table's i-th row that come of comparing it: its letters, its places, and who is like it."""
    told: dict[str, Any] = {}
    for figure, order in orders.items():
        told[f"{figure}_group"] = order.letters(i)
        place = order.places[i]
        if place is not None:
            told[f"{figure}_rank"] = place.rank
            told[f"{figure}_rank_low"], told[f"{figure}_rank_high"] = place.low, place.high
            told[f"{figure}_rank_share"] = place.share
    alike = {figure: tuple(names[j] for j in order.comparison.alike(i)) for figure, order in orders.items()}
    told["indistinguishable_from"] = Alike(
        similarity_percent=alike["similarity"],
        completion_time_s=alike["completion_time"],
        success_rate=alike["success"],
    )
    if success is not None:
        told |= {"success_ci95_low": success.low, "success_ci95_high": success.high}
    return told


def _end(value: float | None, *, most: float = math.inf) -> float | None:
    """An interval's end, within what can be at all: no figure is negative, no similarity above 100."""
    return None if value is None else min(max(value, 0.0), most)


def _all_of(texts: Iterable[str | None]) -> tuple[str, ...]:
    return tuple(sorted({text for text in texts if text is not None}))
