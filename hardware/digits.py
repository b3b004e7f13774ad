"""Figures and ticks to engrave: made of straight bars, as on a seven-segment display.

Knows strokes and places in mm. Knows no fonts, on purpose: a font differs from machine to machine, and so would the part.
"""

from build123d import Align, Box, Part, Pos

# Which bars of a seven-segment figure are cut: top, upper left, upper right, middle, lower left, lower right, bottom.
_BARS = {
    "0": "1110111",
    "1": "0010010",
    "2": "1011101",
    "3": "1011011",
    "4": "0111010",
    "5": "1101011",
    "6": "1101111",
    "7": "1010010",
    "8": "1111111",
    "9": "1111011",
}


def figure(text: str, *, height_mm: float, stroke_mm: float, depth_mm: float) -> list[Part]:
    """Cutters for a row of figures: centred on the origin, read from +z, from z = -depth to a little above 0.

    Raises KeyError for anything but the digits 0 to 9.
    """
    width = height_mm * 0.55
    pitch = width + stroke_mm + 0.6
    first = -(len(text) - 1) / 2 * pitch
    return [
        Pos(first + place * pitch, 0, 0) * bar
        for place, digit in enumerate(text)
        for bar in _one(digit, width, height_mm, stroke_mm, depth_mm)
    ]


def tick(*, length_mm: float, stroke_mm: float, depth_mm: float) -> Part:
    """A cutter for one line from the origin along +y, engraved as deep as `figure`."""
    return Pos(0, 0, -depth_mm) * Box(stroke_mm, length_mm, depth_mm + 1, align=(Align.CENTER, Align.MIN, Align.MIN))


def _one(digit: str, width: float, height: float, stroke: float, depth: float) -> list[Part]:
    half_w, half_h = width / 2, height / 2
    quarter = half_h / 2
    across, along = (width + stroke, stroke), (stroke, half_h + stroke)
    places = (
        (0.0, half_h, across),
        (-half_w, quarter, along),
        (half_w, quarter, along),
        (0.0, 0.0, across),
        (-half_w, -quarter, along),
        (half_w, -quarter, along),
        (0.0, -half_h, across),
    )
    return [
        Pos(x, y, (1 - depth) / 2) * Box(size_x, size_y, depth + 1)
        for bar, (x, y, (size_x, size_y)) in zip(_BARS[digit], places, strict=True)
        if bar == "1"
    ]
