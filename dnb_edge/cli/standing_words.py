"""The last standings of a race in words: what `score` and `judge` tell people of who is first.

Knows events; knows no recording and no terminal.
"""

from __future__ import annotations

from collections.abc import Sequence

from dnb_edge.report.table import printable
from dnb_edge.values import Event, Standing, Standings


def last_standings(events: Sequence[Event]) -> Standings | None:
    """The last ones that were told; None before a car has begun its race."""
    return next((event for event in reversed(events) if isinstance(event, Standings)), None)


def standing_words(row: Standing, unit: str) -> str:
    """One line of them without its place, such as `Ada  12.483 s (tied for 1)`."""
    value = "no result" if row.value is None else f"{row.value:.3f} {unit}"
    end = "" if row.dnf is None else f", DNF: {printable(row.dnf)}"
    tie = f" (tied for {row.place})" if row.tied else ""
    return f"{printable(row.name)}  {value}{tie}{end}"
