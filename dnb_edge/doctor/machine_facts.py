"""Facts of the machine: interpreter, system, clocks, heat, supply, memory, load.

Knows where Linux tells them; the root of its file system can be another one, for tests. Knows no limit.
"""

from __future__ import annotations

import ctypes
import os
import platform
import sys
import time
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

from dnb_edge.doctor.machine_rules import Heat, Load, Memory, PythonFound, Slowed, SystemFound, Ticking
from dnb_edge.doctor.verdict import CannotTell
from dnb_edge.machine.state import firmware_bits, read_machine

_TIMEX_BYTES = 512
"""More than struct timex has anywhere."""
_NOT_SYNCHRONISED = 5
"""TIME_ERROR of adjtimex(2)."""
_READINGS = 20_000


def find_python() -> PythonFound:
    """The interpreter that this runs in."""
    major, minor, micro = sys.version_info[:3]
    return PythonFound(
        version=(major, minor, micro), bits=64 if sys.maxsize > 2**32 else 32, onnxruntime=version("onnxruntime")
    )


def find_system(root: Path) -> SystemFound:
    """The operating system, by its /etc/os-release."""
    told: dict[str, str] = {}
    for name in ("etc/os-release", "usr/lib/os-release"):
        if (root / name).is_file():
            lines = (root / name).read_text(encoding="utf-8", errors="replace").splitlines()
            told = {key: value.strip("\"'") for key, _, value in (line.partition("=") for line in lines)}
            break
    return SystemFound(
        name=told.get("PRETTY_NAME", "an unknown system"),
        kind=told.get("ID", ""),
        version=told.get("VERSION_ID", ""),
        machine=platform.machine(),
        kernel=platform.release(),
    )


def is_synchronised() -> bool:
    """Whether something keeps the wall clock right, by adjtimex(2). Raises `CannotTell` where the kernel does not say."""
    ask = getattr(ctypes.CDLL(None, use_errno=True), "adjtimex", None)
    if ask is None:
        raise CannotTell("this system has no adjtimex")
    # All zero asks for nothing to be changed.
    state = int(ask(ctypes.create_string_buffer(_TIMEX_BYTES)))
    if state < 0:
        raise CannotTell(f"the kernel does not tell: {os.strerror(ctypes.get_errno())}")
    return state != _NOT_SYNCHRONISED


def watch_ticking(root: Path) -> Ticking:
    """CLOCK_MONOTONIC, read many times in a row."""
    place = root / "sys/devices/system/clocksource/clocksource0/current_clocksource"
    source = place.read_text(encoding="ascii").strip() if place.is_file() else None
    readings = [time.monotonic_ns() for _ in range(_READINGS)]
    steps = [after - before for before, after in pairwise(readings)]
    return Ticking(
        source=source,
        resolution_s=max(
            time.clock_getres(time.CLOCK_MONOTONIC), 1e-9 * min((step for step in steps if step > 0), default=1e9)
        ),
        backwards=sum(step < 0 for step in steps),
    )


def find_heat(root: Path) -> Heat:
    """How hot the processor is."""
    # Boards tell the kernel what is on them by a device tree, PCs have none.
    is_board = (root / "sys/firmware/devicetree/base").is_dir()
    return Heat(celsius=read_machine(root=root).temperature_c, is_board=is_board)


def find_slowed(root: Path) -> Slowed:
    """What slows the processor down."""
    return Slowed(now=read_machine(root=root).throttled, bits=firmware_bits(root / "sys"))


def find_memory(root: Path, *, race_runs: bool) -> Memory:
    """The machine's memory, by /proc/meminfo. Raises `CannotTell` where that does not say."""
    lines = (root / "proc/meminfo").read_text(encoding="ascii").splitlines()
    told = {
        key: int(value.split()[0]) * 1024 for key, _, value in (line.partition(":") for line in lines) if value.split()
    }
    if "MemAvailable" not in told or "MemTotal" not in told:
        raise CannotTell("/proc/meminfo does not tell")
    return Memory(available_bytes=told["MemAvailable"], total_bytes=told["MemTotal"], race_runs=race_runs)


def find_load(root: Path) -> Load:
    """How busy the processors were in the last minute."""
    text = (root / "proc/loadavg").read_text(encoding="ascii")
    return Load(waiting=float(text.split()[0]), processors=len(os.sched_getaffinity(0)))
