"""`dnb-edge score` over an archive: many recordings, many workers, one table and Parquet files.

Knows the options and what is printed; imports what it needs of Dask and Matplotlib when it comes to that.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from dnb_edge import wire
from dnb_edge.archive.cluster import Crew, crew
from dnb_edge.archive.lot_score import NOTHING, LotJob, ScoredLot, ScoredRun, Setting, failed, score_lot
from dnb_edge.archive.lots import Lot, at_hand, guarded, is_elsewhere, is_pattern, last_of_chains, listed, previous_of
from dnb_edge.archive.parquet import ResultFiles, check_out
from dnb_edge.archive.rescore import Wanted, changed
from dnb_edge.archive.sweep import Grid, SweepRow, Tally, as_text, columns, parse_grid, settings
from dnb_edge.core import CoreSetup
from dnb_edge.errors import InputError, WorkError
from dnb_edge.record.chain import read_head
from dnb_edge.report.table import ResultTable, Trial, printable, result_table
from dnb_edge.report.table_text import as_text as table_text

Scheduler = Annotated[
    str | None,
    typer.Option(help="Share the work out among the workers of this Dask scheduler.", metavar="tcp://HOST:PORT"),
]
Workers = Annotated[
    int | None, typer.Option(help="Processes of this machine to share the work out among. Default: one a core.", min=1)
]
Out = Annotated[
    Path | None,
    typer.Option(help="Write a row for each lap here, and one for each recording beside it.", metavar="FILE.parquet"),
]
GridOption = Annotated[
    list[str] | None,
    typer.Option(
        "--grid",
        help="Try each of these values: a key as in --set, or rules. Given several times: every combination.",
        metavar="KEY=A,B,C",
    ),
]
Plot = Annotated[
    Path | None,
    typer.Option(help="Picture of the sweep (.png, .svg). Default: beside --out.", metavar="FILE"),
]

_PLOTS = {".png": "png", ".svg": "svg"}
_MEGABYTE = 1e6
_MOST_HEADS = 20
"""Of so many recordings at most the first is looked for that can be read, to check by it what is to be changed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Many:
    """How an archive is to be scored, as the command line says it."""

    scheduler: str | None = None
    workers: int | None = None
    out: Path | None = None
    grid: Sequence[str] = ()
    plot: Path | None = None

    def is_wanted(self, places: Sequence[str]) -> bool:
        """Whether this is no matter of single recordings on this machine."""
        return self != Many() or any(is_elsewhere(place) or is_pattern(place) for place in places)


class Conditions(NamedTuple):
    """Recordings under other ones are not compared."""

    track: str
    """A digest, as `rules`."""
    task: str
    rules: str


@dataclass(slots=True)
class _Account:
    """What came of all recordings."""

    settings: Sequence[Setting]
    trials: dict[Conditions, list[Trial]] = field(default_factory=dict)
    tallies: list[Tally] = field(default_factory=list)
    recordings: int = 0
    laps: int = 0
    failures: list[tuple[str, str]] = field(default_factory=list)
    peak_bytes: int = 0

    @property
    def failed(self) -> int:
        """Recordings with anything that failed."""
        return len({name for name, _ in self.failures})

    def add(self, lot: Lot, scored: ScoredLot) -> None:
        self.recordings += 1
        self.peak_bytes = max(self.peak_bytes, scored.worker_peak_bytes)
        self.failures += [(lot.name, error) for error in scored.errors]
        swept = bool(self.settings[0].values)
        for place, run in enumerate(scored.runs):
            self.laps += len(run.laps)
            if swept:
                self.tallies[place].add(run)
            elif run.run["error"] is None:
                conditions = Conditions(*(run.run[name] for name in Conditions._fields))
                self.trials.setdefault(conditions, []).extend(run.trials)


def score_many(places: Sequence[str], many: Many, wanted: Wanted, *, edits: bool, as_json: bool) -> None:
    """Scores all recordings at `places`, prints one table of them, and writes what `many` asks for.

    Raises `InputError` where anything asked for is wrong by itself, before anything is computed; `WorkError`, after all else is
    done, where recordings could not be scored.
    """
    grid = parse_grid(many.grid)
    plot = _checked(many, grid)
    chosen = settings(wanted, grid)
    console = Console(stderr=True, markup=False, highlight=False, soft_wrap=True)
    account = _Account(settings=chosen, tallies=[Tally() for _ in chosen])
    with ExitStack() as stack:
        lots = listed(places)
        _check_settings(lots, chosen)
        files = None if many.out is None else stack.enter_context(ResultFiles(many.out, columns(grid)))
        with console.status("Waiting for workers ...") if console.is_terminal else nullcontext():
            hands = stack.enter_context(crew(many.scheduler, many.workers))
        lots = _without_continued(hands, lots, console)
        jobs = [LotJob(lot=lot, settings=chosen, edits=edits) for lot in lots]
        with _bar(console, "Scoring", len(jobs)) as step:
            for job, scored in _scored(hands, jobs):
                for run in scored.runs:
                    if files is not None:
                        files.add(run)
                account.add(job.lot, scored)
                step(len(account.failures))
        if files is not None:
            files.finish()
    for name, error in account.failures:
        console.print(f"dnb-edge: {printable(error if name in error else f'{name}: {error}')}")
    rows = [tally.row(dict(one.values)) for tally, one in zip(account.tallies, chosen, strict=True)] if grid else []
    _print(account, rows, many.out, as_json=as_json)
    if plot is not None:
        _draw(rows, plot)
        console.print(f"Plot: {plot}")
    if many.out is not None and files is not None:
        console.print(f"Laps: {files.out}, recordings: {files.runs_out}")
    console.print(f"A worker took {account.peak_bytes / _MEGABYTE:.0f} MB at most.")
    if account.failures:
        raise WorkError(
            f"{account.failed} of {account.recordings} recordings could not be scored, see above; the rest was"
        )


