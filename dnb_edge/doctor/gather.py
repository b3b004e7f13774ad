"""What the checks of camera, picture, disk, display and service want to know, asked of one box.

Each function takes the box and gives the facts of one rule; it raises `CannotTell`, or what the rooms raise, where they cannot
be had. Knows no limit.
"""

from __future__ import annotations

from dnb_edge.config.devices import CaptureConfig, RecordConfig
from dnb_edge.config.web import WebConfig
from dnb_edge.doctor import camera_rules, disk_facts, disk_rules, picture_rules, service_facts, service_rules, usb_rules
from dnb_edge.doctor.access import Access
from dnb_edge.doctor.box import Box
from dnb_edge.doctor.camera_facts import CameraLook, NoCameraHere
from dnb_edge.doctor.sight import Beat, edge_width_px, lamp_beats
from dnb_edge.doctor.unit_facts import RACE_UNIT, WEB_UNIT, UnitLook
from dnb_edge.doctor.usb_facts import UsbLook
from dnb_edge.doctor.verdict import CannotTell
from dnb_edge.errors import DnbEdgeError
from dnb_edge.values import CameraControl
from dnb_edge.view.drift_patches import grey

_LEAST_FRAMES = 12
"""Fewer tell no beat."""


def _capture(box: Box) -> CaptureConfig:
    config = box.readable_config
    return CaptureConfig() if config is None else config.capture


def camera(box: Box) -> CameraLook:
    """The camera as the kernel shows it."""
    return box.camera


def camera_there(box: Box) -> CameraLook | camera_rules.NoCamera:
    """The same, or that there is none."""
    try:
        return box.camera
    except NoCameraHere as error:
        return camera_rules.NoCamera(why=str(error))


def camera_access(box: Box) -> Access:
    """Who may use the camera."""
    access = box.camera.access
    if access is None:
        raise CannotTell(f"{box.camera.path} is not there")
    return access


def camera_use(box: Box) -> camera_rules.Use:
    """Who has the camera."""
    look = box.camera
    if not look.is_there:
        raise CannotTell(f"{look.path} is not there")
    try:
        pid = box.units[RACE_UNIT].main_pid
    except CannotTell:
        pid = None
    return camera_rules.Use(users=look.users, hidden=look.users_hidden, service_pid=pid, service_answers=box.race_runs)


def camera_wanted(box: Box) -> camera_rules.Wanted:
    """What is asked of the camera, and what it offers."""
    capture = _capture(box)
    return camera_rules.Wanted(look=box.camera, width_px=capture.width_px, height_px=capture.height_px, fps=capture.fps)


def frames(box: Box) -> camera_rules.Frames:
    """Whether pictures come."""
    uri = box.uri
    try:
        footage = box.footage
    except (CannotTell, DnbEdgeError) as error:
        return camera_rules.Frames(fault=str(error), words="")
    info = footage.info
    by = "of the running service" if footage.from_service else f"from {uri}"
    words = f"pictures of {info.width_px}x{info.height_px} {by}"
    return camera_rules.Frames(fault=None, words=words)


def rate(box: Box) -> camera_rules.Rate:
    """How many frames a second come."""
    footage = box.footage
    return camera_rules.Rate(fps=footage.fps, asked_fps=_capture(box).fps, live=footage.info.live)


def losses(box: Box) -> camera_rules.Losses:
    """Which frames are missing."""
    footage = box.footage
    if footage.lost is None:
        raise CannotTell("the running service counts frames in a race only")
    return camera_rules.Losses(frames=footage.frames, lost=footage.lost, live=footage.info.live)


def controls(box: Box) -> tuple[CameraControl, ...]:
    """What the camera was asked for, and took."""
    footage = box.footage
    if footage.from_service:
        raise CannotTell("the running service has the camera: its own warnings tell")
    if not footage.info.live:
        raise CannotTell("the source is no camera")
    return footage.info.controls


def stamps(box: Box) -> camera_rules.Stamps:
    """What the frames' stamps are of."""
    footage = box.footage
    if not footage.info.live:
        raise CannotTell("the source is no camera")
    return camera_rules.Stamps(kinds=footage.stamps, delay_s=footage.delay_s)


def blur(box: Box) -> camera_rules.Blur:
    """How the camera exposes."""
    exposure = box.camera.exposure
    if exposure is None:
        raise CannotTell("the camera could not be asked")
    return camera_rules.Blur(exposure=exposure, fps=_capture(box).fps, speed_mps=box.where.speed_mps)


def usb(box: Box) -> UsbLook | None:
    """How the camera hangs on USB."""
    if not box.camera.is_there:
        raise CannotTell(f"{box.camera.path} is not there")
    return box.camera.usb


def bus(box: Box) -> usb_rules.Bus:
    """What the camera sends, and who shares its bus."""
    found = usb(box)
    needed: float | None = None
    try:
        footage = box.footage
    except (CannotTell, DnbEdgeError):
        # The check of the pictures tells it; what shares the bus is known all the same.
        return usb_rules.Bus(usb=found, needed_mbps=None)
    fps = footage.fps if footage.fps is not None else _capture(box).fps
    if footage.info.pixel_format == "YUYV":
        needed = camera_rules.raw_mbps(camera_wanted(box))
    elif footage.frame_bytes is not None:
        needed = 8e-6 * footage.frame_bytes * fps
    return usb_rules.Bus(usb=found, needed_mbps=needed)


