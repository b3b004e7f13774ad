"""`dnb-edge runs copy`: takes finished recordings home on a stick, and says so on the appliance's displays.

Knows how to show it; `archive` knows how to copy. `runs export --to` is the same command.
"""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, TextColumn, TimeRemainingColumn, TransferSpeedColumn
from rich.progress import Progress as Bar

from dnb_edge.archive.stick import Pace
from dnb_edge.archive.take_home import Progress, TakenHome, take_home
from dnb_edge.errors import DnbEdgeError, TemporaryFault, WorkError
from dnb_edge.live.caller import Caller
from dnb_edge.live.messages import ShowText

SAY_EVERY_S = 10.0
SAID_FOR_S = 25.0
"""Longer than until the next word of progress."""
DONE_FOR_S = 600.0
"""Somebody comes back to the box and sees how it ended."""
PATIENCE_S = 3.0
"""For the appliance to take a word; copying waits so long."""

Say = Callable[[str, float], None]


def copy(
    directory: Annotated[Path, typer.Argument(help="The directory with the recordings.")],
    *,
    to: Annotated[Path, typer.Option(metavar="DIR", help="Where the stick is mounted; dnb-edge/HOST is made there.")],
    pictures: Annotated[bool, typer.Option("--pictures/--no-pictures", help="Rings of pictures, too.")] = True,
    check: Annotated[bool, typer.Option("--check", help="Read again what is there already, and compare it.")] = False,
    mb_per_s: Annotated[
        float | None, typer.Option(min=0.1, help="Copy no faster than so many megabytes a second.")
    ] = None,
    live: Annotated[
        Path | None, typer.Option(metavar="PATH", help="Say it on the displays of the appliance that listens there.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="What came of it, as one JSON object on stdout.")] = False,
) -> None:
    """Copy all finished recordings in DIRECTORY to a stick, each checked by reading it back.

    What is there already is passed over, so that it goes on where it stopped. Never the run being recorded; nothing is deleted.
    """
    copy_home(directory, to, pictures=pictures, check=check, mb_per_s=mb_per_s, live=live, as_json=as_json)


def copy_home(
    directory: Path,
    to: Path,
    *,
    pictures: bool = True,
    check: bool = False,
    mb_per_s: float | None = None,
    live: Path | None = None,
    as_json: bool = False,
) -> None:
    """Does it, with its progress on stderr. Raises `WorkError` where something that was to be copied is not there."""
    console = Console(stderr=True, markup=False)
    say = _displays(console, live)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        DownloadColumn(),
        TransferSpeedColumn(),
        TimeRemainingColumn(),
    )
    try:
        with Bar(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
            task = bar.add_task("looking", total=None)
            told = _Told(say)

            def tell(progress: Progress) -> None:
                bar.update(
                    task, description=progress.run, completed=progress.done_bytes, total=progress.total_bytes or None
                )
                told(progress)

            pace = Pace(None if mb_per_s is None else mb_per_s * 1e6)
            taken = take_home(
                directory, to, host=socket.gethostname(), pictures=pictures, check=check, pace=pace, tell=tell
            )
    except DnbEdgeError:
        say("stick: nothing copied: see the log", DONE_FOR_S)
        raise
    say(display_text(taken), DONE_FOR_S)
    if as_json:
        typer.echo(json.dumps(asdict(taken)))
    else:
        for line in lines(taken):
            typer.echo(line)
    if taken.missing:
        runs = len(taken.missing)
        raise WorkError(f"{runs} of {_runs(runs + _there(taken))} not copied: {taken.stopped or taken.missing[0].why}")


def display_text(taken: TakenHome) -> str:
    """What a display says at the end, 60 characters at most."""
    there = _there(taken)
    if taken.missing:
        why = "it is full" if taken.full else "see the log" if taken.stopped is None else "pulled out or bad"
        return f"stick: {there} of {there + len(taken.missing)} runs on it: {why}"
    if taken.copied:
        return f"stick: {_runs(len(taken.copied))} copied and checked, take it out"
    return f"stick: nothing new, {_runs(there)} on it, take it out"


def lines(taken: TakenHome) -> list[str]:
    """What a terminal says at the end."""
    size_mb = taken.copied_bytes / 1e6
    before = f"{len(taken.already)} there before: {taken.directory}"
    return [
        f"{_runs(len(taken.copied))} copied and checked ({taken.files} files, {size_mb:.1f} MB), {before}",
        *(f"left {one.run}: {one.why}" for one in taken.left),
        *(f"not copied {one.run}: {one.why}" for one in taken.missing),
    ]


def _there(taken: TakenHome) -> int:
    return len(taken.copied) + len(taken.already)


def _runs(count: int) -> str:
    return f"{count} run" if count == 1 else f"{count} runs"


class _Told:
    """Says on displays how far it is, now and then."""

    def __init__(self, say: Say) -> None:
        self._say = say
        self._due_s = time.monotonic()

    def __call__(self, progress: Progress) -> None:
        now_s = time.monotonic()
        if now_s >= self._due_s and progress.done_bytes < progress.total_bytes:
            self._due_s = now_s + SAY_EVERY_S
            percent = 100 * progress.done_bytes // progress.total_bytes
            self._say(f"stick: copying, {percent} %, leave it in", SAID_FOR_S)


def _displays(console: Console, live: Path | None) -> Say:
    """Says a text on the appliance's displays; where it is down a line on stderr says that, once, and copying goes on."""
    complained = False

    def say(text: str, for_s: float) -> None:
        nonlocal complained
        if live is None:
            return
        try:
            with Caller(live, timeout_s=PATIENCE_S) as caller:
                caller.ask(ShowText, text=text, for_s=for_s)
        except (TemporaryFault, WorkError) as error:
            if not complained:
                console.print(f"dnb-edge: not said on a display: {error}", soft_wrap=True)
            complained = True

    return say
