"""When a machine is fit to race on: facts to verdicts, nothing else.

Knows the limits and what to type. Reads no sensor.
"""

from __future__ import annotations

from dataclasses import dataclass

from dnb_edge.doctor.verdict import Verdict, fail, ok, skip, warn
from dnb_edge.machine.state import HOT_C

LEAST_PYTHON = (3, 11)
WARM_C = 70.0
PC_WARM_C = 90.0
"""Processors of PCs slow down at 95 to 105 degrees."""
LITTLE_BYTES, TOO_LITTLE_BYTES = 600_000_000, 250_000_000
"""The race takes 200 MB and the pages 80."""
OLD_ONNX, NEW_ONNX = (1, 23), (1, 28)
"""From the first on, and below the second, whose official builds tell home."""

_UNDER_VOLTAGE, _CAPPED, _THROTTLED, _SOFT_LIMIT = 1, 2, 4, 8
_PAST = 16
"""The firmware's bits for what has happened since the start stand so many places higher."""
_SOUND_CLOCKS = {"tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page", "xen", "riscv_clocksource"}
_KNOWN = {("debian", "12"), ("debian", "13"), ("raspbian", "12"), ("raspbian", "13")}


@dataclass(frozen=True, slots=True, kw_only=True)
class PythonFound:
    """The interpreter and what decides about the detector."""

    version: tuple[int, int, int]
    bits: int
    onnxruntime: str


def judge_python(found: PythonFound) -> Verdict:
    """Whether Python and ONNX Runtime are those that we are made for."""
    words = f"Python {'.'.join(map(str, found.version))}, {found.bits} bit, ONNX Runtime {found.onnxruntime}"
    if found.version[:2] < LEAST_PYTHON or found.bits < 64:
        return fail(
            words,
            "Install a 64-bit system with Python 3.11 or newer (Raspberry Pi OS 12 or 13), then type `sudo ./install.sh`.",
        )
    numbers = tuple(int(part) for part in found.onnxruntime.split(".")[:2] if part.isdecimal())
    if len(numbers) == 2 and not OLD_ONNX <= numbers < NEW_ONNX:
        return warn(
            words,
            "Type `/opt/dnb-edge/venv/bin/pip install 'onnxruntime>=1.23,<1.28'`, with which all is "
            "tested and nothing is told home.",
        )
    return ok(words)


@dataclass(frozen=True, slots=True, kw_only=True)
class SystemFound:
    """The operating system."""

    name: str
    """Such as `Debian GNU/Linux 12 (bookworm)`."""
    kind: str
    version: str
    machine: str
    """`x86_64`, `aarch64` ..."""
    kernel: str


def judge_system(found: SystemFound) -> Verdict:
    """Whether the system is one that all is tested on."""
    words = f"{found.name}, {found.machine}, Linux {found.kernel}"
    if (found.kind, found.version) in _KNOWN and found.machine in ("x86_64", "aarch64"):
        return ok(words)
    return warn(
        f"{words}: not tested there",
        "Use Raspberry Pi OS or Debian 12 or 13, 64 bit, where something does not work; `uname -m` and "
        "`cat /etc/os-release` tell what this is.",
    )


