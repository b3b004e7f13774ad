"""What every display is, and the mailbox by which its thread takes the latest board.

Knows how a state is handed over without ever making the race wait. Knows no device and no picture.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from enum import StrEnum
from types import TracebackType
from typing import Protocol, Self

from dnb_edge.display.state import BoardState


class DisplayStatus(StrEnum):
    """Whether what was posted is being shown. A run without display says `none` in its `Health`."""

    ONLINE = "online"
    OFFLINE = "offline"


class Display(Protocol):
    """A peripheral that shows a race. `post` and `status` may be called from any thread."""

    @property
    def status(self) -> DisplayStatus:
        """Whether the display shows what it is told, at this moment; never blocks."""
        ...

    @property
    def fault(self) -> str | None:
        """Why the display is offline, as one line; None where it is online or has not been tried yet."""
        ...

    def post(self, state: BoardState) -> None:
        """Show `state`; returns at once, whatever the device does. The latest state wins, no lap is left out."""
        ...

    def close(self) -> None:
        """Show the last state if the device takes it at once, and let go of the device, all within 1 s.

        May be called twice.
        """
        ...


class ClosesOnExit:
    """Lets a display stand in a `with` statement."""

    def close(self) -> None:
        """Let go of the device."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


@dataclass(slots=True)
class Mailbox:
    """One slot between the race and a display's thread: `put` replaces what is there, `take` waits for news.

    States are cumulative, so one slot is enough and nothing can pile up.
    """

    _latest: BoardState | None = None
    _fresh: bool = False
    _urgent: bool = False
    _closed: bool = False
    _news: threading.Condition = field(default_factory=threading.Condition)

    def put(self, state: BoardState) -> None:
        """Replace the waiting state. A crossing, a lap or a change of phase wakes the taker at once."""
        with self._news:
            self._urgent |= self._latest is None or is_urgent(self._latest, state)
            self._latest, self._fresh = state, True
            self._news.notify_all()

    def take(self, *, pause_s: float, patience_s: float) -> BoardState | None:
        """The latest state: an urgent one at once, any other after `pause_s`, and after `patience_s` the old one again.

        None where nothing has been put yet. A closed mailbox returns at once.
        """
        with self._news:
            self._news.wait_for(lambda: self._closed or self._urgent, timeout=pause_s)
            self._news.wait_for(lambda: self._closed or self._fresh, timeout=patience_s - pause_s)
            self._fresh = self._urgent = False
            return self._latest

    def sleep(self, seconds: float) -> None:
        """Wait for `seconds`, or until the mailbox is closed."""
        with self._news:
            self._news.wait_for(lambda: self._closed, timeout=seconds)

    @property
    def closed(self) -> bool:
        """True once `close` was called."""
        return self._closed

    def close(self) -> None:
        """Wake the taker for the last time."""
        with self._news:
            self._closed = True
            self._news.notify_all()


def is_urgent(earlier: BoardState, later: BoardState) -> bool:
    """True where `later` tells more than the passing of time: a crossing, a lap, a change of phase."""
    return (earlier.phase, earlier.laps_done, earlier.crossed_s) != (later.phase, later.laps_done, later.crossed_s)
