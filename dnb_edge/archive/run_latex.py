r"""A recording's laps for papers: a LaTeX tabular with booktabs' rules.

Knows laps; LaTeX's special characters know `report.table_latex`. Captions, labels and floats are the author's.
"""

from __future__ import annotations

from dnb_edge.race.marshal import Marshalled
from dnb_edge.report.table_latex import escaped
from dnb_edge.values import Lap

_NONE = "--"


def laps_latex(entry: str, marshalled: Marshalled) -> str:
    """The laps that count, a line each; times with their standard deviation, penalties and similarity where there are any."""
    laps = [one.lap for one in marshalled.laps]
    columns: list[tuple[str, list[str]]] = [("Lap", [str(lap.number) for lap in laps])]
    if len({lap.car for lap in laps}) > 1:
        columns.append(("Car", [str(lap.car) for lap in laps]))
    columns.append(("Time (s)", [_time(lap) for lap in laps]))
    sectors = max((sector.number for lap in laps for sector in lap.sectors), default=0)
    columns += [(f"S{number} (s)", [_sector(lap, number) for lap in laps]) for number in range(1, sectors + 1)]
    if any(lap.penalty_s for lap in laps):
        columns.append(("Penalties (s)", [f"{lap.penalty_s:g}" for lap in laps]))
    if any(lap.similarity_percent is not None for lap in laps):
        columns.append((r"Path Sim.\ (\%)", [_similarity(lap) for lap in laps]))
    columns.append(("Valid", ["yes" if lap.valid else "no" for lap in laps]))
    rows = [" & ".join(cells) for cells in zip(*(cells for _, cells in columns), strict=True)]
    head = " & ".join(rf"\textbf{{{name}}}" for name, _ in columns)
    lines = [
        rf"% Laps of {escaped(entry)}. Needs \usepackage{{booktabs}}. Times are followed by their standard deviation.",
        rf"\begin{{tabular}}{{{'r' * (len(columns) - 1)}l}}",
        r"\toprule",
        rf"{head} \\",
        r"\midrule",
        *(rf"{row} \\" for row in rows),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"


def _time(lap: Lap) -> str:
    return rf"${lap.time_s:.4f} \pm {lap.sigma_s:.4f}$"


def _sector(lap: Lap, number: int) -> str:
    time_s = next((one.time_s for one in lap.sectors if one.number == number), None)
    return _NONE if time_s is None else f"{time_s:.3f}"


def _similarity(lap: Lap) -> str:
    return _NONE if lap.similarity_percent is None else f"{lap.similarity_percent:.2f}"
