"""A picture of coloured pixels in a bytearray, and how rectangles and texts are put into it. Runs on MicroPython."""

from .glyphs import TALL, Font

DARK, WHITE, RED, GREEN, AMBER, BLUE, VIOLET, CYAN = range(8)

COLOURS = (
    (0, 0, 0),
    (255, 255, 255),
    (255, 40, 30),
    (40, 255, 70),
    (255, 190, 0),
    (60, 90, 255),
    (220, 60, 255),
    (50, 200, 255),
)
"""Red, green and blue of each colour, 0 to 255: those of a matrix whose three lights a pixel are on or off. A panel of one
colour lights whatever is not dark."""


class Canvas:
    """`width` x `height` pixels; `buffer` has them row by row from the top left, one byte each, an index of `COLOURS`."""

    def __init__(self, width: int, height: int, layout: str = "") -> None:
        self.width = width
        self.height = height
        self.layout = layout
        """Which face belongs on it."""
        self.buffer = bytearray(width * height)

    def clear(self) -> None:
        """All dark."""
        self.fill(0, 0, self.width, self.height, DARK)

    def set(self, x: int, y: int, colour: int) -> None:
        """One pixel; nothing outside the picture."""
        if 0 <= x < self.width and 0 <= y < self.height:
            self.buffer[y * self.width + x] = colour

    def fill(self, x: int, y: int, width: int, height: int, colour: int) -> None:
        """A rectangle, as far as it is inside the picture."""
        left, right = max(0, x), min(self.width, x + width)
        if left >= right:
            return
        row = bytes([colour]) * (right - left)
        for at in range(max(0, y), min(self.height, y + height)):
            start = at * self.width
            self.buffer[start + left : start + right] = row

    def invert(self, colour: int) -> None:
        """What is dark gets `colour`, what is lit gets dark."""
        swap = self.buffer
        for at in range(len(swap)):
            swap[at] = DARK if swap[at] else colour

    def text(self, x: int, y: int, text: str, colour: int, font: Font = TALL, scale: int = 1) -> int:
        """`text` from the top left (x, y) on, each pixel of the lettering `scale` wide and high; returns its width."""
        at = x
        for character in text:
            width, rows = font.glyph(character)
            if at < self.width and at + width * scale > 0:
                self._glyph(at, y, width, rows, colour, scale)
            at += (width + 1) * scale
        return max(0, at - x - scale)

    def _glyph(self, x: int, y: int, width: int, rows: bytes, colour: int, scale: int) -> None:
        for row in rows:
            bit = 1 << (width - 1)
            for at in range(x, x + width * scale, scale):
                if row & bit:
                    if scale == 1:
                        self.set(at, y, colour)
                    else:
                        self.fill(at, y, scale, scale, colour)
                bit >>= 1
            y += scale
