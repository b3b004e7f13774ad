"""A lap display's picture for people: as an image, as characters in a terminal, as plain text for comparing.

Knows the panel's canvas and digits and how such panels look; draws nothing of its own. Knows no port and no clock.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.style import Style
from rich.text import Text

from dnb_edge.display.panel.pixels import COLOURS, DARK, RED, Canvas
from dnb_edge.display.panel.segments import DOT, Digits

LETTERS = ".wrgabvc"
"""One letter for each of the panel's colours, dark first."""

WIDEST_LETTERS = 64
"""Pixels of a row that are a character each; of a wider one eight are."""
_CELL_PX = {8: 20, 32: 12, 64: 7}
"""Side of one of the panel's pixels in an image, by the panel's height."""
_UNLIT = (26, 26, 26)
_MONO = {"matrix-32x8": COLOURS[RED], "oled-128x64": (190, 225, 255)}
"""What panels of one colour light, red, green, blue."""
_DIGIT_PX = (70, 110)
_BRAILLE_BITS = ((0, 3), (1, 4), (2, 5), (6, 7))
"""The bit of each dot of a Braille character, by row and column."""

Surface = Canvas | Digits
Rgb = tuple[int, int, int]


def plain(surface: Surface) -> str:
    """The picture as text: a letter of `LETTERS` a pixel; Braille, lit or not, where the panel is wide; digits as on paper."""
    if isinstance(surface, Digits):
        return "\n".join(_digit_rows(surface)) + "\n"
    rows = pixels(surface)
    if surface.width > WIDEST_LETTERS:
        return "\n".join(_braille(rows)) + "\n"
    return "".join("".join(LETTERS[value] for value in row) + "\n" for row in rows)


def pixels(canvas: Canvas) -> NDArray[np.uint8]:
    """Indices of `COLOURS`, height x width."""
    return np.frombuffer(bytes(canvas.buffer), dtype=np.uint8).reshape(canvas.height, canvas.width)


def in_terminal(surface: Surface, *, colour: bool = True) -> Text:
    """In characters: two pixels a character in colour, eight without or where the panel is wide, digits as on paper."""
    if isinstance(surface, Digits):
        return Text("\n".join(_digit_rows(surface)), style="bold red", no_wrap=True, overflow="crop")
    rows = pixels(surface)
    if surface.width > WIDEST_LETTERS or not colour:
        return Text("\n".join(_braille(rows)), style="bold", no_wrap=True, overflow="crop")
    text = Text(no_wrap=True, overflow="crop")
    for upper, lower in zip(rows[::2], rows[1::2], strict=True):
        for above, below in zip(upper, lower, strict=True):
            text.append("▀", Style(color=_hex(_lit(surface, int(above))), bgcolor=_hex(_lit(surface, int(below)))))
        text.append("\n")
    text.right_crop(1)
    return text


def image(surface: Surface) -> NDArray[np.uint8]:
    """The picture as people see the panel, height x width x 3, blue, green, red: round lights on black."""
    if isinstance(surface, Digits):
        return _digits_image(surface)
    cell = _CELL_PX[surface.height]
    scene = np.zeros((surface.height * cell, surface.width * cell, 3), dtype=np.uint8)
    for (y, x), value in np.ndenumerate(pixels(surface)):
        centre = (x * cell + cell // 2, y * cell + cell // 2)
        colour = _lit(surface, int(value))[::-1]
        cv2.circle(scene, centre, cell * 2 // 5, colour, thickness=cv2.FILLED, lineType=cv2.LINE_AA)
    return scene


def png(surface: Surface) -> bytes:
    """`image` as a PNG file."""
    return cv2.imencode(".png", image(surface))[1].tobytes()


def _lit(canvas: Canvas, value: int) -> Rgb:
    if value == DARK:
        return _UNLIT
    return _MONO.get(canvas.layout, COLOURS[value])


def _hex(colour: Rgb) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)


def _braille(rows: NDArray[np.uint8]) -> list[str]:
    lines = []
    for top in range(0, rows.shape[0], 4):
        codes = np.zeros(rows.shape[1] // 2, dtype=np.int64)
        for y, bits in enumerate(_BRAILLE_BITS):
            for x, bit in enumerate(bits):
                codes |= (rows[top + y, x::2] != DARK).astype(np.int64) << bit
        lines.append("".join(chr(0x2800 + int(code)) for code in codes))
    return lines


def _digit_rows(digits: Digits) -> list[str]:
    """Three rows of four characters a digit: ` _ `, `|_|`, `|_|` and the dot."""
    rows = ["", "", ""]
    for bits in digits.buffer:
        a, b, c, d, e, f, g = (bool(bits >> segment & 1) for segment in range(7))
        rows[0] += f" {'_' if a else ' '}  "
        rows[1] += f"{'|' if f else ' '}{'_' if g else ' '}{'|' if b else ' '} "
        rows[2] += f"{'|' if e else ' '}{'_' if d else ' '}{'|' if c else ' '}{'.' if bits & DOT else ' '}"
    return rows


def _digits_image(digits: Digits) -> NDArray[np.uint8]:
    width, height = _DIGIT_PX
    scene = np.zeros((height, width * digits.count, 3), dtype=np.uint8)
    # Ends of the segments a to g in a digit's own pixels.
    ends = (
        ((16, 12), (48, 12)), ((52, 16), (52, 50)), ((52, 58), (52, 92)), ((16, 96), (48, 96)),
        ((12, 58), (12, 92)), ((12, 16), (12, 50)), ((16, 54), (48, 54)),
    )  # fmt: skip
    for place, bits in enumerate(digits.buffer):
        left = place * width
        for segment, ((x0, y0), (x1, y1)) in enumerate(ends):
            colour = (COLOURS[RED] if bits >> segment & 1 else _UNLIT)[::-1]
            cv2.line(scene, (left + x0, y0), (left + x1, y1), colour, thickness=7, lineType=cv2.LINE_AA)
        colour = (COLOURS[RED] if bits & DOT else _UNLIT)[::-1]
        cv2.circle(scene, (left + 62, 96), 5, colour, thickness=cv2.FILLED, lineType=cv2.LINE_AA)
    return scene
