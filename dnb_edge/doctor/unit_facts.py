"""What the service manager says of our units.

Knows `systemctl show`. Knows no rule.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dnb_edge.doctor.verdict import CannotTell

RACE_UNIT, WEB_UNIT = "dnb-edge.service", "dnb-edge-web.service"
UNITS = (RACE_UNIT, WEB_UNIT)
_PROPERTIES = (
    "Id", "LoadState", "UnitFileState", "ActiveState", "SubState", "Result", "NRestarts", "WatchdogUSec", "StatusText",
    "SupplementaryGroups", "MainPID",
)  # fmt: skip
TIMEOUT_S = 10.0

Ask = Callable[[Sequence[str]], str]
"""Gives what a command says. Raises `CannotTell` where it says nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitLook:
    """One unit."""

    name: str
    is_installed: bool
    is_enabled: bool
    active: str
    """`active`, `activating`, `failed`, `inactive` ..."""
    result: str
    """`success`, or how it ended: `exit-code`, `watchdog`, `oom-kill` ..."""
    restarts: int
    """How often the manager has started it again since it was started by somebody."""
    has_watchdog: bool
    status: str
    """Its own status line."""
    groups: tuple[str, ...]
    main_pid: int | None


def ask_units(ask: Ask | None = None) -> dict[str, UnitLook]:
    """Our units by name. Raises `CannotTell` where there is no service manager to ask."""
    words = ("show", *UNITS, f"--property={','.join(_PROPERTIES)}")
    found = parse_units((systemctl if ask is None else ask)(words))
    if set(found) != set(UNITS):
        raise CannotTell("systemctl does not tell of the units")
    return found


def systemctl(words: Sequence[str]) -> str:
    """What `systemctl` says. Raises `CannotTell` where there is no service manager."""
    program = shutil.which("systemctl")
    if program is None:
        raise CannotTell("this machine has no systemd")
    try:
        done = subprocess.run(  # noqa: S603 systemctl of PATH, asked for properties alone
            [program, *words], check=False, capture_output=True, text=True, timeout=TIMEOUT_S, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired as error:
        raise CannotTell(f"systemctl does not answer within {TIMEOUT_S:g} s") from error
    if done.returncode != 0:
        raise CannotTell((done.stderr.strip().splitlines() or ["systemctl fails"])[0])
    return done.stdout


def parse_units(text: str) -> dict[str, UnitLook]:
    """The units in what `systemctl show` says: a paragraph each, a property a line."""
    found = {}
    for paragraph in text.split("\n\n"):
        said = dict(line.split("=", 1) for line in paragraph.splitlines() if "=" in line)
        if "Id" not in said:
            continue
        restarts, pid = said.get("NRestarts", "0"), said.get("MainPID", "0")
        found[said["Id"]] = UnitLook(
            name=said["Id"],
            is_installed=said.get("LoadState") == "loaded",
            is_enabled=said.get("UnitFileState") in ("enabled", "enabled-runtime", "static", "alias", "generated"),
            active=said.get("ActiveState", "unknown"),
            result=said.get("Result", ""),
            restarts=int(restarts) if restarts.isdecimal() else 0,
            has_watchdog=said.get("WatchdogUSec", "0") not in ("0", "infinity", ""),
            status=said.get("StatusText", ""),
            groups=tuple(said.get("SupplementaryGroups", "").split()),
            main_pid=int(pid) if pid.isdecimal() and pid != "0" else None,
        )
    return found
