"""`dnb-edge score`: the laps and scores of finished recordings, computed again from their detections."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from dnb_edge import wire
from dnb_edge.archive.replayed import Replayed, replay
from dnb_edge.archive.rescore import Wanted, changes, changes_text
from dnb_edge.cli.replay_options import WithEdits
from dnb_edge.cli.results import OtherLines, OtherRules, OtherTrack, OtherValues, recordings
from dnb_edge.cli.score_many import GridOption, Many, Out, Plot, Scheduler, Workers, score_many
from dnb_edge.cli.standing_words import last_standings, standing_words
from dnb_edge.daemon.sinks import JsonSink
from dnb_edge.display.picture import lap_line
from dnb_edge.errors import InputError
from dnb_edge.race.marshal import Marshalled, MarshalledLap
from dnb_edge.record.edits import edits_path
from dnb_edge.report.table import printable
from dnb_edge.values import Event, Lap, RunSummary

Places = Annotated[
    list[str],
    typer.Argument(
        help="Recordings (.mcap), directories of them, patterns, or addresses such as s3://.", metavar="RUN..."
    ),
]


def score(
    runs: Places,
    *,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON object a line, as `run --json` prints them.")
    ] = False,
    observations: Annotated[
        bool, typer.Option("--observations", help="With --json: one line a frame and the running laps as well.")
    ] = False,
    rules: OtherRules = None,
    lines: OtherLines = None,
    track: OtherTrack = None,
    overrides: OtherValues = None,
    edits: WithEdits = True,
    scheduler: Scheduler = None,
    workers: Workers = None,
    out: Out = None,
    grid: GridOption = None,
    plot: Plot = None,
) -> None:
    """Compute laps and scores of recordings again, from the recorded detections: the same numbers as the live run.

    Or what other lines, thresholds and rules would have given: --line, --set, --rules, --track. The recording never changes.

    A judge's edits (`dnb-edge judge`) are laid over the laps; --no-edits gives what the race itself said.

    Archives: with --out, --grid, --workers or --scheduler, a pattern or an address, the work is shared out and one table of all
    is printed. See docs/archive.md.
    """
    wanted = Wanted(rules=rules, track=track, lines=tuple(lines or ()), overrides=tuple(overrides or ()))
    many = Many(scheduler=scheduler, workers=workers, out=out, grid=tuple(grid or ()), plot=plot)
    if many.is_wanted(runs):
        if observations:
            raise InputError("--observations: is for single recordings: leave out what is for archives")
        score_many(runs, many, wanted, edits=edits, as_json=as_json)
        return
    for path in recordings([Path(run) for run in runs]):
        replayed = replay(path, edits=edits, changed=wanted.change(path), tell_running=as_json)
        if as_json:
            _print_json(replayed, observations=observations)
        else:
            _print_text(replayed)
        for warning in replayed.warnings:
            Console(stderr=True, markup=False).print(f"  {warning}", highlight=False, soft_wrap=True)


def _print_json(replayed: Replayed, *, observations: bool) -> None:
    sink = JsonSink(sys.stdout, observations=observations)
    if replayed.setup is not replayed.recorded_setup:
        typer.echo(json.dumps(_rescored_line(replayed)))
    if replayed.marshalled is None:
        for event in replayed.events:
            sink.event(event)
        return
    typer.echo(json.dumps(_edits_line(replayed, replayed.marshalled)))
    changed = {id(one.lap): one for one in replayed.marshalled.laps if one.edits}
    for event in replayed.events:
        one = changed.get(id(event))
        if one is None:
            sink.event(event)
        else:
            typer.echo(json.dumps(json.loads(wire.event_to_json(one.lap)) | _history(one)))


def _rescored_line(replayed: Replayed) -> dict[str, Any]:
    """The first JSON line of a run under another setup: what was changed, and what stands for the rules now."""
    setup = replayed.setup
    return {
        "event": "rescored",
        "changes": changes(replayed.recorded_setup, setup),
        "rules": setup.rules,
        "digest": setup.rules_digest,
    }


def _edits_line(replayed: Replayed, marshalled: Marshalled) -> dict[str, Any]:
    """The first JSON line of an edited run: all edits, what became of them, and the laps that were taken away."""
    return {
        "event": "edits",
        "file": str(edits_path(replayed.path)),
        "edits": [wire.to_dict(edit) for edit in replayed.edits],
        "undone": [edit.number for edit in marshalled.undone],
        "without_effect": [{"number": told.edit.number, "text": told.text} for told in marshalled.without_effect],
        "moved": [{"number": told.edit.number, "text": told.text} for told in marshalled.moved],
        "removed": [wire.to_dict(one.lap) | _history(one) for one in marshalled.removed],
    }


def _history(one: MarshalledLap) -> dict[str, Any]:
    """The members that a lap with edits has besides its own: their numbers, and the race's own laps in it."""
    return {"edited_by": [edit.number for edit in one.edits], "raw": [wire.to_dict(lap) for lap in one.raw]}


def _print_text(replayed: Replayed) -> None:
    console = Console(markup=False)
    console.print(f"{replayed.path}  ({replayed.header.name})", highlight=False, soft_wrap=True)
    if replayed.setup is not replayed.recorded_setup:
        text = changes_text(replayed.recorded_setup, replayed.setup)
        console.print(
            f"  changed: {text}; rules {replayed.setup.rules} {replayed.setup.rules_digest}",
            highlight=False,
            soft_wrap=True,
        )
    for line in _lines(replayed.events, replayed.marshalled):
        console.print(f"  {line}", highlight=False, soft_wrap=True)


def _lines(events: tuple[Event, ...], marshalled: Marshalled | None) -> list[str]:
    """Each lap, with its car where there are several; who is first among several, or that the only car did not finish."""
    lines = []
    last = last_standings(events)
    rows = () if last is None else last.rows
    changed = {} if marshalled is None else {id(one.lap): one for one in marshalled.laps if one.edits}
    for event in events:
        if isinstance(event, Lap):
            one = changed.get(id(event))
            lines += [_lap_line(event, several=len(rows) > 1), *(() if one is None else told_edits(one))]
        elif isinstance(event, RunSummary):
            for gone in () if marshalled is None else marshalled.removed:
                lines += [f"removed: {_lap_line(gone.lap, several=len(rows) > 1)}", *told_edits(gone)]
            if last is not None and (len(rows) > 1 or rows[0].dnf is not None):
                lines += [f"{row.place}. {standing_words(row, last.unit)}" for row in rows]
            lines.append(f"{event.laps} lap{'' if event.laps == 1 else 's'} in {event.frames} frames")
    return lines


def _lap_line(lap: Lap, *, several: bool) -> str:
    line = printable(lap_line(lap))
    return f"car {lap.car}  {line}" if several else line


def told_edits(one: MarshalledLap) -> list[str]:
    """A line for each edit of a lap: number, action, author and reason."""
    return [
        f"  edit {edit.number}: {edit.action.value} by {printable(edit.author)}: {printable(edit.reason)}"
        for edit in one.edits
    ]
