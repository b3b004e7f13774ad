"""What a USB webcam says of itself: the descriptors and controls of USB Video Class 1.0, with MJPEG and YUYV over bulk.

Section numbers in comments are those of the class specification. Knows bytes; knows no picture and no connection.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

SIZES = ((640, 360), (1280, 720))
INTERVALS_100NS = (333_333, 666_666, 1_000_000, 2_000_000)
MJPEG, YUYV = 1, 2
"""Numbers of the two formats."""
PAYLOAD_BYTES = 16_384
"""Largest payload, its header included: what the driver asks for in one request."""

CAMERA, PROCESSING = 1, 2
"""Numbers of the units that have controls."""
_OUTPUT = 3
_CS_INTERFACE = 0x24
_YUY2_GUID = b"YUY2\x00\x00\x10\x00\x80\x00\x00\xaa\x00\x38\x9b\x71"
_SET_CUR, _GET_CUR, _GET_MIN, _GET_MAX, _GET_RES, _GET_LEN, _GET_INFO, _GET_DEF = 1, *range(0x81, 0x88)


@dataclass(frozen=True, slots=True)
class Control:
    """One control: its size in bytes and what its GET requests answer. `bit` is its place in the unit's bmControls."""

    bit: int
    size: int
    lowest: int
    highest: int
    step: int
    default: int


CONTROLS = {
    (CAMERA, 0x02): Control(1, 1, 1, 8, 0b1001, 8),  # auto exposure: manual or aperture priority, a bit each
    (CAMERA, 0x04): Control(3, 4, 1, 5000, 1, 156),  # exposure time, 100 us
    (CAMERA, 0x06): Control(5, 2, 0, 250, 5, 0),  # focus
    (CAMERA, 0x08): Control(17, 1, 0, 1, 1, 1),  # focus by itself
    (PROCESSING, 0x02): Control(0, 2, 0, 255, 1, 128),  # brightness
    (PROCESSING, 0x04): Control(9, 2, 0, 255, 1, 0),  # gain
    (PROCESSING, 0x05): Control(10, 1, 0, 2, 1, 2),  # power line frequency: off, 50, 60 Hz
    (PROCESSING, 0x0A): Control(6, 2, 2000, 6500, 1, 4000),  # white balance, K
    (PROCESSING, 0x0B): Control(12, 1, 0, 1, 1, 1),  # white balance by itself
}
"""(unit, selector) to control: appendix A.9."""


class ControlValues:
    """What the controls are set to."""

    def __init__(self) -> None:
        self._values = {where: control.default for where, control in CONTROLS.items()}

    def answer(self, request: int, where: tuple[int, int], data: bytes) -> bytes | None:
        """Section 4.2: a SET or GET of one control; None to stall."""
        control = CONTROLS.get(where)
        if control is None:
            return None
        if request == _SET_CUR:
            self._values[where] = int.from_bytes(data, "little")
            return b""
        if request == _GET_INFO:
            return b"\x03"
        if request == _GET_LEN:
            return control.size.to_bytes(2, "little")
        numbers = {
            _GET_CUR: self._values[where],
            _GET_MIN: control.lowest,
            _GET_MAX: control.highest,
            _GET_RES: control.step,
            _GET_DEF: control.default,
        }
        return numbers[request].to_bytes(control.size, "little") if request in numbers else None


