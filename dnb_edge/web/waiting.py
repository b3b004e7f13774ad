"""What waits for one reader: so much and no more. Where it is full the oldest of what may be lost goes first.

Knows order and room; knows nothing of what waits.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class TooSlow(Exception):
    """Its reader left so much waiting that something would be lost which must not be."""


class Waiting(Generic[T]):
    """A queue with one reader, in one event loop."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._items: deque[tuple[T, bool]] = deque()
        self._filled = asyncio.Event()
        self._overrun = False

    def put(self, item: T, *, fleeting: bool = False) -> None:
        """Lets `item` wait; a fleeting one may be dropped for a later one."""
        if len(self._items) >= self._most and not self._drop():
            if fleeting:
                return
            self._overrun = True
        self._items.append((item, fleeting))
        self._filled.set()

    def clear(self) -> None:
        """Nothing waits any more."""
        self._items.clear()
        self._overrun = False

    async def get(self) -> T:
        """The next item, when there is one. Raises `TooSlow`."""
        while not self._items:
            self._filled.clear()
            await self._filled.wait()
        if self._overrun:
            raise TooSlow
        return self._items.popleft()[0]

    def _drop(self) -> bool:
        for place, (_, fleeting) in enumerate(self._items):
            if fleeting:
                del self._items[place]
                return True
        return False
