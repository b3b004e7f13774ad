"""MAX7219 panels on the box's own SPI, by luma.led_matrix: what opens one and lights a surface on it.

Knows spidev's requests (Linux, include/uapi/linux/spi/spidev.h) and luma's devices. Knows no race. luma is not needed by
anything else and imported only here, when a panel is opened.
"""

from __future__ import annotations

import fcntl
import os
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol
from urllib.parse import parse_qsl

from dnb_edge.display.panel.board import max7219
from dnb_edge.display.panel.board import settings as board_settings
from dnb_edge.display.panel.pixels import Canvas
from dnb_edge.display.panel.segments import Digits
from dnb_edge.errors import InputError

PANELS = ("max7219-32x8", "max7219-8-digits")
CLOCK_HZ = 1_000_000
"""The chip takes ten times as much; long wires do not."""

_SET_MODE = 0x40016B01
_SET_BITS = 0x40016B03
_SET_CLOCK = 0x40046B04

_OPTIONS = "panel, brightness, turn, reverse and upside_down"

_LUMA_ORIENTATION = {0: 90, 90: 180, 180: -90, 270: 0}
"""luma's `block_orientation` for a module's turn, together with the opposite of `reverse`."""


class Wire(Protocol):
    """What luma's devices are told by, and what it takes to close it."""

    def data(self, data: Sequence[int]) -> None:
        """One message of bytes, after which the chips take over what they got."""
        ...

    def command(self, *command: int) -> None:
        """The same: these chips know no difference."""
        ...

    def cleanup(self) -> None:
        """Let go of the device."""
        ...


class SpiWire:
    """The SPI at `path`, such as /dev/spidev0.0: mode 0, 8 bits. Raises `OSError` where it is not there or not ours."""

    def __init__(self, path: str) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        try:
            fcntl.ioctl(self._file, _SET_MODE, struct.pack("B", 0))
            fcntl.ioctl(self._file, _SET_BITS, struct.pack("B", 8))
            fcntl.ioctl(self._file, _SET_CLOCK, struct.pack("I", CLOCK_HZ))
        except OSError:
            self.cleanup()
            raise

    def data(self, data: Sequence[int]) -> None:
        """Select the chips, send, let go: one write is one message."""
        os.write(self._file, bytes(data))

    def command(self, *command: int) -> None:
        """As `data`."""
        self.data(command)

    def cleanup(self) -> None:
        """Close the device."""
        os.close(self._file)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpiPanel:
    """Which panel is where, as a URI says it."""

    path: str
    panel: str = PANELS[0]
    brightness: int = 3
    turn: int = 0
    reverse: bool = False
    upside_down: bool = False

    @property
    def layout(self) -> str:
        """The layout of what it shows."""
        return board_settings.PANELS[self.panel]


def parse_spi(rest: str) -> SpiPanel:
    """The panel of a URI `spi:REST`, such as /dev/spidev0.0?panel=max7219-8-digits&brightness=5.

    Raises `InputError` for a path that is not absolute and for options that there are not. Looks for no device.
    """
    path, _, query = rest.partition("?")
    if not (path.startswith("/") and path.isprintable()):
        raise InputError(f"display 'spi:{rest}': use spi:/dev/spidev0.0, the full path of an SPI of this machine")
    options: dict[str, Any] = {}
    for key, text in parse_qsl(query, keep_blank_values=True):
        if key not in SpiPanel.__dataclass_fields__ or key == "path":
            raise InputError(f"display 'spi:{rest}': there is no option {key}; there are {_OPTIONS}")
        options[key] = _value(text)
    complaint = board_settings.judge(options)
    if not complaint and options.get("panel", PANELS[0]) not in PANELS:
        complaint = f"panel: one of {' '.join(PANELS)}"
    if complaint:
        raise InputError(f"display 'spi:{rest}': {complaint}")
    return SpiPanel(path=path, **options)


def _value(text: str) -> str | int | bool:
    if text in {"true", "false"}:
        return text == "true"
    return int(text) if text.isdecimal() and text.isascii() else text


class LumaPanel:
    """An open panel. Everything raises `OSError` where the SPI fails; `InputError` where luma is not installed."""

    def __init__(self, wanted: SpiPanel, wire: Callable[[str], Wire] = SpiWire) -> None:
        make, self._image = need_luma()
        self._digits = wanted.layout == "digits-8"
        self._brightness = wanted.brightness
        turn = (wanted.turn + 180 * wanted.upside_down) % 360
        reverse = wanted.reverse != wanted.upside_down
        self._reverse = wanted.reverse
        self._wire = wire(wanted.path)
        try:
            if self._digits:
                self._device = make(self._wire, cascaded=1)
            else:
                self._device = make(
                    self._wire,
                    width=32,
                    height=8,
                    block_orientation=_LUMA_ORIENTATION[turn],
                    blocks_arranged_in_reverse_order=not reverse,
                )
        except OSError:
            self._wire.cleanup()
            raise

    def show(self, surface: Canvas | Digits) -> None:
        """Light `surface`, with all settings of the chips: a spike on the wires may have changed them."""
        count = self._device.cascaded
        for register, value in (
            (max7219.DISPLAY_TEST, 0),
            (max7219.NO_DECODE, 0),
            (max7219.SCAN_LIMIT, 7),
            (max7219.INTENSITY, self._brightness),
            (max7219.SHUTDOWN, 1),
        ):
            self._device.data([register, value] * count)
        lit = self._digit_pixels(surface.buffer) if self._digits else bytes(255 * bool(one) for one in surface.buffer)
        size = (8, 8) if self._digits else (32, 8)
        self._device.display(self._image.frombytes("L", size, lit).convert("1"))

    def _digit_pixels(self, digits: bytearray) -> bytes:
        """As luma sees digits: each register is a column, its lowest bit on top; the first register is the rightmost digit."""
        pixels = bytearray(64)
        for place, segments in enumerate(digits):
            column = place if self._reverse else 7 - place
            bits = max7219.segment_bits(segments)
            for bit in range(8):
                pixels[8 * bit + column] = 255 * (bits >> bit & 1)
        return bytes(pixels)

    def close(self) -> None:
        """Let go of the SPI; the panel stays as it is."""
        self._wire.cleanup()


def need_luma() -> tuple[Any, Any]:
    """luma's MAX7219 and Pillow's `Image`. Raises `InputError` where they are not installed."""
    try:
        return import_module("luma.led_matrix.device").max7219, import_module("PIL.Image")
    except ImportError as error:
        raise InputError(
            f"a display on SPI needs luma.led_matrix ({error}): sudo ./install.sh --extra luma, or pip install 'dnb-edge[luma]'"
        ) from error
