"""`dnb-edge runs`: the recordings in a directory: list them, recover what was cut short, export what they say, copy them.

Knows how to show; `record` knows how to read. Registered by `cli.main` as a sub-app.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from dnb_edge.archive.listing import listed_run
from dnb_edge.archive.replayed import replay
from dnb_edge.archive.run_csv import Table as Exported
from dnb_edge.archive.run_csv import as_csv
from dnb_edge.cli.replay_options import WithEdits
from dnb_edge.cli.runs_copy import copy, copy_home
from dnb_edge.errors import InputError, WorkError
from dnb_edge.record.chain import continued
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.record.edits import edits_path
from dnb_edge.record.reader import read_run
from dnb_edge.record.recover import Leftover, Recovery, recover_directory, recover_file
from dnb_edge.record.retention import Limits, pin, prune, unpin

app = typer.Typer(help="List, recover, prune, pin, export and copy recordings.", no_args_is_help=True)
app.command("copy")(copy)

Directory = Annotated[Path, typer.Argument(help="The directory with the recordings.")]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON object a line on stdout.")]


class What(StrEnum):
    """What of a recording `export` writes."""

    LAPS = "laps"
    PASSES = "passes"
    INCIDENTS = "incidents"
    ALL = "all"


@app.command("list")
def list_runs(directory: Directory = Path(), *, as_json: AsJson = False) -> None:
    """List the recordings in DIRECTORY."""
    if not directory.is_dir():
        raise InputError(f"{directory}: there is no such directory")
    paths = sorted([*directory.glob("*.mcap"), *directory.glob(f"*{PART_SUFFIX}")])
    gone_on = continued(paths)
    runs = [listed_run(path, part_of=gone_on.get(path)) for path in paths]
    if as_json:
        for run in runs:
            typer.echo(json.dumps(asdict(run)))
        return
    table = Table(box=None)
    table.add_column("file", no_wrap=True)
    for heading in ("state", "entry", "session", "laps", "duration", "size", "note"):
        table.add_column(heading, overflow="fold")
    for run in runs:
        duration = "" if run.duration_s is None else f"{run.duration_s:.1f} s"
        laps = "" if run.laps is None else str(run.laps)
        size = f"{run.size_bytes / 1e6:.1f} MB"
        entry = " ".join(text for text in (run.name, run.version) if text)
        table.add_row(run.file, run.state.value, entry, run.session or "", laps, duration, size, run.note or "")
    Console(markup=False).print(table)


@app.command("recover")
def recover(
    paths: Annotated[list[Path], typer.Argument(help="Damaged recordings, or directories with .part files.")],
    *,
    as_json: AsJson = False,
) -> None:
    """Bring back recordings that were cut short by a power cut, a crash or a full disk."""
    results: list[Recovery | Leftover] = []
    for path in paths:
        results += recover_directory(path) if path.is_dir() else [recover_file(path)]
    for result in results:
        typer.echo(json.dumps(asdict(result), default=str) if as_json else _recovery_text(result))
    if not results and not as_json:
        typer.echo("nothing to recover")
    failed = [result for result in results if isinstance(result, Leftover)]
    if failed:
        raise WorkError(f"{len(failed)} of {len(results)} files could not be recovered")


@app.command("prune")
def prune_runs(
    directory: Directory,
    *,
    keep_free_mb: Annotated[float, typer.Option(min=0, help="Room to leave on the disk, megabytes.")] = 200.0,
    max_total_gb: Annotated[
        float | None, typer.Option(min=0, help="Most that the recordings take together, gigabytes. Default: no limit.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would be deleted.")] = False,
    as_json: AsJson = False,
) -> None:
    """Delete the oldest recordings in DIRECTORY, pictures first, until there is room.

    Never one that is pinned, is being recorded or was renamed.
    """
    limits = Limits(
        keep_free_bytes=round(keep_free_mb * 1e6),
        max_total_bytes=None if max_total_gb is None else round(max_total_gb * 1e9),
    )
    removals = prune(directory, limits, dry_run=dry_run)
    for one in removals:
        what = "pictures of " if one.pictures_only else ""
        done = "would delete" if dry_run else "deleted"
        told = {
            "name": one.name,
            "pictures_only": one.pictures_only,
            "size_bytes": one.size_bytes,
            "files": [path.name for path in one.files],
            "why": one.why,
            "deleted": not dry_run,
        }
        text = f"{done} {what}{one.name}, {one.size_bytes / 1e6:.1f} MB: {one.why}"
        typer.echo(json.dumps(told) if as_json else text)
    if not removals and not as_json:
        typer.echo("nothing to delete")


@app.command("pin")
def pin_runs(runs: Annotated[list[Path], typer.Argument(help="Recordings.", metavar="RUN...")]) -> None:
    """Keep recordings for ever, whatever the room."""
    for run in runs:
        typer.echo(f"{run.name} is kept: {pin(run).name}")


@app.command("unpin")
def unpin_runs(runs: Annotated[list[Path], typer.Argument(help="Recordings.", metavar="RUN...")]) -> None:
    """Let recordings go again when room is short."""
    for run in runs:
        unpin(run)
        typer.echo(f"{run.name} may go when room is short")


@app.command("export")
def export(
    run: Annotated[Path, typer.Argument(help="The recording.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="File to write; stdout without it. With --what all: NAME-laps.csv and so on."
        ),
    ] = None,
    what: Annotated[
        What | None, typer.Option(help="Laps (default), passes of all lines, incidents, or each in a file.")
    ] = None,
    edits: WithEdits = True,
    to: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Copy all recordings of the directory RUN to a stick, as `runs copy` does."),
    ] = None,
) -> None:
    """Write the laps of RUN as CSV, or its passes or incidents.

    Laps are as a judge left them, with what the race said beside it; --no-edits gives that alone.
    """
    if to is not None:
        if output is not None or what is not None or not edits:
            raise InputError("--to: copies whole recordings: leave --output, --what and --no-edits out")
        copy_home(run, to)
        return
    what = what or What.LAPS
    marshalled = replay(run).marshalled if edits and edits_path(run).exists() else None
    if what is not What.ALL:
        text = as_csv(read_run(run), Exported(what.value), marshalled)
        if output is None:
            typer.echo(text, nl=False)
        else:
            _write_new({output: text})
        return
    if output is None:
        raise InputError("--what all: writes three files: give -o NAME.csv")
    recorded = read_run(run)
    suffix = output.suffix or ".csv"
    _write_new(
        {output.with_name(f"{output.stem}-{one}{suffix}"): as_csv(recorded, one, marshalled) for one in Exported}
    )


def _write_new(texts: dict[Path, str]) -> None:
    """Writes each text into a new file: an export never replaces one. Raises `InputError` before any is written.

    Where the disk fails, it raises `WorkError` and leaves none of them behind.
    """
    there = next((path for path in texts if path.exists()), None)
    if there is not None:
        raise InputError(f"{there}: is there already; choose another name")
    written: list[Path] = []
    for path, text in texts.items():
        try:
            with path.open("x", encoding="utf-8", newline="") as stream:
                written.append(path)
                stream.write(text)
        except FileExistsError as error:
            raise InputError(f"{path}: is there already; choose another name") from error
        except OSError as error:
            for one in written:
                one.unlink()
            raise WorkError(f"{path}: cannot be written: {error.strerror}") from error


def _recovery_text(result: Recovery | Leftover) -> str:
    if isinstance(result, Leftover):
        return result.reason
    lost = f", {result.bad_parts} damaged parts left out" if result.bad_parts else ""
    kept = f"; the damaged file is kept beside {result.path.name}" if result.original_kept else ""
    return f"{result.path}: {result.messages} messages, {result.laps} laps recovered{lost}{kept}"
