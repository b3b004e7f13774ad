"""A HUB75 panel of 64 x 32 in colour (1/16 scan), driven by the RP2040's PIO and DMA without the processor.

Knows the panel's wires: two rows of 64 pixels are shifted in at once, six lamps a clock, taken over by LAT and lit while OE is
low, row pair by row pair. Knows no picture. All of that stands in one table, one half-word a clock, each bit a pin: the PIO
program only puts them out, and the DMA begins again at the end. Seven colours, each lamp on or off. Panels whose chips want to
be set up first (FM6126A) stay dark.
"""

from array import array

WIDTH = 64
HEIGHT = 32
ROWS = 16
"""Row pairs: row r and row r + 16 are lit together."""
IDLE = 4
"""Clocks before each row in which nothing is lit, while the address of the row changes."""
STEPS = IDLE + WIDTH
"""Half-words of a row."""

# Pins from the first one on: R1 G1 B1 R2 G2 B2 A B C D E LAT OE.
PINS = 13
_ADDRESS = 6
_LATCH = 1 << 11
_DARK = 1 << 12

PIO_HZ = 4_000_000
"""Two instructions a clock of the panel: 16 rows of 68 clocks are told 1838 times a second."""


class Table:
    """What the pins do through one picture, as the PIO puts it out: `words`, 16 rows of `STEPS` half-words.

    While a row's pixels are shifted in, the row before it is lit.
    """

    def __init__(self, brightness: int = 3) -> None:
        self.words = array("H", bytes(2 * ROWS * STEPS))
        lit = (min(max(brightness, 0), 15) + 1) * (WIDTH - 4) // 16
        at = 0
        for row in range(ROWS):
            address = ((row - 1) % ROWS) << _ADDRESS
            for step in range(STEPS):
                word = address
                if not IDLE <= step < IDLE + lit:
                    word |= _DARK
                if step == STEPS - 1:
                    word |= _LATCH
                self.words[at] = word
                at += 1

    def take(self, pixels, colours) -> None:
        """Put the 64 x 32 `pixels` into the table: bytes, places in `colours`, triples of red, green, blue, 0 to 255."""
        bits = bytes([_bits(*colour) for colour in colours])
        words = self.words
        upper = 0
        for row in range(ROWS):
            at = row * STEPS + IDLE
            for _ in range(WIDTH):
                pair = bits[pixels[upper]] | bits[pixels[upper + ROWS * WIDTH]] << 3
                words[at] = (words[at] & 0xFFC0) | pair
                at += 1
                upper += 1


def _bits(red: int, green: int, blue: int) -> int:
    """The colour as three lights, on or off: those that have at least three fifths of its brightest one."""
    enough = max(red, green, blue, 1) * 3
    return (5 * red >= enough) | (5 * green >= enough) << 1 | (5 * blue >= enough) << 2


class Hub75:
    """A panel on 13 pins in a row from `first_pin` on, and the clock on the pin after them."""

    def __init__(self, colours, first_pin: int = 0, brightness: int = 3, *, upside_down: bool = False) -> None:
        self._colours = colours
        self._first_pin = first_pin
        self._upside_down = upside_down
        self._table = Table(brightness)
        self._moved = None

    def begin(self) -> None:
        """Start what tells the panel its table for ever; nothing where it runs already."""
        if self._moved is None:
            self._moved = _run_for_ever(self._table.words, self._first_pin)

    def show(self, surface) -> None:
        """Light `surface`, a Canvas of 64 x 32."""
        pixels = surface.buffer
        self._table.take(bytes(reversed(pixels)) if self._upside_down else pixels, self._colours)


def _program(rp2):
    """Two instructions: put out the next half-word with the clock low, then the clock high, by which the panel takes it."""

    @rp2.asm_pio(
        out_init=(rp2.PIO.OUT_LOW,) * PINS,
        sideset_init=rp2.PIO.OUT_LOW,
        out_shiftdir=rp2.PIO.SHIFT_RIGHT,
        autopull=True,
        pull_thresh=32,
    )
    def put_out():
        wrap_target()  # type: ignore[name-defined] # noqa: F821 a word of the assembler
        out(pins, 16).side(0)  # type: ignore[name-defined] # noqa: F821
        nop().side(1)  # type: ignore[name-defined] # noqa: F821
        wrap()  # type: ignore[name-defined] # noqa: F821

    return put_out


def _run_for_ever(words, first_pin: int):
    """State machine 0 puts out `words`; one DMA channel feeds it, another rewinds that one whenever it is through.

    Returns everything that must not be thrown away meanwhile.
    """
    import machine
    import rp2
    import uctypes

    putter = rp2.StateMachine(
        0,
        _program(rp2),
        freq=PIO_HZ,
        out_base=machine.Pin(first_pin),
        sideset_base=machine.Pin(first_pin + PINS),
    )
    feeder, rewinder = rp2.DMA(), rp2.DMA()
    # The address to write into the feeder's READ_ADDR_TRIG, its register 15: that starts it as well.
    start = array("I", [uctypes.addressof(words)])
    rewinder.config(
        read=start,
        write=feeder.registers[15:16],
        count=1,
        ctrl=rewinder.pack_ctrl(inc_read=False, inc_write=False),
    )
    # Transfers of 32 bits, whenever state machine 0 of PIO 0 has room.
    feeder.config(
        read=words,
        write=putter,
        count=len(words) // 2,
        ctrl=feeder.pack_ctrl(inc_write=False, treq_sel=0, chain_to=rewinder.channel),
        trigger=True,
    )
    putter.active(1)
    return putter, feeder, rewinder, start, words
