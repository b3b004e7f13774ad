"""What a race makes a vehicle do: stop, ready, go; and its laps. A pure reducer of what the live socket says.

Knows live messages. Knows no channel and no clock.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from dnb_edge.live.messages import Hello, Phase, State, Told
from dnb_edge.values import RacePhase

GRID = "grid"


class Word(StrEnum):
    """What holds until another word is said."""

    STOP = "stop"
    READY = "ready"
    GO = "go"


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """A line for vehicles."""

    line: bytes
    car: int | None = None
    """Whom it concerns; None for all."""


class Signals:
    """Follows one daemon. What nobody has told is no reason to drive: at first, and while the daemon is away, it is stop."""

    def __init__(self) -> None:
        self._state: State | None = None
        self._race: RacePhase | None = None
        self._live_from = 0
        """Number of the first event that is news."""
        self.word = Word.STOP
        """What holds now."""

    def greeted(self, hello: Hello) -> None:
        """A connection begins: events before its next one are only to be known, not told."""
        self._live_from = hello.next_sequence
        self._state, self._race = None, None

    def gone(self) -> None:
        """The daemon is away."""
        self._state, self._race = None, None
        self._decide()

    def state(self, state: State) -> None:
        """What the daemon does now."""
        if self._state is None or state.first_sequence != self._state.first_sequence:
            self._race = None
        self._state = state
        self._decide()

    def told(self, told: Told) -> Signal | None:
        """An event; a lap's signal where it is one that has just been driven."""
        event = told.event
        if event.get("event") == "race":
            self._race = _phase(event.get("phase"))
            self._decide()
        if event.get("event") == "lap" and told.sequence >= self._live_from:
            return _lap(event)
        return None

    @property
    def standing(self) -> Signal:
        """The word that holds, as a line."""
        return Signal(line=_line(signal=self.word.value))

    def _decide(self) -> None:
        self.word = _word(self._state, self._race)


def _word(state: State | None, race: RacePhase | None) -> Word:
    if state is None or state.phase is not Phase.RACING or race is RacePhase.FINISHED:
        return Word.STOP
    if state.start == GRID:
        if race is RacePhase.COUNTDOWN:
            return Word.READY
        return Word.GO if race in {RacePhase.RACING, RacePhase.GRACE} else Word.STOP
    # A rolling start: cars must drive to begin. The race's first word comes with the camera's first picture.
    return Word.READY if race is None else Word.GO


def _phase(said: object) -> RacePhase | None:
    return RacePhase(said) if isinstance(said, str) and said in set(RacePhase) else None


def _lap(event: dict[str, Any]) -> Signal:
    members = {
        "car": event.get("car"),
        "lap": event.get("number"),
        "time_s": event.get("time_s"),
        "valid": event.get("valid"),
    }
    car = event.get("car")
    return Signal(line=_line(signal="lap", **members), car=car if isinstance(car, int) else None)


def _line(**members: Any) -> bytes:
    return json.dumps(members, separators=(",", ":")).encode() + b"\n"
