"""The paper's Table I for any set of runs: entry, path similarity, completion time; as text, CSV and JSON.

Knows laps and who drove them. Both figures are means over the entry's valid laps; an entry without a valid lap did not
finish (DNF). Knows no file and no picture.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Protocol

from rich.cells import cell_len

from dnb_edge import wire
from dnb_edge.values import Lap

DNF = "DNF"
"""Did not finish: no valid lap."""

NO_VALUE = "-"
"""A figure that there is none of, in text."""

HEADINGS = ("Entry", "Laps", "Path similarity (%)", "Completion time (s)")

_FORMULA_STARTS = ("=", "+", "-", "@")
"""What makes a spreadsheet take a cell for a formula."""


class Attempt(Protocol):
    """Anything with an entry's name and its laps, such as a `RunResult`."""

    @property
    def entry(self) -> str:
        """Who drove."""

    @property
    def laps(self) -> Sequence[Lap]:
        """All laps, valid or not."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EntryRow:
    """One row of the table: all runs of one entry."""

    entry: str
    runs: int
    laps: int
    valid_laps: int
    finished: bool
    """False where no lap is valid: the text says DNF."""
    similarity_percent: float | None
    """Mean over the valid laps that were scored, 0..100; None where there is none."""
    completion_time_s: float | None
    """Mean over the valid laps; None where there is none."""
    best_lap_s: float | None


def entry_rows(attempts: Iterable[Attempt]) -> tuple[EntryRow, ...]:
    """One row an entry, in the order in which entries first appear; runs of the same entry are taken together."""
    by_entry: dict[str, list[Attempt]] = {}
    for attempt in attempts:
        by_entry.setdefault(attempt.entry, []).append(attempt)
    return tuple(_row(entry, runs) for entry, runs in by_entry.items())


def as_text(rows: Sequence[EntryRow]) -> str:
    """The table for people: aligned columns, figures to the right, no trailing line feed."""
    lines = [HEADINGS, *(_cells(row) for row in rows)]
    widths = [max(cell_len(line[column]) for line in lines) for column in range(len(HEADINGS))]
    text = [_aligned(line, widths) for line in lines]
    text.insert(1, "  ".join("-" * width for width in widths))
    return "\n".join(text)


def as_csv(rows: Sequence[EntryRow]) -> str:
    """The table for spreadsheets: a header, a line an entry, figures unrounded, empty cells where there is no figure."""
    stream = io.StringIO()
    names = list(EntryRow.__dataclass_fields__)
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow([_csv_cell(value) for value in wire.to_dict(row).values()])
    return stream.getvalue()


def as_json_lines(rows: Sequence[EntryRow]) -> str:
    """The table for programs: one JSON object a line, one line an entry."""
    return "".join(json.dumps(wire.to_dict(row), allow_nan=False) + "\n" for row in rows)


def printable(text: str) -> str:
    """`text` on one line and without control characters: any space as a plain one, anything else unprintable as `?`."""
    return "".join(char if char.isprintable() else " " if char.isspace() else "?" for char in text)


def _row(entry: str, runs: Sequence[Attempt]) -> EntryRow:
    laps = [lap for run in runs for lap in run.laps]
    valid = [lap for lap in laps if lap.valid]
    similarities = [lap.similarity_percent for lap in valid if lap.similarity_percent is not None]
    return EntryRow(
        entry=entry,
        runs=len(runs),
        laps=len(laps),
        valid_laps=len(valid),
        finished=bool(valid),
        similarity_percent=fmean(similarities) if similarities else None,
        completion_time_s=fmean(lap.time_s for lap in valid) if valid else None,
        best_lap_s=min((lap.time_s for lap in valid), default=None),
    )


def _cells(row: EntryRow) -> tuple[str, str, str, str]:
    name = printable(row.entry)
    laps = f"{row.valid_laps} of {row.laps}"
    if row.completion_time_s is None:
        return name, laps, DNF, DNF
    similarity = NO_VALUE if row.similarity_percent is None else f"{row.similarity_percent:.2f}"
    return name, laps, similarity, f"{row.completion_time_s:.3f}"


def _aligned(cells: Sequence[str], widths: Sequence[int]) -> str:
    name, *figures = cells
    padded = [name + " " * (widths[0] - cell_len(name))]
    padded += [figure.rjust(width) for figure, width in zip(figures, widths[1:], strict=True)]
    return "  ".join(padded)


def _csv_cell(value: object) -> str:
    match value:
        case None:
            return ""
        case bool():
            return "true" if value else "false"
        case str() if printable(value).lstrip(" ").startswith(_FORMULA_STARTS):
            return f"'{printable(value)}"
        case _:
            return printable(str(value))
