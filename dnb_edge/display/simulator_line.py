"""The simulated display's end of the line: a pseudo-terminal of its own, a serial port, or standard input.

Knows how each is opened, waited for and how it ends. Knows no line of the protocol.
"""

from __future__ import annotations

import errno
import os
import select
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from dnb_edge.errors import InputError

READ_BYTES = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """Something to read bytes from."""

    descriptor: int
    name: str
    """What the appliance, or a person, calls it."""

    def read(self, wait_s: float) -> bytes | None:
        """What has come, after `wait_s` at most; nothing where nothing has; None where the line has ended."""
        ready, _, _ = select.select([self.descriptor], [], [], max(0.0, wait_s))
        if not ready:
            return b""
        try:
            return os.read(self.descriptor, READ_BYTES) or None
        except OSError as error:
            if error.errno == errno.EIO:
                # The other end of a pseudo-terminal, or a USB adapter, has gone.
                return None
            raise


@contextmanager
def own_line(link: Path | None) -> Iterator[Line]:
    """A new pseudo-terminal, under the name `link`, too, where it is given: an older link is replaced, anything else is not.

    Raises `InputError` where the link cannot be made.
    """
    master, slave = os.openpty()
    tty.setraw(slave)
    # This end keeps the slave open, so that the line outlives any appliance that speaks on it.
    name = os.ttyname(slave)
    try:
        if link is not None:
            _link(link, name)
        yield Line(descriptor=master, name=name if link is None else str(link))
    finally:
        if link is not None and link.is_symlink() and str(link.readlink()) == name:
            link.unlink()
        os.close(slave)
        os.close(master)


@contextmanager
def port_line(path: Path) -> Iterator[Line]:
    """A serial port at 115200 baud, or anything else that can be read, such as a file of lines. Raises `InputError`."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        if os.isatty(descriptor):
            tty.setraw(descriptor)
            settings = termios.tcgetattr(descriptor)
            settings[4] = settings[5] = termios.B115200
            termios.tcsetattr(descriptor, termios.TCSANOW, settings)
        yield Line(descriptor=descriptor, name=str(path))
    finally:
        os.close(descriptor)


@contextmanager
def input_line() -> Iterator[Line]:
    """Standard input."""
    yield Line(descriptor=sys.stdin.fileno(), name="standard input")


def _link(link: Path, name: str) -> None:
    try:
        if link.is_symlink():
            link.unlink()
        link.symlink_to(name)
    except OSError as error:
        raise InputError(f"{link}: cannot be a link to the display: {error.strerror}") from error
