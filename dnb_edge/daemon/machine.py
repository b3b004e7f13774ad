"""The machine under the appliance: how hot, how full, how much memory, and what of it is worth a warning.

Knows where Linux tells these things; the root of its file system can be another one, for tests. Knows no race. Reading may
block (a disk that hangs, a firmware that is asked), so the race reads what a thread of its own has found.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

PERIOD_S = 1.0
"""Time between two readings."""

HOT_C = 80.0
"""From here on a Raspberry Pi slows down by itself."""
COOL_C = 77.0
"""A warning of heat holds until here, so that it does not come and go."""
LOW_BYTES = 500_000_000
ENOUGH_BYTES = 550_000_000
"""The same for the disk."""

_PROCESSOR_ZONES = ("cpu", "soc", "pkg")
"""Words by which thermal zones of processors are called."""
_SLOWED_NOW = 0xF
"""Raspberry Pi firmware's bits: low voltage, frequency capped, throttled, warm; higher ones tell of the past."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineState:
    """One reading; None where the machine does not tell."""

    disk_free_bytes: int | None = None
    temperature_c: float | None = None
    throttled: bool | None = None
    memory_bytes: int | None = None


NOTHING_KNOWN = MachineState()


def read_machine(recording: Path | None = None, *, root: Path = Path("/")) -> MachineState:
    """A reading of the machine whose file system begins at `root`, and of the disk that holds `recording`."""
    return MachineState(
        disk_free_bytes=None if recording is None else _free_bytes(recording),
        temperature_c=_temperature_c(root / "sys/class/thermal"),
        throttled=_throttled(root / "sys"),
        memory_bytes=_memory_bytes(root / "proc/self/statm"),
    )


def _free_bytes(directory: Path) -> int | None:
    """What an unprivileged process may still write there."""
    try:
        disk = os.statvfs(directory)
    except OSError:
        return None
    return disk.f_bavail * disk.f_frsize


def _temperature_c(zones: Path) -> float | None:
    """The hottest of the processor's zones, else of all."""
    found: dict[bool, list[float]] = {True: [], False: []}
    for zone in sorted(zones.glob("thermal_zone*")):
        text = _text(zone / "temp")
        if text is not None and text.lstrip("-").isdecimal():
            kind = (_text(zone / "type") or "").lower()
            found[any(word in kind for word in _PROCESSOR_ZONES)].append(int(text) / 1000.0)
    return max(found[True] or found[False], default=None)


def _throttled(sys: Path) -> bool | None:
    """By the Raspberry Pi's firmware and its supply's alarm, and by the kernel's own cooling of processors."""
    told = [*_firmware(sys), *_supply(sys), *_cooling(sys)]
    return any(told) if told else None


def _firmware(sys: Path) -> Iterator[bool]:
    for path in sorted(sys.glob("devices/platform/*/*firmware/get_throttled")):
        text = _text(path)
        try:
            yield int(text or "", 16) & _SLOWED_NOW != 0
        except ValueError:
            continue


def _supply(sys: Path) -> Iterator[bool]:
    for name in sorted(sys.glob("class/hwmon/hwmon*/name")):
        alarm = _text(name.parent / "in0_lcrit_alarm")
        if _text(name) == "rpi_volt" and alarm is not None:
            yield alarm == "1"


def _cooling(sys: Path) -> Iterator[bool]:
    for device in sorted(sys.glob("class/thermal/cooling_device*")):
        state = _text(device / "cur_state")
        if "cpufreq" in (_text(device / "type") or "") and state is not None and state.isdecimal():
            yield int(state) > 0


def _memory_bytes(statm: Path) -> int | None:
    """Resident memory: the second number there, in pages (proc_pid_statm(5))."""
    fields = (_text(statm) or "").split()
    return int(fields[1]) * os.sysconf("SC_PAGE_SIZE") if len(fields) > 1 and fields[1].isdecimal() else None


def _text(path: Path) -> str | None:
    try:
        return path.read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        # A sensor that is not there, or does not answer at present.
        return None


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
