"""Words for the service manager, without ever waiting for it: while its queue is full they wait here.

Knows the notify socket's address and the binding's one call. That call waits where the manager's queue is full, and holds all
of Python's threads meanwhile, so a socket of our own looks first. Knows no word's meaning beyond which may be left out.
"""

from __future__ import annotations

import logging
import select
import socket
from collections import deque
from types import ModuleType

_KEPT = 16
"""Words that wait at most; the oldest of those that may be left out gives way."""

_NEVER_LEFT_OUT = ("READY", "STOPPING")

log = logging.getLogger(__name__)


class Messenger:
    """Sends words in order, each as soon as the manager takes it."""

    def __init__(self, daemon: ModuleType, address: str) -> None:
        """`address`: of the manager's socket, as NOTIFY_SOCKET has it; a leading `@` is an abstract one."""
        self._daemon = daemon
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._words: deque[str] = deque()

    def tell(self, word: str) -> None:
        """Sends `word` now or with a later one."""
        self._words.append(word)
        if len(self._words) > _KEPT:
            spare = next((one for one in self._words if not one.startswith(_NEVER_LEFT_OUT)), self._words[0])
            self._words.remove(spare)
        self.flush()

    def flush(self) -> None:
        """Sends what waits, as far as the manager takes it."""
        while self._words and self._has_room():
            self._send(self._words.popleft())

    def _has_room(self) -> bool:
        """Whether a word would go out at once; True as well where it would fail at once."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
            probe.settimeout(0.0)
            try:
                probe.connect(self._address)
            except OSError:
                return True
            # A connected socket is ready to write only while its peer's queue has room (unix(7), unix_dgram_poll).
            return bool(select.select([], [probe], [], 0.0)[1])

    def _send(self, word: str) -> None:
        while True:
            try:
                self._daemon.notify(word)
            except InterruptedError:
                # A signal came in between, and the binding does not try again by itself.
                continue
            except OSError as error:
                log.warning("the service manager does not take %s: %s", word, error)
            return
