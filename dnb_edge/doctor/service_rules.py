"""When the services, the pages and the display are well: facts to verdicts, nothing else.

Knows the limits and what to type. Asks nobody.
"""

from __future__ import annotations

from dataclasses import dataclass

from dnb_edge.doctor.access import Access
from dnb_edge.doctor.camera_rules import judge_access
from dnb_edge.doctor.unit_facts import UnitLook
from dnb_edge.doctor.verdict import Verdict, fail, ok, skip, warn
from dnb_edge.live.messages import Phase

MANY_RESTARTS = 3


def judge_unit(unit: UnitLook) -> Verdict:
    """Whether a unit is installed, starts with the machine, and runs."""
    name = unit.name.removesuffix(".service")
    if not unit.is_installed:
        return warn(
            f"{name} is not installed as a service",
            "Type `sudo ./install.sh` in a clone of the repository, unless you start it by hand.",
        )
    if unit.active == "failed":
        return fail(
            f"{name} has failed ({unit.result})",
            f"Type `journalctl -u {name} -n 30`, mend what it says, and `sudo systemctl restart {name}`.",
        )
    if unit.active != "active":
        return fail(
            f"{name} is {unit.active}",
            f"Type `sudo systemctl start {name}`, and `journalctl -u {name} -n 30` where it does not stay.",
        )
    if not unit.is_enabled:
        return warn(f"{name} runs, and will not start with the machine", f"Type `sudo systemctl enable {name}`.")
    if unit.restarts > MANY_RESTARTS:
        return warn(
            f"{name} was started again {unit.restarts} times", f"Type `journalctl -u {name} -p warning` to see why."
        )
    return ok(f"{name} runs and starts with the machine" + (f": {unit.status}" if unit.status else ""))


@dataclass(frozen=True, slots=True, kw_only=True)
class Watchdogs:
    """Who starts what hangs."""

    unit: UnitLook
    hardware: bool
    """Whether the machine has a watchdog of its own."""
    armed: bool | None
    """Whether the service manager feeds it; None where it does not tell."""


def judge_watchdog(dogs: Watchdogs) -> Verdict:
    """Whether a hung service, and a hung machine, are started again."""
    if not dogs.unit.is_installed:
        return skip("not installed as a service")
    if not dogs.unit.has_watchdog:
        return fail(
            "a service that hangs is not started again",
            "Type `sudo ./install.sh` to install our own unit, which has WatchdogSec=10.",
        )
    if dogs.hardware and dogs.armed is False:
        return warn(
            "the service is watched, the machine is not: one that hangs stays so",
            "Type `sudo ./install.sh --watchdog`, then `sudo systemctl daemon-reexec`.",
        )
    return ok("service and machine are watched" if dogs.armed else "the service is watched")


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Whether a service answers at the live socket, and what."""

    is_installed: bool
    phase: Phase | None
    """None where nobody answers."""
    reason: str | None = None
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def judge_service(answer: Answer) -> Verdict:
    """Whether the race's process answers and can work."""
    if answer.phase is None:
        if not answer.is_installed:
            return skip("no dnb-edge runs here")
        return fail(
            "the service does not answer at its socket",
            "Type `sudo systemctl restart dnb-edge`, and `journalctl -u dnb-edge -n 30` where it stays silent.",
        )
    if answer.phase is Phase.FAULT:
        return fail(
            f"it cannot race: {answer.reason or 'no reason is told'}",
            "Mend what it names; it tries again by itself, and `systemctl status dnb-edge` follows it.",
        )
    return ok(f"it answers: {answer.phase.value}" + (f", {answer.reason}" if answer.reason else ""))


def judge_warnings(answer: Answer) -> Verdict:
    """Whether the running service warns of anything."""
    if answer.phase is None:
        return skip("no dnb-edge runs here")
    if answer.warnings:
        return warn("; ".join(answer.warnings), "Mend what it names; `journalctl -u dnb-edge -n 30` tells since when.")
    return ok("it warns of nothing" + (f", and notes: {'; '.join(answer.notes)}" if answer.notes else ""))


@dataclass(frozen=True, slots=True, kw_only=True)
class Reached:
    """Whether the pages can be had."""

    url: str
    status: int | None
    """HTTP's; None where nobody answers."""
    fault: str | None
    is_installed: bool


def judge_web(reached: Reached) -> Verdict:
    """Whether the pages answer."""
    journal = "`journalctl -u dnb-edge-web -n 30`"
    if reached.status is None:
        if not reached.is_installed:
            return skip(f"no pages at {reached.url}, and they are not installed as a service")
        return fail(
            f"{reached.url}: {reached.fault}",
            f"Type `sudo systemctl restart dnb-edge-web`, and {journal} where it does not help.",
        )
    if reached.status >= 500:
        return fail(
            f"{reached.url} answers {reached.status}",
            f"Type {journal} to see why, and `sudo systemctl restart dnb-edge-web`.",
        )
    if reached.status >= 400:
        return warn(
            f"{reached.url} answers {reached.status}: another program may have that port",
            "Type `sudo ss -ltnp` to see which, or set `web.port` to another one.",
        )
    return ok(f"{reached.url} answers")


@dataclass(frozen=True, slots=True, kw_only=True)
class Port:
    """A display's port."""

    uri: str | None
    """None where no display is configured."""
    fault: str | None = None
    """Why the URI is none."""
    needs_port: bool = False
    access: Access | None = None
    """None where the port is not there."""
    ports: tuple[str, ...] = ()
    """Ports for displays that this machine has."""


def judge_port(port: Port) -> Verdict:
    """Whether the display's port is there and may be used."""
    if port.uri is None:
        return skip("no display is configured (display.uri)")
    if port.fault is not None:
        return fail(
            port.fault, "Set `display.uri: serial:/dev/dnb-edge-display` or mend what is named, or leave it out."
        )
    if not port.needs_port:
        return ok(f"{port.uri} needs no port")
    if port.access is None:
        there = f"this machine has {', '.join(port.ports)}" if port.ports else "this machine has no port for one"
        plug = "Plug the display in, or name its port in display.uri; `ls -l /dev/serial/by-id` shows them."
        switch_on = (
            "Switch the board's SPI on with `sudo raspi-config nonint do_spi 0` and start it anew, or name another one."
        )
        return fail(f"{port.uri} is not there: {there}", switch_on if port.uri.startswith("spi:") else plug)
    return judge_access(port.access, what="display's port")


@dataclass(frozen=True, slots=True, kw_only=True)
class Taking:
    """Whether a display takes what it is told."""

    uri: str
    by_service: bool
    """True where the running service says so, which has its port."""
    fault: str | None
    answer: str = ""
    """What it said itself."""


def judge_taking(taking: Taking) -> Verdict:
    """Whether the display takes lines."""
    if taking.fault is not None:
        return fail(
            f"{taking.uri}: {taking.fault}",
            "Unplug the display and plug it in again, then type `dnb-edge doctor --only display-answer`; "
            "`dnb-edge display flash` writes its program anew.",
        )
    said = f", and said {taking.answer!r}" if taking.answer else ""
    return ok(f"it takes what {'the service tells it' if taking.by_service else 'it is told'}{said}")
