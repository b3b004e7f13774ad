"""Panels of MAX7219 chips on SPI: four 8x8 matrices in a row, or eight digits of seven segments.

Knows the chip's registers (Maxim, MAX7219/MAX7221 data sheet, tables 2 to 10). Knows no picture. The chips stand in a chain:
what is sent first ends up in the chip furthest from the wires. The chip cannot be asked anything, and a spike on its wires may
turn it off or into its test mode, so each picture is sent with all of its settings: what went wrong is right again at once.
"""

NO_DECODE = 0x09
INTENSITY = 0x0A
SCAN_LIMIT = 0x0B
SHUTDOWN = 0x0C
DISPLAY_TEST = 0x0F
FIRST_ROW = 0x01
BRIGHTEST = 15


class Chain:
    """`count` chips one behind the other: `spi` has `write(bytes)`, mode 0, most significant bit first, 10 MHz at most; `cs`,
    called with 0 or 1, is their common LOAD pin."""

    def __init__(self, spi, cs, count: int, brightness: int = 3) -> None:
        self._spi = spi
        self._cs = cs
        self._count = count
        self._words = bytearray(2 * count)
        self.brightness = brightness

    def begin(self) -> None:
        """Set the chips up: every row driven, no digit decoder, brightness, on."""
        cs = self._cs
        cs(1)
        self._tell_all(DISPLAY_TEST, 0)
        self._tell_all(NO_DECODE, 0)
        self._tell_all(SCAN_LIMIT, 7)
        self._tell_all(INTENSITY, min(max(self.brightness, 0), BRIGHTEST))
        self._tell_all(SHUTDOWN, 1)

    def _tell_all(self, register: int, value: int) -> None:
        words = self._words
        for chip in range(self._count):
            words[2 * chip] = register
            words[2 * chip + 1] = value
        self._send()

    def _send(self) -> None:
        """One word of register and value to each chip, taken over by all of them at the rising edge of LOAD."""
        cs = self._cs
        cs(0)
        self._spi.write(self._words)
        cs(1)


class Matrix(Chain):
    """A row of 8x8 matrices, such as the blue modules "FC-16" of four: wires on the right, seen from the front, upright.

    `upside_down` where the whole panel hangs the other way up, wires on the left. Other modules: `reverse` where the first
    matrix is the leftmost one, `turn` where each matrix is turned by 90, 180 or 270 degrees clockwise on its board, `mirror`
    where it shows letters as a mirror does.
    """

    def __init__(
        self,
        spi,
        cs,
        width: int = 32,
        brightness: int = 3,
        *,
        turn: int = 0,
        reverse: bool = False,
        mirror: bool = False,
        upside_down: bool = False,
    ) -> None:
        super().__init__(spi, cs, width // 8, brightness)
        if upside_down:
            turn, reverse = (turn + 180) % 360, not reverse
        self._order = []
        for row in range(8):
            for sent in range(self._count):
                block = self._count - 1 - sent if reverse else sent
                for column in range(8):
                    x, y = _turned(7 - column if mirror else column, row, turn)
                    self._order.append(y * width + 8 * block + x)

    def show(self, surface) -> None:
        """Light each pixel of `surface` (a Canvas, 8 high) that is not 0."""
        self.begin()
        pixels, words, order = surface.buffer, self._words, self._order
        at = 0
        for row in range(8):
            for chip in range(self._count):
                bits = 0
                for _ in range(8):
                    bits <<= 1
                    if pixels[order[at]]:
                        bits |= 1
                    at += 1
                words[2 * chip] = FIRST_ROW + row
                words[2 * chip + 1] = bits
            self._send()


def _turned(column: int, row: int, turn: int):
    """Where in the picture's 8x8 block the light of a chip's `row` and `column` is, on a board turned by `turn`."""
    if turn == 90:
        return 7 - row, column
    if turn == 180:
        return 7 - column, 7 - row
    if turn == 270:
        return row, 7 - column
    return column, row


class DigitRow(Chain):
    """One chip with eight digits of seven segments, the first register being the rightmost digit."""

    def __init__(self, spi, cs, brightness: int = 3, *, reverse: bool = False) -> None:
        super().__init__(spi, cs, 1, brightness)
        self._reverse = reverse

    def show(self, surface) -> None:
        """Light the segments of `surface` (Digits of 8)."""
        self.begin()
        words = self._words
        for place in range(8):
            words[0] = FIRST_ROW + (place if self._reverse else 7 - place)
            words[1] = segment_bits(surface.buffer[place])
            self._send()


def segment_bits(segments: int) -> int:
    """A digit as the chip has it: dot, a, b, c, d, e, f, g from the most significant bit; `segments` has a in bit 0."""
    bits = segments & 0x80
    for place in range(7):
        if segments & (1 << place):
            bits |= 0x40 >> place
    return bits
