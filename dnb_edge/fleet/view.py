"""What the hub's pages show of a box and of a lap, as text.

Events come from boxes of other versions, so each member is looked at before it is used. Pure; knows no page and no file.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from dnb_edge.fleet.hub import Seen
from dnb_edge.fleet.messages import BoxState
from dnb_edge.fleet.store import Row

NONE = "–"
MOST_ROWS = 16
"""Of a box's standings."""
_PHASES = {
    "starting": "starting",
    "racing": "racing",
    "setup": "being set up",
    "finished": "the run is over",
    "fault": "fault",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class StandingCells:
    """One car of a box's standings."""

    place: str
    name: str
    laps: str
    best: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """One box."""

    name: str
    tone: str
    """`good`, `warn` or `bad`."""
    words: str
    reason: str | None
    warnings: tuple[str, ...]
    facts: tuple[tuple[str, str], ...]
    standings: tuple[StandingCells, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LapCells:
    """One lap."""

    box: str
    run: str | None
    car: str
    number: str
    time: str
    sigma: str
    similarity: str
    valid: bool | None
    verdict: str
    at: str
    """When the hub stored it, by its own clock."""


def card(seen: Seen, last: Row | None, *, wall_s: float) -> Card:
    """The box as it is now; `last`: its last lap."""
    state = seen.box.state
    tone, words = _standing(seen, state)
    facts = [("Laps here", str(seen.box.laps))]
    if last is not None:
        facts.append(("Last lap", f"{lap(last).time} ({lap(last).verdict})"))
    if state is not None:
        facts += [
            (name, text)
            for name, text in (("Track", state.track), ("Run", state.run), ("Source", state.source))
            if text
        ]
        facts += _health(state.health or {})
        if state.queued:
            facts.append(("Waiting on the box", str(state.queued)))
    if seen.box.missing:
        facts.append(("Never came", str(seen.box.missing)))
    if seen.box.state_wall_s is not None:
        facts.append(("Heard", _ago(wall_s - seen.box.state_wall_s)))
    return Card(
        name=seen.box.name,
        tone=tone,
        words=words,
        reason=None if state is None or seen.online is False else state.reason,
        warnings=() if state is None or seen.online is False else _warnings(state),
        facts=tuple(facts),
        standings=() if state is None else _standings(state.standings or {}),
    )


def lap(row: Row) -> LapCells:
    """One lap's line in a table."""
    event = row.event
    valid = event.get("valid")
    valid = valid if isinstance(valid, bool) else None
    reasons = event.get("reasons")
    because = ", ".join(map(str, reasons)) if isinstance(reasons, list) else ""
    return LapCells(
        box=row.box,
        run=row.run,
        car=_text(event.get("car")),
        number=_text(event.get("number")),
        time=_seconds(event.get("time_s"), 3),
        sigma=_seconds(event.get("sigma_s"), 4),
        similarity=f"{_fixed(event.get('similarity_percent'), 2)} %"
        if _is_number(event.get("similarity_percent"))
        else NONE,
        valid=valid,
        verdict="valid" if valid else NONE if valid is None else f"not valid: {because}" if because else "not valid",
        at=time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(row.wall_s)),
    )


def _standing(seen: Seen, state: BoxState | None) -> tuple[str, str]:
    if seen.online is None:
        return "warn", "not heard since the hub is on the line"
    if not seen.online:
        return "bad", f"offline: {seen.gone}" if seen.gone else "offline"
    if state is None or state.phase is None:
        return "warn", "on the line, its race does not answer"
    return "bad" if state.phase == "fault" else "good", _PHASES.get(state.phase, state.phase)


def _health(health: dict[str, Any]) -> list[tuple[str, str]]:
    facts = []
    if _is_number(health.get("fps")):
        facts.append(("Frames a second", _fixed(health["fps"], 1)))
    if _is_number(health.get("latency_ms")):
        facts.append(("Latency", f"{_fixed(health['latency_ms'], 0)} ms"))
    if _is_number(health.get("temperature_c")):
        facts.append(("Processor", f"{_fixed(health['temperature_c'], 0)} °C"))
    if _is_number(health.get("disk_free_bytes")):
        facts.append(("Room on its disk", f"{_fixed(health['disk_free_bytes'] / 1e9, 1)} GB"))
    return facts


def _warnings(state: BoxState) -> tuple[str, ...]:
    warnings = (state.health or {}).get("warnings")
    found = tuple(map(str, warnings)) if isinstance(warnings, list) else ()
    if state.thrown_away:
        found = (*found, f"its queue was full: {state.thrown_away} results are in its recordings alone")
    return found


def _standings(standings: dict[str, Any]) -> tuple[StandingCells, ...]:
    rows = standings.get("rows")
    if not isinstance(rows, list):
        return ()
    return tuple(
        StandingCells(
            place=_text(row.get("place")),
            name=_text(row.get("name")),
            laps=_text(row.get("laps")),
            best=_seconds(row.get("best_lap_s"), 3),
        )
        for row in rows[:MOST_ROWS]
        if isinstance(row, dict)
    )


def _ago(passed_s: float) -> str:
    """Coarse on purpose: a figure that changes with each look says nothing."""
    if passed_s < 10.0:
        return "just now"
    if passed_s < 90.0:
        return f"{passed_s // 10 * 10:.0f} s ago"
    if passed_s < 5400.0:
        return f"{passed_s / 60:.0f} min ago"
    return f"{passed_s / 3600:.0f} h ago"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _seconds(value: Any, digits: int) -> str:
    return f"{_fixed(value, digits)} s" if _is_number(value) else NONE


def _fixed(value: Any, digits: int) -> str:
    return f"{value:.{digits}f}"


def _text(value: object) -> str:
    return NONE if value is None else str(value)
