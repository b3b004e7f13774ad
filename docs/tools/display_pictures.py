"""The pictures of docs/display.md, drawn by the panels' own code: `python docs/tools/display_pictures.py`.

Knows the panel's modules and SVG as text, so that the same code gives the same bytes on every machine.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from dnb_edge.display.panel import face
from dnb_edge.display.panel.pixels import COLOURS, DARK, RED, Canvas
from dnb_edge.display.panel.segments import DOT, Digits
from dnb_edge.display.panel.state import Panel

FOLDER = Path(__file__).resolve().parents[1] / "pictures" / "display"

INK, PAPER, CASE, UNLIT = "#1a1b1f", "#ffffff", "#0b0b0c", "#232326"
CELL: Final = {"matrix-32x8": 8.0, "matrix-64x32": 4.0, "oled-128x64": 3.0}
"""Side of one of the panel's pixels, by layout."""
MONO = {"matrix-32x8": COLOURS[RED], "oled-128x64": (190, 225, 255)}
DIGIT_WIDTH, DIGIT_HEIGHT = 34.0, 54.0
EDGE, GAP, CAPTION = 6.0, 18.0, 20.0
"""Of a panel's case round its pixels, between panels, for the words above one."""

Bodies = Sequence[str]
Scene = tuple[str, Sequence[tuple[int, Bodies]], int]
"""Words, what is told when (milliseconds), and when the picture is taken."""

LAP = (
    "HELLO DNB-EDGE 1", "STATE LAP 3 OF 5", "LAP 1 12.483 +-0.002 OK 95.8", "LAP 2 13.207 +-0.003 OK 91.2",
    "BEST 1 12.483", "LIVE -0.214 95.8", "HEALTH FPS 29.9 REC RECORDING WARNINGS 0", "RUN 3 4.200",
)  # fmt: skip
BEFORE = ("HELLO DNB-EDGE 1", "STATE WAITING", "HEALTH FPS 29.9 REC RECORDING WARNINGS 0", "RUN - -")
LOST = (*LAP[:6], "HEALTH FPS - REC RECORDING WARNINGS 1", "WARN 1 the camera is gone", LAP[-1])
BEST = ("LAP 3 12.180 +-0.002 OK 97.0", "BEST 3 12.180", "RUN 4 0.033")
BAD = ("LAP 3 14.000 +-0.010 BAD -", "WHY 3 off the lane for 0.8 s", "RUN 4 0.033")
CODE = (*BEFORE[:3], "NOTE set-up code 4711 0815", BEFORE[-1])
GRID = (*BEFORE[:3], "GRID waiting for 2 cars to stand on the grid", BEFORE[-1])
CARS = (
    "HELLO DNB-EDGE 1", "CAR 2 Anna", "STATE LAP 6", "LAP 5 12.483 +-0.002 OK 95.8", "BEST 5 12.483",
    "PLACE 1 2 5 12.483 - IN Anna", "PLACE 2 1 4 12.591 0.108 IN Ben", "HEALTH FPS 29.9 REC RECORDING WARNINGS 0",
    "RUN 6 7.300",
)  # fmt: skip
END = ("HELLO DNB-EDGE 1", "STATE FINISHED", *LAP[2:5], "RUN - -")

RUNNING: Scene = ("a lap is running", [(0, LAP)], 1480)
FACES: tuple[Scene, ...] = (
    ("switched on", [], 1200),
    ("no car yet", [(0, BEFORE)], 0),
    ("set-up code", [(0, CODE), (4000, BEFORE[-1:])], 6300),
    ("on the grid", [(0, GRID)], 0),
    ("countdown", [(0, (*BEFORE[:3], "COUNT 3.0", BEFORE[-1]))], 0),
    ("go", [(0, (*BEFORE[:3], "COUNT 0.1", BEFORE[-1])), (200, ("GO 300.0", "RUN - -"))], 840),
    RUNNING,
    ("the car crosses", [(0, LAP), (8000, ("CROSS 39.890", "RUN 3 12.200"))], 8040),
    ("a new lap", [(0, LAP), (9000, ("LAP 3 13.180 +-0.002 OK 93.0", "RUN 4 0.033"))], 10000),
    ("the best lap", [(0, LAP), (9000, BEST)], 10000),
    ("a bad lap", [(0, LAP), (9000, BAD)], 10000),
    ("camera lost", [(0, LOST)], 1400),
    ("two cars", [(0, CARS)], 1000),
    ("finished", [(0, END)], 2000),
    ("silence", [(0, LAP)], 3640),
)


def drawn(layout: str, scene: Scene) -> Canvas | Digits:
    """The panel's picture of a scene."""
    panel, surface = Panel(), face.surface(layout)
    for t_ms, bodies in scene[1]:
        for body in bodies:
            checksum = 0
            for byte in body.encode():
                checksum ^= byte
            panel.feed(f"{body} *{checksum:02X}\r\n".encode(), t_ms)
    face.draw(panel, surface, scene[2])
    return surface


