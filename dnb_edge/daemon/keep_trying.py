"""Starting as a service: what is wrong stands in the status line, and is tried again until it is right.

Knows the service manager's notifier and how long to wait. A user at a terminal gets the error at once instead.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import TypeVar

from dnb_edge.display.service import ServiceNotifier
from dnb_edge.errors import InputError, TemporaryFault

T = TypeVar("T")

WAITS_S = (1.0, 1.0, 2.0)
"""Waits between attempts; the last one repeats: a camera that is plugged in races within 5 s."""

log = logging.getLogger(__name__)


def keep_trying(
    attempt: Callable[[ServiceNotifier], T], notifier: ServiceNotifier, *, sleep: Callable[[float], None] = time.sleep
) -> T:
    """The result of `attempt(notifier)`, tried again under a service manager for as long as it fails before it is ready.

    Raises what it raises: at once without a service manager, and whatever comes after the start. While we wait, the manager's
    SIGTERM ends the process as it ends any other.
    """
    told = None
    tries = 0
    while True:
        try:
            return attempt(notifier)
        except (InputError, TemporaryFault) as error:
            if not notifier.active or notifier.was_ready:
                raise
            reason = " ".join(str(error).split())
        if reason != told:
            log.warning("cannot start yet: %s", reason)
            told = reason
        notifier.status(f"cannot start yet: {reason}")
        sleep(WAITS_S[min(tries, len(WAITS_S) - 1)])
        tries += 1
