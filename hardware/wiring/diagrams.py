"""The diagrams: each joins pins of a board to pins of a panel, wire by wire, from one table.

Knows which pin goes where: the tables here are those of the firmware (`dnb_edge/display/panel/board/wires.py`), which a test
compares. Knows how wires are laid so that they can be followed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from hardware.wiring import boards
from hardware.wiring.svg import FAINT, INK, Drawing, Point

RED, BLACK, YELLOW, GREEN, BLUE, VIOLET, ORANGE = (
    "#d1342f", "#2b2b2b", "#d9a400", "#2e9a4b", "#2a6fd0", "#8a45c2", "#e37b1a",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Wire:
    """From a board's pin, by its number, to a panel's, by its name."""

    pin: int
    to: str
    colour: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Small:
    """A small panel on a Pico: its wires, its board's title and all of its pins in their order, and words below."""

    title: str
    board: str
    pins: tuple[str, ...]
    wires: tuple[Wire, ...]
    notes: tuple[str, ...]


_MAX_WIRES = (
    Wire(pin=40, to="VCC", colour=RED),
    Wire(pin=38, to="GND", colour=BLACK),
    Wire(pin=25, to="DIN", colour=BLUE),
    Wire(pin=22, to="CS", colour=GREEN),
    Wire(pin=24, to="CLK", colour=YELLOW),
)
_MAX_NOTES = (
    "5 V from VBUS, which is the USB supply. With all lit, brightness 5 of 15 draws 0.45 A by the data sheet.",
    "The chip wants 3.5 V for a one, the Pico gives 3.3 V: most boards take it. If pictures flicker, put a 74AHCT125",
    "into DIN, CS and CLK, or keep those wires under 20 cm.",
)
SMALL = {
    "pico-max7219-32x8": Small(
        title="Four 8x8 matrices with MAX7219 on a Pico (max7219-32x8)",
        board="4 x MAX7219, side IN",
        pins=("VCC", "GND", "DIN", "CS", "CLK"),
        wires=_MAX_WIRES,
        notes=_MAX_NOTES,
    ),
    "pico-max7219-8-digits": Small(
        title="Eight digits with MAX7219 on a Pico (max7219-8-digits)",
        board="8 digits, MAX7219",
        pins=("VCC", "GND", "DIN", "CS", "CLK"),
        wires=_MAX_WIRES,
        notes=_MAX_NOTES,
    ),
    "pico-tm1637": Small(
        title="Six digits with TM1637 on a Pico (tm1637-6-digits)",
        board="6 digits, TM1637",
        pins=("CLK", "DIO", "VCC", "GND"),
        wires=(
            Wire(pin=36, to="VCC", colour=RED),
            Wire(pin=38, to="GND", colour=BLACK),
            Wire(pin=24, to="CLK", colour=YELLOW),
            Wire(pin=25, to="DIO", colour=BLUE),
        ),
        notes=(
            "3.3 V, not 5 V (boards are sold for both): it pulls CLK and DIO up to its VCC, and the Pico takes 3.3 V only.",
        ),
    ),
    "pico-oled": Small(
        title="OLED of 128 x 64 on a Pico (ssd1306-128x64, sh1106-128x64)",
        board="OLED 128 x 64, I2C",
        pins=("GND", "VCC", "SCL", "SDA"),
        wires=(
            Wire(pin=38, to="GND", colour=BLACK),
            Wire(pin=36, to="VCC", colour=RED),
            Wire(pin=22, to="SCL", colour=YELLOW),
            Wire(pin=21, to="SDA", colour=BLUE),
        ),
        notes=(
            "3.3 V. Some boards have VCC first and GND second: go by what is printed on yours.",
            "Address 0x3C (0x78 in eight bits), as nearly all of them have.",
        ),
    ),
}

