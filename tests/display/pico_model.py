"""A Raspberry Pi Pico as far as the panels' drivers see it: `machine`, `rp2` and `uctypes`, with chips soldered to its pins.

After the RP2040's data sheet (3.4 for what PIO instructions do, 2.5 for the DMA's registers) and MicroPython's documentation of
the modules. For MicroPython and CPython alike. What a pin cannot do (an SPI on the wrong pins) raises, as on the chip.
"""

_SPI0_CLOCK, _SPI0_DATA = (2, 6, 18, 22), (3, 7, 19, 23)
_I2C0_DATA, _I2C0_CLOCK = (0, 4, 8, 12, 16, 20), (1, 5, 9, 13, 17, 21)


class Pin:
    """A pin by its GPIO number; called with a level it tells whoever is soldered to it, called without it asks."""

    OUT, OPEN_DRAIN = 1, 2

    def __init__(self, pico, number, mode, value):
        self.number = number
        self._wired = pico.wired.get(number)
        self.mode = mode
        if value is not None:
            self(value)

    def __call__(self, level=None):
        if level is None:
            return self._wired()
        return self._wired(level) if self._wired else None


class _PinMaker:
    OUT, OPEN_DRAIN = Pin.OUT, Pin.OPEN_DRAIN

    def __init__(self, pico):
        self._pico = pico

    def __call__(self, number, mode=None, value=None):
        return Pin(self._pico, number, mode, value)


class Machine:
    """The module `machine`."""

    def __init__(self, pico):
        self._pico = pico
        self.Pin = _PinMaker(pico)

    def SPI(self, number, baudrate, polarity, phase, sck, mosi):  # noqa: N802
        assert (number, sck.number in _SPI0_CLOCK, mosi.number in _SPI0_DATA) == (0, True, True)
        assert (baudrate <= 10000000, polarity, phase) == (True, 0, 0), "more than a MAX7219 takes"
        return self._pico.spi

    def I2C(self, number, sda, scl, freq):  # noqa: N802
        assert (number, sda.number in _I2C0_DATA, scl.number in _I2C0_CLOCK, freq <= 400000) == (0, True, True, True)
        return self._pico.i2c

    def reset(self):
        raise SystemExit("reset")


class _Instruction:
    """One instruction while it is written: `.side(level)`, `[delay]`."""

    def __init__(self, what):
        self.what = what
        self.level = 0

    def side(self, level):
        self.level = level
        return self


class _Pio:
    OUT_LOW, SHIFT_RIGHT = 2, 1


class Rp2:
    """The module `rp2`."""

    def __init__(self, pico):
        self._pico = pico
        self.PIO = _Pio

    def asm_pio(self, out_init, sideset_init, out_shiftdir, autopull, pull_thresh):
        assert (out_shiftdir, autopull, pull_thresh, sideset_init) == (_Pio.SHIFT_RIGHT, True, 32, _Pio.OUT_LOW)

        def assemble(function):
            written = []

            def put(instruction):
                written.append(instruction)
                return instruction

            words = {
                "wrap_target": lambda: None,
                "wrap": lambda: None,
                "pins": "pins",
                "out": lambda where, count: put(_Instruction(("out", where, count))),
                "nop": lambda: put(_Instruction(("nop",))),
            }
            names = function.__globals__
            names.update(words)
            try:
                function()
            finally:
                for name in words:
                    del names[name]
            return {"code": written, "outs": len(out_init)}

        return assemble

    def StateMachine(self, number, program, freq, out_base, sideset_base):  # noqa: N802
        self._pico.machines[number] = StateMachine(self._pico, program, out_base.number, sideset_base.number, freq)
        return self._pico.machines[number]

    def DMA(self):  # noqa: N802
        channel = Dma(len(self._pico.channels))
        self._pico.channels.append(channel)
        return channel


class StateMachine:
    """A state machine that runs a program of `out` and `nop` with one side-set pin."""

    def __init__(self, pico, program, out_base, side_base, freq):
        self._pico = pico
        self._program = program
        self._out_base = out_base
        self._side_base = side_base
        self.freq = freq
        self.running = False
        self._left = 0
        self._word = 0

    def active(self, on):
        self.running = bool(on)

    def step(self, pull):
        """The whole program once; `pull()` gives the next 32 bits of the FIFO."""
        levels = self._pico.levels
        for instruction in self._program["code"]:
            if instruction.what[0] == "out":
                if self._left == 0:
                    self._word, self._left = pull(), 32
                count = instruction.what[2]
                value = self._word & ((1 << count) - 1)
                self._word >>= count
                self._left -= count
                for bit in range(self._program["outs"]):
                    levels[self._out_base + bit] = value >> bit & 1
            levels[self._side_base] = instruction.level
            self._pico.tell()


class Dma:
    """One channel: reads words from a buffer, or hands addresses to the registers of another."""

    def __init__(self, channel):
        self.channel = channel
        self.told = {}
        self.active = False
        self.registers = _Registers(self)

    def pack_ctrl(self, **fields):
        return fields

    def config(self, read, write, count, ctrl, trigger=False):
        self.told = {"read": read, "write": write, "count": count, "ctrl": ctrl}
        self.active = trigger


class _Registers:
    def __init__(self, channel):
        self._channel = channel

    def __getitem__(self, which):
        return self._channel, which.start, which.stop


class Pico:
    """Chips at its pins: `wired` by GPIO number, `spi`, `i2c`; `tell_panel(levels)` hears what state machines do to pins."""

    def __init__(self, wired=None, spi=None, i2c=None, tell_panel=None):
        self.wired = wired or {}
        self.spi = spi
        self.i2c = i2c
        self.levels = [0] * 30
        self._tell_panel = tell_panel
        self.machines = {}
        self.channels = []
        self._addresses = {}
        self.machine = Machine(self)
        self.rp2 = Rp2(self)
        self.uctypes = self

    def addressof(self, buffer):
        """`uctypes.addressof`."""
        address = 0x20000000 + 0x10000 * len(self._addresses)
        self._addresses[address] = buffer
        return address

    def modules(self):
        """What `import` is to find, by name."""
        return {"machine": self.machine, "rp2": self.rp2, "uctypes": self.uctypes}

    def tell(self):
        self._tell_panel(self.levels)

    def run(self, words):
        """Let the DMA feed state machine 0 with so many words of 32 bits, rewinding whenever it is through."""
        putter = self.machines[0]
        (feeder,) = [one for one in self.channels if one.active]
        assert putter.running
        assert feeder.told["write"] is putter
        assert (feeder.told["ctrl"]["treq_sel"], feeder.told["ctrl"]["inc_write"]) == (0, False)
        stream = self._fed(feeder)
        for _ in range(words * 2):
            putter.step(lambda: next(stream))

    def _fed(self, feeder):
        """The 32-bit words, little-endian pairs of half-words, for as long as the chain of channels goes on."""
        buffer = feeder.told["read"]
        while True:
            for at in range(feeder.told["count"]):
                yield buffer[2 * at] | buffer[2 * at + 1] << 16
            chained = feeder.told["ctrl"].get("chain_to", feeder.channel)
            if chained == feeder.channel:
                return
            rewinder = self.channels[chained]
            target, first, stop = rewinder.told["write"]
            # READ_ADDR_TRIG of alias 3: the new read address, and off it goes with its old count.
            assert (target, first, stop, rewinder.told["count"]) == (feeder, 15, 16, 1)
            assert rewinder.told["ctrl"] == {"inc_read": False, "inc_write": False}
            buffer = self._addresses[rewinder.told["read"][0]]
