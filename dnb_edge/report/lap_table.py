"""The tables of laps on a run's page. Knows a `RunResult`; everything is escaped by `report.markup`. Knows no picture."""

from __future__ import annotations

from collections.abc import Sequence

from dnb_edge.report.lap_style import lap_name
from dnb_edge.report.markup import NONE, PLUS_MINUS, number, plain_table, text
from dnb_edge.report.run import RunResult
from dnb_edge.values import Lap, Score

_HEADINGS = (f"Time {PLUS_MINUS} sigma (s)", "Official (s)", "Similarity (%)", "Car seen (%)")

_DRIVEN_HEADINGS = (
    "DTW, mean (m)",
    "Fr\N{LATIN SMALL LETTER E WITH ACUTE}chet (m)",
    "Lateral, mean (m)",
    "p95 (m)",
    "max (m)",
    "max at s (m)",
    "Speed, mean (m/s)",
    "max (m/s)",
)


_OPEN_ROWS = 20
"""A longer second table is folded away."""

MOST_ROWS = 10_000
"""More laps are not told one by one: a page of a day's race should open everywhere."""


def lap_table(result: RunResult, *, most: int = MOST_ROWS) -> str:
    """The last `most` laps in their order, and how they were driven; a sentence where there is none."""
    if not result.laps:
        return "<p>No complete lap: the entry did not finish (DNF).</p>"
    several = result.several_cars
    heads = ["Lap", *(["Car"] if several else []), *_HEADINGS]
    head = "".join(f'<th scope="col">{text(heading)}</th>' for heading in heads)
    judges = _judges(result)
    names = {row.car: row.name for row in result.standings.rows} if result.standings is not None else {}
    rows = []
    for lap in result.laps[-most:]:
        car = [names.get(lap.car, str(lap.car))] if several else []
        rows.append(_row(lap, car, judges.get((lap.car, lap.number), ())))
    table = (
        f'<div class="scroll"><table>\n<thead><tr>{head}<th scope="col" class="text">Valid</th></tr></thead>\n'
        f"<tbody>\n{''.join(rows)}</tbody>\n</table></div>"
    )
    missing = len(result.laps) - most
    told = (
        f"<p>The first {missing} laps are left out: `dnb-edge runs export` has them all.</p>\n" if missing > 0 else ""
    )
    return f"{told}{table}\n{_driven(result, most)}"


def _driven(result: RunResult, most: int) -> str:
    """How close to the route and how fast the laps were; nothing where none was scored."""
    several = result.several_cars
    rows = []
    scores = {(score.lap, score.target_id): score for score in reversed(result.scores)}
    for lap in result.laps[-most:]:
        score = scores.get((lap.number, lap.target_id))
        name = lap_name(lap, several=True) if several else str(lap.number)
        rows.append((name, *((NONE,) * len(_DRIVEN_HEADINGS) if score is None else _score_cells(score))))
    if not result.scores:
        return ""
    caption = "How close to the route, and how fast. Lateral: distance from the centreline; s: along the route"
    table = plain_table(caption, ("Lap", *_DRIVEN_HEADINGS), rows)
    if len(rows) <= _OPEN_ROWS:
        return table
    return f"<details><summary>How close to the route, and how fast</summary>\n{table}</details>"


def _judges(result: RunResult) -> dict[tuple[int, int], tuple[str, ...]]:
    """By car and lap: what a judge decided about it, with name and reason."""
    if result.marshalled is None:
        return {}
    return {
        (one.lap.car, one.lap.number): tuple(
            f"{edit.action.value} by {edit.author}: {edit.reason}" for edit in one.edits
        )
        for one in result.marshalled.laps
    }


def _row(lap: Lap, car: Sequence[str], edits: Sequence[str]) -> str:
    cells = [
        *car,
        f"{lap.time_s:.4f} {PLUS_MINUS} {lap.sigma_s:.4f}",
        _official(lap),
        number(lap.similarity_percent, "{:.2f}"),
        f"{100 * lap.observed_fraction:.1f}",
    ]
    kind = "text" if lap.valid and not lap.suspect else "text bad"
    figures = "".join(f"<td>{text(cell)}</td>" for cell in cells)
    verdict = "<br>".join(text(line) for line in (_verdict(lap), *edits))
    return f'<tr><th scope="row">{lap.number}</th>{figures}<td class="{kind}">{verdict}</td></tr>\n'


def _official(lap: Lap) -> str:
    """The time with penalties and what of it they are; of a lap that was never judged, nothing."""
    if lap.official_time_s is None:
        return NONE
    return f"{lap.official_time_s:.4f}" + (f" (+{lap.penalty_s:.3f})" if lap.penalty_s > 0 else "")


def _verdict(lap: Lap) -> str:
    """Whether the lap counts, and what else must be known of its numbers."""
    verdict = "yes" if lap.valid else "no: " + "; ".join(lap.reasons)
    if lap.suspect:
        verdict += ", but suspect: " + "; ".join(lap.suspect)
    if lap.estimated:
        verdict += ", estimated: the car was not seen where it crossed the line"
    return verdict


def _score_cells(score: Score) -> tuple[str, ...]:
    return (
        f"{score.dtw_mean_m:.4f}",
        f"{score.frechet_m:.4f}",
        f"{score.lateral_mean_m:.4f}",
        number(score.lateral_p95_m, "{:.4f}"),
        f"{score.lateral_max_m:.4f}",
        number(score.lateral_max_s_m, "{:.2f}"),
        number(score.speed_mean_mps, "{:.2f}"),
        number(score.speed_max_mps, "{:.2f}"),
    )
