"""The report of several recordings on one page, which `dnb-edge report` makes for more than one and for a session.

Knows recordings; what the page looks like is `report.session`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console
from rich.progress import track

from dnb_edge.archive.comparable import check_comparable
from dnb_edge.archive.reported import reported
from dnb_edge.archive.rescore import Wanted
from dnb_edge.archive.trials import Raced, raced
from dnb_edge.errors import InputError
from dnb_edge.record.chain import continued, read_head
from dnb_edge.report.files import write_whole
from dnb_edge.report.session import SessionParts, render_session
from dnb_edge.report.table import RowsBy, Trial, result_table

_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9._-]+")
_LONGEST_NAME = 80


def make_session(
    runs: Iterable[Path], out: Path | None, *, session: str | None, wanted: Wanted, edits: bool, console: Console
) -> Path:
    """Writes the page of `runs`, of those of the session of that name where one is given, into `out`, by default beside the
    first; returns its path. Raises `InputError` where there are none, or they cannot be compared.
    """
    named = {path.resolve(): path for path in runs}
    gone_on = continued(named)
    files = [path for real, path in named.items() if real not in gone_on]
    if session is not None:
        there = {path: read_head(path).header.session for path in files}
        files = [path for path, name in there.items() if name == session]
        if not files:
            known = ", ".join(sorted({repr(name) for name in there.values() if name is not None})) or "none"
            raise InputError(f"--session {session}: no recording of that session; sessions here: {known}")
    parts = SessionParts()
    found: list[Raced] = []
    shown = track(files, "Racing again", console=console, transient=True, disable=not console.is_terminal)
    for path in shown:
        made = reported(path, edits=edits, wanted=wanted)
        one = raced(made.replayed)
        found.append(one)
        parts.add(made.result, {number: trial.entry.name for number, trial in _by_car(one)})
    warnings = [*check_comparable(found), *(f"{one.path.name}: {told}" for one in found for told in one.warnings)]
    trials = [trial for one in found for trial in one.trials]
    page = render_session(
        session or f"{len(files)} runs", parts, result_table(trials, RowsBy.ENTRY), trials, warnings
    ).encode()
    directory = out if out is not None else files[0].parent
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{directory}: the report cannot be written there: {error.strerror}") from error
    path = directory / _file_name(session)
    write_whole(path, page)
    return path


def _by_car(one: Raced) -> Iterable[tuple[int, Trial]]:
    """The trials by the number of the car that drove them."""
    if len(one.trials) == 1:
        yield 1, one.trials[0]
        return
    for trial in one.trials:
        for car in {lap.car for lap in trial.laps}:
            yield car, trial


def _file_name(session: str | None) -> str:
    """`session-NAME.html`, of letters that every file system takes."""
    if session is None:
        return "session.html"
    plain = _NOT_IN_NAMES.sub("-", session).strip("-.")[:_LONGEST_NAME] or "unnamed"
    return f"session-{plain}.html"
