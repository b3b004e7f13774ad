"""Six digits of seven segments on a TM1637, two wires.

Knows the chip's protocol (Titan Micro, TM1637 data sheet, version 2.4): like I2C without an address, least significant bit
first, and an answer after each byte, so that a chip that is away is noticed. Knows no picture.
"""

WRITE_IN_ORDER = 0x40
FIRST_DIGIT = 0xC0
LIGHT = 0x88
BRIGHTEST = 7

SIX_IN_THREES = (2, 1, 0, 5, 4, 3)
"""Where the digits from left to right are in the chip on the usual board of six."""


class Tm1637:
    """`clock` and `data` are open-drain pins: called with 0 or 1, and `data` with nothing to be read; `wait_us(n)` waits so
    many microseconds."""

    digits = 6
    """As many as it shows."""

    def __init__(self, clock, data, wait_us, brightness: int = 3) -> None:
        self._clock = clock
        self._data = data
        self._wait_us = wait_us
        self.brightness = brightness

    def begin(self) -> None:
        """Both wires at rest; the settings go with each picture."""
        self._clock(1)
        self._data(1)
        self._wait()

    def show(self, surface) -> None:
        """Light the segments of `surface` (Digits of 6). Raises `OSError` where no chip answers."""
        self.begin()
        digits = bytearray(6)
        for place in range(6):
            digits[SIX_IN_THREES[place]] = surface.buffer[place]
        self._told(bytes([WRITE_IN_ORDER]))
        self._told(bytes([FIRST_DIGIT]) + digits)
        # 0..15 as everywhere, 0..7 in the chip.
        self._told(bytes([LIGHT | min(max(self.brightness, 0) // 2, BRIGHTEST)]))

    def _told(self, message: bytes) -> None:
        self._data(0)
        self._wait()
        self._clock(0)
        answered = True
        for byte in message:
            answered = self._put(byte) and answered
        self._data(0)
        self._wait()
        self._clock(1)
        self._wait()
        self._data(1)
        self._wait()
        if not answered:
            raise OSError("TM1637 does not answer")

    def _put(self, byte: int) -> bool:
        """One byte; True where the chip pulled `data` down at the ninth clock."""
        for place in range(8):
            self._data((byte >> place) & 1)
            self._wait()
            self._clock(1)
            self._wait()
            self._clock(0)
        self._data(1)
        self._wait()
        self._clock(1)
        self._wait()
        answered = not self._data()
        self._clock(0)
        self._wait()
        return answered

    def _wait(self) -> None:
        self._wait_us(4)
