"""When a camera's line and bus are fit for its pictures: facts to verdicts, nothing else.

Knows the limits and what to type. Opens nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

from dnb_edge.doctor.usb_facts import UsbLook
from dnb_edge.doctor.verdict import Verdict, fail, ok, skip, warn

HIGH_SPEED_MBPS = 480.0
USABLE_MBPS = 190.0
"""What a USB 2 camera can be given: three packets of 1024 bytes in each 125 microseconds, less what goes round them."""
BUS_WARN = 0.8


def judge_usb_speed(usb: UsbLook | None) -> Verdict:
    """Whether the camera's line is as fast as it can be."""
    if usb is None:
        return skip("the camera is not on USB")
    found = f"{usb.product} at {usb.speed_mbps:g} Mbit/s"
    if usb.speed_mbps >= HIGH_SPEED_MBPS:
        return ok(found)
    return fail(
        f"{found}: too slow for pictures",
        "Plug it into another port with another cable, without a hub, then look at `lsusb -t`.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Bus:
    """What a camera sends, and who shares its bus."""

    usb: UsbLook | None
    needed_mbps: float | None
    """Mean of what its frames take, Mbit/s."""


def judge_bus(bus: Bus) -> Verdict:
    """Whether the bus has room for the pictures."""
    usb = bus.usb
    if usb is None:
        return skip("the camera is not on USB")
    room_mbps = USABLE_MBPS * usb.speed_mbps / HIGH_SPEED_MBPS
    needed = "" if bus.needed_mbps is None else f"{bus.needed_mbps:.0f} of about {room_mbps:.0f} Mbit/s"
    if bus.needed_mbps is not None and bus.needed_mbps > BUS_WARN * room_mbps:
        return fail(
            f"the pictures take {needed}",
            "Set `capture.pixel_format: MJPG`, or a smaller capture.width_px and height_px.",
        )
    rivals = [other for other in usb.neighbours if "camera" in other.kinds or "disk" in other.kinds]
    if rivals:
        names = ", ".join(f"{other.product} ({', '.join(other.kinds)})" for other in rivals)
        return warn(
            f"shares its bus with {names}",
            "Plug a USB 3 disk into a blue port, where it has a bus of its own, and other cameras into another bus (all of a "
            "Pi 4's sockets are one for them); `lsusb -t` shows which is where.",
        )
    if usb.hubs:
        return warn(
            f"behind a hub ({', '.join(usb.hubs)})",
            "Plug the camera into the machine itself; `lsusb -t` shows where it is.",
        )
    return ok(f"alone on its bus{', takes ' + needed if needed else ''}")
