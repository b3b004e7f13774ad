"""Names that every file system takes, FAT included, and that stay apart where capitals do not count.

Pure. The names that this software gives to recordings stay as they are: files that go on from one another name each other.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable

MOST_LETTERS = 100
"""Of a name; what comes behind it (`.pictures`, a picture's own name) still fits."""

_FORBIDDEN = re.compile(r"[^A-Za-z0-9._()+=@#-]+")
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)
"""What Windows takes for devices, whatever their ending."""


def plain_name(name: str) -> str:
    """`name` where all file systems take it, else the nearest to it that they do, with some digits of its own."""
    plain = _FORBIDDEN.sub("_", name).strip(". ")[:MOST_LETTERS].rstrip(".")
    if plain == name and plain and not _DEVICES.fullmatch(plain):
        return plain
    return with_digits(plain, name)


def plain_names(names: Iterable[str]) -> dict[str, str]:
    """`plain_name` of each, all different even where capitals do not count. The same for the same names in any order."""
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in sorted(set(names)):
        plain = plain_name(name)
        if plain.casefold() in taken:
            plain = with_digits(plain, name)
        taken.add(plain.casefold())
        found[name] = plain
    return found


def with_digits(plain: str, name: str) -> str:
    """`plain` with eight hexadecimal digits that belong to `name` alone."""
    digest = hashlib.sha256(name.encode(errors="surrogateescape")).hexdigest()[:8]
    return f"{plain or 'run'}-{digest}"
