"""When a camera is fit to race with: facts to verdicts, nothing else.

Knows the limits and what to type. Opens nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from dnb_edge.capture.settings import changed_controls
from dnb_edge.doctor.access import Access
from dnb_edge.doctor.camera_facts import CameraLook, Exposure
from dnb_edge.doctor.verdict import Verdict, fail, ok, skip, warn
from dnb_edge.values import CameraControl, LostFrames, StampSource

SLOWEST_SHARE = 0.97
"""A camera that makes fewer frames than this share of those asked for is slow."""
USELESS_SHARE = 0.6
LOST_WARN, LOST_FAIL = 0.01, 0.2
"""Shares of the frames that may be missing."""
LATE_S = 0.25
BLUR_WARN_M, BLUR_FAIL_M = 0.010, 0.040
"""How far a car may go while one picture is exposed, metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoCamera:
    """No source is named, and this machine has no camera."""

    why: str


def judge_there(look: CameraLook | NoCamera) -> Verdict:
    """Whether the camera that is named is plugged in and is one."""
    if isinstance(look, NoCamera):
        return fail(look.why, "Plug a USB camera in, and name it in capture.source; `ls -l /dev/v4l/by-id` shows it.")
    if not look.is_there:
        return fail(
            f"{look.path} is not there: {look.others}",
            "Plug the camera in, or name another one in capture.source; `ls -l /dev/v4l/by-id` shows them.",
        )
    if look.unfit is not None:
        return fail(look.unfit, "Name the camera's own node in capture.source; `ls -l /dev/v4l/by-id` shows them.")
    return ok(f"{look.card or 'a camera'} at {look.path}")


def judge_name(look: CameraLook) -> Verdict:
    """Whether the camera is named by a name that stays with it."""
    if not look.is_there:
        return skip(f"{look.path} is not there")
    if not re.fullmatch(r"video\d+", look.path.name):
        return ok(f"{look.path} is a name that stays")
    lasting = (
        f"v4l2:/dev/v4l/by-id/{look.identity}"
        if look.identity and "/" not in look.identity and " " not in look.identity
        else None
    )
    if lasting is None:
        return ok(f"{look.path}; the camera has no serial number to be named by")
    return warn(
        f"{look.path.name} may be another camera after the next start",
        f"Set `capture.source: {lasting}` in the configuration.",
    )


def judge_access(access: Access, *, what: str) -> Verdict:
    """Whether the service, and whoever runs this, may use a device."""
    if not access.group_may:
        return fail(
            f"only its owner may use the {what} {access.path}",
            f"Give it to its group with `sudo chmod g+rw {access.path}`, and for good with `sudo "
            "./install.sh`, whose udev rules do.",
        )
    if access.service_groups is not None and access.group not in access.service_groups:
        return fail(
            f"{access.path} belongs to group {access.group}, in which the service is not",
            f"Type `sudo usermod -aG {access.group} dnb-edge && sudo systemctl restart dnb-edge`.",
        )
    if access.may_open:
        return ok(f"{access.path}, group {access.group}")
    fix = f"Type `sudo usermod -aG {access.group} $USER` and log in anew, or run this with sudo."
    if access.service_groups is not None:
        return warn(f"the service may use {access.path}, you may not: some checks are left out", fix)
    return fail(f"you may not use {access.path}, which belongs to group {access.group}", fix)


@dataclass(frozen=True, slots=True, kw_only=True)
class Use:
    """Who has the camera."""

    users: tuple[str, ...]
    hidden: bool
    service_pid: int | None
    service_answers: bool


