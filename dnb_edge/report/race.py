"""The race's part of a run's page: standings, a judge's decisions, sectors and incidents with their pictures, as HTML.

Knows a `RunResult`; whatever came from a user or a file is escaped by `report.markup`. Knows no recording.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from dnb_edge.race.standings import TheoreticalLap, best_theoretical
from dnb_edge.report.judged import judged
from dnb_edge.report.lap_style import lap_name
from dnb_edge.report.lap_table import MOST_ROWS
from dnb_edge.report.markup import NONE, PLUS_MINUS, data_uri, number, plain_table, text
from dnb_edge.report.run import RunResult
from dnb_edge.values import Incident, Lap, SectorTime, Standing

_RANKED_BY = "Standings by {}"

MOST_INCIDENTS = 1000
"""More are counted by their kind."""


def race_sections(result: RunResult) -> str:
    """All sections that have something to show, in order; empty where there is none."""
    parts = [
        ("Standings", _standings(result)),
        ("A judge's decisions", judged(result.marshalled, result.edits)),
        ("Sectors", _sectors(result)),
        ("Incidents", _incidents(result)),
    ]
    return "\n".join(f"<section>\n<h2>{title}</h2>\n{body}\n</section>" for title, body in parts if body)


def _standings(result: RunResult) -> str:
    standings = result.standings
    if standings is None or len(standings.rows) < 2:
        return ""
    headings = ("Place", "Car", "Laps", f"Value ({standings.unit})", "sigma", "Gap", "Interval")
    rows = [_standing(row) for row in standings.rows]
    ties = any(row.tied for row in standings.rows)
    note = "<p>= : nobody can tell which of two neighbours is better: the difference lies inside their uncertainty.</p>"
    return plain_table(_RANKED_BY.format(standings.rank_by.replace("_", " ")), headings, rows) + (note if ties else "")


def _standing(row: Standing) -> tuple[str, ...]:
    name = row.name if row.dnf is None else f"{row.name} (out: {row.dnf})"
    return (
        f"{row.place}{'=' if row.tied else ''}",
        name,
        f"{row.valid_laps} valid of {row.laps}",
        number(row.value, "{:.4f}"),
        number(row.sigma, "{:.4f}"),
        _behind(row.gap, row.gap_laps),
        _behind(row.interval, row.interval_laps),
    )


def _behind(value: float | None, laps: int | None) -> str:
    """How far a car is behind, in laps where times say nothing."""
    if value is None and laps is not None:
        return f"+{laps} lap{'' if laps == 1 else 's'}"
    return number(value, "{:.4f}")


def _sectors(result: RunResult) -> str:
    laps = [lap for lap in result.laps[-MOST_ROWS:] if lap.sectors]
    if not laps:
        return ""
    several = result.several_cars
    headings = ["", *(f"Sector {one.number} (s)" for one in laps[0].sectors), "Lap (s)"]
    rows = [[lap_name(lap, several=several), *map(_sector, lap.sectors), f"{lap.time_s:.4f}"] for lap in laps]
    for car in sorted({lap.car for lap in laps}):
        mine = [lap for lap in laps if lap.car == car]
        best = best_theoretical(mine)
        if best is not None:
            together = f"{best.time_s:.4f} {PLUS_MINUS} {best.sigma_s:.4f}"
            rows.append([f"car {car}, best" if several else "best", *_best_of_each(best, mine), together])
    caption = (
        f"Times between the sector lines, {PLUS_MINUS} sigma. Best: of the valid laps, and the lap that it would make"
    )
    return plain_table(caption, headings, rows)


def _best_of_each(best: TheoreticalLap, laps: Sequence[Lap]) -> list[str]:
    """Each sector's least time, with the lap in which it was driven."""
    by_number = {lap.number: {one.number: one for one in lap.sectors} for lap in laps}
    return [
        f"{number(by_number[lap][sector].time_s, '{:.4f}')} (lap {lap})"
        for sector, lap in enumerate(best.laps, start=1)
    ]


def _sector(sector: SectorTime) -> str:
    if sector.time_s is None:
        return NONE
    return f"{sector.time_s:.4f}" + ("" if sector.sigma_s is None else f" {PLUS_MINUS} {sector.sigma_s:.4f}")


def _incidents(result: RunResult) -> str:
    if not result.incidents:
        return ""
    several = result.several_cars
    rows = "".join(
        _incident(one, result.thumbnails.get((one.car, one.number)), several=several)
        for one in result.incidents[:MOST_INCIDENTS]
    )
    kinds = Counter(one.kind.value.replace("_", " ") for one in result.incidents[MOST_INCIDENTS:])
    more = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
    return (
        f"<p>Left out, later than these: {text(more)}.</p>\n" if more else ""
    ) + f'<ul class="incidents">\n{rows}</ul>'


def _incident(incident: Incident, jpeg: bytes | None, *, several: bool) -> str:
    where = NONE if incident.s_m is None else f"{incident.s_m:.2f} m along the route"
    lap = "outside laps" if incident.lap is None else f"lap {incident.lap}"
    facts = f"{lap}, {incident.start_s:.2f} s after the first frame, for {incident.lasted_s:.2f} s; {where}"
    if several:
        facts = f"car {incident.car}, {facts}"
    picture = ""
    if jpeg is not None:
        alt = text(f"The picture at the worst moment: {incident.text}")
        picture = f'<img alt="{alt}" src="{data_uri(jpeg, "image/jpeg")}">'
    return f"<li>{picture}<div><strong>{text(incident.text)}</strong><br>{text(facts)}</div></li>\n"
