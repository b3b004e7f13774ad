"""What the machine is on which a model is measured, as far as Linux tells.

Knows where Linux tells it; the root of its file system can be another one, for tests. Knows no model.
"""

from __future__ import annotations

import os
import platform
from pathlib import Path

from dnb_edge.nut.bench_card import Host


def read_host(
    *, temperature_before_c: float | None, temperature_after_c: float | None, throttled: bool | None, load: float
) -> Host:
    """This machine, with what its sensors said and its load before."""
    machine = platform.machine() or "unknown"
    return Host(
        name=platform.node() or "unknown",
        cpu=processor_name(Path("/"), machine),
        cores=len(os.sched_getaffinity(0)),
        architecture=machine,
        memory_bytes=os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"),
        governor=governor(Path("/")),
        temperature_before_c=temperature_before_c,
        temperature_after_c=temperature_after_c,
        load=round(load, 2),
        throttled=throttled,
    )


def processor_name(root: Path, machine: str) -> str:
    """The processor's name where the kernel knows it, else the board's (`Raspberry Pi 5 Model B Rev 1.0`), else `machine`."""
    for line in (_text(root / "proc/cpuinfo") or "").splitlines():
        key, _, value = line.partition(":")
        if key.strip().lower() == "model name" and value.strip():
            return value.strip()
    board = (_text(root / "proc/device-tree/model") or "").strip("\0 \n")
    return board or machine


def governor(root: Path) -> str | None:
    """Of the processors' frequency; several are joined by a comma."""
    found = {_text(path) for path in root.glob("sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor")}
    names = sorted(text.strip() for text in found if text and text.strip())
    return ",".join(names) or None


def _text(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        # Not told on this machine.
        return None
