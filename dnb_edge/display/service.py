"""The service manager's view of the run: ready, one status line, and the watchdog's food, by systemd's notify socket.

The status line that `systemctl status` shows is a display too. Knows the environment that systemd sets and its binding,
which is imported only under systemd; whoever watches the others' progress calls `feed`, and nobody waits for the manager.
"""

from __future__ import annotations

import importlib
import os
import time
from collections.abc import Callable
from types import ModuleType

from dnb_edge.display.messenger import Messenger
from dnb_edge.display.state import BoardState
from dnb_edge.errors import InputError


class ServiceNotifier:
    """Tells systemd how the run goes; does nothing where no service manager listens (NOTIFY_SOCKET is not set).

    Raises `InputError` where one listens and the systemd binding is not installed: the service would be killed as hung.
    """

    def __init__(self, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        address = os.environ.get("NOTIFY_SOCKET")
        self._messenger = Messenger(_binding(), address) if address else None
        self._period_s = watchdog_period_s()
        self._fed_s: float | None = None
        self._status: str | None = None
        self._watched = False
        """Whether the manager's watchdog runs: from the first READY on, or the first food."""
        self._patient = False
        """Whether it was told to wait longer than usual."""
        self.was_ready = False
        """Whether `ready` was told."""

    @property
    def active(self) -> bool:
        """True where a service manager listens."""
        return self._messenger is not None

    @property
    def period_s(self) -> float | None:
        """How often the watchdog is fed at most: half its patience, seconds; None where there is no watchdog."""
        return self._period_s if self.active else None

    def ready(self) -> None:
        """The first frame has come and the recording stands, or what they wait for was said: units after this one may start."""
        self.was_ready = self._watched = True
        self._tell("READY=1")

    def show(self, state: BoardState) -> None:
        """The status line for `state`, sent only where it differs from the last one."""
        self.status(status_text(state))

    def status(self, text: str) -> None:
        """Any other status line, such as what start-up waits for."""
        line = " ".join(text.split())
        if line != self._status:
            self._status = line
            self._tell(f"STATUS={line}")

    def feed(self, progressed: bool) -> bool:
        """Feed the watchdog if it is due; True where it was fed. Call it often from the one thread that watches the others.

        `progressed`: capture, scoring and writer all moved since the last call, or are in a declared degraded state (such
        as a camera that is away). Where they did not, the watchdog starves and systemd restarts the service.
        """
        now_s = self._clock_s()
        due = self._fed_s is None or (self._period_s is not None and now_s - self._fed_s >= self._period_s)
        if self._messenger is not None:
            self._messenger.flush()
        if not (progressed and due and self._period_s is not None):
            return False
        self._fed_s = now_s
        self._watched = True
        self._tell("WATCHDOG=1")
        return True

    def feed_now(self, *, for_s: float | None = None) -> None:
        """Feed the watchdog between two phases of the process, of which the next takes its patience at most, or `for_s`.

        Does nothing before the service was ready: until then the manager goes by its start timeout, and food would have it go
        by the shorter one of the two.
        """
        if self._period_s is None or not self._watched:
            return
        self._fed_s = self._clock_s()
        if for_s is not None or self._patient:
            self._patient = for_s is not None
            patience_s = 2.0 * self._period_s if for_s is None else max(for_s, 2.0 * self._period_s)
            self._tell(f"WATCHDOG_USEC={round(patience_s * 1e6)}")
        self._tell("WATCHDOG=1")

    def stopping(self) -> None:
        """The run is over; the recording is being finished."""
        self._tell("STOPPING=1")

    def _tell(self, assignment: str) -> None:
        if self._messenger is not None:
            self._messenger.tell(assignment)


def status_text(state: BoardState) -> str:
    """One line for `state`, such as `lap 4 of 10, last 12.483 s`; free of the running time, which changes with each frame."""
    parts = [state.state_line]
    if state.last_lap is not None:
        parts.append(f"last {state.last_lap.time_s:.3f} s")
    if state.health is not None and state.health.warnings:
        parts.append("; ".join(state.health.warnings))
    return ", ".join(parts)


def watchdog_period_s() -> float | None:
    """Half of WATCHDOG_USEC, seconds; None where systemd set no watchdog for this process, as sd_watchdog_enabled(3)."""
    pid = os.environ.get("WATCHDOG_PID", "")
    patience_us = os.environ.get("WATCHDOG_USEC", "")
    if not patience_us.isdecimal() or int(patience_us) == 0 or pid not in {"", str(os.getpid())}:
        return None
    return int(patience_us) / 1e6 / 2


def _binding() -> ModuleType:
    try:
        # Imported here because machines without systemd have no such module, and need none.
        return importlib.import_module("systemd.daemon")
    except ImportError as error:
        raise InputError(
            "NOTIFY_SOCKET is set but Python's systemd binding is missing: install systemd-python, or unset NOTIFY_SOCKET"
        ) from error