def sharpness(box: Box) -> picture_rules.Sharpness:
    """How wide the sharpest edges are: of the picture in which they are narrowest, since others may show a hand."""
    stills = box.footage.stills
    if not stills:
        raise CannotTell("none of the pictures could be decoded")
    widths = [width for still in stills if (width := edge_width_px(grey(still))) is not None]
    height_px, width_px = stills[0].shape[:2]
    return picture_rules.Sharpness(
        edge_px=min(widths, default=None), width_px=width_px, mm_per_px=_mm_per_px(box, width_px / 2, height_px / 2)
    )


def _mm_per_px(box: Box, u: float, v: float) -> float | None:
    """What a camera px is worth on the floor there, across the picture, mm; None where no calibration tells."""
    try:
        ground = box.assembly.setup.ground
        (xu, _), (yu, _) = ground.jacobian((u, v))
    except (CannotTell, DnbEdgeError, OSError, ValueError):
        return None
    return float(1e3 * (xu**2 + yu**2) ** 0.5)


def beats(box: Box) -> tuple[Beat, ...]:
    """How the lamps beat in the picture."""
    footage = box.footage
    if not footage.info.live:
        raise CannotTell("the source is no camera")
    if len(footage.brightness) < _LEAST_FRAMES or footage.fps is None:
        raise CannotTell("too few pictures came to measure a beat")
    return lamp_beats(footage.brightness, footage.fps)


def _record(box: Box) -> RecordConfig:
    config = box.readable_config
    return RecordConfig() if config is None else config.record


def _runs(box: Box) -> None:
    """Raises `CannotTell` where nothing is recorded here."""
    config = box.readable_config
    if not box.is_installed and config is not None and config.record.directory is None and not box.runs.is_dir():
        raise CannotTell("nothing is recorded: record.directory is not set")
    if not box.is_installed and config is None and not box.runs.is_dir():
        raise CannotTell(f"nothing is recorded: {box.runs} is not there")


def space(box: Box) -> disk_rules.Space:
    """The room where recordings go."""
    _runs(box)
    try:
        frame_bytes = box.footage.frame_bytes
    except (CannotTell, DnbEdgeError):
        frame_bytes = None
    return disk_facts.find_space(box.runs, _record(box), frame_bytes=frame_bytes)


def writing(box: Box) -> disk_rules.Writing:
    """How fast the disk is; a running race is disturbed by a few megabytes no more than by its own pictures."""
    _runs(box)
    box.say("Writing to the disk")
    if box.race_runs:
        return disk_facts.measure_writing(box.runs, chunks=8, syncs=10)
    return disk_facts.measure_writing(box.runs)


def mount(box: Box) -> disk_rules.Mount:
    """The file system that recordings go to."""
    _runs(box)
    return disk_facts.find_mount(box.runs, mounts=box.where.root / "proc/self/mounts")


def holder(box: Box) -> disk_rules.Holder:
    """Who may write there."""
    _runs(box)
    return disk_facts.find_holder(box.runs, installed=box.is_installed, may=service_facts.may_write)


def recordings(box: Box) -> disk_rules.Recordings:
    """What lies there."""
    _runs(box)
    return disk_facts.find_recordings(box.runs)


def race_unit(box: Box) -> UnitLook:
    """The unit of the race."""
    return box.units[RACE_UNIT]


def web_unit(box: Box) -> UnitLook:
    """The unit of the pages."""
    return box.units[WEB_UNIT]


def watchdogs(box: Box) -> service_rules.Watchdogs:
    """Who starts what hangs."""
    return service_facts.find_watchdogs(box.units[RACE_UNIT], dev=box.where.root / "dev")


def answer(box: Box) -> service_rules.Answer:
    """What the service says of itself."""
    service = box.service
    if service is None:
        return service_rules.Answer(is_installed=box.is_installed, phase=None)
    health = service.health
    return service_rules.Answer(
        is_installed=box.is_installed,
        phase=service.state.phase,
        reason=service.state.reason,
        warnings=() if health is None else health.warnings,
        notes=() if health is None else health.notes,
    )


def web(box: Box) -> service_rules.Reached:
    """Whether the pages answer."""
    config = box.readable_config
    try:
        installed = box.units[WEB_UNIT].is_installed
    except CannotTell:
        installed = False
    return service_facts.reach_web((WebConfig() if config is None else config.web).port, is_installed=installed)


def display_port(box: Box) -> service_rules.Port:
    """The display's port."""
    return service_facts.find_port(box.config.display.uri, unit_groups=box.unit_groups, dev=box.where.root / "dev")


def display_taking(box: Box) -> service_rules.Taking:
    """Whether the display takes lines: by the running service, which has its port, else tried."""
    uri = box.config.display.uri
    if uri is None:
        raise CannotTell("no display is configured (display.uri)")
    service = box.service
    if service is None:
        box.say("Telling the display a line")
        return service_facts.try_display(uri)
    if service.health is None or service.health.display == "none":
        raise CannotTell("the running service has the display and does not tell of it just now")
    online = service.health.display == "online"
    return service_rules.Taking(uri=uri, by_service=True, fault=None if online else "the service cannot reach it")
