"""Work that may hang, in a thread of its own with a bounded queue: whoever hands it over never waits.

Knows threads and counts. Knows nothing of the work: lines for a pipe that nobody reads, messages for a log that is stuck.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")

CAPACITY = 4096


class Aside(Generic[T]):
    """Does `work(item)` for each item, in order, in its own thread; the thread ends with the first `OSError`, which is kept."""

    def __init__(self, name: str, work: Callable[[T], None], *, capacity: int = CAPACITY) -> None:
        self._work = work
        self._capacity = capacity
        self._changed = threading.Condition()
        self._items: deque[T] = deque()
        self._closed = False
        self.lost = 0
        """Items for which there was no room."""
        self.failure: OSError | None = None
        """What ended the work; None while all is well."""
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def put(self, item: T, *, vital: bool = False) -> None:
        """Hands `item` over at once; where the queue is full it is lost and counted, unless it is `vital`: of those there are
        a few a minute."""
        with self._changed:
            if self._closed or self.failure is not None:
                return
            if not vital and len(self._items) >= self._capacity:
                self.lost += 1
                return
            self._items.append(item)
            self._changed.notify_all()

    def close(self, timeout_s: float) -> bool:
        """Lets the thread do what waits; True where it has done all within `timeout_s`. The thread is left behind otherwise."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join(timeout_s)
        return not self._thread.is_alive() and self.failure is None

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._items or self._closed)
                if not self._items:
                    return
                item = self._items.popleft()
            try:
                self._work(item)
            except OSError as error:
                with self._changed:
                    self.failure = error
                    self._items.clear()
                return