HUB75 = ("R1", "G1", "B1", "GND", "R2", "G2", "B2", "E", "A", "B", "C", "D", "CLK", "LAT", "OE", "GND")
"""The panel's socket IN, pins 1 to 16: odd ones in one row, even ones in the other."""
HUB75_WIRES = (
    Wire(pin=1, to="R1", colour=RED),
    Wire(pin=2, to="G1", colour=GREEN),
    Wire(pin=4, to="B1", colour=BLUE),
    Wire(pin=5, to="R2", colour=RED),
    Wire(pin=6, to="G2", colour=GREEN),
    Wire(pin=7, to="B2", colour=BLUE),
    Wire(pin=9, to="A", colour=ORANGE),
    Wire(pin=10, to="B", colour=ORANGE),
    Wire(pin=11, to="C", colour=ORANGE),
    Wire(pin=12, to="D", colour=ORANGE),
    Wire(pin=14, to="E", colour=ORANGE),
    Wire(pin=15, to="LAT", colour=VIOLET),
    Wire(pin=16, to="OE", colour=VIOLET),
    Wire(pin=17, to="CLK", colour=YELLOW),
    Wire(pin=3, to="GND", colour=BLACK),
)
PI_WIRES = (
    Wire(pin=2, to="VCC", colour=RED),
    Wire(pin=6, to="GND", colour=BLACK),
    Wire(pin=19, to="DIN", colour=BLUE),
    Wire(pin=24, to="CS", colour=GREEN),
    Wire(pin=23, to="CLK", colour=YELLOW),
)


def pictures() -> dict[str, str]:
    """Every diagram: its file's name and its SVG."""
    drawn: dict[str, Callable[[], Drawing]] = {
        "wiring-overview.svg": _overview,
        "wiring-pico-hub75.svg": _hub75,
        "wiring-pi-max7219.svg": _pi_spi,
    }
    made = {name: draw().text() for name, draw in drawn.items()}
    return made | {f"wiring-{name}.svg": _small(one).text() for name, one in SMALL.items()}


def _small(panel: Small) -> Drawing:
    drawing = Drawing(width=900, height=640 + 20 * len(panel.notes), title=panel.title)
    drawing.words(24, 28, panel.title, size=18, bold=True)
    starts = boards.pico(drawing, 40, 90, {wire.pin for wire in panel.wires})
    ends = boards.module(drawing, 640, 312, panel.pins, panel.board)
    _lay(drawing, [(starts[wire.pin], ends[wire.to], wire.colour) for wire in panel.wires], 330, 610)
    _notes(drawing, panel.notes)
    return drawing


def _pi_spi() -> Drawing:
    title = "Four 8x8 matrices with MAX7219 on the box's own pins (spi:/dev/spidev0.0)"
    notes = ("No microcontroller: the Raspberry Pi drives the panel itself. See the page for what to switch on.",)
    drawing = Drawing(width=860, height=540, title=title)
    drawing.words(24, 28, title, size=18, bold=True)
    starts = boards.pi_header(drawing, 200, 110, {wire.pin for wire in PI_WIRES})
    ends = boards.module(drawing, 620, 202, ("VCC", "GND", "DIN", "CS", "CLK"), "4 x MAX7219, side IN")
    _lay(drawing, [(starts[wire.pin], ends[wire.to], wire.colour) for wire in PI_WIRES], 410, 580, between=200 + 29)
    _notes(drawing, notes)
    return drawing


def _hub75() -> Drawing:
    title = "HUB75 panel of 64 x 32 on a Pico (hub75-64x32)"
    notes = (
        "The panel takes up to 4 A at 5 V: it has a supply of its own, never the Pico's. GND of both is joined by the ribbon.",
        "The panel wants 3.5 V for a one, the Pico gives 3.3 V: most take it. If it flickers, put two 74AHCT245 in between.",
        "E is not used by panels of 64 x 32, where that place is often a second GND: leave that wire out then.",
        "Panels with FM6126A or ICN2038S chips want to be set up first and stay dark.",
    )
    drawing = Drawing(width=1000, height=752, title=title)
    drawing.words(24, 28, title, size=18, bold=True)
    starts = boards.pico(drawing, 700, 70, {wire.pin for wire in HUB75_WIRES})
    names = tuple(f"{name} ({place})" for place, name in enumerate(HUB75, start=1))
    ends = boards.module(drawing, 40, 76, names, "socket IN of the panel", pins_left=False, width=200)
    places = {name: ends[f"{name} ({place})"] for place, name in reversed(list(enumerate(HUB75, start=1)))}
    _lay(drawing, [(starts[wire.pin], places[wire.to], wire.colour) for wire in HUB75_WIRES], 680, 270)
    drawing.box(40, 570, 200, 40, fill="#f7e3df", radius=8)
    drawing.words(140, 590, "5 V supply, 4 A: panel only", size=13, anchor="middle", bold=True)
    drawing.wire([(80, 570), (80, 526)], colour=RED, width=5)
    drawing.wire([(110, 570), (110, 526)], colour=BLACK, width=5)
    _socket(drawing, 300, 498)
    _notes(drawing, notes)
    return drawing


