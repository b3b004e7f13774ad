"""Which tickets the disk has acknowledged, with the holes that a failed disk left between them.

Knows numbers and a condition to wait on. Where it is not sure, a ticket is not saved.
"""

from __future__ import annotations

import bisect
import threading
from collections.abc import Callable

HOLES_KEPT = 4096
"""More spans of lost tickets than this are not told apart: all below the oldest one kept then count as not saved."""


class Acks:
    """Tickets grow; `saved` moves on over all that came before, except for those that were `lost`."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._through = 0
        self._floor = 0
        self._first: list[int] = []
        self._last: list[int] = []

    @property
    def through(self) -> int:
        """All tickets up to this one are saved or lost."""
        return self._through

    def saved(self, ticket: int) -> None:
        """The disk has acknowledged everything up to `ticket` that is not lost."""
        with self._changed:
            self._through = max(self._through, ticket)
            self._changed.notify_all()

    def lost(self, ticket: int) -> None:
        """`ticket` will never be written."""
        with self._changed:
            place = bisect.bisect_right(self._first, ticket)
            if place and self._last[place - 1] + 1 >= ticket:
                self._last[place - 1] = max(self._last[place - 1], ticket)
                return
            self._first.insert(place, ticket)
            self._last.insert(place, ticket)
            if len(self._first) > HOLES_KEPT:
                self._floor = self._last[HOLES_KEPT // 2]
                del self._first[: HOLES_KEPT // 2 + 1], self._last[: HOLES_KEPT // 2 + 1]

    def is_saved(self, ticket: int | None) -> bool:
        """True once the disk has acknowledged `ticket`."""
        with self._changed:
            return ticket is not None and self._is_saved(ticket)

    def wait(self, ticket: int, timeout_s: float, ended: Callable[[], bool]) -> bool:
        """Wait until `ticket` is saved, or lost, or `ended`; whether it is saved."""
        with self._changed:
            self._changed.wait_for(lambda: self._through >= ticket or ended(), timeout_s)
            return self._is_saved(ticket)

    def wake(self) -> None:
        """Let everybody who waits look again."""
        with self._changed:
            self._changed.notify_all()

    def _is_saved(self, ticket: int) -> bool:
        if not self._floor < ticket <= self._through:
            return False
        place = bisect.bisect_right(self._first, ticket) - 1
        return place < 0 or ticket > self._last[place]
