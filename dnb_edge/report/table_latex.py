r"""The result table for papers: a LaTeX tabular in the manner of the paper's Table I, with booktabs' rules.

Knows LaTeX's special characters. Captions, labels and floats are the author's.
"""

from __future__ import annotations

from collections.abc import Sequence

from dnb_edge.report.inference import ms_text
from dnb_edge.report.table import EntryRow, ResultTable, printable

_SPECIAL = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
}

_NONE = "--"

_CI = r"95\,\% CI"


def as_latex(table: ResultTable) -> str:
    """A `tabular` with its notes as comments. Means are followed by the laps' standard deviation and the letters of those who
    cannot be told apart; intervals and penalties have columns where there are any.
    """
    columns = _columns(table.rows)
    head = " & ".join(rf"\textbf{{{column[0]}}}" for column in columns)
    body = [" & ".join(cells) for cells in zip(*(column[1:] for column in columns), strict=True)]
    lines = [
        *([] if table.conditions is None else [f"% {printable(table.conditions)}"]),
        r"% Needs \usepackage{booktabs}.",
        rf"\begin{{tabular}}{{l{'r' * (len(columns) - 1)}}}",
        r"\toprule",
        rf"{head} \\",
        r"\midrule",
        *(rf"{row} \\" for row in body),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    if any(row.interval_over is not None for row in table.rows):
        lines.append(r"% Mean \pm standard deviation of laps; CI: of the mean, over laps with one run, else over runs.")
    if any(row.similarity_group or row.completion_time_group for row in table.rows):
        lines.append("% Means with a letter in common cannot be told apart (Welch's t test, Holm's correction, 95 %).")
    return "\n".join([*lines, *(f"% {printable(note)}" for note in table.notes)]) + "\n"


def escaped(text: str) -> str:
    """`text` as LaTeX sets it, on one line."""
    plain = "".join(_SPECIAL.get(char, char) for char in printable(text))
    # After the end of a row, \\ would take these for its own.
    return "{}" + plain if plain.startswith(("[", "*")) else plain


def _columns(rows: Sequence[EntryRow]) -> list[list[str]]:
    similarity = [
        _mean(row, row.similarity_percent, row.similarity_sd_percent, row.similarity_group, 2) for row in rows
    ]
    time = [_mean(row, row.completion_time_s, row.completion_time_sd_s, row.completion_time_group, 3) for row in rows]
    columns = [
        ["Entry", *(escaped(row.label) for row in rows)],
        ["Runs", *(str(row.runs) for row in rows)],
        ["Laps", *(f"{row.valid_laps}/{row.attempted_laps}" for row in rows)],
        [r"Success (\%)", *map(_success, rows)],
        [r"Path Sim.\ (\%)", *similarity],
        [_CI, *(_interval(row.similarity_ci95_low_percent, row.similarity_ci95_high_percent, 2) for row in rows)],
        ["Completion Time (s)", *time],
        [_CI, *(_interval(row.completion_time_ci95_low_s, row.completion_time_ci95_high_s, 3) for row in rows)],
        ["Best Lap (s)", *(_best(row) for row in rows)],
    ]
    if any(row.penalties for row in rows):
        columns.append(["Penalties (s)", *(f"{row.penalty_s:g}" for row in rows)])
    if any(row.collisions for row in rows):
        columns.append(["Collisions", *(str(row.collisions) for row in rows)])
    if any(row.inference_p95_ms is not None for row in rows):
        columns.append([r"Inference $p_{95}$ (ms)", *map(_inference, rows)])
    return [column for column in columns if column[0] != _CI or not set(column[1:]) <= {_NONE}]


def _success(row: EntryRow) -> str:
    """With its interval where that is over runs."""
    if row.success_rate is None:
        return _NONE
    part = f"{100 * row.success_rate:.0f}"
    low, high = row.success_ci95_low, row.success_ci95_high
    return part if row.runs < 2 or low is None or high is None else f"{part} [{100 * low:.0f}, {100 * high:.0f}]"


def _inference(row: EntryRow) -> str:
    return _NONE if row.inference_p95_ms is None else ms_text(row.inference_p95_ms)


def _mean(row: EntryRow, mean: float | None, sd: float | None, group: str | None, digits: int) -> str:
    if not row.finished:
        return "DNF"
    if mean is None:
        return _NONE
    spread = "" if sd is None else rf" \pm {sd:.{digits}f}"
    letters = "" if group is None else rf"^{{\mathrm{{{group}}}}}"
    return f"${mean:.{digits}f}{spread}{letters}$"


def _interval(low: float | None, high: float | None, digits: int) -> str:
    return _NONE if low is None or high is None else f"[{low:.{digits}f}, {high:.{digits}f}]"


def _best(row: EntryRow) -> str:
    if row.best_lap_s is None or row.best_lap_sigma_s is None:
        return _NONE
    return rf"${row.best_lap_s:.3f} \pm {row.best_lap_sigma_s:.3f}$"
