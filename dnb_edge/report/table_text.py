"""The result table for people: aligned columns of text, and under them what must be said of the figures.

Knows how wide letters are on a terminal. Knows no file.
"""

from __future__ import annotations

from collections.abc import Sequence

from rich.cells import cell_len

from dnb_edge.report.inference import ms_text
from dnb_edge.report.table import EntryRow, ResultTable, printable

DNF = "DNF"
"""Did not finish: no valid lap."""

NO_VALUE = "-"
"""A figure that there is none of, in text."""

INTERVALS = "[ ]: 95 % confidence interval, over laps where there is one run, else over runs; sd: of laps"


INFERENCE = "Inference: median / 95th percentile for one picture, of the network alone"


def as_text(table: ResultTable) -> str:
    """The table: figures to the right, one line an entry, then one line a note; no trailing line feed.

    Spreads have columns where any entry has one, penalties where anybody got one.
    """
    columns = table_columns(table.rows)
    widths = [max(map(cell_len, column)) for column in columns]
    text = [_aligned(line, widths) for line in zip(*columns, strict=True)]
    text.insert(1, "  ".join("-" * width for width in widths))
    if table.conditions is not None:
        text = [printable(table.conditions), "", *text]
    notes = [printable(note) for note in table.notes]
    if any(row.interval_over is not None for row in table.rows):
        notes.append(INTERVALS)
    if any(row.inference_p50_ms is not None for row in table.rows):
        notes.append(INFERENCE)
    return "\n".join([*text, "", *notes] if notes else text)


def table_columns(rows: Sequence[EntryRow]) -> list[list[str]]:
    """The columns that the rows need, each with its heading first."""
    similarity, time = [_similarity(row) for row in rows], [_time(row) for row in rows]
    spread = any(row.completion_time_sd_s is not None for row in rows)
    columns = [
        ["Entry", *(printable(row.label) for row in rows)],
        ["Runs", *(str(row.runs) for row in rows)],
        ["Laps", *(f"{row.valid_laps} of {row.attempted_laps}" for row in rows)],
        ["Success", *map(_success, rows)],
        ["Path similarity (%)", *similarity],
        ["sd", *(_figure(row.similarity_sd_percent, "{:.2f}") for row in rows)] if spread else [],
        ["Completion time (s)", *time],
        ["sd", *(_figure(row.completion_time_sd_s, "{:.3f}") for row in rows)] if spread else [],
        ["Best lap (s)", *(_best(row) for row in rows)],
    ]
    if any(row.penalties for row in rows):
        columns.append(["Penalties", *(f"{row.penalties} (+{row.penalty_s:g} s)" for row in rows)])
    if any(row.collisions for row in rows):
        columns.append(["Collisions", *(str(row.collisions) for row in rows)])
    if any(row.inference_p50_ms is not None for row in rows):
        columns.append(["Inference (ms)", *map(_inference, rows)])
    return [column for column in columns if column]


def _success(row: EntryRow) -> str:
    """With its interval where that is over runs."""
    share = _figure(row.success_rate, "{:.0%}")
    low, high = row.success_ci95_low, row.success_ci95_high
    return share if row.runs < 2 or low is None or high is None else f"{share} [{100 * low:.0f}, {100 * high:.0f}]"


def _inference(row: EntryRow) -> str:
    """Median and 95th percentile."""
    if row.inference_p50_ms is None or row.inference_p95_ms is None:
        return NO_VALUE
    return f"{ms_text(row.inference_p50_ms)} / {ms_text(row.inference_p95_ms)}"


def _similarity(row: EntryRow) -> str:
    if not row.finished:
        return DNF
    mean = _figure(row.similarity_percent, "{:.2f}")
    return mean + _interval(row.similarity_ci95_low_percent, row.similarity_ci95_high_percent, "{:.2f}")


def _time(row: EntryRow) -> str:
    if not row.finished:
        return DNF
    mean = _figure(row.completion_time_s, "{:.3f}")
    return mean + _interval(row.completion_time_ci95_low_s, row.completion_time_ci95_high_s, "{:.3f}")


def _interval(low: float | None, high: float | None, form: str) -> str:
    return "" if low is None or high is None else f" [{form.format(low)}, {form.format(high)}]"


def _best(row: EntryRow) -> str:
    if row.best_lap_s is None or row.best_lap_sigma_s is None:
        return NO_VALUE
    return f"{row.best_lap_s:.3f} +- {row.best_lap_sigma_s:.3f}"


def _figure(value: float | None, form: str) -> str:
    return NO_VALUE if value is None else form.format(value)


def _aligned(cells: Sequence[str], widths: Sequence[int]) -> str:
    name, *figures = cells
    padded = [name + " " * (widths[0] - cell_len(name))]
    padded += [figure.rjust(width) for figure, width in zip(figures, widths[1:], strict=True)]
    return "  ".join(padded)
