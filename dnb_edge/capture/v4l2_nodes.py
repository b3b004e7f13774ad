"""Cameras as files: what udev and the kernel call them, who is using one, and whom its node belongs to.

Knows /dev, /sys and /proc. Knows no format and no frame; asks a device nothing but its name.
"""

from __future__ import annotations

import grp
import os
import pwd
import stat
from pathlib import Path

from linuxpy.video import device as linux

DEV = Path("/dev")
PROC = Path("/proc")
SYS = Path("/sys")
_INDEX = "-video-index"
_OWN = " (this program itself)"


def camera_id(path: Path, device: linux.Device, *, dev: Path = DEV, sys: Path = SYS) -> str:
    """What tells the open camera at `path` from any other and stays the same over unplugging and restarts.

    Its name in /dev/v4l/by-id where the camera has a serial number, which goes with it to any socket. Without one that name
    is that of every camera of its make: then card and bus, which names the socket.
    """
    if _has_serial(path, sys):
        for link in _links(dev, "by-id"):
            if link.resolve() == path.resolve():
                return link.name
    return f"{device.info.card} ({device.info.bus_info})"


def node_of(identity: str, *, dev: Path = DEV, sys: Path = SYS) -> Path | None:
    """Where the camera that `camera_id` calls `identity` is now; None where it is not plugged in."""
    link = dev / "v4l" / "by-id" / identity
    if "/" not in identity and link.exists():
        return link
    for path in sorted(dev.glob("video*"), key=lambda node: (len(node.name), node.name)):
        device = linux.Device(path, blocking=False)
        try:
            device.open()
            captures = linux.Capability.VIDEO_CAPTURE in device.info.device_capabilities
            if captures and camera_id(path, device, dev=dev, sys=sys) == identity:
                return path
        except OSError:
            continue  # not ours to open, or gone meanwhile: not the one that is sought
        finally:
            device.close()
    return None


def first_camera(*, dev: Path = DEV, usb: bool) -> Path | None:
    """A camera of this machine for somebody who has named none, always the same while they stay plugged in; None where there is
    none. `usb`: one on USB, no other kind of device that gives pictures."""
    named = [link for link in _links(dev, "by-id") if link.name.endswith(f"{_INDEX}0") and link.exists()]
    nodes = sorted(dev.glob("video*"), key=lambda node: (len(node.name), node.name))
    for path in (*named, *nodes):
        device = linux.Device(path, blocking=False)
        try:
            device.open()
            captures = linux.Capability.VIDEO_CAPTURE in device.info.device_capabilities
            if captures and (not usb or device.info.driver == "uvcvideo"):
                return path
        except OSError:
            continue  # not ours to open, or gone meanwhile
        finally:
            device.close()
    return None


def known_cameras(dev: Path = DEV) -> str:
    """The cameras of this machine in words: their lasting names where udev gives any, else their nodes."""
    links = [link for link in _links(dev, "by-id") if link.exists()]
    linked = {link.resolve() for link in links}
    names = [f"{link} ({link.resolve().name})" for link in links if link.name.endswith(f"{_INDEX}0")]
    names += [str(node) for node in sorted(dev.glob("video*")) if node.resolve() not in linked]
    return f"this machine has {', '.join(names)}" if names else "no camera is connected to this machine"


def picture_node(path: Path, *, dev: Path = DEV) -> Path | None:
    """The node of the same camera that gives pictures, where udev says so of the metadata node `path`."""
    for folder in ("by-id", "by-path"):
        for link in _links(dev, folder):
            head, mark, number = link.name.rpartition(_INDEX)
            if link.resolve() == path.resolve() and mark and number != "0":
                sibling = link.with_name(f"{head}{mark}0")
                return sibling if sibling.exists() else None
    return None


def users_of(path: Path, *, proc: Path = PROC) -> tuple[list[str], bool]:
    """Which processes hold the device open, such as `obs (process 1234)`, and whether some could not be looked into."""
    target = str(path.resolve())
    found, hidden = [], False
    for process in sorted(proc.glob("[0-9]*"), key=lambda one: int(one.name)):
        try:
            held = any(_leads_to(link, target) for link in (process / "fd").iterdir())
            if held:
                name = (process / "comm").read_text(encoding="utf-8", errors="replace").strip()
                own = _OWN if process.name == str(os.getpid()) else ""
                found.append(f"{name}, process {process.name}{own}")
        except PermissionError:
            hidden = True
        except (FileNotFoundError, ProcessLookupError):
            continue  # it has ended meanwhile
    return found, hidden


def busy_words(path: Path, *, proc: Path = PROC) -> str:
    """Why the camera is busy and what to do about it."""
    users, hidden = users_of(path, proc=proc)
    others = [user for user in users if not user.endswith(_OWN)]
    if others:
        return f"another program is using the camera ({'; '.join(others)}): close it"
    if len(users) > 0 and not hidden:
        return "this program itself is using the camera already: name each camera once"
    where = "of another user" if hidden else "that cannot be seen from here"
    return f"another program is using the camera, one {where}: close it (`sudo fuser -v {path}` names it)"


def permission_words(path: Path) -> str:
    """Whose the node is and how to get at it."""
    try:
        node = path.stat()
    except OSError:
        return "no permission: its folder cannot be looked into"
    both = stat.S_IRGRP | stat.S_IWGRP
    if node.st_mode & both != both:
        return f"no permission: only its owner, {_user(node.st_uid)}, may use it (mode {stat.S_IMODE(node.st_mode):o})"
    group = _group(node.st_gid)
    return f"no permission: it belongs to group {group}: add the user (`sudo usermod -aG {group} $USER`, log in anew)"


def _links(dev: Path, folder: str) -> list[Path]:
    return sorted((dev / "v4l" / folder).glob("*"))


def _has_serial(path: Path, sys: Path) -> bool:
    """Whether the USB device behind the node has a serial number of its own."""
    try:
        number = path.stat().st_rdev
        interface = (sys / "dev" / "char" / f"{os.major(number)}:{os.minor(number)}" / "device").resolve(strict=True)
        return bool((interface.parent / "serial").read_text(encoding="utf-8", errors="replace").strip())
    except OSError:
        return False


def _leads_to(link: Path, target: str) -> bool:
    try:
        # The text of the link alone: following it could block on a dead network drive.
        return os.readlink(link) == target  # noqa: PTH115
    except FileNotFoundError:
        return False


def _group(number: int) -> str:
    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return str(number)


def _user(number: int) -> str:
    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return str(number)
