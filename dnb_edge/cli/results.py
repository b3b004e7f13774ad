"""`dnb-edge report`, and which recordings a command line means."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from dnb_edge.archive.reported import reported
from dnb_edge.archive.rescore import Wanted
from dnb_edge.cli.replay_options import WithEdits
from dnb_edge.errors import InputError
from dnb_edge.record.chain import continued
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.report.run import RunResult

Runs = Annotated[list[Path], typer.Argument(help="Recordings (.mcap), or directories of them.", metavar="RUN...")]


OtherRules = Annotated[
    str | None,
    typer.Option("--rules", help="Another rule set: a name (`dnb-edge config rules`) or a file.", metavar="NAME|FILE"),
]
"""This and the next three: what of a recording's setup can be changed after the fact; see `cli.rescore`."""
OtherLines = Annotated[
    list[str] | None,
    typer.Option(
        "--line",
        help="Another line: start, finish or any sector's name, then its ends on the twin (px), a place on the route "
        "(NAME=AT:u,v) or none. Or a file of lines. May be given several times.",
        metavar="NAME=u,v:u,v",
    ),
]
OtherTrack = Annotated[
    Path | None, typer.Option("--track", help="Another track file of the same twin.", metavar="FILE")
]
OtherValues = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Another value for one key, such as race.min_lap_s=3. May be given several times.",
        metavar="KEY=VALUE",
    ),
]


class FigureFormat(StrEnum):
    """Of figures as files."""

    PNG = "png"
    SVG = "svg"


_LONGEST_LAP = 12
"""Characters of a lap's name."""


def report(
    runs: Runs,
    *,
    out: Annotated[Path | None, typer.Option(help="Directory for the report. Default: beside the recording.")] = None,
    session: Annotated[
        str | None, typer.Option(help="Only runs of the session of this name, on one page.", metavar="NAME")
    ] = None,
    laps: Annotated[
        list[str] | None,
        typer.Option("--lap", help="A lap to look at more closely. May be given several times.", metavar="[CAR:]LAP"),
    ] = None,
    figures: Annotated[
        Path | None, typer.Option(help="Write each figure as a file of its own into this directory.", metavar="DIR")
    ] = None,
    form: Annotated[FigureFormat, typer.Option("--format", help="Of these files.")] = FigureFormat.PNG,
    video: Annotated[
        Path | None,
        typer.Option(help="Write an annotated video (.mp4, .webm, .avi) instead of the page.", metavar="FILE"),
    ] = None,
    clip: Annotated[
        Path | None,
        typer.Option(help="For --video: take the pictures from the clip that the run was raced from.", metavar="FILE"),
    ] = None,
    rules: OtherRules = None,
    lines: OtherLines = None,
    track: OtherTrack = None,
    overrides: OtherValues = None,
    edits: WithEdits = True,
) -> None:
    """Write a report with pictures of one run, or of several together: one HTML file that needs nothing else.

    With --figures the pictures as files, with --video the camera's picture with what the race knew. With --line, --set, --rules
    or --track, of what these would have given, as in `score`; the recordings never change.
    """
    wanted = Wanted(rules=rules, track=track, lines=tuple(lines or ()), overrides=tuple(overrides or ()))
    chosen = tuple(_lap_key(text) for text in laps or ())
    found = recordings(runs)
    console = Console(stderr=True, markup=False)
    one_page = len(found) > 1 or session is not None
    if one_page and (figures or video or clip or chosen):
        raise InputError("--figures, --video, --clip and --lap are of one run: name one recording")
    if clip is not None and video is None:
        raise InputError(f"--clip {clip}: is for --video: name the video to write")
    if one_page:
        from dnb_edge.cli.report_session import make_session  # noqa: PLC0415 Matplotlib is slow to import

        typer.echo(f"Report: {make_session(found, out, session=session, wanted=wanted, edits=edits, console=console)}")
        return
    run = found[0]
    with _busy(console, f"Racing {run.name} again ..."):
        made = reported(run, edits=edits, wanted=wanted, laps=chosen)
    if figures is not None:
        _write_figures(made.result, figures, form, console)
    if video is not None:
        from dnb_edge.cli.report_video import make_video  # noqa: PLC0415 as above

        count = make_video(made, video, clip=clip, console=console)
        typer.echo(f"Video: {video} ({count} pictures)")
    if figures is None and video is None:
        with _busy(console, "Drawing ..."):
            path = _written(made.result, run, out)
        typer.echo(f"Report: {path}")


def make_report(run: Path, out: Path | None, *, edits: bool = True, wanted: Wanted | None = None) -> Path:
    """Writes the report of the recording `run` into `out`, by default beside it; returns the report's path.

    With a judge's edits unless they are not wanted, and under the setup that `wanted` makes of the recorded one.
    """
    return _written(reported(run, edits=edits, wanted=wanted).result, run, out)


def _written(result: RunResult, run: Path, out: Path | None) -> Path:
    from dnb_edge.report.html import write_report  # noqa: PLC0415 Matplotlib is slow to import

    return write_report(result, out if out is not None else run.parent, file_name=f"{run.stem}.html")


def _write_figures(result: RunResult, directory: Path, form: FigureFormat, console: Console) -> None:
    from dnb_edge.report.figures import write_figures  # noqa: PLC0415 Matplotlib is slow to import

    with _busy(console, "Drawing ..."):
        for path in write_figures(result, directory, "svg" if form is FigureFormat.SVG else "png"):
            typer.echo(f"Figure: {path}")


def _lap_key(text: str) -> tuple[int, int]:
    """`3` is lap 3 of car 1, `2:3` that of car 2."""
    car, colon, lap = text.rpartition(":")
    if not lap.isdecimal() or (colon and not car.isdecimal()) or len(text) > _LONGEST_LAP:
        raise InputError(f"--lap {text}: must be a lap's number, or CAR:LAP")
    return (int(car) if colon else 1, int(lap))


def _busy(console: Console, words: str) -> AbstractContextManager[object]:
    """Says on a terminal that something takes its time."""
    return console.status(words) if console.is_terminal else nullcontext()


def recordings(runs: list[Path]) -> list[Path]:
    """The recordings that `runs` names, those in directories sorted by name. Raises `InputError` where there are none.

    Of a run in a directory that was cut short and gone on with only the last file, which is read with those before it.
    """
    files: list[Path] = []
    for run in runs:
        if not run.is_dir():
            files.append(run)
            continue
        found = sorted(run.glob("*.mcap"))
        if not found:
            parts = len(list(run.glob(f"*{PART_SUFFIX}")))
            hint = f"; {parts} unfinished ones: run `dnb-edge runs recover {run}`" if parts else ""
            raise InputError(f"{run}: no recordings (.mcap) in this directory{hint}")
        gone_on = continued(found)
        files += [path for path in found if path not in gone_on]
    return files
