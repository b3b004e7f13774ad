"""Whether the appliance as a whole gets on, which is what feeds the watchdog.

Knows who must move: capture, the race's own loop, the recorder's thread. Knows no clock: the notifier says when food is due.
"""

from __future__ import annotations

from typing import Protocol

from dnb_edge.display.service import ServiceNotifier


class Writer(Protocol):
    """The recorder, as far as its life goes."""

    @property
    def progress(self) -> int:
        """Grows for as long as the writer's thread lives and the disk answers, with or without anything to write."""

    @property
    def state(self) -> str:
        """`recording`, or what else has been declared: then nobody waits for progress."""


class Progress:
    """Feeds the watchdog where everybody moved since it was fed last, or has said what is wrong."""

    def __init__(self, notifier: ServiceNotifier, writer: Writer | None) -> None:
        self._notifier = notifier
        self._writer = writer
        self._captured = 0
        self._written = None if writer is None else writer.progress

    def stepped(self, *, captured: int) -> None:
        """The race's loop went round once; `captured` grows with each frame, and each attempt to open a lost camera."""
        if self._notifier.feed(progressed=captured != self._captured and self._writes()):
            self._captured = captured
            self._written = None if self._writer is None else self._writer.progress

    def _writes(self) -> bool:
        if self._writer is None or self._writer.state != "recording":
            return True
        return self._writer.progress != self._written