def judge_synchronised(synchronised: bool) -> Verdict:
    """Whether the wall clock is right; laps are timed by another one."""
    if synchronised:
        return ok("set by the network")
    return warn(
        "not set by the network: dates of recordings may be wrong, lap times are not",
        "Connect the box to a network and type `sudo timedatectl set-ntp true`, or set it with `sudo "
        "timedatectl set-time '2026-05-17 09:30:00'`.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ticking:
    """The clock that laps are timed by."""

    source: str | None
    """The kernel's clock source; None where it does not tell."""
    resolution_s: float
    backwards: int
    """How often it went back in the readings that were made."""


def judge_ticking(ticking: Ticking) -> Verdict:
    """Whether the monotonic clock is fine and goes on."""
    words = f"{ticking.source or 'unknown source'}, resolution {1e9 * ticking.resolution_s:.0f} ns"
    fix = (
        "Type `cat /sys/devices/system/clocksource/clocksource0/available_clocksource` and start the kernel "
        "with `clocksource=` and the best of them."
    )
    if ticking.backwards:
        return fail(f"{words}: it went back {ticking.backwards} times", fix)
    if ticking.resolution_s > 1e-4:
        return fail(words, fix)
    if ticking.source is not None and ticking.source not in _SOUND_CLOCKS:
        return warn(words, fix)
    return ok(words)


@dataclass(frozen=True, slots=True, kw_only=True)
class Heat:
    """How hot the processor is."""

    celsius: float | None
    """None where the machine does not tell."""
    is_board: bool
    """Whether it is a board such as a Raspberry Pi, which slows down earlier than a PC."""


def judge_temperature(heat: Heat) -> Verdict:
    """Whether the processor is cool enough."""
    celsius = heat.celsius
    if celsius is None:
        return skip("this machine does not tell its temperature")
    found = f"{celsius:.0f} C"
    fix = (
        "Open the case or put a heat sink and a fan on the processor; `watch cat "
        "/sys/class/thermal/thermal_zone0/temp` follows it."
    )
    if not heat.is_board:
        return warn(f"{found}: it will slow itself down soon", fix) if celsius >= PC_WARM_C else ok(found)
    if celsius >= HOT_C:
        return fail(f"{found}: it slows itself down", fix)
    return warn(f"{found}: at {HOT_C:.0f} C it slows itself down", fix) if celsius >= WARM_C else ok(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slowed:
    """What slows the processor down."""

    now: bool | None
    """Whether it is slowed down now, by whatever tells; None where nothing does."""
    bits: int | None
    """The Raspberry Pi firmware's own word; None elsewhere."""


def judge_throttling(slowed: Slowed) -> Verdict:
    """Whether heat slows the processor down."""
    if slowed.now is None:
        return skip("this machine does not tell")
    bits = slowed.bits or 0
    hot = _CAPPED | _THROTTLED | _SOFT_LIMIT
    fix = "Cool the box and give it a stronger supply; `vcgencmd get_throttled` says 0x0 when all was well since the start."
    if slowed.now:
        return fail("slowed down at this moment", fix)
    if bits & hot << _PAST:
        return warn(f"was slowed down since the start ({bits:#x})", fix)
    return ok("at full speed")


def judge_power(slowed: Slowed) -> Verdict:
    """Whether the supply is strong enough."""
    if slowed.bits is None:
        return skip("only a Raspberry Pi's firmware tells")
    fix = (
        "Take the supply that came with the board (5.1 V, 3 A; a Pi 5 wants 5 A) and a short cable; "
        "`vcgencmd get_throttled` says 0x0 when all was well."
    )
    if slowed.bits & _UNDER_VOLTAGE:
        return fail("the supply is too weak at this moment", fix)
    if slowed.bits & _UNDER_VOLTAGE << _PAST:
        return warn("the supply was too weak since the start", fix)
    return ok("no low voltage since the start")


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """Bytes."""

    available_bytes: int
    total_bytes: int
    race_runs: bool
    """Whether the race has its share already."""


def judge_memory(memory: Memory) -> Verdict:
    """Whether there is memory for a race."""
    found = f"{memory.available_bytes / 1e6:.0f} of {memory.total_bytes / 1e6:.0f} MB available"
    fix = (
        "Close other programs (`ps aux --sort=-rss | head` names the greatest), or run without a desktop: "
        "`sudo systemctl set-default multi-user.target`."
    )
    needed = 0.5 if memory.race_runs else 1.0
    if memory.available_bytes < needed * TOO_LITTLE_BYTES:
        return fail(found, fix)
    return warn(found, fix) if memory.available_bytes < needed * LITTLE_BYTES else ok(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """How busy the processors are."""

    waiting: float
    """Processes that ran or waited to, mean of a minute."""
    processors: int


def judge_load(load: Load) -> Verdict:
    """Whether the processors have time."""
    found = f"{load.waiting:.1f} processes want to run on {load.processors} processors"
    if load.waiting > load.processors:
        return warn(found, "Close other programs: `top` names those that take the time.")
    return ok(found)
