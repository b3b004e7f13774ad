"""The log of a live run, written in a thread of its own: a terminal that was stopped, or a full pipe, holds up no race.

Knows Python's logging. Knows no race.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from dnb_edge.daemon.aside import Aside

CLOSE_S = 0.5


class _AsideHandler(logging.Handler):
    """Hands records to another handler in a thread of its own."""

    def __init__(self, inner: logging.Handler) -> None:
        super().__init__(inner.level)
        self._inner = inner
        self._aside: Aside[logging.LogRecord] = Aside("log", self._write)

    def emit(self, record: logging.LogRecord) -> None:
        self._aside.put(record)

    def _write(self, record: logging.LogRecord) -> None:
        self._inner.handle(record)

    def close(self) -> None:
        self._aside.close(CLOSE_S)
        super().close()


@contextmanager
def log_aside(logger: logging.Logger | None = None) -> Iterator[None]:
    """Has all handlers of `logger`, by default the root's, work in threads of their own for as long as the context lasts."""
    logger = logging.getLogger() if logger is None else logger
    before = list(logger.handlers)
    behind = [_AsideHandler(handler) for handler in before]
    for old, new in zip(before, behind, strict=True):
        logger.removeHandler(old)
        logger.addHandler(new)
    try:
        yield
    finally:
        for old, new in zip(before, behind, strict=True):
            logger.removeHandler(new)
            new.close()
            logger.addHandler(old)
