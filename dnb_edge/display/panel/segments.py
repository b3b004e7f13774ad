"""Eight digits of seven segments and a dot, and how texts are put on them. Runs on MicroPython."""

#     a
#   f   b
#     g
#   e   c
#     d   dot
DOT = 0x80

_SHAPES = {
    "0": "abcdef", "1": "bc", "2": "abdeg", "3": "abcdg", "4": "bcfg", "5": "acdfg", "6": "acdefg", "7": "abc",
    "8": "abcdefg", "9": "abcdfg", "-": "g", "_": "d", "=": "dg", "'": "b", '"': "bf", "[": "adef", "]": "abcd",
    "(": "adef", ")": "abcd", "?": "abeg", "!": "bc", "/": "beg", "+": "efg",
    "a": "abcefg", "b": "cdefg", "c": "deg", "d": "bcdeg", "e": "adefg", "f": "aefg", "g": "acdef", "h": "cefg",
    "i": "c", "j": "bcde", "k": "acefg", "l": "def", "m": "aceg", "n": "ceg", "o": "cdeg", "p": "abefg", "q": "abcfg",
    "r": "eg", "s": "acdfg", "t": "defg", "u": "cde", "v": "cdef", "w": "bdfg", "x": "bcefg", "y": "bcdfg", "z": "abdeg",
}  # fmt: skip


def shape(character: str) -> int:
    """Bits 0 to 6 are the segments a to g; nothing where no likeness is known. Small letters and capitals look the same."""
    bits = 0
    for segment in _SHAPES.get(character.lower(), ""):
        bits |= 1 << (ord(segment) - 0x61)
    return bits


def shapes(text: str) -> list[int]:
    """`text` as digits: a dot, a comma or a colon lights the dot of the digit before it."""
    digits: list[int] = []
    for character in text:
        if character in ".,:" and digits and not digits[-1] & DOT:
            digits[-1] |= DOT
        else:
            digits.append(DOT if character in ".,:" else shape(character))
    return digits


class Digits:
    """`buffer` has a byte a digit from the left: bits 0 to 6 are the segments a to g, bit 7 is the dot."""

    def __init__(self, count: int, layout: str = "") -> None:
        self.count = count
        self.layout = layout
        """Which face belongs on it."""
        self.buffer = bytearray(count)

    def clear(self) -> None:
        """All dark."""
        for at in range(self.count):
            self.buffer[at] = 0

    def text(self, at: int, text: str) -> None:
        """`text` from the digit `at` on, which may be negative; what does not fit is left out."""
        for bits in shapes(text):
            if 0 <= at < self.count:
                self.buffer[at] = bits
            at += 1

    def right(self, text: str) -> None:
        """`text` at the right end."""
        self.text(self.count - len(shapes(text)), text)
