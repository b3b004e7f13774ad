"""Models of the chips that panels are made of, after their data sheets: what came down the wires, and what then is lit.

Written from the data sheets and not from the drivers, for MicroPython and CPython alike. A model raises `AssertionError` where
the wires do what its chip does not allow.
"""

SEGMENTS = "abcdefg."


class Max7219Chain:
    """`count` MAX7219 with DOUT of one on DIN of the next: call `load(level)` for LOAD and `write(bytes)` for DIN and CLK.

    Data sheet: 16 bits are shifted in, D15 first, whatever LOAD is; at its rising edge each chip takes its last 16 over; D11 to
    D8 are the register. At power on the chip is shut down and scans one digit only.
    """

    def __init__(self, count):
        self.chips = [
            {"decode": 0, "intensity": 0, "scan": 0, "on": 0, "test": 0, "rows": [0] * 8} for _ in range(count)
        ]
        self._bits = [0] * (16 * count)
        self._level = 1

    def write(self, data):
        for byte in data:
            for place in range(7, -1, -1):
                self._bits.pop()
                self._bits.insert(0, (byte >> place) & 1)

    def load(self, level):
        if level and not self._level:
            for chip in range(len(self.chips)):
                # The bit shifted in last is D0 of the chip nearest to the wires.
                word = 0
                for place in range(16):
                    word |= self._bits[16 * chip + place] << place
                self._take(self.chips[chip], (word >> 8) & 0x0F, word & 0xFF)
        self._level = level

    def _take(self, chip, register, value):
        if 1 <= register <= 8:
            chip["rows"][register - 1] = value
        elif register:
            name = {9: "decode", 10: "intensity", 11: "scan", 12: "on", 15: "test"}[register]
            chip[name] = value & {9: 0xFF, 10: 0x0F, 11: 7, 12: 1, 15: 1}[register]

    def lit(self, chip, digit):
        """Which of D7..D0 are lit while `digit` is driven, as a number."""
        registers = self.chips[chip]
        if registers["test"]:
            return 0xFF
        if not registers["on"] or digit > registers["scan"]:
            return 0
        assert registers["decode"] == 0, "the digit decoder would make letters of a matrix"
        return registers["rows"][digit]


class ChipWire:
    """The SPI of a Raspberry Pi with a chain of MAX7219 on it: each message is one selection."""

    def __init__(self, count):
        self.chain = Max7219Chain(count)
        self.closed = 0
        self.away = None
        """The error that everything raises; None while it is there."""

    def __call__(self, path):
        self.path = path
        if self.away:
            raise self.away
        return self

    def data(self, data):
        if self.away:
            raise self.away
        self.chain.load(0)
        self.chain.write(bytes(data))
        self.chain.load(1)

    def command(self, *command):
        self.data(command)

    def cleanup(self):
        self.closed += 1