def size(layout: str) -> tuple[float, float]:
    """Width and height of a panel with its case."""
    if layout == "digits-8":
        return 8 * DIGIT_WIDTH + 2 * EDGE, DIGIT_HEIGHT + 2 * EDGE
    surface = face.surface(layout)
    return surface.width * CELL[layout] + 2 * EDGE, surface.height * CELL[layout] + 2 * EDGE


def panel_at(x: float, y: float, layout: str, scene: Scene, words: str) -> str:
    """One panel with its caption, its top left at (x, y)."""
    width, height = size(layout)
    surface = drawn(layout, scene)
    inside = _digits(surface) if isinstance(surface, Digits) else _pixels(surface)
    return (
        f'<g transform="translate({x:g} {y:g})"><text x="0" y="13">{words}</text>'
        f'<g transform="translate(0 {CAPTION:g})"><rect width="{width:g}" height="{height:g}" rx="4" fill="{CASE}"/>'
        f'<g transform="translate({EDGE:g} {EDGE:g})">{inside}</g></g></g>\n'
    )


def _pixels(canvas: Canvas) -> str:
    cell = CELL[canvas.layout]
    parts = []
    for value, colour in enumerate(COLOURS):
        lit = MONO.get(canvas.layout, colour)
        dots = "".join(
            f"M{(at % canvas.width + 0.5) * cell:g} {(at // canvas.width + 0.5) * cell:g}h0"
            for at in range(len(canvas.buffer))
            if canvas.buffer[at] == value
        )
        if value == DARK:
            # Each dark light by itself would be most of the file.
            columns = "".join(
                f"M{(x + 0.5) * cell:g} {cell / 2:g}V{canvas.height * cell:g}" for x in range(canvas.width)
            )
            dash = f'stroke-dasharray="0 {cell:g}"'
            parts.append(f'<path d="{columns}" stroke="{UNLIT}" stroke-width="{0.8 * cell:g}" {dash}/>')
        elif dots:
            parts.append(f'<path d="{dots}" stroke="{_hex(lit)}" stroke-width="{0.84 * cell:g}"/>')
    return f'<g stroke-linecap="round" fill="none">{"".join(parts)}</g>'


def _digits(digits: Digits) -> str:
    ends = (
        (8, 5, 23, 5),
        (26, 8, 26, 24),
        (26, 30, 26, 46),
        (8, 49, 23, 49),
        (5, 30, 5, 46),
        (5, 8, 5, 24),
        (8, 27, 23, 27),
    )
    parts = []
    for place, bits in enumerate(digits.buffer):
        left = place * DIGIT_WIDTH
        for segment, (x0, y0, x1, y1) in enumerate(ends):
            colour = _hex(COLOURS[RED]) if bits >> segment & 1 else UNLIT
            parts.append(f'<path d="M{left + x0:g} {y0}L{left + x1:g} {y1}" stroke="{colour}"/>')
        parts.append(f'<path d="M{left + 31:g} 49h0" stroke="{_hex(COLOURS[RED]) if bits & DOT else UNLIT}"/>')
    return f'<g stroke-linecap="round" stroke-width="4" fill="none">{"".join(parts)}</g>'


def _hex(colour: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)


def sheet(title: str, columns: Sequence[Sequence[tuple[str, Scene, str]]]) -> str:
    """Columns of panels: layout, scene, caption."""
    x, parts, height = GAP, [], 0.0
    for column in columns:
        y = GAP
        for layout, scene, words in column:
            parts.append(panel_at(x, y, layout, scene, words))
            y += CAPTION + size(layout)[1] + GAP
        height = max(height, y)
        x += max(size(layout)[0] for layout, _, _ in column) + GAP
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{x:g}" height="{height:g}" '
        f'viewBox="0 0 {x:g} {height:g}" role="img">\n'
        f"<title>{title}</title>\n"
        f'<rect width="{x:g}" height="{height:g}" fill="{PAPER}"/>\n'
        f'<g font-family="sans-serif" font-size="14" fill="{INK}">\n{"".join(parts)}</g>\n</svg>\n'
    )


def panels() -> str:
    """The four panels side by side, the same lap on each."""
    left = [(name, RUNNING, name) for name in ("matrix-32x8", "digits-8", "matrix-64x32")]
    return sheet("The four panels during a lap", [left, [("oled-128x64", RUNNING, "oled-128x64")]])


def faces() -> str:
    """What the large matrix shows, scene by scene."""
    each = [("matrix-64x32", scene, scene[0]) for scene in FACES]
    return sheet("What a panel of 64 by 32 pixels shows", [each[at : at + 5] for at in range(0, len(each), 5)])


def small_faces() -> str:
    """The same on the row of letters and on the digits."""
    row = [("matrix-32x8", scene, scene[0]) for scene in FACES]
    digits = [("digits-8", scene, scene[0]) for scene in FACES]
    return sheet("What a row of 32 by 8 pixels and eight digits show", [row[:8], row[8:], digits[:8], digits[8:]])


PICTURES: dict[str, Callable[[], str]] = {"panels.svg": panels, "faces.svg": faces, "small-faces.svg": small_faces}


def main() -> int:
    """Writes all of them."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, picture in PICTURES.items():
        (FOLDER / name).write_text(picture(), encoding="utf-8")
        sys.stdout.write(f"{name}: written\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
