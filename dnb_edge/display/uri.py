"""From a display's URI, as a config or the command line has it, to the display.

Knows the schemes; knows nothing of what a display does.
"""

from __future__ import annotations

from dnb_edge.display.base import Display
from dnb_edge.display.serial_port import SerialDisplay
from dnb_edge.display.terminal import TerminalDisplay
from dnb_edge.errors import InputError


def open_display(uri: str) -> Display:
    """The display at `uri`: `serial:/dev/ttyUSB0`, or `terminal:` on stderr.

    A serial port that is not there is no error: the display is offline until it comes. Raises `InputError` for anything
    else than these two schemes and for a port that is not an absolute path.
    """
    scheme, _, rest = uri.partition(":")
    if scheme == "serial" and rest.startswith("/") and rest.isprintable():
        return SerialDisplay(rest)
    if uri == "terminal:":
        return TerminalDisplay()
    raise InputError(f"display {uri!r}: use serial:/dev/ttyUSB0 (any serial port, by its full path) or terminal:")
