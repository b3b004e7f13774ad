"""A display that keeps what it was told: the peer of the real ones for tests and rehearsals. Knows no device."""

from __future__ import annotations

import threading

from dnb_edge.display.base import ClosesOnExit, DisplayStatus
from dnb_edge.display.state import BoardState


class RecordingDisplay(ClosesOnExit):
    """A `Display` that is online until it is closed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._states: tuple[BoardState, ...] = ()
        self._closed = False

    @property
    def states(self) -> tuple[BoardState, ...]:
        """Every state posted before `close`, in order."""
        return self._states

    @property
    def status(self) -> DisplayStatus:
        """Online until closed."""
        return DisplayStatus.OFFLINE if self._closed else DisplayStatus.ONLINE

    @property
    def fault(self) -> str | None:
        """Nothing ever fails here."""
        return None

    def post(self, state: BoardState) -> None:
        """Keep `state`."""
        with self._lock:
            if not self._closed:
                self._states = (*self._states, state)

    def close(self) -> None:
        """Keep nothing more."""
        with self._lock:
            self._closed = True
