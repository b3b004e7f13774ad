"""A line of text for people at the box, such as the set-up code, and how long it is to be seen.

Knows a clock. Knows no display: whoever shows boards asks for the text, and is told when there is a new one.
"""

from __future__ import annotations

import time
from collections.abc import Callable

LONGEST_S = 3600.0
LONGEST_TEXT = 60
"""Characters: what fits into a line of every display."""


class Notices:
    """The latest notice. Methods may be called from any thread."""

    def __init__(self, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        self._shown: tuple[str, float] | None = None
        self.on_change: Callable[[], None] = _nobody
        """Called, from whichever thread, when there is a new text."""

    def show(self, text: str, for_s: float) -> None:
        """Replaces the notice by `text`, printable and in one line, for so long."""
        plain = "".join(char if char.isprintable() else " " for char in " ".join(text.split()))[:LONGEST_TEXT]
        self._shown = (plain, self._clock_s() + min(for_s, LONGEST_S)) if plain and for_s > 0 else None
        self.on_change()

    @property
    def text(self) -> str | None:
        """What is to be seen now; None where nothing is."""
        shown = self._shown
        return None if shown is None or self._clock_s() >= shown[1] else shown[0]


def _nobody() -> None:
    """Nobody shows boards yet."""
