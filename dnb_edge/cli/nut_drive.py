"""`dnb-edge nut drive`: drivers in closed loop over many seeds, each drive timed and recorded by the appliance, then ranked."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from dnb_edge import wire
from dnb_edge.cli.nut_trial import SCRATCH_PREFIX, checked_driver, checked_entry, drive_trial, one_thread, trial_key
from dnb_edge.config.loop_task import TASKS, load_task
from dnb_edge.daemon.alone import alone
from dnb_edge.errors import InputError, WorkError
from dnb_edge.nut.campaign import Trial, TrialResult, drive_all, seeds_of
from dnb_edge.nut.open import FORMS, SHIPPED
from dnb_edge.nut.ranking import CampaignRanking, RankBy, Standing, ranked
from dnb_edge.score.compare import Estimate

MOST_JOBS = 64


def drive(
    drivers: Annotated[
        list[str],
        typer.Option(
            "--driver",
            metavar="DRIVER",
            help=f"{', '.join(SHIPPED)}, {FORMS}; NAME=DRIVER names it. May be given again.",
        ),
    ],
    task: Annotated[
        str, typer.Option(metavar="TASK", help=f"{', '.join(TASKS)}, or a .yaml file of your own.")
    ] = TASKS[0],
    seeds: Annotated[
        str, typer.Option(metavar="SEEDS", help="1-30, or 1-3,8: the conditions of a seed are the same for all.")
    ] = "1-5",
    laps: Annotated[int | None, typer.Option(min=1, max=1000, help="Laps of each drive. Default: the task's.")] = None,
    directory: Annotated[
        Path, typer.Option("--record", metavar="DIR", help="Directory for recordings and results.")
    ] = Path("drives"),
    jobs: Annotated[int, typer.Option(min=1, max=MOST_JOBS, help="Drives at the same time.")] = 1,
    by: Annotated[
        RankBy,
        typer.Option("--rank-by", help="The mean score of the wanted laps, or valid laps a minute."),
    ] = RankBy.SCORE,
    overrides: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="One key of the appliance's configuration, such as race.max_lap_s=20. May be given again."
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON object a line on stdout: each drive, then the ranking.")
    ] = False,
) -> None:
    """Let drivers drive a simulated vehicle by its own camera, timed from above as a real one is, and rank them.

    Each drive is a recording in DIR that any verb reads, with its result and the simulator's own times beside it. Ctrl-C loses
    nothing: the same command goes on. A driver that fails is told, and the others go on; then the exit code is 1.
    """
    one_thread()
    console = Console(stderr=True, markup=False)
    trials = _trials(drivers, task, seeds_of(seeds), laps, directory, tuple(overrides or ()))
    with alone(directory):
        _clear(directory)
        try:
            results = _driven(trials, jobs, console, as_json=as_json)
        except KeyboardInterrupt:
            console.print(
                f"Interrupted: what is finished stays in {directory}; the same command goes on.", soft_wrap=True
            )
            raise typer.Exit(130) from None
        finally:
            _clear(directory)
    made = ranked(results[0].task, results, by)
    if as_json:
        _say_json(ranking_line(made))
    else:
        out = Console(markup=False)
        _print_drives(out, results)
        _print_ranking(out, made)
        out.print(f"Recordings: {directory}", highlight=False, soft_wrap=True)
    failures = [one for one in results if one.failure is not None]
    if failures:
        first = failures[0]
        raise WorkError(
            f"{len(failures)} of {len(results)} drives failed, the first {first.entry}, seed {first.seed}: {first.failure}"
        )


def _trials(
    drivers: Sequence[str],
    task: str,
    seeds: Sequence[int],
    laps: int | None,
    directory: Path,
    overrides: tuple[str, ...],
) -> list[Trial]:
    """All drives, seed after seed, so that an interrupted campaign has compared all drivers. Raises `InputError`."""
    wanted = load_task(task)
    loops = {seed: wanted.loop(seed, laps) for seed in seeds}
    entries: dict[str, str] = {}
    for word in drivers:
        entry = checked_driver(word)
        name = checked_entry(entry)
        if name in entries.values():
            raise InputError(f"--driver {word}: another driver is called {entry!r}: give it a name, as in mine={word}")
        entries[word] = name
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{directory}: cannot record there: {error.strerror}") from error
    return [
        Trial(
            driver=word,
            entry=entry,
            task=task,
            seed=seed,
            laps=loop.laps,
            directory=str(directory),
            overrides=overrides,
            name=f"{checked_entry(wanted.name)}-{entry}-seed{seed:04d}",
            key=trial_key(word, wanted, loop, entry, overrides),
        )
        for seed, loop in loops.items()
        for word, entry in entries.items()
    ]


def _clear(directory: Path) -> None:
    """Takes away what drives left that were cut short; this process holds the directory."""
    for scratch in directory.glob(f"{SCRATCH_PREFIX}*"):
        shutil.rmtree(scratch, ignore_errors=True)


def _driven(trials: Sequence[Trial], jobs: int, console: Console, *, as_json: bool) -> list[TrialResult]:
    """The results in the trials' order; with `as_json` each is told as soon as all before it are."""
    done: dict[str, TrialResult] = {}
    told = 0
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console, transient=True) as progress:
        bar = progress.add_task("Driving", total=len(trials))
        for trial, result in drive_all(trials, drive_trial, jobs=jobs):
            done[trial.name] = result
            progress.update(bar, advance=1, description=f"{trial.entry} seed {trial.seed}")
            if result.failure is not None:
                progress.console.print(
                    f"dnb-edge: {trial.entry}, seed {trial.seed}: {result.failure}", highlight=False, soft_wrap=True
                )
            while as_json and told < len(trials) and trials[told].name in done:
                _say_json(_drive_line(done[trials[told].name]))
                told += 1
    return [done[trial.name] for trial in trials]


