"""One reading of the machine: how hot, how full, how much memory, whether something slows it down.

Knows where Linux tells these things; the root of its file system can be another one, for tests. Reading may block (a disk that
hangs, a firmware that is asked). Knows no threads and nothing of what is worth a warning to a race.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

HOT_C = 80.0
"""From here on a Raspberry Pi slows down by itself."""
LOW_BYTES = 500_000_000
"""With less room than this on a disk it is nearly full."""

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


def firmware_bits(sys: Path) -> int | None:
    """A Raspberry Pi firmware's own word on supply and heat, from the `sys` of its machine; None where there is none."""
    for path in sorted(sys.glob("devices/platform/*/*firmware/get_throttled")):
        text = _text(path)
        try:
            return int(text or "", 16)
        except ValueError:
            continue
    return None


def _firmware(sys: Path) -> Iterator[bool]:
    bits = firmware_bits(sys)
    if bits is not None:
        yield bits & _SLOWED_NOW != 0


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
