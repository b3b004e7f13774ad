"""What a channel to vehicles is to the gateway: lines that come, lines that go, and nothing that waits.

Knows bytes. Knows no channel in particular.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Protocol

from dnb_edge.vehicle.telemetry import MOST_LINE_BYTES

MOST_AT_ONCE = 64
"""Lines that a channel gives in one turn; where it has as many it is left alone for a moment."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """A line as it came."""

    line: bytes
    sender: Hashable
    """Whose it is, as far as limits go."""
    came_ns: int
    """CLOCK_MONOTONIC."""
    address: tuple[str, int] | None = None
    """Where signals for it go; None where the channel needs none."""


class Channel(Protocol):
    """A way to vehicles. One thread uses it; no call blocks."""

    name: str
    """As people know it, such as `UDP 0.0.0.0:5610`."""
    thrown_away: int
    """Lines that were lost before anybody could read them."""

    def fileno(self) -> int | None:
        """What becomes readable when a line comes; None while the channel is away."""

    def read(self) -> list[Heard]:
        """The lines that have come, at most about `MOST_AT_ONCE`. Raises `InputError` where the channel can never work."""

    def registered(self, heard: Heard, car: int | None, now_s: float) -> None:
        """A line made sense: whoever sent it hears signals from now on. `now_s` is of the monotonic clock."""

    def tell(self, line: bytes, car: int | None, now_s: float) -> None:
        """Sends a line to whom it concerns: all for None. What cannot be sent at once is lost."""

    def tend(self, now_s: float) -> None:
        """Called a few times a second: opens again what is away."""

    def close(self) -> None:
        """Ends it. Safe to repeat."""


class Splitter:
    """Whole lines of a stream; of one that is too long the beginning alone, so that it is refused once and no memory grows."""

    def __init__(self) -> None:
        self._rest = b""
        self._overlong = False

    def feed(self, data: bytes) -> list[bytes]:
        """The lines that end in `data`, without line ends; blank ones are left out."""
        *ended, self._rest = (self._rest + data).split(b"\n")
        lines = [line.strip() for line in ended]
        if self._overlong and lines:
            # Its beginning was told already.
            del lines[0]
            self._overlong = False
        if len(self._rest) > MOST_LINE_BYTES:
            if not self._overlong:
                lines.append(self._rest[: MOST_LINE_BYTES + 1])
            self._rest, self._overlong = b"", True
        return [line for line in lines if line]
