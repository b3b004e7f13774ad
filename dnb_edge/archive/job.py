"""Long work on recordings in a process of its own, with limits: `python -m dnb_edge.archive.job KIND SPEC OUT`.

What a page must not do itself: reports, tables, whole files read through. Says one JSON object a line on stdout: how far it is,
and at the end what came of it. Ends when its stdin does, so that it never outlives who started it. Knows recordings; knows no
request.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from dnb_edge.errors import DnbEdgeError, InputError, TemporaryFault

MEMORY_BYTES = 1024 * 1024 * 1024
"""Of its own data: a report with all pictures takes a third of it."""
CPU_S = 900
NICE = 15

Tell = Callable[[str, float | None], None]


def main(arguments: list[str]) -> int:
    """Does what `arguments` say: the kind, its JSON and the file to write. 0 where it is written, 1 otherwise."""
    kind, text, out = arguments
    spec = json.loads(text)
    _limit()
    threading.Thread(target=_die_with_parent, daemon=True).start()
    try:
        told = KINDS[kind](spec, Path(out), _tell)
    except (DnbEdgeError, MemoryError) as error:
        text = str(error) if isinstance(error, DnbEdgeError) else "it takes more memory than the page may use"
        # Where the recordings lie is nobody's business who only looks at a page.
        text = _without_folder(text, [Path(path) for path in (spec.get("path"), *spec.get("paths", ())) if path])
        fault = "input" if isinstance(error, InputError) else "work"
        if isinstance(error, TemporaryFault):
            fault = "temporary"
        _say({"error": text, "fault": fault})
        return 1
    _say({"done": True, **told})
    return 0


def make_report(spec: dict[str, Any], out: Path, tell: Tell) -> dict[str, Any]:
    """The report of the recording `path`."""
    tell("Reading the recording and racing it again", None)
    from dnb_edge.archive.reported import reported  # noqa: PLC0415 Matplotlib is slow to import
    from dnb_edge.report.html import write_report  # noqa: PLC0415

    result = reported(Path(spec["path"])).result
    tell("Drawing", 0.6)
    write_report(result, out.parent, file_name=out.name)
    return {}


def make_table(spec: dict[str, Any], out: Path, tell: Tell) -> dict[str, Any]:
    """The table of entries over the recordings `paths`: its text in each format, and what to know of it, as JSON."""
    from dnb_edge.archive.bench_cards import cards_beside, with_cards  # noqa: PLC0415 the page's small jobs need none of it
    from dnb_edge.archive.comparable import check_comparable  # noqa: PLC0415
    from dnb_edge.archive.trials import raced_file, told_apart  # noqa: PLC0415
    from dnb_edge.report.table import RowsBy, result_table  # noqa: PLC0415
    from dnb_edge.report.table_files import as_csv, as_json_lines  # noqa: PLC0415
    from dnb_edge.report.table_latex import as_latex  # noqa: PLC0415

    paths = [Path(path) for path in spec["paths"]]
    found = []
    for done, path in enumerate(paths):
        tell(f"Racing recording {done + 1} of {len(paths)} again", done / len(paths))
        found.append(raced_file(path))
    found, cards_told = with_cards(told_apart(found), cards_beside(paths))
    told = [f"{run.path.name}: {text}" for run in found for text in run.warnings]
    warnings = [*check_comparable(found), *cards_told, *told]
    table = result_table((trial for run in found for trial in run.trials), RowsBy(spec["by"]))
    rows = [json.loads(line) for line in as_json_lines(table).splitlines()]
    made = {"csv": as_csv(table), "latex": as_latex(table), "rows": rows, "notes": list(table.notes)}
    made["warnings"] = [_without_folder(text, paths) for text in warnings]
    out.write_text(json.dumps(made, allow_nan=False), encoding="utf-8")
    return {}


def judged_laps(spec: dict[str, Any], out: Path, tell: Tell) -> dict[str, Any]:
    """The laps of the recording `path` after a judge's edits, those that he made scored, as JSON of `Marshalled`."""
    from dnb_edge import wire  # noqa: PLC0415 the page's small jobs need none of it
    from dnb_edge.archive.replayed import replay  # noqa: PLC0415

    tell("Racing the recording again", None)
    marshalled = replay(Path(spec["path"])).marshalled
    if marshalled is None:
        raise TemporaryFault(f"{Path(spec['path']).name}: its edits have changed just now: try again")
    out.write_text(json.dumps(wire.to_dict(marshalled), allow_nan=False), encoding="utf-8")
    return {}


def end_copy(spec: dict[str, Any], out: Path, tell: Tell) -> dict[str, Any]:
    """The end for a copy of `path` as it is now, and how much of that comes before it."""
    from dnb_edge.archive.live_copy import copy_end  # noqa: PLC0415

    tell("Reading what is recorded so far", None)
    made = copy_end(Path(spec["path"]), growing=bool(spec["growing"]))
    out.write_bytes(made.end)
    return {"data_bytes": made.data_bytes}


KINDS: dict[str, Callable[[dict[str, Any], Path, Tell], dict[str, Any]]] = {
    "report": make_report,
    "table": make_table,
    "laps": judged_laps,
    "copy": end_copy,
}


def _without_folder(text: str, paths: list[Path]) -> str:
    for folder in {path.parent for path in paths}:
        text = text.replace(f"{folder}{os.sep}", "")
    return text


def _limit() -> None:
    for kind, most in ((resource.RLIMIT_DATA, MEMORY_BYTES), (resource.RLIMIT_CPU, CPU_S), (resource.RLIMIT_CORE, 0)):
        _, hard = resource.getrlimit(kind)
        resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
    with contextlib.suppress(PermissionError):
        # A service may forbid it, and then has its own weight.
        os.nice(NICE)


def _die_with_parent() -> None:
    # Not through sys.stdin: its lock would be held when the interpreter ends.
    while os.read(0, 4096):
        pass
    os._exit(3)


def _tell(text: str, share: float | None) -> None:
    _say({"text": text, "share": share})


def _say(what: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