@dataclass(frozen=True, slots=True)
class Stream:
    """What was agreed by probe and commit (section 4.3.1.1): one format, one size, one rate."""

    format: int = MJPEG
    frame: int = 1
    interval_100ns: int = INTERVALS_100NS[0]

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height)."""
        return SIZES[self.frame - 1]

    @property
    def interval_s(self) -> float:
        """Time from frame to frame."""
        return self.interval_100ns * 1e-7

    @classmethod
    def asked(cls, data: bytes) -> Stream:
        """The nearest to what the host asks that there is."""
        _hint, kind, frame, interval = struct.unpack_from("<HBBI", data)
        nearest = min(INTERVALS_100NS, key=lambda known: abs(known - interval))
        return cls(min(max(kind, MJPEG), YUYV), min(max(frame, 1), len(SIZES)), nearest)

    def granted(self) -> bytes:
        """The 26 bytes that describe it."""
        width, height = self.size_px
        return struct.pack(
            "<HBBIHHHHHII",
            1,
            self.format,
            self.frame,
            self.interval_100ns,
            0,
            0,
            0,
            0,
            0,
            2 * width * height,
            PAYLOAD_BYTES,
        )


def device(vendor: int, product: int) -> bytes:
    """The device descriptor; strings 1, 2 and 3 are maker, product and serial number."""
    return struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x0200, 0xEF, 2, 1, 64, vendor, product, 0x0100, 1, 2, 3, 1)


def configuration() -> bytes:
    """The one configuration: two interfaces, for control and for streaming, with all that belongs to them."""
    association = bytes((8, 11, 0, 2, 0x0E, 3, 0, 2))
    endpoint = struct.pack("<BBBBHB", 7, 5, 0x81, 2, 512, 0)
    body = association + _control_interface() + _streaming_interface() + endpoint
    return struct.pack("<BBHBBBBB", 9, 2, 9 + len(body), 2, 1, 0, 0x80, 250) + body


def string(text: str) -> bytes:
    """A string descriptor."""
    data = text.encode("utf-16-le")
    return bytes((2 + len(data), 3)) + data


LANGUAGES = bytes((4, 3, 9, 4))
"""String descriptor 0: American English."""


def _control_interface() -> bytes:
    camera = struct.pack("<BBBBHBBHHHB", 18, _CS_INTERFACE, 2, CAMERA, 0x0201, 0, 0, 0, 0, 0, 3) + _bits(CAMERA, 3)
    processing = struct.pack("<BBBBBHB", 11, _CS_INTERFACE, 5, PROCESSING, CAMERA, 0, 2) + _bits(PROCESSING, 2) + b"\0"
    output = struct.pack("<BBBBHBBB", 9, _CS_INTERFACE, 3, _OUTPUT, 0x0101, 0, PROCESSING, 0)
    units = camera + processing + output
    header = struct.pack("<BBBHHIBB", 13, _CS_INTERFACE, 1, 0x0100, 13 + len(units), 48_000_000, 1, 1)
    return bytes((9, 4, 0, 0, 0, 0x0E, 1, 0, 2)) + header + units


def _bits(unit: int, size: int) -> bytes:
    return sum(1 << control.bit for (of, _), control in CONTROLS.items() if of == unit).to_bytes(size, "little")


def _streaming_interface() -> bytes:
    colours = bytes((6, _CS_INTERFACE, 0x0D, 1, 1, 4))
    mjpeg = bytes((11, _CS_INTERFACE, 6, MJPEG, len(SIZES), 1, 1, 0, 0, 0, 0)) + _frames(7) + colours
    yuyv = (
        bytes((27, _CS_INTERFACE, 4, YUYV, len(SIZES))) + _YUY2_GUID + bytes((16, 1, 0, 0, 0, 0)) + _frames(5) + colours
    )
    formats = mjpeg + yuyv
    header = struct.pack("<BBBBHBBBBBBBB", 15, _CS_INTERFACE, 1, 2, 15 + len(formats), 0x81, 0, _OUTPUT, 0, 0, 0, 1, 0)
    return bytes((9, 4, 1, 0, 1, 0x0E, 2, 0, 0)) + header + b"\0" + formats


def _frames(subtype: int) -> bytes:
    count = len(INTERVALS_100NS)
    descriptors = b""
    for index, (width, height) in enumerate(SIZES, start=1):
        bits = 16 * width * height
        slowest, fastest = (round(bits * 1e7 / INTERVALS_100NS[at]) for at in (-1, 0))
        descriptors += struct.pack(
            f"<BBBBBHHIIIIB{count}I",
            26 + 4 * count, _CS_INTERFACE, subtype, index, 0, width, height, slowest, fastest, 2 * width * height,
            INTERVALS_100NS[0], count, *INTERVALS_100NS,
        )  # fmt: skip
    return descriptors