def _drive_line(result: TrialResult) -> dict[str, Any]:
    """A drive as one JSON object: its result, and what follows from it."""
    line = {"event": "drive"} | wire.to_dict(result)
    for told, lap in zip(line["laps"], result.laps, strict=True):
        told["error_ms"] = lap.error_ms
    return line | {"score": result.score, "pace": result.pace, "worst_error_ms": result.worst_error_ms}


def ranking_line(made: CampaignRanking) -> dict[str, Any]:
    """The ranking as one JSON object, without the degrees of freedom: they may be infinite, which JSON cannot say."""
    line = {"event": "ranking"} | wire.to_dict(made)
    for row in line["rows"]:
        for figure in (row[name] for name in ("score", "pace", "time_s", "to_start_s")):
            if figure is not None:
                del figure["df"]
    return line


def _say_json(line: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(line, allow_nan=False) + "\n")
    sys.stdout.flush()


def _print_drives(out: Console, results: Sequence[TrialResult]) -> None:
    rows = [("driver", "seed", "laps", "score %", "lap s", "error ms", "to start s", "hits", "off", "over")]
    for one in results:
        times = [lap.time_s for lap in one.laps]
        rows.append(
            (
                one.entry,
                str(one.seed),
                f"{len(one.laps)}/{one.wanted_laps}",
                f"{one.score:.2f}",
                _number(sum(times) / len(times) if times else None, 3),
                _number(one.worst_error_ms, 1),
                _number(one.to_start_s, 2),
                str(one.collisions),
                str(one.off_track),
                one.ended,
            )
        )
    _print_columns(out, rows)


def _print_ranking(out: Console, made: CampaignRanking) -> None:
    by = "score" if made.by is RankBy.SCORE else "valid laps a minute"
    out.print(f"\n{made.task}, {made.seeds} seeds, ranked by {by}; 95 % intervals over the seeds:", highlight=False)
    head = (
        "",
        "driver",
        "",
        "score %",
        "laps/min",
        "lap s",
        "to start s",
        "completed",
        "valid",
        "hits",
        "error ms",
        "holds in",
    )
    _print_columns(out, [head, *(tuple(_cells(row)) for row in made.rows)])
    for line in _verdict(made):
        out.print(line, highlight=False)


def _print_columns(out: Console, rows: Sequence[Sequence[str]]) -> None:
    """Rows, the first the head, in columns as wide as they need; a line is not broken."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    for row in rows:
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        out.print(line.rstrip(), highlight=False, soft_wrap=True)


def _cells(row: Standing) -> Iterator[str]:
    yield f"{row.place}."
    yield row.entry
    yield row.letters or ""
    yield _interval(row.score, 2)
    yield _interval(row.pace, 3)
    yield _interval(row.time_s, 3)
    yield _interval(row.to_start_s, 2)
    yield f"{row.completed}/{row.drives}"
    yield f"{row.valid_laps}/{row.wanted_laps}"
    yield str(row.collisions)
    yield _number(row.error_ms, 1)
    yield "" if row.place_share is None else f"{100 * row.place_share:.1f} %"


def _verdict(made: CampaignRanking) -> Iterator[str]:
    """What the ranking is worth, in words."""
    if len(made.rows) < 2:
        return
    yield (
        "Neighbours' intervals are disjoint."
        if made.disjoint
        else "Intervals overlap or are missing: more seeds may part them."
    )
    if made.order_share is not None:
        yield f"The whole order is the same in {100 * made.order_share:.1f} % of the resamples of the seeds."


def _interval(figure: Estimate | None, digits: int) -> str:
    if figure is None:
        return ""
    if figure.low is None or figure.high is None:
        return f"{figure.mean:.{digits}f}"
    return f"{figure.mean:.{digits}f} [{figure.low:.{digits}f}, {figure.high:.{digits}f}]"


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"
