"""What of the machine's state is worth a warning to whoever races, and the thread that reads it for them.

Knows no sensor: `machine.state` does. Reading may block (a disk that hangs, a firmware that is asked), so the race reads what a
thread of its own has found.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from dnb_edge.machine.state import HOT_C, LOW_BYTES, NOTHING_KNOWN, MachineState, read_machine

PERIOD_S = 1.0
"""Time between two readings."""
COOL_C = 77.0
"""A warning of heat holds until here, so that it does not come and go."""
ENOUGH_BYTES = 550_000_000
"""The same for the disk."""


class MachineJudge:
    """What of one machine's state is worth a warning; remembers what it has said, so that no warning comes and goes."""

    def __init__(self) -> None:
        self._hot = False
        self._low = False

    def warnings(self, state: MachineState) -> tuple[str, ...]:
        """The warnings that hold now."""
        said = []
        if state.throttled:
            said.append("processor slowed down by heat or a weak supply: cool the box, check its power supply")
        if state.temperature_c is not None:
            self._hot = state.temperature_c >= (COOL_C if self._hot else HOT_C)
            if self._hot:
                said.append(f"processor at {state.temperature_c:.0f} C: cool the box")
        if state.disk_free_bytes is not None:
            self._low = state.disk_free_bytes < (ENOUGH_BYTES if self._low else LOW_BYTES)
            if self._low:
                said.append(f"disk nearly full, {state.disk_free_bytes // 1_000_000} MB left: remove old recordings")
        return tuple(said)


class MachineWatch:
    """Reads the machine every second in a thread of its own; `state` is the latest reading and never blocks."""

    def __init__(self, recording: Callable[[], Path | None], *, root: Path = Path("/")) -> None:
        """`recording` tells in which directory the recording is at the moment."""
        self._recording = recording
        self._root = root
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="machine", daemon=True)
        self.state = NOTHING_KNOWN

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        # Not joined: a disk that hangs would hold us up.
        self._stop.set()

    def _run(self) -> None:
        while not self._stop.is_set():
            self.state = read_machine(self._recording(), root=self._root)
            self._stop.wait(PERIOD_S)