def matrix_rows(chain, turn=0, reverse=False, mirror=False):
    """What is seen on a row of 8x8 matrices, as texts of # and dots, top row first.

    An FC-16 board seen upright has its wires on the right, digit 0 at the top and D7 on the left. On other boards each matrix
    is turned clockwise by `turn`, the wires are on the left (`reverse`), or D0 is on the left (`mirror`, before it is turned).
    """
    blocks = []
    for chip in range(len(chain.chips)):
        block = []
        for row in range(8):
            bits = chain.lit(chip, row)
            line = ["#" if bits & (0x80 >> column) else "." for column in range(8)]
            block.append(list(reversed(line)) if mirror else line)
        for _ in range(turn // 90):
            block = [[block[7 - x][y] for x in range(8)] for y in range(8)]
        blocks.append(block)
    if not reverse:
        blocks.reverse()
    return ["".join(["".join(block[row]) for block in blocks]) for row in range(8)]


def max7219_digits(chain, reverse=False):
    """What is seen on eight digits of one MAX7219, left to right, as letters of lit segments (data sheet, table 6)."""
    digits = []
    for digit in range(8):
        bits = chain.lit(0, digit)
        digits.append("".join([SEGMENTS[at] for at, bit in enumerate((6, 5, 4, 3, 2, 1, 0, 7)) if bits >> bit & 1]))
    return digits if reverse else list(reversed(digits))


class Tm1637Chip:
    """A TM1637 on two wires that anybody may pull down: `clock(level)`, `data(level)`, and `data()` to read.

    Data sheet: DIO falls while CLK is high to start, rises while CLK is high to stop, else it may only change while CLK is low.
    Bits are taken at rising edges of CLK, the lowest first; from the eighth falling edge to the ninth the chip holds DIO down.
    """

    def __init__(self, present=True):
        self.memory = [0] * 6
        self.light = None
        """0 to 7; None while the panel is off."""
        self.present = present
        self._clock = self._host = 1
        self._answering = False
        self._bits = None
        self._bytes = []
        self._increments = False

    def clock(self, level):
        if level and not self._clock and self._bits is not None and not self._answering:
            self._bits.append(self._host)
        if not level and self._clock and self._bits is not None:
            if self._answering:
                self._answering = False
                self._bits = []
            elif len(self._bits) == 8:
                self._bytes.append(sum([bit << place for place, bit in enumerate(self._bits)]))
                self._answering = True
        self._clock = level

    def data(self, level=None):
        if level is None:
            return 0 if self.present and self._answering else self._host
        if level != self._host and self._clock:
            assert not self._answering, "the wire changes while the chip holds it"
            if level:
                assert self._bits == [0], "a stop in the middle of a byte"
                self._take()
                self._bits = None
            else:
                self._bits, self._bytes = [], []
        self._host = level
        return None

    def _take(self):
        if not self.present or not self._bytes:
            return
        command = self._bytes[0]
        if command & 0xC0 == 0x40:
            self._increments = not command & 0x04
            assert command & 0x03 == 0, "a command to read keys"
        elif command & 0xC0 == 0xC0:
            assert self._increments or len(self._bytes) == 2
            for place, byte in enumerate(self._bytes[1:]):
                self.memory[(command & 0x0F) + place] = byte
        elif command & 0xC0 == 0x80:
            self.light = command & 0x07 if command & 0x08 else None

    def seen(self, order):
        """The digits left to right on a board whose digits are wired in `order`, as letters of lit segments."""
        lit = self.memory if self.light is not None else [0] * 6
        return ["".join([name for place, name in enumerate(SEGMENTS) if lit[at] >> place & 1]) for at in order]


_ARGUMENTS = {0x20: 1, 0x81: 1, 0x8D: 1, 0xA8: 1, 0xD3: 1, 0xD5: 1, 0xD9: 1, 0xDA: 1, 0xDB: 1}


class OledChip:
    """An SSD1306 (`columns` 128) or SH1106 (132) at one address of an I2C bus: `writeto(address, bytes)`.

    Data sheets: the first byte says whether commands or memory follow. In page addressing 0xB0 | page, low and high nibble of
    the column say where; the column goes on by itself and stays within the page. 0xA1 and 0xC8 turn columns and rows about.
    """

    def __init__(self, columns=128, address=0x3C):
        self.columns = columns
        self.address = address
        self.present = True
        self.lose_power()

    def lose_power(self):
        """As at power on: off, and anything in the memory."""
        self.memory = [bytearray([0x5A] * self.columns) for _ in range(8)]
        self.on = self.pumped = self.mirrored = self.turned = False
        self.page = self.column = 0
        self.paging = False
        self.rows = 64
        self.contrast = 0x7F
        self.wires = 0x12
        self.sent = 0

    def writeto(self, address, data):
        if not self.present or address != self.address:
            raise OSError(5)
        data = bytes(data)
        self.sent += len(data)
        if data[0] == 0x40:
            assert self.paging, "not in page addressing"
            for byte in data[1:]:
                self.memory[self.page][self.column] = byte
                self.column = (self.column + 1) % self.columns
            return
        assert data[0] == 0x00, "neither commands nor memory"
        at = 1
        while at < len(data):
            code = data[at]
            count = _ARGUMENTS.get(code, 0)
            assert at + count < len(data), "a command without its argument"
            self._obey(code, data[at + count])
            at += 1 + count

    def _obey(self, code, value):
        if code < 0x10:
            self.column = self.column & 0xF0 | code
        elif code < 0x20:
            self.column = self.column & 0x0F | (code & 0x0F) << 4
        elif 0xB0 <= code < 0xB8:
            self.page = code & 7
        elif code in (0xA0, 0xA1):
            self.mirrored = code == 0xA1
        elif code in (0xC0, 0xC8):
            self.turned = code == 0xC8
        elif code in (0xAE, 0xAF):
            self.on = code == 0xAF
        elif code in _ARGUMENTS:
            self._set(code, value)
        else:
            assert code in (0x2E, 0x40, 0xA4, 0xA6), f"command {code:02x}"

    def _set(self, code, value):
        if code == 0x20:
            self.paging = value == 2
        elif code == 0x81:
            self.contrast = value
        elif code == 0x8D:
            self.pumped = value == 0x14
        elif code == 0xA8:
            self.rows = value + 1
        elif code == 0xDA:
            self.wires = value
        elif code == 0xD3:
            assert value == 0, "shifted"

    def seen(self):
        """What is seen on the usual board, upright, as texts of # and dots."""
        if not (self.on and self.pumped and self.rows == 64 and self.wires == 0x12):
            return ["." * 128] * 64
        before = (self.columns - 128) // 2
        rows = []
        for y in range(64):
            # The board's upright way is the one with both turned about.
            row = y if self.turned else 63 - y
            line = []
            for x in range(128):
                column = before + (x if self.mirrored else 127 - x)
                line.append("#" if self.memory[row >> 3][column] >> (row & 7) & 1 else ".")
            rows.append("".join(line))
        return rows


class Hub75Panel:
    """A panel of 64 x 32 with 1/16 scan: `pins(levels)` gives the 14 wires R1 G1 B1 R2 G2 B2 A B C D E LAT OE CLK at a moment.

    Three and three shift registers of 64 bits, which move at rising edges of CLK; their latches follow them while LAT is high;
    while OE is low the latched bits light the rows A..D and A..D + 16. `light` counts for how many moments each lamp was lit.
    """

    def __init__(self):
        self._registers = [[0] * 64 for _ in range(6)]
        self._latched = [(0,) * 64] * 6
        self._clock = 0
        self._address = None
        self.light = {}
        self.moments = 0
        self.moved_while_lit = 0

    def pins(self, levels):
        if levels[13] and not self._clock:
            for colour in range(6):
                self._registers[colour].pop(0)
                self._registers[colour].append(levels[colour])
        self._clock = levels[13]
        latched_before = self._latched
        if levels[11]:
            self._latched = [tuple(register) for register in self._registers]
        address = levels[6] | levels[7] << 1 | levels[8] << 2 | levels[9] << 3
        lit = not levels[12]
        if lit and (address != self._address or self._latched != latched_before):
            self.moved_while_lit += 1
        self._address = address
        self.moments += 1
        if lit:
            key = (address, tuple(self._latched))
            self.light[key] = self.light.get(key, 0) + 1

    def seen(self):
        """What is seen: 32 rows of 64 sets of lamps as numbers (red 1, green 2, blue 4), of all lamps lit at any moment."""
        rows = [[0] * 64 for _ in range(32)]
        for address, latched in self.light:
            for x in range(64):
                rows[address][x] |= latched[0][x] | latched[1][x] << 1 | latched[2][x] << 2
                rows[address + 16][x] |= latched[3][x] | latched[4][x] << 1 | latched[5][x] << 2
        return rows
