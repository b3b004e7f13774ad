"""Setting a V4L2 camera up: opening, checking what it can do, choosing a format, and saying plainly what is wrong.

Knows linuxpy's device and the kernel's error numbers. Knows no frame.
"""

from __future__ import annotations

import errno
from dataclasses import dataclass
from pathlib import Path

from linuxpy.video import device as linux

from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.errors import InputError

_JPEG_FORMATS = ("MJPG", "JPEG")
_PREFERRED = ("MJPG", "JPEG", "YUYV")
_DEV = Path("/dev")


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFormat:
    """The format that the driver granted."""

    width: int
    height: int
    pixel_format: str
    """FourCC, such as `MJPG`."""
    bytes_per_line: int
    fps: float | None
    """The rate that the driver claims; None where it does not say."""

    @property
    def is_jpeg(self) -> bool:
        """True where each buffer holds one JPEG picture."""
        return self.pixel_format in _JPEG_FORMATS


def open_device(path: Path) -> linux.Device:
    """The capture device at `path`, open and non-blocking. Raises `InputError` where there is none to use."""
    if not path.exists():
        raise InputError(f"{path}: there is no such camera: {_known_cameras(_DEV)}")
    if not path.is_char_device():
        raise InputError(f"{path}: is not a capture device: {_known_cameras(_DEV)}")
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
        raise InputError(
            f"{path}: is not a capture device (many cameras have a second node for metadata): {_known_cameras(_DEV)}"
        )
    return device


def configure(device: linux.Device, path: Path, settings: CaptureSettings) -> CameraFormat:
    """Choose the pixel format, set size, rate and controls. Raises `InputError` where the camera cannot do as asked, and
    `OSError` where the kernel refuses (see `refusal`)."""
    kind = linux.BufferType.VIDEO_CAPTURE
    offered = [fmt.pixel_format.human_str() for fmt in device.info.buffer_formats(kind)]
    chosen = choose_pixel_format(path, offered, settings.pixel_format)
    device.set_format(kind, settings.width_px, settings.height_px, chosen)
    granted = device.get_format(kind)
    pixel_format = granted.pixel_format.human_str()
    if (granted.width, granted.height, pixel_format) != (settings.width_px, settings.height_px, chosen):
        raise InputError(
            f"{path}: the camera gives {granted.width}x{granted.height} {pixel_format} where "
            f"{settings.width_px}x{settings.height_px} {chosen} is asked: set the capture size to one it has"
        )
    _set_controls(device, path, settings.controls)
    return CameraFormat(
        width=granted.width,
        height=granted.height,
        pixel_format=pixel_format,
        bytes_per_line=granted.bytes_per_line,
        fps=_set_rate(device, settings.fps),
    )


def choose_pixel_format(path: Path, offered: list[str], asked: str | None) -> str:
    """The FourCC to use of those `offered`: the one `asked` for, else MJPEG, else YUYV. Raises `InputError` for none."""
    if asked is not None and asked not in _PREFERRED:
        raise InputError(f"{path}: pixel format {asked!r} cannot be decoded here: use one of {', '.join(_PREFERRED)}")
    for candidate in _PREFERRED if asked is None else (asked,):
        if candidate in offered:
            return candidate
    wanted = " or ".join(_PREFERRED) if asked is None else asked
    raise InputError(f"{path}: the camera offers {', '.join(offered) or 'no format'}, and {wanted} is needed")


def refusal(path: Path, error: OSError) -> InputError:
    """What a kernel error at set-up means to the user."""
    if error.errno == errno.EBUSY:
        return InputError(f"{path}: another program is using the camera: close it (`fuser -v {path}` names it)")
    if error.errno in (errno.EACCES, errno.EPERM):
        return InputError(
            f"{path}: no permission: add the user to group video (`sudo usermod -aG video $USER`, log in anew)"
        )
    if error.errno in (errno.ENOTTY, errno.ENODEV, errno.ENXIO):
        return InputError(f"{path}: is not a capture device: {_known_cameras(_DEV)}")
    return InputError(f"{path}: the camera refuses to start ({error.strerror}): unplug it and plug it in again")


def camera_id(path: Path, device: linux.Device) -> str:
    """A name that stays the same wherever the camera is plugged in: its udev name, else the driver's card and bus."""
    for folder in ("by-id", "by-path"):
        for link in sorted((_DEV / "v4l" / folder).glob("*")):
            if link.resolve() == path.resolve():
                return link.name
    return f"{device.info.card} ({device.info.bus_info})"


def _known_cameras(dev: Path) -> str:
    names = sorted(str(name) for name in dev.glob("video*"))
    return f"this machine has {', '.join(names)}" if names else "no camera is connected to this machine"


def _set_rate(device: linux.Device, fps: float) -> float | None:
    """Ask for `fps` frames a second; the rate that the driver then claims, None for drivers that know no rate."""
    kind = linux.BufferType.VIDEO_CAPTURE
    try:
        device.set_fps(kind, fps)
        return float(device.get_fps(kind))
    except ZeroDivisionError:
        return None
    except OSError as error:
        if error.errno in (errno.ENOTTY, errno.EINVAL):
            return None
        raise


def _set_controls(device: linux.Device, path: Path, controls: dict[str, int]) -> None:
    for name, value in controls.items():
        try:
            control = device.controls[name]
            # Out of range is an error: linuxpy would quietly take the nearest value that the camera has.
            control.clipping = False
            control.value = value
        except KeyError as error:
            known = sorted(c.config_name for c in device.controls.values())
            raise InputError(f"{path}: the camera has no control {name!r}: it has {', '.join(known)}") from error
        except (AttributeError, ValueError, OSError) as error:
            raise InputError(f"{path}: control {name!r} cannot be set to {value} ({error})") from error
