"""All checks, in the order in which they are made and told: a table.

Knows which facts go to which rule, and what each check is for people who read the list.
"""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any

from dnb_edge.doctor import (
    camera_rules,
    disk_rules,
    gather,
    machine_facts,
    machine_rules,
    picture_rules,
    service_rules,
    setup_facts,
    setup_rules,
)
from dnb_edge.doctor.check import Check, Group
from dnb_edge.errors import InputError
from dnb_edge.machine.state import HOT_C, read_machine

CHECKS: tuple[Check[Any], ...] = (
    Check(
        name="set-up",
        group=Group.SETUP,
        looks_at="whether a track is set up: a configuration at its place, or one saved on the pages",
        amiss="fails where there is neither",
        remedy="go through Set up on the pages",
        gather=setup_facts.find_set_up,
        judge=setup_rules.judge_set_up,
    ),
    Check(
        name="config",
        group=Group.SETUP,
        looks_at="the configuration, as `dnb-edge config check` does",
        amiss="fails at the first key that is wrong, and names its line",
        remedy="mend that line",
        gather=setup_facts.config_fault,
        judge=setup_rules.judge_config,
    ),
    Check(
        name="track",
        group=Group.SETUP,
        looks_at="the twin or the track's file: whether they make a route",
        amiss="fails where they do not",
        remedy="make the track again, under Set up or with `dnb-edge track build`",
        gather=setup_facts.find_track,
        judge=setup_rules.judge_track,
    ),
    Check(
        name="calibration",
        group=Group.SETUP,
        looks_at="the calibration: of this camera, this size and this track, and how good",
        amiss=(
            f"fails where it does not fit or is over the configuration's limit, warns over {1e3 * setup_rules.ERROR_WARN_M:g} "
            "mm of mean error"
        ),
        remedy="calibrate again",
        gather=setup_facts.find_calibration,
        judge=setup_rules.judge_calibration,
    ),
    Check(
        name="calibration-age",
        group=Group.SETUP,
        looks_at="how old the calibration is",
        amiss=f"warns after {setup_rules.OLD_DAYS:g} days",
        remedy="`dnb-edge calibrate check`",
        gather=setup_facts.find_calibration,
        judge=setup_rules.judge_age,
    ),
    Check(
        name="camera",
        group=Group.CAMERA,
        looks_at="whether the camera is plugged in and is one",
        amiss="fails where it is not",
        remedy="plug it in, or name another one in `capture.source`",
        gather=gather.camera_there,
        judge=camera_rules.judge_there,
    ),
    Check(
        name="camera-name",
        group=Group.CAMERA,
        looks_at="whether the configuration names it by a name that stays",
        amiss="warns of `/dev/video0` and its like, which may be another camera after the next start",
        remedy="name it by `/dev/v4l/by-id`",
        gather=gather.camera,
        judge=camera_rules.judge_name,
    ),
    Check(
        name="camera-access",
        group=Group.CAMERA,
        looks_at="whether the service, and you, may use it",
        amiss="fails where the service is not in its group",
        remedy="add the user to the group",
        gather=gather.camera_access,
        judge=lambda access: camera_rules.judge_access(access, what="camera"),
    ),
    Check(
        name="camera-in-use",
        group=Group.CAMERA,
        looks_at="which programs have it open",
        amiss="fails where another one than dnb-edge has, and names it",
        remedy="close that program",
        gather=gather.camera_use,
        judge=camera_rules.judge_use,
    ),
    Check(
        name="formats",
        group=Group.CAMERA,
        looks_at="whether it offers the size and rate that are asked for",
        amiss="fails where it does not, warns where it has them uncompressed only",
        remedy="ask for what it has",
        gather=gather.camera_wanted,
        judge=camera_rules.judge_formats,
    ),
    Check(
        name="usb-speed",
        group=Group.CAMERA,
        looks_at="how fast its USB line is",
        amiss=f"fails below {camera_rules.HIGH_SPEED_MBPS:g} Mbit/s",
        remedy="another port, another cable, no hub",
        gather=gather.usb,
        judge=camera_rules.judge_usb_speed,
    ),
    Check(
        name="frames",
        group=Group.CAMERA,
        looks_at="whether pictures come: of the running service, else by opening the camera for two seconds",
        amiss="fails where none come",
        remedy="unplug the camera and plug it in again",
        gather=gather.frames,
        judge=camera_rules.judge_frames,
    ),
    Check(
        name="rate",
        group=Group.CAMERA,
        looks_at="how many frames a second the camera really makes, by the kernel's stamps",
        amiss=(
            f"warns below {100 * camera_rules.SLOWEST_SHARE:g} % of `capture.fps`, fails below "
            f"{100 * camera_rules.USELESS_SHARE:g} %"
        ),
        remedy="more light and a fixed exposure",
        gather=gather.rate,
        judge=camera_rules.judge_rate,
    ),
    Check(
        name="gaps",
        group=Group.CAMERA,
        looks_at="numbers that are missing among the frames, and why",
        amiss=f"warns from {100 * camera_rules.LOST_WARN:g} % on, fails from {100 * camera_rules.LOST_FAIL:g} % on",
        remedy="by the reason: another cable, fewer programs, a smaller picture",
        gather=gather.losses,
        judge=camera_rules.judge_losses,
    ),
    Check(
        name="usb-bandwidth",
        group=Group.CAMERA,
        looks_at="what the pictures take of the bus, hubs, other cameras and disks on it",
        amiss=f"fails over {100 * camera_rules.BUS_WARN:g} % of what a camera can be given, warns of a hub or a rival",
        remedy="MJPG, another port",
        gather=gather.bus,
        judge=camera_rules.judge_bus,
    ),
    Check(
        name="controls",
        group=Group.CAMERA,
        looks_at="whether the camera took exposure, gain, focus and the rest as asked",
        amiss="warns where it took another value",
        remedy="ask for what it takes",
        gather=gather.controls,
        judge=camera_rules.judge_controls,
    ),
    Check(
        name="stamps",
        group=Group.CAMERA,
        looks_at="whether the kernel stamps each frame, on the clock that laps are timed by",
        amiss="warns where frames are timed by their arrival, fails where stamps are of another clock",
        remedy="a UVC camera",
        gather=gather.stamps,
        judge=camera_rules.judge_stamps,
    ),
    Check(
        name="exposure",
        group=Group.CAMERA,
        looks_at="the exposure against a frame's time, and how far a car goes in it (`--speed`)",
        amiss=(
            f"warns where it is automatic and over {1e3 * camera_rules.BLUR_WARN_M:g} mm, fails over "
            f"{1e3 * camera_rules.BLUR_FAIL_M:g} mm and over a frame's time"
        ),
        remedy="`capture.exposure_us` and more light",
        gather=gather.blur,
        judge=camera_rules.judge_exposure,
    ),
    Check(
        name="picture",
        group=Group.PICTURE,
        looks_at="whether the picture shows anything",
        amiss="fails where it is black, overexposed, covered or frozen",
        remedy="lens cap, light, exposure",
        gather=setup_facts.picture_fault,
        judge=picture_rules.judge_shows,
    ),
    Check(
        name="sharpness",
        group=Group.PICTURE,
        looks_at="how wide the sharpest edges of the picture are",
        amiss=(
            f"warns over {picture_rules.SOFT_PX:g} px, fails over {picture_rules.BLURRED_PX:g} px (of a "
            "picture 1280 px wide)"
        ),
        remedy="focus, wipe the lens",
        gather=gather.sharpness,
        judge=picture_rules.judge_sharpness,
    ),
    Check(
        name="flicker",
        group=Group.PICTURE,
        looks_at="whether the brightness beats with lamps on 50 or 60 Hz",
        amiss=(
            f"warns from an amplitude of {100 * picture_rules.FLICKER_WARN:g} % on, fails from "
            f"{100 * picture_rules.FLICKER_FAIL:g} % on"
        ),
        remedy="`capture.power_line_hz`, an exposure of whole flickers, other lamps",
        gather=gather.beats,
        judge=picture_rules.judge_flicker,
    ),
    Check(
        name="camera-moved",
        group=Group.PICTURE,
        looks_at="whether the camera still stands where it was calibrated",
        amiss="fails where it has moved by 0.2 % of the track's span, warns where nobody can tell",
        remedy="put it back, or calibrate again",
        gather=setup_facts.find_place,
        judge=picture_rules.judge_place,
    ),
    Check(
        name="model",
        group=Group.DETECTOR,
        looks_at="the detector's model and its checksum",
        amiss="fails where it is damaged or missing",
        remedy="install it again",
        gather=setup_facts.find_model,
        judge=setup_rules.judge_model,
    ),
    Check(
        name="detector-speed",
        group=Group.DETECTOR,
        looks_at="how long the detector takes against a frame's time; of a running race, which frames it was too slow for",
        amiss=(
            f"warns from {100 * setup_rules.BUSY_SHARE:g} % of a frame's time on, fails where it is slower than the camera; of "
            f"a running race from {100 * setup_rules.LOST_WARN:g} % and {100 * setup_rules.LOST_FAIL:g} % of the frames on"
        ),
        remedy="two threads, a lower rate, fewer programs",
        gather=setup_facts.find_pace,
        judge=setup_rules.judge_pace,
    ),
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
        amiss=f"warns from {machine_rules.WARM_C:g} degrees on, fails from {HOT_C:g} on",
        remedy="a heat sink, a fan",
        gather=lambda box: read_machine(root=box.where.root).temperature_c,
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
"""In the order in which they are told: what the later ones need comes first."""


def chosen(names: list[str] | None) -> tuple[Check[Any], ...]:
    """The checks of these names or groups, in their own order; all of them for none. Raises `InputError` for an unknown one."""
    if not names:
        return CHECKS
    known = {check.name for check in CHECKS} | {check.group.value.lower() for check in CHECKS}
    for name in names:
        if name.lower() not in known:
            near = get_close_matches(name.lower(), sorted(known), n=3)
            hint = f"did you mean {', '.join(near)}? " if near else ""
            raise InputError(f"--only {name}: there is no such check: {hint}`dnb-edge doctor --list` shows them")
    wanted = {name.lower() for name in names}
    return tuple(check for check in CHECKS if check.name in wanted or check.group.value.lower() in wanted)
