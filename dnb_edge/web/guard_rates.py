"""How often an address may ask: token buckets, and counts of failed log-ins over a minute and an hour.

Knows addresses and instants; knows no request.
"""

from __future__ import annotations

import ipaddress
from collections import OrderedDict, deque
from dataclasses import dataclass

MOST_ADDRESSES = 4096
"""Addresses that are remembered; the one that asked longest ago is forgotten first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What one address may do."""

    per_s: float = 100.0
    """Requests a second in the long run; 0 for no limit."""
    burst: int = 1000
    """Requests at once."""
    wrong_codes: tuple[tuple[int, float], ...] = ((3, 60.0), (10, 3600.0))
    """So many wrong set-up codes in so many seconds."""
    wrong_codes_of_all: tuple[tuple[int, float], ...] = ((30, 60.0), (200, 3600.0))
    """The same of all addresses together, which may be one guesser's: in a year of guessing 2 % of being hit."""


class Buckets:
    """A token bucket for each address."""

    def __init__(self, per_s: float, burst: int) -> None:
        self._per_s = per_s
        self._burst = float(burst)
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def take(self, address: str, now_s: float) -> float | None:
        """None where `address` may ask now; else the seconds until it may again."""
        if self._per_s <= 0:
            return None
        left, then_s = self._left.pop(address, (self._burst, now_s))
        left = min(self._burst, left + (now_s - then_s) * self._per_s)
        granted = left >= 1.0
        self._left[address] = (left - 1.0 if granted else left, now_s)
        if len(self._left) > MOST_ADDRESSES:
            self._left.popitem(last=False)
        return None if granted else (1.0 - left) / self._per_s


class Failures:
    """When each address failed (or did what else it may not do often), as far back as the longest of the windows."""

    def __init__(self, windows: tuple[tuple[int, float], ...]) -> None:
        self._windows = windows
        self._longest_s = max(window_s for _, window_s in windows)
        self._instants: OrderedDict[str, deque[float]] = OrderedDict()

    def wait_s(self, address: str, now_s: float) -> float | None:
        """None where `address` may try now; else the seconds until it may again."""
        instants = self._instants.get(address, deque())
        waits = []
        for most, window_s in self._windows:
            recent = [instant for instant in instants if instant > now_s - window_s]
            if len(recent) >= most:
                waits.append(recent[-most] + window_s - now_s)
        return max(waits, default=None)

    def failed(self, address: str, now_s: float) -> None:
        """`address` has failed."""
        instants = self._instants.pop(address, deque())
        while instants and instants[0] <= now_s - self._longest_s:
            instants.popleft()
        instants.append(now_s)
        self._instants[address] = instants
        if len(self._instants) > MOST_ADDRESSES:
            self._instants.popitem(last=False)

    def forgiven(self, address: str) -> None:
        """The latest time of `address` does not count."""
        instants = self._instants.get(address)
        if instants:
            instants.pop()


def counted_as(client: tuple[str, int] | list[object] | None) -> str:
    """The address that a client is counted under: an IPv6 client has the whole of its network's /64 to choose from."""
    text = str(client[0]) if client else "unknown"
    try:
        address = ipaddress.ip_address(text.partition("%")[0])
    except ValueError:
        return text
    if isinstance(address, ipaddress.IPv6Address):
        if address.ipv4_mapped is not None:
            return str(address.ipv4_mapped)
        return str(ipaddress.IPv6Network((address, 64), strict=False))
    return text