def judge_use(use: Use) -> Verdict:
    """Whether nobody but the service has the camera."""
    ours = f"process {use.service_pid}"
    others = [user for user in use.users if use.service_pid is None or not user.endswith(ours)]
    if use.service_pid is None and use.service_answers:
        # A race that somebody started by hand, which is found by its name.
        others = [user for user in others if not user.startswith(("dnb-edge", "python"))]
    if others:
        pid = others[0].rpartition(" ")[2]
        return fail(f"{'; '.join(others)} has the camera", f"Close that program, with `kill {pid}` if need be.")
    if use.users:
        return ok(f"only dnb-edge has it ({'; '.join(use.users)})")
    unsure = ", as far as can be seen without sudo" if use.hidden else ""
    return ok(f"nobody else has it{unsure}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What is asked of a camera, and what it offers."""

    look: CameraLook
    width_px: int
    height_px: int
    fps: float


def judge_formats(wanted: Wanted) -> Verdict:
    """Whether the camera offers the size and the rate that are asked for, compressed."""
    look = wanted.look
    if not look.offers:
        return skip("the camera could not be asked what it offers")
    asked = f"{wanted.width_px}x{wanted.height_px} at {wanted.fps:g}"
    fitting = [one.pixel_format for one in look.offers if one.has(wanted.width_px, wanted.height_px, wanted.fps)]
    jpeg, raw = [one for one in fitting if one in ("MJPG", "JPEG")], [one for one in fitting if one == "YUYV"]
    if jpeg:
        return ok(f"{asked} as {jpeg[0]}")
    has = (
        ". ".join(one.words() for one in look.offers if one.pixel_format in ("MJPG", "JPEG", "YUYV"))
        or "no format we read"
    )
    if raw:
        return warn(
            f"{asked} only as {raw[0]}, which takes {raw_mbps(wanted):.0f} Mbit/s of the bus",
            f"Set capture.width_px, height_px and fps to what it has as MJPG: {has}.",
        )
    return fail(f"the camera has no {asked}", f"Set capture.width_px, height_px and fps to what it has: {has}.")


def raw_mbps(wanted: Wanted) -> float:
    """What the frames take uncompressed (YUYV, two bytes a pixel), Mbit/s."""
    return 16e-6 * wanted.width_px * wanted.height_px * wanted.fps


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """Whether pictures came."""

    fault: str | None
    words: str


def judge_frames(given: Frames) -> Verdict:
    """Whether the source gives pictures."""
    if given.fault is None:
        return ok(given.words)
    return fail(
        given.fault,
        "Unplug the camera and plug it in again, then look at `journalctl -k -n 20` for what the kernel says of it.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """How many frames a second the camera makes, and was asked for."""

    fps: float | None
    asked_fps: float
    live: bool


def judge_rate(rate: Rate) -> Verdict:
    """Whether the camera makes as many frames as it should."""
    if not rate.live:
        return skip("the source is no camera and has its own time")
    if rate.fps is None:
        return skip("too few frames to measure a rate by")
    found = f"{rate.fps:.2f} frames a second, {rate.asked_fps:g} asked for"
    if rate.fps >= SLOWEST_SHARE * rate.asked_fps:
        return ok(found)
    fix = "Give it more light and a fixed exposure (`capture.exposure_us: 5000`), or set capture.fps to what it makes."
    return (fail if rate.fps < USELESS_SHARE * rate.asked_fps else warn)(found, fix)


@dataclass(frozen=True, slots=True, kw_only=True)
class Losses:
    """Frames that came and frames that did not, by reason."""

    frames: int
    lost: tuple[LostFrames, ...]
    live: bool


_LOSS_FIXES = {
    "queue": "Lower capture.fps or the size, or cool the box: the processor is too slow; `dnb-edge bench` tells by how much.",
    "overtaken": "Close other programs: the processor had no time for the camera; `top` names them.",
    "damaged": "Take a shorter or better USB cable and no hub, then type `dnb-edge doctor --only gaps`.",
    "short": "Take a shorter or better USB cable and no hub, then type `dnb-edge doctor --only gaps`.",
    "unreadable": "Take a shorter or better USB cable and no hub, then type `dnb-edge doctor --only gaps`.",
}
_OTHER_LOSS_FIX = "Plug the camera into a port of its own, without a hub, then type `dnb-edge doctor --only gaps`."


def judge_losses(losses: Losses) -> Verdict:
    """Whether frames are missing, and by whose fault."""
    if not losses.live:
        return skip("the source is no camera")
    missing = sum(one.frames for one in losses.lost)
    total = losses.frames + missing
    if missing == 0:
        return ok(f"none of {total} frames is missing")
    share = missing / total
    worst = max(losses.lost, key=lambda one: one.frames)
    words = ", ".join(f"{one.reason} {one.frames}" for one in losses.lost)
    found = f"{missing} of {total} frames are missing ({words})"
    if share < LOST_WARN:
        return ok(found)
    return (fail if share >= LOST_FAIL else warn)(found, _LOSS_FIXES.get(worst.reason, _OTHER_LOSS_FIX))


def judge_controls(controls: Iterable[CameraControl]) -> Verdict:
    """Whether the camera took what it was asked for."""
    asked = tuple(controls)
    changed = changed_controls(asked)
    if changed:
        names = ", ".join(one.name for one in asked if one.taken is not None and one.taken != one.asked)
        return warn("; ".join(changed), f"Set {names} in `capture` to what the camera took, or leave it out.")
    return ok(f"{len(asked)} settings taken as asked" if asked else "no settings are asked for")


@dataclass(frozen=True, slots=True, kw_only=True)
class Stamps:
    """What the frames' times are of."""

    kinds: frozenset[StampSource]
    delay_s: float | None


def judge_stamps(stamps: Stamps) -> Verdict:
    """Whether the kernel says when each picture was taken, on the clock that laps are timed by."""
    if not stamps.kinds:
        return skip(
            "the service has the camera and does not tell: `dnb-edge doctor --only stamps` while it is stopped does"
        )
    if StampSource.ARRIVAL in stamps.kinds:
        return warn(
            "the driver does not stamp frames: laps are timed by when a picture arrives, some milliseconds worse",
            "Use a UVC camera (`lsusb -t` shows Driver=uvcvideo), whose driver stamps each frame.",
        )
    if stamps.delay_s is not None and not -0.001 <= stamps.delay_s <= LATE_S:
        return fail(
            f"frames come {stamps.delay_s:.3f} s after their stamps: the camera's clock is not the machine's",
            "Restart the machine, and if it stays so set `options uvcvideo clock=CLOCK_MONOTONIC` in "
            "/etc/modprobe.d/uvcvideo.conf.",
        )
    delay = "" if stamps.delay_s is None else f", {1e3 * stamps.delay_s:.0f} ms before it arrives"
    return ok(f"stamped by the kernel at the {_words(stamps.kinds)}{delay}")


def _words(kinds: Iterable[StampSource]) -> str:
    return " or ".join(sorted(kind.value.replace("_", " ") for kind in kinds))


@dataclass(frozen=True, slots=True, kw_only=True)
class Blur:
    """How the camera exposes, for how many frames a second, of cars how fast."""

    exposure: Exposure
    fps: float
    speed_mps: float


def judge_exposure(blur: Blur) -> Verdict:
    """Whether the exposure is ours, shorter than a frame, and short enough for cars not to smear."""
    time_us, frame_us = blur.exposure.time_us, 1e6 / blur.fps
    fix = f"Set `capture.exposure_us: {_good_exposure_us(blur):.0f}` in the configuration, and put the light on."
    if time_us is None:
        return skip("the camera does not tell its exposure")
    blur_m = blur.speed_mps * time_us * 1e-6
    smear = f"{time_us / 1e3:.1f} ms, a car at {blur.speed_mps:g} m/s smears over {1e3 * blur_m:.0f} mm"
    if blur.exposure.automatic:
        slower = ", and may make fewer frames for it" if blur.exposure.slows_down else ""
        return warn(f"the camera chooses its exposure by itself{slower}: it changes with the light", fix)
    if time_us > frame_us:
        return fail(f"{smear}, and longer than a frame lasts ({frame_us / 1e3:.1f} ms)", fix)
    if blur_m > BLUR_FAIL_M:
        return fail(smear, fix)
    return warn(smear, fix) if blur_m > BLUR_WARN_M else ok(smear)


def _good_exposure_us(blur: Blur) -> float:
    """What keeps the smear at half of what is worth a warning, and within half a frame; V4L2 counts in 100 us."""
    wanted_us = 0.5e6 * BLUR_WARN_M / blur.speed_mps
    return max(100.0, 100.0 * round(min(wanted_us, 0.5e6 / blur.fps) / 100.0))
