"""From whatever bytes a port gives to the bodies of whole lines whose checksum is right. Runs on MicroPython.

Knows how a line ends, how long it may be and its checksum. Knows no kind of line. It never raises and keeps at most one line.
"""

LONGEST = 80
"""Bytes of a line, its end included."""

_HEX = "0123456789ABCDEF"


class Lines:
    """Puts lines together out of pieces. `strict`: a line without a checksum is dropped, as a display should."""

    def __init__(self, strict: bool = True) -> None:
        self.strict = strict
        self.dropped = 0
        """Lines that were thrown away: too long, not printable, a checksum that is wrong or missing."""
        self._torn = b""
        self._too_long = False

    def feed(self, data: bytes) -> list:
        """The bodies of the lines that end within `data`, as texts, in order."""
        pieces = bytes(data).split(b"\n")
        bodies = []
        for piece in pieces[:-1]:
            body = self._end(piece)
            if body is not None:
                bodies.append(body)
        self._add(pieces[-1])
        return bodies

    def _add(self, piece: bytes) -> None:
        if len(self._torn) + len(piece) >= LONGEST:
            self._torn, self._too_long = b"", True
        elif not self._too_long:
            self._torn += piece

    def _end(self, piece: bytes) -> str | None:
        self._add(piece)
        line, too_long = self._torn, self._too_long
        self._torn, self._too_long = b"", False
        if line[-1:] == b"\r":
            line = line[:-1]
        if not line and not too_long:
            return None
        body = None if too_long else checked(line, self.strict)
        self.dropped += body is None
        return body


def checked(line: bytes, strict: bool = True) -> str | None:
    """The body of `line`, which has no end any more, as a text; None where it or its checksum is not as it should be."""
    for byte in line:
        if not 0x20 <= byte <= 0x7E:
            return None
    text = line.decode()
    if len(line) < 4 or text[-4:-2] != " *" or text[-2] not in _HEX or text[-1] not in _HEX:
        return None if strict else text
    found = 0
    for byte in line[:-4]:
        found ^= byte
    return text[:-4] if found == int(text[-2:], 16) else None
