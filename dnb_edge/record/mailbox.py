"""The bounded queue between the race and the recording's own thread: pictures give way first, laps always get in.

Knows threads and counts. Knows nothing of what the items mean beyond their class.
"""

from __future__ import annotations

import threading
from collections import deque
from enum import Enum
from typing import Generic, TypeVar

T = TypeVar("T")


class Rank(Enum):
    """What happens to an item when there is no room."""

    PICTURE = "gives way"
    EXTRA = "waits for nothing, and has half of the room: the race can be raced again without it"
    DATA = "waits, or is refused and counted"
    VITAL = "always gets in: there are a few a minute"


class Mailbox(Generic[T]):
    """First in, first out. Each item that gets in has a ticket, one higher than the one before it."""

    def __init__(self, *, capacity: int, picture_capacity: int) -> None:
        self._changed = threading.Condition()
        self._items: deque[tuple[int, Rank, T]] = deque()
        self._capacity = capacity
        self._picture_capacity = picture_capacity
        self._pictures = 0
        self._closed = False
        self._urgent = False
        self.last_ticket = 0
        self.dropped_pictures = 0
        self.lost = 0
        """DATA items refused for want of room."""
        self.lost_extras = 0

    def put(self, item: T, rank: Rank, *, wait: bool) -> int | None:
        """Hand `item` over, waiting for room where `wait`; its ticket, or None where it was dropped or the box shut."""
        with self._changed:
            while wait and rank is not Rank.EXTRA and not self._closed and not self._has_room(rank):
                self._changed.wait()
            if self._closed:
                return None
            if not self._has_room(rank) and not self._make_room(rank):
                self._count_lost(rank)
                return None
            self.last_ticket += 1
            self._items.append((self.last_ticket, rank, item))
            self._pictures += rank is Rank.PICTURE
            self._changed.notify_all()
            return self.last_ticket

    def take(self, most: int, timeout_s: float) -> list[tuple[int, T]] | None:
        """Up to `most` items as (ticket, item); empty after `timeout_s` or `hurry`; None once closed and empty."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed or self._urgent, timeout_s)
            self._urgent = False
            if not self._items:
                return None if self._closed else []
            batch: list[tuple[int, T]] = []
            while self._items and len(batch) < most:
                ticket, rank, item = self._items.popleft()
                self._pictures -= rank is Rank.PICTURE
                batch.append((ticket, item))
            self._changed.notify_all()
            return batch

    def hurry(self) -> None:
        """Let a waiting `take` return at once."""
        with self._changed:
            self._urgent = True
            self._changed.notify_all()

    def close(self, *, discard: bool = False) -> None:
        """Let nobody put any more; what is inside can still be taken, unless `discard`. Wakes everybody who waits."""
        with self._changed:
            self._closed = True
            if discard:
                self._items.clear()
                self._pictures = 0
            self._changed.notify_all()

    def __len__(self) -> int:
        with self._changed:
            return len(self._items)

    def _has_room(self, rank: Rank) -> bool:
        if rank is Rank.VITAL:
            return True
        if rank is Rank.PICTURE and self._pictures >= self._picture_capacity:
            return False
        return len(self._items) < (self._capacity // 2 if rank is Rank.EXTRA else self._capacity)

    def _count_lost(self, rank: Rank) -> None:
        self.dropped_pictures += rank is Rank.PICTURE
        self.lost_extras += rank is Rank.EXTRA
        self.lost += rank is Rank.DATA

    def _make_room(self, rank: Rank) -> bool:
        """Drop the oldest waiting picture in favour of an item of `rank`; False where there is none to drop."""
        if rank in {Rank.PICTURE, Rank.EXTRA} or not self._pictures:
            return False
        oldest = next(entry for entry in self._items if entry[1] is Rank.PICTURE)
        self._items.remove(oldest)
        self._pictures -= 1
        self.dropped_pictures += 1
        return True
