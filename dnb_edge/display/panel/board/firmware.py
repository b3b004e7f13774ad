"""The panel's firmware: reads the line protocol from USB, draws, lights the panel; for ever.

Knows a stream of bytes, a clock and a driver. Knows no pin. The board's `main.py` calls `run`.
"""

import sys
import time

from .. import face, state
from ..segments import Digits
from . import settings, wires

READ_BYTES = 256
FRAME_MS = 40
"""While more bytes wait, drawing waits as well, but not longer than this."""
TEST_MS = 300
"""Each step of the self-test at power on."""
COMPLAINT_MS = 5000
"""How long a wrong settings file is complained about."""
AWAY_MS = 1000
"""Pause between attempts to reach a panel that does not answer."""


class Clock:
    """Milliseconds that never wrap, from `ticks_ms`, which does."""

    def __init__(self, ticks_ms, ticks_diff) -> None:
        self._ticks_ms = ticks_ms
        self._ticks_diff = ticks_diff
        self._last = ticks_ms()
        self._now = 0

    def __call__(self) -> int:
        """Milliseconds since the clock was made."""
        ticks = self._ticks_ms()
        self._now += self._ticks_diff(ticks, self._last)
        self._last = ticks
        return self._now


class Inbox:
    """What has come in on `stream`, by single bytes: a board's stdin has no other way to read without waiting for more."""

    def __init__(self, stream, select) -> None:
        self._stream = stream
        self._poll = select.poll()
        self._poll.register(stream, select.POLLIN)
        self._buffer = bytearray(READ_BYTES)

    def read(self, wait_ms: int) -> bytes:
        """What is there, `READ_BYTES` at most; waits `wait_ms` for a first byte. Raises `EOFError` at the stream's end."""
        buffer, poll, stream = self._buffer, self._poll, self._stream
        count = 0
        while count < READ_BYTES and poll.poll(wait_ms if count == 0 else 0):
            byte = stream.read(1)
            if not byte:
                raise EOFError
            buffer[count] = byte[0]
            count += 1
        return bytes(buffer[:count])


class Firmware:
    """The loop's one turn after another: `read(wait_ms)` gives bytes, `clock()` milliseconds, `driver` lights a surface."""

    def __init__(self, layout: str, driver, read, clock, *, checksums: bool = True, complaint: str = "") -> None:
        self.panel = state.Panel(checksums)
        self.surface = face.surface(layout)
        if getattr(driver, "digits", 8) != 8:
            # The face of eight digits looks at how many there are.
            self.surface = Digits(driver.digits, layout)
        self._driver = driver
        self._read = read
        self._clock = clock
        self._complaint = complaint
        self._step = 0
        self._due = self._drawn = clock()
        self._changed = True
        self._away = True
        self._try_at = self._due

    def turn(self) -> None:
        """Take what has come in; draw where something changed or is due, but not while more waits and it is not yet time."""
        t_ms = self._clock()
        data = self._read(0 if self._changed else min(max(self._due - t_ms, 0), FRAME_MS))
        t_ms = self._clock()
        if self.panel.feed(data, t_ms):
            self._changed = True
        if self._step <= face.TEST_STEPS:
            self._test(t_ms)
        elif (self._changed or t_ms >= self._due) and (not data or t_ms - self._drawn >= FRAME_MS):
            face.draw(self.panel, self.surface, t_ms)
            self._changed = False
            self._due = face.next_change(self.panel, self.surface, t_ms)
            self._light(t_ms)
            # A slow panel must leave time to read.
            self._drawn = self._clock()

    def _test(self, t_ms: int) -> None:
        """The self-test's next picture, and after them what is wrong with the settings."""
        if t_ms < self._due:
            return
        if self._step < face.TEST_STEPS:
            face.test_picture(self.surface, self._step)
            self._due = t_ms + TEST_MS
            self._light(t_ms)
        elif self._complaint:
            told = state.Panel(False)  # noqa: FBT003 MicroPython has no cheap keywords
            told.feed(b"NOTE settings.json: " + self._complaint.encode()[:50] + b"\r\nRUN - -\r\n", t_ms)
            face.draw(told, self.surface, t_ms)
            self._due = t_ms + COMPLAINT_MS
            self._light(t_ms)
        self._step += 1

    def _light(self, t_ms: int) -> None:
        """Give the driver the surface. A panel that does not answer is set up anew once it does."""
        if self._away and t_ms < self._try_at:
            return
        try:
            if self._away:
                self._driver.begin()
            self._driver.show(self.surface)
            self._away = False
        except OSError:
            self._away = True
            self._try_at = t_ms + AWAY_MS


def run(path: str = "settings.json") -> None:
    """Read the settings and serve the panel for ever. Ctrl-C on the line ends it: that is how a board is written anew."""
    import select

    import machine

    chosen, complaint = settings.load(path)
    driver = wires.make(chosen, machine, time.sleep_us)  # type: ignore[attr-defined]
    clock = Clock(time.ticks_ms, time.ticks_diff)  # type: ignore[attr-defined]
    inbox = Inbox(sys.stdin.buffer, select)
    layout = settings.PANELS[chosen["panel"]]
    firmware = Firmware(layout, driver, inbox.read, clock, checksums=chosen["checksums"], complaint=complaint)
    try:
        while True:
            firmware.turn()
    except MemoryError:
        machine.reset()
