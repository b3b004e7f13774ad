"""The events of this epoch, numbered, and those of them that are kept for whoever comes later.

*Lasting* events (laps, crossings, incidents, scores, race states, the run's summary) are all kept for as long as their run is
the latest; of standings and health the last ones; *fleeting* ones (where the cars are just now) are only counted. Knows
values and their bytes; knows no socket, no thread and no clock.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

from dnb_edge import wire
from dnb_edge.live.messages import Told, encode
from dnb_edge.values import Event, Health, Observation, Running, Standings, Target, VehicleReport

MOST_KEPT = 5000
"""Lasting events that are kept: a race of some hundred laps by eight cars."""

FLEETING = (Observation, Target, Running, VehicleReport)
"""What nobody needs to know later."""
LAST_ONLY = (Standings, Health)
"""Of which each replaces the one before it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class News:
    """What a client that wants the events from a number on is to be told of those that last."""

    lasting: list[Numbered]
    first: int
    run_first: int
    next: int
    """All three: of the backlog, when it was asked."""


@dataclass(slots=True)
class Numbered:
    """An event with its number; its bytes are made once, when somebody first wants them."""

    sequence: int
    event: Event
    _line: bytes | None = None

    def line(self) -> bytes:
        """The message that tells it."""
        if self._line is None:
            plain = {"event": wire.EVENT_NAMES[type(self.event)], **wire.to_dict(self.event)}
            self._line = encode(Told(sequence=self.sequence, event=plain))
        return self._line


class Backlog:
    """Numbers events from 0 on and keeps what lasts. Not for several threads at once."""

    def __init__(self, *, most: int = MOST_KEPT) -> None:
        self._most = most
        self._kept: list[Numbered] = []
        self._last: dict[type, Numbered] = {}
        self.next = 0
        """Number of the event that comes next."""
        self.first = 0
        """From this number on no lasting event is missing."""
        self.run_first = 0
        """Number of the first event of the latest run."""

    def begin_run(self) -> None:
        """Forgets the events of the run before."""
        self._kept.clear()
        self._last.clear()
        self.first = self.run_first = self.next

    def add(self, event: Event) -> Numbered:
        """Numbers `event`, and keeps it where it lasts."""
        numbered = Numbered(self.next, event)
        self.next += 1
        if isinstance(event, LAST_ONLY):
            self._last[type(event)] = numbered
        elif not isinstance(event, FLEETING):
            self._kept.append(numbered)
            if len(self._kept) > self._most:
                # Many at once: taking one from the front of a list moves all others.
                gone = max(1, self._most // 10)
                self.first = self._kept[gone - 1].sequence + 1
                del self._kept[:gone]
        return numbered

    def since(self, sequence: int, *, most: int) -> list[Numbered]:
        """The first `most` of the kept events numbered `sequence` or later, in order. Quick, however many are kept."""
        start = bisect_left(self._kept, sequence, key=lambda one: one.sequence)
        found = self._kept[start : start + most]
        found += [one for one in self._last.values() if one.sequence >= sequence]
        found.sort(key=lambda one: one.sequence)
        return found[:most]

    def news(self, sequence: int, *, most: int) -> News:
        """As `since`, with where the backlog stands."""
        return News(lasting=self.since(sequence, most=most), first=self.first, run_first=self.run_first, next=self.next)
