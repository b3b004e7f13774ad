"""Setting a V4L2 camera up: opening, checking what it can do, agreeing on a format, and saying plainly what is wrong.

Knows linuxpy's device and the kernel's error numbers. Knows no frame.
"""

from __future__ import annotations

import errno
from dataclasses import dataclass
from pathlib import Path

from linuxpy.video import device as linux

from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.v4l2_nodes import busy_words, known_cameras, permission_words, picture_node
from dnb_edge.capture.v4l2_offers import JPEG_FORMATS, choose, read_offers, set_rate
from dnb_edge.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFormat:
    """The format that the driver granted."""

    width: int
    height: int
    pixel_format: str
    """FourCC, such as `MJPG`."""
    bytes_per_line: int
    """Of raw pictures."""
    fps: float | None
    """The rate that the driver claims; None where it does not say."""

    @property
    def is_jpeg(self) -> bool:
        """True where each buffer holds one JPEG picture."""
        return self.pixel_format in JPEG_FORMATS


def open_device(path: Path) -> linux.Device:
    """The capture device at `path`, open and non-blocking. Raises `InputError` where there is none to use."""
    try:
        found, is_device = path.exists(), path.is_char_device()
    except PermissionError as error:
        raise refusal(path, error) from error
    if not found:
        raise InputError(f"{path}: there is no such camera: {known_cameras()}")
    if not is_device:
        raise InputError(f"{path}: is not a capture device: {known_cameras()}")
    device = linux.Device(path, blocking=False)
    try:
        device.open()
        capabilities = device.info.device_capabilities
    except OSError as error:
        device.close()
        raise refusal(path, error) from error
    wanted = linux.Capability.VIDEO_CAPTURE | linux.Capability.STREAMING
    if capabilities & wanted != wanted:
        device.close()
        raise InputError(f"{path}: is not a capture device{_instead(path, capabilities)}")
    return device


def agree(device: linux.Device, path: Path, settings: CaptureSettings) -> CameraFormat:
    """Choose the pixel format, set size and rate. Raises `InputError` where the camera cannot do as asked, naming what it can,
    and `OSError` where the kernel refuses (see `refusal`)."""
    kind = linux.BufferType.VIDEO_CAPTURE
    width, height = settings.width_px, settings.height_px
    offers = read_offers(device, width, height)
    chosen = choose(
        path, offers, width_px=width, height_px=height, fps=settings.fps, asked=settings.pixel_format
    )  # fmt: skip
    device.set_format(kind, width, height, chosen)
    granted = linux.get_raw_format(device, kind).fmt.pix
    pixel_format = linux.human_pixel_format(int(granted.pixelformat))
    if (granted.width, granted.height, pixel_format) != (width, height, chosen):
        raise InputError(
            f"{path}: capture.width_px, capture.height_px: the camera gives {granted.width}x{granted.height} {pixel_format} "
            f"where {width}x{height} {chosen} is asked: set the capture size to one it has"
        )
    return CameraFormat(
        width=width,
        height=height,
        pixel_format=pixel_format,
        bytes_per_line=int(granted.bytesperline) or 2 * width,
        fps=set_rate(device, settings.fps),
    )


def refusal(path: Path, error: OSError) -> InputError:
    """What a kernel error at set-up means to the user."""
    if error.errno == errno.EBUSY:
        return InputError(f"{path}: {busy_words(path)}")
    if error.errno == errno.EACCES:
        return InputError(f"{path}: {permission_words(path)}")
    if error.errno == errno.EPERM:
        return InputError(
            f"{path}: this service may not use cameras: give its unit `DeviceAllow=char-video4linux rw`, or start it by hand"
        )
    if error.errno in (errno.ENOTTY, errno.ENODEV, errno.ENXIO):
        return InputError(f"{path}: is not a capture device: {known_cameras()}")
    return InputError(f"{path}: the camera refuses to start ({error.strerror}): unplug it and plug it in again")


def _instead(path: Path, capabilities: linux.Capability) -> str:
    """What the node is and which one to take in its place."""
    if linux.Capability.VIDEO_CAPTURE_MPLANE in capabilities:
        return " of one plane, as this machine's own cameras are: use libcamera:0"
    if linux.Capability.META_CAPTURE in capabilities:
        pictures = picture_node(path)
        return " but a camera's second node, for metadata: " + (
            f"use {pictures}" if pictures is not None else known_cameras()
        )
    return f": {known_cameras()}"
