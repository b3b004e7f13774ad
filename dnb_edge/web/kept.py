"""The events of the latest run that are kept for browsers which come later or again.

As the daemon keeps them: all that last, of standings and health the last, and nothing of where the cars were. Knows the names
of events; knows no socket.
"""

from __future__ import annotations

from bisect import bisect_left

from dnb_edge.live.messages import Told

FLEETING = frozenset({"observation", "target", "running", "vehicle"})
LAST_ONLY = frozenset({"standings", "health"})
MOST_KEPT = 6000
"""More than the daemon itself keeps."""


class Kept:
    """The kept events, in the order of their numbers."""

    def __init__(self, most: int = MOST_KEPT) -> None:
        self._most = most
        self._lasting: list[Told] = []
        self._last: dict[str, Told] = {}
        self.next: int | None = None
        """Number after that of the last event; None before the first."""
        self.first = 0
        """From this number on no lasting event is missing."""

    def begin(self, first: int) -> None:
        """Events from number `first` on come now: whatever is missing before it does not come any more."""
        if self.next is None or self.next < first:
            self.first = first

    def add(self, told: Told) -> bool:
        """Keeps what lasts; False for an event that has come before."""
        if self.next is not None and told.sequence < self.next:
            return False
        self.next = told.sequence + 1
        name = str(told.event.get("event"))
        if name in LAST_ONLY:
            self._last[name] = told
        elif name not in FLEETING:
            self._lasting.append(told)
            if len(self._lasting) > self._most:
                gone = max(1, self._most // 10)
                self.first = self._lasting[gone - 1].sequence + 1
                del self._lasting[:gone]
        return True

    def forget_before(self, sequence: int) -> None:
        """Forgets the events of the runs before."""
        del self._lasting[: bisect_left(self._lasting, sequence, key=lambda told: told.sequence)]
        self._last = {name: told for name, told in self._last.items() if told.sequence >= sequence}

    def since(self, sequence: int | None) -> tuple[Told, ...]:
        """The kept events from that number on; all for None."""
        start = 0 if sequence is None else bisect_left(self._lasting, sequence, key=lambda told: told.sequence)
        last = (told for told in self._last.values() if sequence is None or told.sequence >= sequence)
        return tuple(sorted((*self._lasting[start:], *last), key=lambda told: told.sequence))


def is_fleeting(told: Told) -> bool:
    """Whether nobody needs the event later."""
    return told.event.get("event") in FLEETING
