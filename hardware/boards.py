"""The electronics that there is a case for: single-board computers and displays, with their sizes in mm.

Knows sizes from the makers' drawings (`source`). Knows no part and no wiring.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Display:
    """A display module behind a window; the window's middle may lie off the module's."""

    name: str
    title: str
    module_mm: tuple[float, float]
    """Width and height of the module's widest part."""
    depth_mm: float
    """From the face that touches the bezel to the tallest part at the back."""
    window_mm: tuple[float, float]
    window_off_mm: tuple[float, float] = (0.0, 0.0)
    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Computer:
    """A board of the Raspberry Pi's outline; x along the long side from the card's end, y from the side of the USB-C socket."""

    name: str
    title: str
    board_mm: tuple[float, float]
    holes_mm: tuple[tuple[float, float], ...]
    thickness_mm: float
    below_mm: float
    """Room below the board."""
    above_mm: float
    """Room above it: the USB sockets, a cooler."""
    source: str


PI = Computer(
    name="pi",
    title="Raspberry Pi 4 and 5",
    board_mm=(85.0, 56.0),
    holes_mm=((3.5, 3.5), (61.5, 3.5), (3.5, 52.5), (61.5, 52.5)),
    thickness_mm=1.4,
    below_mm=5.0,
    above_mm=24.0,
    source="maker's drawings: 85 x 56 mm, four 2.7 mm holes 58 x 49 mm apart; the 5's active cooler fits",
)

MATRIX_32X8 = Display(
    name="max7219-32x8",
    title="four 8 x 8 LED matrices with MAX7219, 32 x 8",
    module_mm=(130.0, 32.6),
    depth_mm=15.0,
    window_mm=(128.4, 32.0),
    source="sellers' drawings: 128 to 130 x 32 mm",
)
PANEL_64X32 = Display(
    name="hub75-64x32",
    title="HUB75 panel, 64 x 32, 3 mm pitch",
    module_mm=(192.6, 96.6),
    depth_mm=16.0,
    window_mm=(190.0, 94.0),
    source="sellers' drawings: 192 x 96 mm, 13 to 15 mm deep with plugs",
)
SEVEN_SEGMENT = Display(
    name="seven-segment-8",
    title="eight seven-segment digits with MAX7219",
    module_mm=(82.8, 15.8),
    depth_mm=13.0,
    window_mm=(61.0, 14.6),
    source="sellers' drawings: 82 x 15 mm board, digits 60.5 x 14.2 mm in its middle",
)
OLED = Display(
    name="oled-128x64",
    title="OLED, 128 x 64, 0.96 inch, SSD1306",
    module_mm=(28.0, 28.0),
    depth_mm=8.0,
    window_mm=(24.0, 14.0),
    window_off_mm=(0.0, 1.5),
    source="sellers' drawings: 27.3 x 27.8 mm board, glass 26.7 x 19.3 mm",
)

DISPLAYS = (MATRIX_32X8, PANEL_64X32, SEVEN_SEGMENT, OLED)

PICO_MM = (51.0, 21.0)
PICO_HOLES_MM = (47.0, 11.4)
"""Between the Raspberry Pi Pico's four 2.1 mm holes."""
