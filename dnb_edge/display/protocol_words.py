"""How the line protocol writes and reads numbers and texts. Knows no message."""

from __future__ import annotations

import re
import unicodedata

# Numbers are bounded so that 32 bits hold them in milliseconds on a microcontroller; no leading zeros, no signs.
INT = r"(0|[1-9][0-9]{0,5})"
NUMBER = r"(?:0|[1-9][0-9]{0,5})\.[0-9]{3}"
SECONDS = rf"({NUMBER})"
TENTHS = r"((?:0|[1-9][0-9]{0,5})\.[0-9]|-)"
TEXT = r"([!-)+-~]+(?: [!-)+-~]+)*)"


def plain(text: str) -> str:
    """`text` in printable ASCII without `*`, in words parted by single spaces.

    Accents are dropped, anything else becomes `?`, and nothing at all a hyphen.
    """
    bare = unicodedata.normalize("NFKD", text.replace("±", "+-"))
    bare = "".join(char for char in bare if not unicodedata.combining(char))
    return re.sub(r"[^ -)+-~]", "?", " ".join(bare.split())) or "-"


# max(0.0, value), in this order, makes 0.0 of -0.0.
def seconds(value: float) -> str:
    """`value` as the protocol writes seconds."""
    return f"{min(max(0.0, value), 999_999.999):.3f}"


def tenths(value: float | None) -> str:
    """`value` with one decimal; a hyphen for none."""
    return "-" if value is None else f"{min(max(0.0, value), 999_999.9):.1f}"


def maybe_int(word: str | None) -> int | None:
    """The number of a word that may be missing."""
    return None if word is None else int(word)


def maybe_float(word: str | None) -> float | None:
    """The number of a word that may be missing or a hyphen."""
    return None if word in {None, "-"} else float(str(word))
