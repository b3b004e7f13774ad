"""A recording's laps, passes and incidents as CSV: what `dnb-edge runs export` writes.

Knows which fields go into which column and what a spreadsheet takes for a formula; knows no option and no file to write.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from enum import StrEnum
from typing import Any

from dnb_edge import wire
from dnb_edge.race.marshal import Marshalled, MarshalledLap
from dnb_edge.record.reader import RecordedRun
from dnb_edge.values import Crossing, Incident, Lap, Penalty


class Table(StrEnum):
    """What of a recording can be exported."""

    LAPS = "laps"
    PASSES = "passes"
    INCIDENTS = "incidents"


EDIT_COLUMNS = ("removed", "edited_by", "raw_number", "raw_time_s", "raw_official_time_s", "raw_valid")
"""What a judge decided about a lap, and what the race itself said of it: of the first one where several were merged, nothing
where the judge added it."""

LAP_COLUMNS = (
    "number", "start_s", "time_s", "sigma_s", "valid", "reasons", "similarity_percent", "observed_fraction", "suspect",
    "car", "official_time_s", "penalty_s", "penalty_factor", "penalties", "estimated", *EDIT_COLUMNS,
)  # fmt: skip
"""Of the laps; `sector_1_s`, `sector_1_sigma_s` ... follow for every sector that the track has."""

PASS_COLUMNS = (
    "t_s", "line", "direction", "status", "reason", "car", "lap", "sigma_s", "speed_mps", "estimated", "x_m", "y_m",
    "target_id",
)  # fmt: skip
"""Of the passes: every crossing of every line, whatever the race made of it. `x_m` and `y_m` are track m."""

INCIDENT_COLUMNS = (
    "number", "kind", "car", "lap", "start_s", "lasted_s", "greatest_m", "s_m", "x_m", "y_m", "u_px", "v_px", "text",
)  # fmt: skip
"""Of the incidents. `x_m` and `y_m` are track m, `u_px` and `v_px` camera px."""


_FORMULA_STARTS = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""What makes a spreadsheet take a cell for a formula, in full width too."""


def as_csv(run: RecordedRun, table: Table, marshalled: Marshalled | None = None) -> str:
    """One table of `run` with a heading, floats in full, the entry's name in front. Raises InputError.

    `marshalled` are its laps after a judge's edits, those taken away among them; None where nobody edited any.
    """
    name, events = run.header.name, run.events()
    match table:
        case Table.PASSES:
            return passes_csv(name, (event for event in events if isinstance(event, Crossing)))
        case Table.INCIDENTS:
            return incidents_csv(name, (event for event in events if isinstance(event, Incident)))
        case Table.LAPS:
            if marshalled is None:
                laps = (event for event in events if isinstance(event, Lap))
                marshalled = Marshalled(laps=tuple(MarshalledLap(lap=lap, raw=(lap,)) for lap in laps))
            return laps_csv(name, marshalled)


def laps_csv(name: str, marshalled: Marshalled) -> str:
    """The laps of the run of entry `name`, those that a judge took away behind the others."""
    rows = [(one, False) for one in marshalled.laps] + [(one, True) for one in marshalled.removed]
    sectors = range(1, max((sector.number for one, _ in rows for sector in one.lap.sectors), default=0) + 1)
    columns = [*LAP_COLUMNS, *(f"sector_{k}_{figure}" for k in sectors for figure in ("s", "sigma_s"))]
    return _table(name, columns, (_lap(one.lap) | _edited(one, removed=removed) for one, removed in rows))


def _edited(one: MarshalledLap, *, removed: bool) -> dict[str, Any]:
    """A lap's cells of `EDIT_COLUMNS`."""
    cells: dict[str, Any] = {"removed": removed}
    cells["edited_by"] = "; ".join(
        f"{edit.number} {edit.action.value} by {edit.author}: {edit.reason}" for edit in one.edits
    )
    if one.raw:
        names = ("number", "time_s", "official_time_s", "valid")
        cells |= {f"raw_{name}": getattr(one.raw[0], name) for name in names}
    return cells


def _lap(lap: Lap) -> dict[str, Any]:
    cells = wire.to_dict(lap)
    cells |= {name: "; ".join(cells[name]) for name in ("reasons", "suspect")}
    cells["penalties"] = "; ".join(map(_penalty_text, lap.penalties))
    for sector in lap.sectors:
        cells |= {f"sector_{sector.number}_s": sector.time_s, f"sector_{sector.number}_sigma_s": sector.sigma_s}
    return cells


def _penalty_text(penalty: Penalty) -> str:
    """What the penalty costs and why, such as `off_track: +3 s (left the lane)`."""
    costs = [
        f"+{penalty.seconds:g} s" if penalty.seconds else "",
        f"x {penalty.factor:g}" if penalty.factor != 1.0 else "",
        "not valid" if penalty.invalid else "",
        "DNF" if penalty.dnf else "",
    ]
    return f"{penalty.offence}: {', '.join(filter(None, costs)) or 'nothing'} ({penalty.reason})"


def passes_csv(name: str, passes: Iterable[Crossing]) -> str:
    """Every crossing of a line in the run of entry `name`."""
    return _table(name, PASS_COLUMNS, (wire.to_dict(one) | _places(one) for one in passes))


def incidents_csv(name: str, incidents: Iterable[Incident]) -> str:
    """What happened besides in the run of entry `name`."""
    return _table(name, INCIDENT_COLUMNS, (wire.to_dict(one) | _places(one) for one in incidents))


def _places(event: Crossing | Incident) -> dict[str, float | None]:
    x_m, y_m = event.track_m
    u_px, v_px = (None, None) if isinstance(event, Crossing) or event.camera_px is None else event.camera_px
    return {"x_m": x_m, "y_m": y_m, "u_px": u_px, "v_px": v_px}


def _table(name: str, columns: Sequence[str], rows: Iterable[dict[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(("run", *columns))
    for row in rows:
        writer.writerow([_cell(name), *(_cell(row.get(column)) for column in columns)])
    return text.getvalue()


def _cell(value: object) -> str:
    """`value` as a spreadsheet should show it: never as a formula, whatever name somebody gave to a run."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str) and (value.startswith(("\t", "\r", "\n")) or value.lstrip().startswith(_FORMULA_STARTS)):
        return "'" + value
    return str(value)
