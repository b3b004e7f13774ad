"""Setting a libcamera camera up: finding it, choosing a format, and saying plainly what is wrong.

Knows libcamera's Python bindings, which come with the operating system (Debian: `python3-libcamera`) and not from PyPI, so
that they are imported only here and only when a `libcamera:` source is opened. Knows no frame.
"""

from __future__ import annotations

import errno
import importlib
import os
import time
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from dnb_edge.capture.libcamera_pictures import PICTURE_FORMATS
from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.v4l2_nodes import DEV, busy_words
from dnb_edge.errors import InputError, WorkError

CHAR_DEVICES = Path("/sys/dev/char")
NEWS_S = 2.0
"""How long news of a plug may take; it takes milliseconds."""
_OWN_NAMES = {"MJPG": "MJPEG", "YUYV": "YUYV"}


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamFormat:
    """The format that the camera granted."""

    width: int
    height: int
    name: str
    """libcamera's name of the pixel format, such as `MJPEG` or `RGB888`."""
    four_cc: str
    stride: int
    """Bytes from one row of the first plane to the next; 0 for JPEG."""


def bindings(uri: str) -> ModuleType:
    """libcamera's bindings. Raises `InputError` that says how to get them."""
    try:
        return importlib.import_module("libcamera")
    except ImportError as error:
        raise InputError(
            f"{uri}: libcamera's Python bindings are not there ({error}): `sudo apt install python3-libcamera`, and let the "
            "virtual environment see it: `make VENV_FLAGS=--system-site-packages` (a new one: `make clean` first)"
        ) from error


def start_manager(uri: str, libcamera: ModuleType) -> Any:
    """The process's one camera manager. Raises `InputError` where it cannot run."""
    try:
        return libcamera.CameraManager.singleton()
    except RuntimeError as error:
        raise InputError(f"{uri}: libcamera does not start ({error})") from error


def is_listed(camera: Any, manager: Any) -> bool:
    """False once libcamera knows that the camera is gone; one that was plugged in again is another, even by the same name."""
    return any(known is camera for known in manager.cameras)


def is_plugged_in(camera: Any) -> bool:
    """False once the kernel has dropped the camera's devices, of which libcamera hears a moment later, or never."""
    devices = _devices(camera)
    return not devices or any(device.exists() for device in devices)


def _devices(camera: Any) -> list[Path]:
    """The camera's device nodes, as the kernel lists them while they are there."""
    numbers = next((value for key, value in camera.properties.items() if key.name == "SystemDevices"), ())
    return [CHAR_DEVICES / f"{os.major(number)}:{os.minor(number)}" for number in numbers]


def is_settled(manager: Any) -> bool:
    """Waits a moment for libcamera to hear of what was unplugged. False where it does not: it is in the dark for good.

    It hears from udev, by a netlink socket in the machine's own network namespace.
    """
    until_s = time.monotonic() + NEWS_S
    while not all(is_plugged_in(camera) for camera in manager.cameras):
        if time.monotonic() > until_s:
            return False
        time.sleep(0.02)
    return True


def find_camera(uri: str, manager: Any) -> Any:
    """The camera that `libcamera:0` (by number) or `libcamera:ID` names. Raises `InputError` naming those that there are, and
    `WorkError` where libcamera has not heard that one was unplugged: then it will not hear of one plugged in, either.
    """
    if not is_settled(manager):
        raise WorkError(
            f"{uri}: libcamera has not heard that a camera was unplugged, and only a new process finds it again "
            "(as a service: PrivateNetwork=no and RestrictAddressFamilies=AF_NETLINK let it hear)"
        )
    wanted = uri.removeprefix("libcamera:")
    cameras = list(manager.cameras)
    for number, camera in enumerate(cameras):
        if wanted in (camera.id, str(number)):
            return camera
    if not cameras:
        raise InputError(
            f"{uri}: libcamera finds no camera: plug one in, and see that this user may open it "
            "(`sudo usermod -aG video $USER`, log in anew)"
        )
    known = ", ".join(f"{number} ({camera.id})" for number, camera in enumerate(cameras))
    raise InputError(f"{uri}: there is no such camera: libcamera finds {known}")


def configure(uri: str, libcamera: ModuleType, camera: Any, settings: CaptureSettings) -> tuple[StreamFormat, Any]:
    """Set size, pixel format and the number of buffers; what was granted, and the bindings' stream.

    Raises `InputError` where the camera cannot do as asked, `RuntimeError` where libcamera refuses (see `refusal`).
    """
    configuration = camera.generate_configuration([libcamera.StreamRole.VideoRecording])
    if configuration is None or configuration.empty:
        raise InputError(f"{uri}: the camera gives no video")
    stream = configuration.at(0)
    offered = [str(pixel_format) for pixel_format in stream.formats.pixel_formats]
    chosen = choose_pixel_format(uri, offered, settings.pixel_format)
    stream.pixel_format = libcamera.PixelFormat(chosen)
    stream.size = libcamera.Size(settings.width_px, settings.height_px)
    stream.buffer_count = settings.buffers
    status = configuration.validate()
    granted = stream.size.width, stream.size.height, str(stream.pixel_format)
    if status == libcamera.CameraConfiguration.Status.Invalid or granted != (
        settings.width_px,
        settings.height_px,
        chosen,
    ):
        sizes = ", ".join(str(size) for size in stream.formats.sizes(libcamera.PixelFormat(chosen)))
        raise InputError(
            f"{uri}: the camera gives {granted[0]}x{granted[1]} {granted[2]} where {settings.width_px}x{settings.height_px} "
            f"{chosen} is asked: set the capture size to one it has ({sizes})"
        )
    camera.configure(configuration)
    return StreamFormat(
        width=granted[0],
        height=granted[1],
        name=chosen,
        four_cc=int(stream.pixel_format.fourcc).to_bytes(4, "little").decode("ascii", "replace").strip(),
        stride=int(stream.stride),
    ), stream.stream


def choose_pixel_format(uri: str, offered: list[str], asked: str | None) -> str:
    """libcamera's name of the format to use: the one `asked` for (by its V4L2 name), else the best that we can read."""
    if asked is not None:
        if _OWN_NAMES.get(asked) in offered:
            return _OWN_NAMES[asked]
        raise InputError(f"{uri}: the camera offers {', '.join(offered) or 'no format'}, and {asked} is asked")
    for candidate in PICTURE_FORMATS:
        if candidate in offered:
            return candidate
    raise InputError(
        f"{uri}: the camera offers {', '.join(offered) or 'no format'}, and one of {', '.join(PICTURE_FORMATS)} is needed"
    )


def refusal(uri: str, error: RuntimeError, camera: Any) -> InputError:
    """What libcamera's error at set-up means to the user. The bindings give the kernel's number as its text only."""
    if os.strerror(errno.EBUSY) in str(error):
        nodes = [DEV / device.resolve().name for device in _devices(camera) if device.exists()]
        return InputError(
            f"{uri}: {busy_words(nodes[0]) if nodes else 'another program is using the camera: close it'}"
        )
    if os.strerror(errno.EACCES) in str(error) or os.strerror(errno.EPERM) in str(error):
        return InputError(
            f"{uri}: no permission: add the user to group video (`sudo usermod -aG video $USER`, log in anew)"
        )
    return InputError(f"{uri}: the camera refuses to start ({error}): unplug it and plug it in again")
