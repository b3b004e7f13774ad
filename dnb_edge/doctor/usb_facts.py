"""How a camera hangs on USB: how fast its line is, what else shares the hub and the bus.

Knows /sys; its root can be another one, for tests. The form is the kernel's Documentation/ABI/testing/sysfs-bus-usb.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

_ISOCHRONOUS_CLASSES = {"01": "sound", "0e": "camera"}
_BULK_CLASSES = {"08": "disk"}
_HUB_CLASS = "09"


@dataclass(frozen=True, slots=True, kw_only=True)
class UsbNeighbour:
    """Another device on the same bus."""

    product: str
    kinds: tuple[str, ...]
    """Of those that take much of a bus: `camera`, `sound`, `disk`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UsbLook:
    """A USB device and what is about it."""

    product: str
    speed_mbps: float
    """What the line was agreed at, Mbit/s: 1.5, 12, 480, 5000."""
    hubs: tuple[str, ...]
    """Hubs between it and the machine, the nearest first; those inside the machine are none."""
    neighbours: tuple[UsbNeighbour, ...]
    """Other devices on the same bus that take much of it."""


def usb_of(device_number: tuple[int, int], *, sys: Path) -> UsbLook | None:
    """The USB device behind the character device of that (major, minor) number; None where it is on no USB.

    Raises `OSError` where its speed cannot be read.
    """
    node = sys / "dev" / "char" / f"{device_number[0]}:{device_number[1]}" / "device"
    try:
        interface = node.resolve(strict=True)
    except FileNotFoundError:
        return None
    device = next((place for place in (interface, *interface.parents) if (place / "busnum").is_file()), None)
    if device is None:
        return None
    return UsbLook(
        product=_text(device / "product") or device.name,
        speed_mbps=float((device / "speed").read_text(encoding="ascii").strip()),
        hubs=_hubs(device),
        neighbours=_neighbours(device),
    )


def _hubs(device: Path) -> tuple[str, ...]:
    """The hubs above `device` that somebody has plugged in; names of root hubs are `usb1`."""
    found: list[str] = []
    for place in device.parents:
        if place.name.startswith("usb") or not (place / "busnum").is_file():
            # The only port of a root hub is no socket: a Raspberry Pi 4 has its four behind a hub of its own there.
            return tuple(found[:-1] if _text(place / "maxchild") == "1" else found)
        found.append(_text(place / "product") or place.name)
    return tuple(found)


def _neighbours(device: Path) -> tuple[UsbNeighbour, ...]:
    root = next((place for place in device.parents if place.name.startswith("usb")), None)
    if root is None:
        return ()
    found = []
    for number in sorted(root.rglob("busnum")):
        other = number.parent
        if other in (device, root) or _text(other / "bDeviceClass") == _HUB_CLASS:
            continue
        classes = {_text(place) for place in other.glob("*:*/bInterfaceClass")}
        known = _ISOCHRONOUS_CLASSES | _BULK_CLASSES
        kinds = tuple(sorted(word for code, word in known.items() if code in classes))
        if kinds:
            found.append(UsbNeighbour(product=_text(other / "product") or other.name, kinds=kinds))
    return tuple(found)


def _text(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return None
