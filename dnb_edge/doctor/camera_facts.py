"""A V4L2 camera as the kernel shows it: there or not, whose, in use by whom, what it offers, how it exposes.

Opens the node beside whoever streams from it, which V4L2 lets everybody do, asks and closes; it never starts a stream and sets
nothing.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from linuxpy.video import device as linux

from dnb_edge.capture.v4l2_controls import Control, read_controls, value_of
from dnb_edge.capture.v4l2_nodes import camera_id, first_camera, known_cameras, users_of
from dnb_edge.capture.v4l2_offers import Offer, read_offers
from dnb_edge.capture.v4l2_setup import open_device
from dnb_edge.config.devices import CaptureConfig
from dnb_edge.doctor.access import Access, access_of
from dnb_edge.doctor.usb_facts import UsbLook, usb_of
from dnb_edge.doctor.verdict import CannotTell
from dnb_edge.errors import InputError

_ID = linux.ControlID
_EXPOSURE_UNIT_US = 100.0
"""V4L2_CID_EXPOSURE_ABSOLUTE counts in units of 100 us."""
_MANUAL = (1, 2)
"""Of V4L2_CID_EXPOSURE_AUTO: manual mode and shutter priority, in which the time is ours."""


class NoCameraHere(CannotTell):
    """No source is named, and this machine has no camera."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Exposure:
    """How the camera exposes at present; None where it does not tell."""

    time_us: float | None
    automatic: bool | None
    slows_down: bool | None
    """Whether it may give fewer frames for the sake of light ("dynamic framerate")."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraLook:
    """One camera."""

    uri: str
    path: Path
    is_there: bool
    others: str
    """Which cameras this machine has, in words."""
    unfit: str | None = None
    """Why it cannot be used, in one line; None where it can, or was not opened."""
    access: Access | None = None
    users: tuple[str, ...] = ()
    """Processes that have it open, such as `obs, process 1234`."""
    users_hidden: bool = False
    """Whether some processes could not be looked into."""
    identity: str | None = None
    card: str | None = None
    offers: tuple[Offer, ...] = ()
    exposure: Exposure | None = None
    usb: UsbLook | None = None


def camera_uri(named: str | None) -> str:
    """The source that a race would use: the `named` one, else the first camera. Raises `NoCameraHere` where there is none."""
    if named is not None:
        return named
    camera = first_camera(usb=True)
    if camera is None and importlib.util.find_spec("libcamera") is not None:
        return "libcamera:0"
    camera = camera if camera is not None else first_camera(usb=False)
    if camera is None:
        raise NoCameraHere(f"no source is named, and {known_cameras()}")
    return f"v4l2:{camera}"


def look_at_camera(uri: str, capture: CaptureConfig | None, *, root: Path, unit_groups: tuple[str, ...]) -> CameraLook:
    """The V4L2 camera at `uri`. Raises `CannotTell` where the source is another kind."""
    scheme, _, rest = uri.partition(":")
    if scheme != "v4l2":
        raise CannotTell(f"{uri} is no V4L2 camera")
    path = Path(rest).expanduser()
    others = known_cameras()
    if not path.exists():
        return CameraLook(uri=uri, path=path, is_there=False, others=others)
    access = access_of(path, unit_groups=unit_groups)
    users, hidden = users_of(path, proc=root / "proc")
    number = path.stat().st_rdev
    usb = usb_of((os.major(number), os.minor(number)), sys=root / "sys")
    known = {"uri": uri, "path": path, "is_there": True, "others": others, "access": access, "users": tuple(users),
             "users_hidden": hidden, "usb": usb}  # fmt: skip
    if not access.may_open:
        return CameraLook(**known)  # type: ignore[arg-type]
    wanted = CaptureConfig() if capture is None else capture
    try:
        device = open_device(path)
    except InputError as error:
        return CameraLook(**known, unfit=str(error))  # type: ignore[arg-type]
    try:
        return CameraLook(
            **known,  # type: ignore[arg-type]
            identity=camera_id(path, device, sys=root / "sys"),
            card=str(device.info.card),
            offers=tuple(read_offers(device, wanted.width_px, wanted.height_px)),
            exposure=_exposure(device, read_controls(device)),
        )
    finally:
        device.close()


def _exposure(device: linux.Device, controls: Mapping[int, Control]) -> Exposure:
    def value(ident: linux.ControlID) -> int | None:
        return value_of(device, controls[ident]) if ident in controls else None

    units, mode, priority = value(_ID.EXPOSURE_ABSOLUTE), value(_ID.EXPOSURE_AUTO), value(_ID.EXPOSURE_AUTO_PRIORITY)
    return Exposure(
        time_us=None if units is None else units * _EXPOSURE_UNIT_US,
        automatic=None if mode is None else mode not in _MANUAL,
        slows_down=None if priority is None else bool(priority),
    )
