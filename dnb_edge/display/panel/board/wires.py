"""Which driver a panel has, and at which pins of a Raspberry Pi Pico it is: the table of `docs/wiring.md`.

Knows pins. Knows no picture. `machine` is MicroPython's, given so that a test can give another.
"""

from ..pixels import COLOURS
from . import hub75, max7219, ssd1306, tm1637

SPI_CLOCK, SPI_DATA, SPI_SELECT = 18, 19, 17
"""MAX7219: CLK, DIN, CS."""
I2C_DATA, I2C_CLOCK = 16, 17
"""OLED: SDA, SCL."""
TM_CLOCK, TM_DATA = 18, 19
"""TM1637: CLK, DIO."""
HUB75_FIRST = 0
"""HUB75: R1 G1 B1 R2 G2 B2 A B C D E LAT OE CLK from here on."""


def make(settings, machine, wait_us):
    """The driver of the panel that `settings` name, every key of them there."""
    panel = settings["panel"]
    brightness = settings["brightness"]
    if panel.startswith("max7219"):
        return _max7219(settings, machine)
    if panel.startswith("tm1637"):
        # A pin that pulls down or lets go: the chip answers on the same wire, and the board has the resistors that pull up.
        clock = machine.Pin(TM_CLOCK, machine.Pin.OPEN_DRAIN, value=1)
        data = machine.Pin(TM_DATA, machine.Pin.OPEN_DRAIN, value=1)
        return tm1637.Tm1637(clock, data, wait_us, brightness)
    if panel.startswith("hub75"):
        return hub75.Hub75(COLOURS, HUB75_FIRST, brightness, upside_down=settings["upside_down"])
    i2c = machine.I2C(0, sda=machine.Pin(I2C_DATA), scl=machine.Pin(I2C_CLOCK), freq=400000)
    first_column = ssd1306.SH1106_FIRST_COLUMN if panel.startswith("sh1106") else 0
    return ssd1306.Oled(i2c, brightness=brightness, first_column=first_column, upside_down=settings["upside_down"])


def _max7219(settings, machine):
    spi = machine.SPI(
        0,
        baudrate=4000000,
        polarity=0,
        phase=0,
        sck=machine.Pin(SPI_CLOCK),
        mosi=machine.Pin(SPI_DATA),
    )
    select = machine.Pin(SPI_SELECT, machine.Pin.OUT, value=1)
    brightness, reverse = settings["brightness"], settings["reverse"]
    if settings["panel"] == "max7219-8-digits":
        return max7219.DigitRow(spi, select, brightness, reverse=reverse)
    turned = {name: settings[name] for name in ("turn", "reverse", "mirror", "upside_down")}
    return max7219.Matrix(spi, select, 32, brightness, **turned)
