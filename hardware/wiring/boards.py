"""The boards of the diagrams: where their pins are and what is printed beside them.

Knows the pinouts of a Raspberry Pi Pico (data sheet, figure 4), of the 40-pin header of a Raspberry Pi, and of the panels'
usual boards. Knows no wire. Each function draws a board and returns its pins' places by name.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from hardware.wiring.svg import FAINT, INK, Drawing, Point

PITCH = 24
PICO_WIDTH = 260.0
PICO_LEFT = (
    "GP0", "GP1", "GND", "GP2", "GP3", "GP4", "GP5", "GND", "GP6", "GP7",
    "GP8", "GP9", "GND", "GP10", "GP11", "GP12", "GP13", "GND", "GP14", "GP15",
)  # fmt: skip
"""Pins 1 to 20, from the USB socket down."""
PICO_RIGHT = (
    "VBUS", "VSYS", "GND", "3V3_EN", "3V3", "ADC_VREF", "GP28", "AGND", "GP27", "GP26",
    "RUN", "GP22", "GND", "GP21", "GP20", "GP19", "GP18", "GND", "GP17", "GP16",
)  # fmt: skip
"""Pins 40 down to 21."""
PI_HEADER = (
    "3V3", "5V", "GPIO2", "5V", "GPIO3", "GND", "GPIO4", "GPIO14", "GND", "GPIO15",
    "GPIO17", "GPIO18", "GPIO27", "GND", "GPIO22", "GPIO23", "3V3", "GPIO24", "GPIO10 MOSI", "GND",
    "GPIO9 MISO", "GPIO25", "GPIO11 SCLK", "GPIO8 CE0", "GND", "GPIO7 CE1",
)  # fmt: skip
"""Pins 1 to 26 of 40, row by row."""

_GOLD, _BOARD, _PLAIN = "#e8c15a", "#dfeee6", "#eef1f4"


def pico_pin(name: str) -> int:
    """The number of the pin called `name` that the diagrams use; for GND the one nearest to the others."""
    if name in PICO_LEFT:
        return PICO_LEFT.index(name) + 1
    return 40 - PICO_RIGHT.index(name)


def pico(drawing: Drawing, x: float, y: float, used: Collection[int], note: str = "USB to the box") -> dict[int, Point]:
    """A Pico with its USB socket on top, `used` pins named in full; returns where wires leave each pin."""
    width, height = PICO_WIDTH, 20 * PITCH + 20.0
    drawing.box(x, y, width, height, fill=_BOARD, radius=10)
    drawing.box(x + width / 2 - 26, y - 14, 52, 30, fill="#c9cfd6")
    drawing.words(x + width / 2, y - 26, note, size=13, anchor="middle", fill=FAINT)
    drawing.words(x + width / 2, y + 9 * PITCH + 10, "Pico", size=17, anchor="middle", bold=True)
    places: dict[int, Point] = {}
    for row in range(20):
        at_y = y + 10 + PITCH * (row + 0.5)
        for number, name, left in ((row + 1, PICO_LEFT[row], True), (40 - row, PICO_RIGHT[row], False)):
            at_x = x + 12 if left else x + width - 12
            lit = number in used
            drawing.dot(at_x, at_y, 7, fill=_GOLD if lit else _PLAIN, line=INK if lit else FAINT)
            words_x, anchor = (at_x + 14, "start") if left else (at_x - 14, "end")
            text = f"{name} ({number})" if lit and left else f"({number}) {name}" if lit else name
            drawing.words(
                words_x, at_y, text, size=13 if lit else 10, anchor=anchor, fill=INK if lit else FAINT, bold=lit
            )
            places[number] = (at_x, at_y)
    return places


def pi_header(drawing: Drawing, x: float, y: float, used: Collection[int]) -> dict[int, Point]:
    """The upper 26 pins of a Raspberry Pi's header, pin 1 at the top left; returns the pins' places.

    Wires leave between the rows, those of the inner pins below, those of the outer ones above, so that names can be read.
    """
    drawing.box(x - 166, y - 46, 360, 13 * PITCH + 74, fill=_BOARD, radius=10)
    drawing.words(x + 29, y - 26, "Raspberry Pi: header, pins 1 to 26", size=14, anchor="middle", bold=True)
    drawing.box(x - 14, y - 6, 86, 13 * PITCH + 12, fill="#39424e")
    places: dict[int, Point] = {}
    for number, name in enumerate(PI_HEADER, start=1):
        left = number % 2 == 1
        at_x, at_y = (x + 10 if left else x + 48), y + PITCH * ((number - 1) // 2 + 0.5)
        lit = number in used
        drawing.dot(at_x, at_y, 7, fill=_GOLD if lit else _PLAIN, line=INK if lit else FAINT)
        text = f"{name} ({number})" if lit else name
        drawing.words(at_x - 30 if left else at_x + 30, at_y, text, size=13 if lit else 10,
                      anchor="end" if left else "start", fill=INK if lit else FAINT, bold=lit)  # fmt: skip
        places[number] = (at_x, at_y)
    drawing.words(x + 29, y + 13 * PITCH + 16, "pins 27 to 40 are not used", size=11, anchor="middle", fill=FAINT)
    return places


def module(
    drawing: Drawing,
    x: float,
    y: float,
    names: Sequence[str],
    title: str,
    *,
    pins_left: bool = True,
    width: float = 220,
) -> dict[str, Point]:
    """A board with one row of pins, on its left or its right, top to bottom; returns the pins' places by name."""
    height = PITCH * len(names) + 66
    drawing.box(x, y, width, height, fill="#e6ecf8", radius=8)
    drawing.words(x + width / 2, y + 20, title, size=14, anchor="middle", bold=True)
    places: dict[str, Point] = {}
    for row, name in enumerate(names):
        at_x, at_y = (x + 14 if pins_left else x + width - 14), y + 52 + PITCH * row
        drawing.dot(at_x, at_y, 7, fill=_GOLD)
        drawing.words(
            at_x + 16 if pins_left else at_x - 16, at_y, name, size=14, anchor="start" if pins_left else "end"
        )
        places[name] = (at_x, at_y)
    return places
