"""What each kind of line looks like, in version 1 of the line protocol, and what it says. Runs on MicroPython.

Knows one line's body, without its checksum; see docs/display-protocol.md. Knows no bytes and no state.
"""

_FORMS = {
    "HELLO": ("DNB-EDGE i",),
    "CAR": ("i x",),
    "STATE": ("WAITING", "OUT-LAP", "FINISHED", "LAP i", "LAP i OF i"),
    "GRID": ("x",),
    "COUNT": ("t",),
    "GO": ("t",),
    "RUN": ("- -", "i s"),
    "CROSS": ("s",),
    "LAP": ("i s g OK t", "i s g BAD t"),
    "PENALTY": ("i s x",),
    "WHY": ("i x",),
    "SUSPECT": ("i x",),
    "BEST": ("i s",),
    "CARLAP": ("i i s OK", "i i s BAD"),
    "PLACE": ("p i i m m IN x", "p i i m m OUT x"),
    "LIVE": ("d t",),
    "SAVED": ("i",),
    "HEALTH": ("FPS t REC NONE WARNINGS i", "FPS t REC RECORDING WARNINGS i", "FPS t REC FAILED WARNINGS i"),
    "WARN": ("i x",),
    "NOTE": ("x",),
}
"""The forms of each kind. Small letters stand for what is read: i a whole number, s seconds, m seconds or none, g a sigma,
d a difference or none, t tenths or none, p a place, x the rest as a text. Anything else stands for itself."""

_LONGEST = 6
"""Digits of a whole number."""


class Misspelt(Exception):
    """A word is not what its place asks for."""


def parse(body: str) -> list | None:
    """The line's first word and what follows it, seconds as milliseconds and tenths as tenths, whole numbers both.

    Only the first word where the kind is not known; None where a known one is misspelt.
    """
    words = body.split(" ")
    if "" in words or "*" in body:
        return None
    for form in _FORMS.get(words[0], ()):
        try:
            return [words[0]] + _read(form.split(" "), words[1:])
        except Misspelt:
            pass
    return None if words[0] in _FORMS else [words[0]]


def _read(form: list, words: list) -> list:
    if form[-1] == "x" and len(words) > len(form):
        words = words[: len(form) - 1] + [" ".join(words[len(form) - 1 :])]
    if len(words) != len(form):
        raise Misspelt
    return [_word(kind, word) for kind, word in zip(form, words)]  # noqa: B905 MicroPython's zip is never strict


def _word(kind: str, word: str):
    if kind in _READERS:
        return _READERS[kind](word)
    if kind != word:
        raise Misspelt
    return word


def _whole(word: str) -> int:
    """Digits without leading zeros."""
    if not word or len(word) > _LONGEST or (word[0] == "0" and len(word) > 1):
        raise Misspelt
    return _digits(word)


def _digits(word: str) -> int:
    value = 0
    for character in word:
        if not "0" <= character <= "9":
            raise Misspelt
        value = 10 * value + ord(character) - 48
    return value


def _decimal(word: str, places: int) -> int:
    """A number with exactly so many decimals, as a whole number of its last one."""
    point = len(word) - 1 - places
    if point < 1 or word[point] != ".":
        raise Misspelt
    return _whole(word[:point]) * int("1" + places * "0") + _digits(word[point + 1 :])


def _seconds(word: str) -> int:
    return _decimal(word, 3)


def _sigma(word: str) -> int:
    if word[:2] != "+-":
        raise Misspelt
    return _decimal(word[2:], 3)


def _maybe_seconds(word: str):
    return None if word == "-" else _decimal(word, 3)


def _difference(word: str):
    if word == "-":
        return None
    if word[0] not in "+-":
        raise Misspelt
    value = _decimal(word[1:], 3)
    return -value if word[0] == "-" else value


def _tenths(word: str):
    return None if word == "-" else _decimal(word, 1)


def _place(word: str) -> tuple:
    """The place, and whether it is shared."""
    shared = word[-1:] == "="
    return (_whole(word[:-1] if shared else word), shared)


def _text(word: str) -> str:
    return word


_READERS = {
    "i": _whole,
    "s": _seconds,
    "m": _maybe_seconds,
    "g": _sigma,
    "d": _difference,
    "t": _tenths,
    "p": _place,
    "x": _text,
}