def _socket(drawing: Drawing, x: float, y: float) -> None:
    """The socket as it is seen on the panel's back, the notch on the left."""
    drawing.box(x, y, 110, 8 * 17 + 12, fill="#39424e")
    drawing.box(x - 4, y + 60, 10, 28, fill="#ffffff", line="#39424e", radius=1)
    for place, name in enumerate(HUB75, start=1):
        at_x, at_y = x + (32 if place % 2 else 78), y + 15 + 17 * ((place - 1) // 2)
        drawing.words(at_x, at_y, name, size=11, anchor="middle", fill="#ffffff", bold=True)
    for line, text in enumerate(
        ("The socket IN, seen from", "behind, its notch on the left:", "1 and 2 on top, 15 and 16", "at the bottom.")
    ):
        drawing.words(x + 124, y + 20 + 18 * line, text, size=12, fill=FAINT)


def _overview() -> Drawing:
    title = "What is plugged into what"
    drawing = Drawing(width=900, height=430, title=title)
    drawing.words(24, 28, title, size=18, bold=True)
    places = {
        "camera": (40, 80, ("USB camera", "over the track")),
        "box": (350, 170, ("Raspberry Pi", "with dnb-edge")),
        "pico": (660, 80, ("Pico", "with the display's firmware")),
        "panel": (660, 250, ("LED panel or OLED", "4 to 15 wires: see below")),
        "supply": (40, 250, ("5 V USB-C supply", "of the Raspberry Pi")),
        "own": (350, 330, ("5 V supply, 4 A", "HUB75 panels only")),
    }
    join = _Joins(drawing, {name: (x, y) for name, (x, y, _) in places.items()})
    join.draw("camera", "box", BLUE, "USB, 3 m at most; a blue USB 3 socket")
    join.draw("pico", "box", BLUE, "USB, micro-B or USB-C")
    join.draw("supply", "box", RED, "")
    drawing.wire([(760, 160), (760, 250)], colour=VIOLET, width=4)
    drawing.wire([(550, 365), (690, 365), (690, 330)], colour=RED, width=4)
    for x, y, lines in places.values():
        drawing.box(x, y, 200, 80, fill="#e6ecf8", radius=10)
        drawing.words(x + 100, y + 30, lines[0], size=15, anchor="middle", bold=True)
        drawing.words(x + 100, y + 54, lines[1], size=13, anchor="middle", fill=FAINT)
    return drawing


@dataclass(frozen=True, slots=True)
class _Joins:
    """Cables between boxes of 200 x 80."""

    drawing: Drawing
    corners: Mapping[str, tuple[float, float]]

    def draw(self, outer: str, inner: str, colour: str, text: str) -> None:
        """From the side of `outer` that looks at `inner`."""
        (ox, oy), (ix, iy) = self.corners[outer], self.corners[inner]
        start = (ox + 200, oy + 40) if ox < ix else (ox, oy + 40)
        end_x = ix if ox < ix else ix + 200
        end = (end_x, iy + (25 if oy < iy else 55))
        middle = (start[0] + end[0]) / 2
        self.drawing.wire([start, (middle, start[1]), (middle, end[1]), end], colour=colour, width=4)
        self.drawing.words((ox + ix + 200) / 2, oy - 16, text, size=12, anchor="middle", fill=FAINT)


def _lay(
    drawing: Drawing,
    joins: Sequence[tuple[Point, Point, str]],
    near: float,
    far: float,
    *,
    between: float | None = None,
) -> None:
    """Wires from starts to ends, each with a lane of its own between `near` (the starts' side) and `far`.

    Wires that go up have their lanes in one order, those that go down in the other, so that few cross. Where `between` is given
    wires leave between two rows of pins: half a pitch lower left of that x, half a pitch higher right of it.
    """
    order = sorted(
        joins, key=lambda join: (join[1][1] > join[0][1], -join[0][1] if join[1][1] > join[0][1] else join[0][1])
    )
    step = (far - near) / (len(order) + 1)
    for place, (start, end, colour) in enumerate(order, start=1):
        lane = near + step * place
        points = [start]
        level = start[1]
        if between is not None:
            level += boards.PITCH / 2 if start[0] < between else -boards.PITCH / 2
            points.append((start[0] + 12, level))
        drawing.wire([*points, (lane, level), (lane, end[1]), end], colour=colour)
        for x, y in (start, end):
            drawing.dot(x, y, 4, fill=colour, line=INK)


def _notes(drawing: Drawing, notes: Sequence[str]) -> None:
    for place, text in enumerate(reversed(notes)):
        drawing.words(24, drawing.height - 22 - 20 * place, text, size=13)
