"""The result table for spreadsheets and programs: CSV and JSON lines, figures in full.

Knows what a spreadsheet takes for a formula. Knows no file system.
"""

from __future__ import annotations

import csv
import io
import json

from dnb_edge import wire
from dnb_edge.report.table import EntryRow, ResultTable, printable

_FORMULA_STARTS = ("=", "+", "-", "@")
"""What makes a spreadsheet take a cell for a formula."""

COLUMNS = tuple(name for name in EntryRow.__dataclass_fields__ if name != "indistinguishable_from")
"""Of the CSV: the letters of the groups say the same in one cell."""


def as_csv(table: ResultTable) -> str:
    """A header, a line an entry, figures unrounded, empty cells where there is no figure, `; ` between several texts."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in table.rows:
        cells = wire.to_dict(row)
        writer.writerow([_csv_cell(cells[name]) for name in COLUMNS])
    return stream.getvalue()


def as_json_lines(table: ResultTable) -> str:
    """One JSON object a line, one line an entry."""
    return "".join(json.dumps(wire.to_dict(row), allow_nan=False) + "\n" for row in table.rows)


def _csv_cell(value: object) -> str:
    match value:
        case None:
            return ""
        case bool():
            return "true" if value else "false"
        case list():
            return _csv_cell("; ".join(map(str, value)))
        case str() if printable(value).lstrip(" ").startswith(_FORMULA_STARTS):
            return f"'{printable(value)}"
        case _:
            return printable(str(value))