def _checked(many: Many, grid: Grid) -> Path | None:
    """Where the plot goes; None where there is none. Raises `InputError` where options do not go together."""
    if many.scheduler is not None and many.workers is not None:
        raise InputError("--workers is of this machine; a scheduler has its own: leave one out")
    if many.out is not None:
        check_out(many.out)
    plot = many.plot
    if plot is not None and not grid:
        raise InputError(f"--plot {plot}: is for --grid: name what to sweep")
    if grid and plot is None and many.out is not None:
        return many.out.with_suffix(".png")
    if plot is not None and (plot.suffix.lower() not in _PLOTS or not plot.parent.is_dir()):
        raise InputError(f"--plot {plot}: must be a file that ends in .png or .svg, in a directory that is there")
    return plot


def _without_continued(hands: Crew, lots: Sequence[Lot], console: Console) -> tuple[Lot, ...]:
    """The recordings without files that another one of them goes on from."""
    if len(lots) == 1:
        return tuple(lots)
    previous = {}
    with _bar(console, "Looking", len(lots)) as step:
        for place, done in enumerate(hands.in_order(_previous, lots)):
            if done.error is None and done.result is not None:
                previous[place] = done.result[0]
            step(0)
    return last_of_chains(lots, previous)


def _previous(lot: Lot) -> tuple[str | None] | None:
    """The name that `previous_of` says; None where the file cannot be read, which its scoring says."""
    try:
        return (previous_of(lot),)
    except InputError:
        return None


def _check_settings(lots: Sequence[Lot], chosen: Sequence[Setting]) -> None:
    """Raises `InputError` where what is to be changed does not even fit the first recording that can be read."""
    if all(setting.loaded == NOTHING for setting in chosen):
        return
    for lot in lots[:_MOST_HEADS]:
        try:
            setup = guarded(partial(_setup_of, lot), lot.name)
        except InputError:
            continue
        for setting in chosen:
            if setting.loaded.track is None and not setting.loaded.lines:
                changed(setup, setting.loaded, Path(lot.name))
        return


def _setup_of(lot: Lot) -> CoreSetup:
    with at_hand(lot) as path:
        try:
            return CoreSetup.from_dict(read_head(path).header.setup["core"])
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{lot.name}: its setup cannot be read") from error


def _scored(hands: Crew, jobs: Iterable[LotJob]) -> Iterator[tuple[LotJob, ScoredLot]]:
    for done in hands.in_order(score_lot, jobs):
        if done.result is not None:
            yield done.job, done.result
        else:
            run: ScoredRun = failed(done.job.lot, done.error or "failed")
            yield done.job, ScoredLot(runs=(run,), worker_peak_bytes=0)


@contextmanager
def _bar(console: Console, words: str, total: int) -> Iterator[Callable[[int], None]]:
    """A bar on a terminal; what is given is called after each step, with the number of failures so far."""
    parts = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*parts, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(words, total=total)

        def step(failures: int) -> None:
            told = f"{words} ({failures} failed)" if failures else words
            progress.update(task, advance=1, description=told)

        yield step


def _print(account: _Account, rows: Sequence[SweepRow], out: Path | None, *, as_json: bool) -> None:
    tables = {key: result_table(account.trials[key]) for key in sorted(account.trials)}
    if as_json:
        _print_json(account, tables, rows, out)
        return
    for conditions, table in tables.items():
        if len(tables) > 1:
            typer.echo(f"Track {conditions.track}, {printable(conditions.task)}, rules {conditions.rules}:")
        typer.echo(table_text(table) + "\n")
    if rows:
        typer.echo(as_text(rows) + "\n")
    good = _count(account.recordings - account.failed, "recording")
    told = f"{_count(len(rows), 'combination')} over" if rows else f"{_count(account.laps, 'lap')} in"
    typer.echo(f"{told} {good}")


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"


def _print_json(
    account: _Account, tables: dict[Conditions, ResultTable], rows: Sequence[SweepRow], out: Path | None
) -> None:
    """A line for each entry or combination, one for each failure, and one of all."""
    lines: list[dict[str, Any]] = [
        {"event": "entry", **wire.to_dict(row)} for table in tables.values() for row in table.rows
    ]
    lines += [{"event": "combination", **wire.to_dict(row)} for row in rows]
    lines += [{"event": "failed", "recording": name, "error": error} for name, error in account.failures]
    lines.append(
        {
            "event": "scored",
            "recordings": account.recordings,
            "failed": account.failed,
            "laps": account.laps,
            "out": None if out is None else str(out),
            "worker_peak_mb": round(account.peak_bytes / _MEGABYTE, 1),
        }
    )
    for line in lines:
        typer.echo(json.dumps(line, allow_nan=False))


def _draw(rows: Sequence[SweepRow], plot: Path) -> None:
    from dnb_edge.report.sweep_plot import sweep_picture  # noqa: PLC0415 Matplotlib is slow to import

    try:
        plot.write_bytes(sweep_picture(rows, picture_format="svg" if plot.suffix.lower() == ".svg" else "png"))
    except OSError as error:
        raise WorkError(f"{plot}: the plot was not written: {error.strerror}") from error
