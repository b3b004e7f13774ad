"""A judge's decisions on a run's page: the laps that they touched, as they count and as the race said, and each decision.

Knows edited laps; everything is escaped by `report.markup`. Knows no file of edits.
"""

from __future__ import annotations

from dnb_edge.race.edit import Edit
from dnb_edge.race.marshal import Marshalled, MarshalledLap
from dnb_edge.report.markup import NONE, PLUS_MINUS, plain_table
from dnb_edge.values import Lap


def judged(marshalled: Marshalled | None, edits: tuple[Edit, ...]) -> str:
    """Two tables; empty where nobody decided anything."""
    if marshalled is None or not edits:
        return ""
    touched = [(one, "") for one in marshalled.laps if one.edits] + [(one, "removed: ") for one in marshalled.removed]
    several = len({one.lap.car for one, _ in touched}) > 1
    laps = [_lap_row(one, note, several=several) for one, note in touched]
    tables = (
        [plain_table("Laps with decisions", ("Lap", "As it counts", "As the race said", "Decisions"), laps)]
        if laps
        else []
    )
    states = {edit.number: "undone" for edit in marshalled.undone}
    states |= {told.edit.number: f"without effect: {told.text}" for told in marshalled.without_effect}
    rows = [
        (
            str(edit.number),
            edit.time,
            edit.author,
            f"{edit.action.value} {edit.subject}",
            edit.reason,
            states.get(edit.number, ""),
        )
        for edit in edits
    ]
    tables.append(plain_table("All decisions", ("Number", "Time", "By", "What", "Because", ""), rows))
    return "\n".join(tables)


def _lap_row(one: MarshalledLap, note: str, *, several: bool) -> tuple[str, ...]:
    name = f"car {one.lap.car}, lap {one.lap.number}" if several else str(one.lap.number)
    raw = "; ".join(map(_words, one.raw)) or NONE
    return name, note + _words(one.lap), raw, ", ".join(str(edit.number) for edit in one.edits)


def _words(lap: Lap) -> str:
    """Its number and time, what penalties add, whether it counts."""
    added = f" (+{lap.penalty_s:.3f})" if lap.penalty_s else ""
    valid = "" if lap.valid else ", not valid: " + "; ".join(lap.reasons)
    return f"lap {lap.number}, {lap.time_s:.4f} {PLUS_MINUS} {lap.sigma_s:.4f} s{added}{valid}"
