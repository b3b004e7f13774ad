"""From a display's URI, as a config or the command line has it, to the display.

Knows the schemes; knows nothing of what a display does.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from dnb_edge.display.base import Display
from dnb_edge.display.luma_device import parse_spi
from dnb_edge.display.luma_display import open_luma
from dnb_edge.display.serial_port import SerialDisplay
from dnb_edge.display.terminal import TerminalDisplay
from dnb_edge.errors import InputError


def open_display(uri: str) -> Display:
    """The display at `uri`: `serial:/dev/ttyUSB0`, `spi:/dev/spidev0.0` for a panel on the box's own pins, `terminal:`, stderr.

    A port that is not there is no error: the display is offline until it comes. Raises `InputError` as `check_uri` does, and
    where a display on SPI lacks luma.
    """
    return _opener(uri)()


def check_uri(uri: str) -> None:
    """Raises `InputError` for anything else than the schemes that there are and for a port that is not an absolute path.

    Looks for no device.
    """
    _opener(uri)


def _opener(uri: str) -> Callable[[], Display]:
    """What opens the display at `uri`."""
    scheme, _, rest = uri.partition(":")
    if scheme == "serial" and rest.startswith("/") and rest.isprintable():
        return partial(SerialDisplay, rest)
    if scheme == "spi":
        return partial(open_luma, parse_spi(rest))
    if uri == "terminal:":
        return TerminalDisplay
    raise InputError(
        f"display {uri!r}: use serial:/dev/ttyUSB0 (any serial port, by its full path), spi:/dev/spidev0.0 or terminal:"
    )
