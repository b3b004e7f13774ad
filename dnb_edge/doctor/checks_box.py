"""The checks of what a race stands on: disk, machine, display and services; a table.

Knows which facts go to which rule, and what each check is for people who read the list.
"""

from __future__ import annotations

from typing import Any

from dnb_edge.doctor import disk_rules, gather, machine_facts, machine_rules, service_rules
from dnb_edge.doctor.check import Check, Group
from dnb_edge.machine.state import HOT_C

BOX_CHECKS: tuple[Check[Any], ...] = (
    Check(
        name="disk-access",
        group=Group.DISK,
        looks_at="whether recordings can be written",
        amiss="fails where the directory is missing or the service may not write there",
        remedy="make the directory for the service's user",
        gather=gather.holder,
        judge=disk_rules.judge_holder,
    ),
    Check(
        name="disk-space",
        group=Group.DISK,
        looks_at="the room left, and for how long it is enough at this rate of pictures",
        amiss=(
            f"warns below {disk_rules.SHORT_MIN / 60:g} hours, fails below {disk_rules.TOO_SHORT_MIN:g} "
            "minutes where nothing old may go"
        ),
        remedy="`dnb-edge runs prune`, `dnb-edge runs copy`",
        gather=gather.space,
        judge=disk_rules.judge_space,
    ),
    Check(
        name="disk-speed",
        group=Group.DISK,
        looks_at="how fast the disk takes what is written and synced",
        amiss=(
            f"warns below {disk_rules.SLOW_BYTES_PER_S / 1e6:g} MB/s or where a sync takes {1e3 * disk_rules.SLOW_SYNC_S:g} "
            "ms, fails "
            f"where it takes {disk_rules.TOO_SLOW_SYNC_S:g} s"
        ),
        remedy="another card, or a disk on USB 3",
        gather=gather.writing,
        judge=disk_rules.judge_writing,
    ),
    Check(
        name="disk-kind",
        group=Group.DISK,
        looks_at="the kind of file system",
        amiss="fails where it is read-only or in memory, warns of FAT, NTFS and networks",
        remedy="a disk with ext4",
        gather=gather.mount,
        judge=disk_rules.judge_mount,
    ),
    Check(
        name="recordings",
        group=Group.DISK,
        looks_at="recordings that were cut short or are damaged",
        amiss="warns of each",
        remedy="`dnb-edge runs recover`",
        gather=gather.recordings,
        judge=disk_rules.judge_recordings,
    ),
    Check(
        name="python",
        group=Group.MACHINE,
        looks_at="the versions of Python and ONNX Runtime",
        amiss="fails before Python 3.11 and on 32 bit, warns of an ONNX Runtime that we do not know",
        remedy="a 64-bit system",
        gather=lambda _: machine_facts.find_python(),
        judge=machine_rules.judge_python,
    ),
    Check(
        name="system",
        group=Group.MACHINE,
        looks_at="the operating system",
        amiss="warns where it is not Debian or Raspberry Pi OS 12 or 13 on x86-64 or aarch64",
        remedy="nothing, as long as all works",
        gather=lambda box: machine_facts.find_system(box.where.root),
        judge=machine_rules.judge_system,
    ),
    Check(
        name="clock",
        group=Group.MACHINE,
        looks_at="whether something sets the wall clock",
        amiss="warns where nothing does: dates may be wrong, lap times are not",
        remedy="a network, or `timedatectl`",
        gather=lambda _: machine_facts.is_synchronised(),
        judge=machine_rules.judge_synchronised,
    ),
    Check(
        name="monotonic",
        group=Group.MACHINE,
        looks_at="the clock that laps are timed by",
        amiss="fails where it goes back or is coarse, warns of a slow source",
        remedy="another `clocksource=`",
        gather=lambda box: machine_facts.watch_ticking(box.where.root),
        judge=machine_rules.judge_ticking,
    ),
    Check(
        name="temperature",
        group=Group.MACHINE,
        looks_at="the processor's temperature",
        amiss=(
            f"warns from {machine_rules.WARM_C:g} degrees on, fails from {HOT_C:g} on; of a PC warns from "
            f"{machine_rules.PC_WARM_C:g} on"
        ),
        remedy="a heat sink, a fan",
        gather=lambda box: machine_facts.find_heat(box.where.root),
        judge=machine_rules.judge_temperature,
    ),
    Check(
        name="throttling",
        group=Group.MACHINE,
        looks_at="whether the processor is slowed down, now or since the start",
        amiss="fails for now, warns of the past",
        remedy="a fan, a stronger supply",
        gather=lambda box: machine_facts.find_slowed(box.where.root),
        judge=machine_rules.judge_throttling,
    ),
    Check(
        name="power",
        group=Group.MACHINE,
        looks_at="a Raspberry Pi's supply",
        amiss="fails where the voltage is too low now, warns where it was since the start",
        remedy="the board's own supply",
        gather=lambda box: machine_facts.find_slowed(box.where.root),
        judge=machine_rules.judge_power,
    ),
    Check(
        name="memory",
        group=Group.MACHINE,
        looks_at="the memory that is available",
        amiss=(
            f"warns below {machine_rules.LITTLE_BYTES / 1e6:g} MB, fails below "
            f"{machine_rules.TOO_LITTLE_BYTES / 1e6:g} MB; half of it while the service runs"
        ),
        remedy="close programs, run without a desktop",
        gather=lambda box: machine_facts.find_memory(box.where.root, race_runs=box.race_runs),
        judge=machine_rules.judge_memory,
    ),
    Check(
        name="load",
        group=Group.MACHINE,
        looks_at="how many processes want the processors",
        amiss="warns where more want them than there are",
        remedy="close programs",
        gather=lambda box: machine_facts.find_load(box.where.root),
        judge=machine_rules.judge_load,
    ),
    Check(
        name="display",
        group=Group.DISPLAY,
        looks_at="the display's port: there, and may be used",
        amiss="fails where it is not",
        remedy="plug it in, add the user to the group",
        gather=gather.display_port,
        judge=service_rules.judge_port,
    ),
    Check(
        name="display-answer",
        group=Group.DISPLAY,
        looks_at="whether the display takes lines: as the running service says, else by painting an empty board",
        amiss="fails where it takes none",
        remedy="plug it in again, `dnb-edge display flash`",
        gather=gather.display_taking,
        judge=service_rules.judge_taking,
    ),
    Check(
        name="unit",
        group=Group.SERVICE,
        looks_at="the service of the race: installed, starts with the machine, runs",
        amiss="fails where it is installed and does not run, warns where it is not installed or not enabled",
        remedy="`sudo ./install.sh`, `systemctl enable --now dnb-edge`",
        gather=gather.race_unit,
        judge=service_rules.judge_unit,
    ),
    Check(
        name="unit-web",
        group=Group.SERVICE,
        looks_at="the same of the pages",
        amiss="as above",
        remedy="`sudo ./install.sh`, `systemctl enable --now dnb-edge-web`",
        gather=gather.web_unit,
        judge=service_rules.judge_unit,
    ),
    Check(
        name="watchdog",
        group=Group.SERVICE,
        looks_at="who starts a service, and a machine, that hangs",
        amiss="fails where nobody watches the service, warns where nobody watches the machine",
        remedy="`sudo ./install.sh --watchdog`",
        gather=gather.watchdogs,
        judge=service_rules.judge_watchdog,
    ),
    Check(
        name="service",
        group=Group.SERVICE,
        looks_at="whether the race's process answers, and can race",
        amiss="fails where it is silent, or says that it cannot",
        remedy="by what it says",
        gather=gather.answer,
        judge=service_rules.judge_service,
    ),
    Check(
        name="warnings",
        group=Group.SERVICE,
        looks_at="what the running service itself warns of",
        amiss="warns of each",
        remedy="by what it says",
        gather=gather.answer,
        judge=service_rules.judge_warnings,
    ),
    Check(
        name="web",
        group=Group.SERVICE,
        looks_at="whether the pages answer on this machine",
        amiss="fails where they are installed and do not",
        remedy="`systemctl restart dnb-edge-web`",
        gather=gather.web,
        judge=service_rules.judge_web,
    ),
)
