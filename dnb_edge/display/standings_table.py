"""The standings of several cars as the terminal board shows them. Knows one `Standings`; knows no car's laps."""

from __future__ import annotations

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from dnb_edge import values

LEAST_CARS = 2
"""From so many cars on there are standings to show."""


def standings_table(standings: values.Standings, rows: int) -> RenderableType:
    """The best `rows` cars: place (`=` where it cannot be told), car, laps, what they are ranked by, gap, last lap."""
    table = Table(box=None, expand=True, padding=(0, 1), header_style="dim")
    table.add_column("", justify="right", width=3)
    table.add_column("car", ratio=1, no_wrap=True, overflow="ellipsis")
    table.add_column("laps", justify="right", width=4)
    table.add_column(standings.rank_by.replace("_", " "), justify="right", width=12)
    table.add_column("gap", justify="right", width=9)
    table.add_column("last", justify="right", width=9)
    shown = standings.rows[:rows]
    for row in shown:
        place = f"{row.place}{'=' if row.tied else ''}"
        # Text, never markup: a name may hold brackets.
        name = Text(row.name if row.dnf is None else f"{row.name} (out: {row.dnf})")
        style = "red" if row.dnf is not None else "bold green" if row.place == 1 else ""
        value = "-" if row.value is None else f"{_figure(row.value, standings.unit)} {standings.unit}"
        gap = _gap(row, standings.unit)
        last = "-" if row.last_lap_s is None else f"{row.last_lap_s:.3f}"
        table.add_row(place, name, str(row.laps), value, gap, last, style=style)
    for _ in range(rows - len(shown)):
        table.add_row()
    return table


def _gap(row: values.Standing, unit: str) -> str:
    """Behind the leader; in laps where the times of different numbers of laps say nothing; empty for the leader."""
    if row.gap is not None:
        return f"+{_figure(abs(row.gap), unit)}"
    if row.gap_laps is not None:
        return f"+{row.gap_laps} lap{'' if row.gap_laps == 1 else 's'}"
    return ""


def _figure(value: float, unit: str) -> str:
    return f"{value:.3f}" if unit == "s" else f"{value:.1f}" if unit in {"percent", "m"} else f"{value:g}"
