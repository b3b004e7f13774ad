"""What other processes ask of the daemon, one thing at a time, and how the main thread hears of it.

Knows orders and answers. Knows no run and no camera: who fulfils a wish says so here.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from dnb_edge.daemon.notices import Notices
from dnb_edge.daemon.vehicle import VehicleInbox
from dnb_edge.errors import InputError
from dnb_edge.live.messages import AimCamera, NewRun, ShowText, VehicleSays
from dnb_edge.live.server import Order, Reply


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """What is to be done next."""

    aim: bool
    """True for pictures only, False for a race."""
    entry: str | None = None
    """Who or what drives; None for the configuration's own."""
    camera: Mapping[str, Any] | None = None
    """What is asked of the camera while it is aimed, over the configuration's section `capture`."""
    resumes: bool = False
    """Whether the race may go on with one that was cut short: never where somebody asks for another one."""


class Orders:
    """Takes orders in the server's thread, and gives wishes to the main thread."""

    def __init__(self, notices: Notices, check: Callable[[str | None], None]) -> None:
        """`check(entry)` raises `InputError` where a race could not begin as things are; it may take a while."""
        self._notices = notices
        self._check = check
        self._lock = threading.Lock()
        self._reply: Reply | None = None
        """Of the order that is under way."""
        self._wish: Wish | None = None
        self._taken = False
        """Whether its wish was taken: only then is what begins or fails its own."""
        self.aims = False
        """Whether somebody aims the camera."""
        self.races = False
        """Whether a run is on; both are set by whoever fulfils wishes."""
        self.quits = False
        """Whether the process is to end."""
        self.vehicles = VehicleInbox()
        """What vehicles said, for the run that is on."""

    def end(self) -> None:
        """Ends the process, in good order. For signal handlers: takes no lock."""
        self.quits = True

    def is_set(self) -> bool:
        """Whether what is done now is to end: for another wish, or since the process ends. Takes no lock."""
        return self.quits or self._wish is not None

    @property
    def waits(self) -> bool:
        """Whether there is a wish that nobody has taken yet."""
        return self._wish is not None

    def take(self) -> Wish | None:
        """The wish to be fulfilled now."""
        with self._lock:
            wish, self._wish = self._wish, None
            self._taken |= wish is not None
            return wish

    def done(self, reason: str | None = None) -> None:
        """The wish that was taken is fulfilled, or is not, for a `reason`. Nothing where nobody waits for it."""
        with self._lock:
            if not self._taken:
                return  # what waits for an answer, if anything does, has not begun
            reply, self._reply, self._taken = self._reply, None, False
        if reply is not None:
            reply(reason)

    def __call__(self, order: Order, reply: Reply) -> None:
        """Takes an order. Never blocks."""
        match order:
            case VehicleSays():
                if self.races:
                    self.vehicles.put(order.words)
                reply(None if self.races else "no race is on")
            case ShowText():
                self._notices.show(order.text, order.for_s)
                reply(None)
            case AimCamera() if order.camera is None and (self.aims if order.aim else self.races):
                reply(None if self._reply is None else _UNDER_WAY)
            case AimCamera():
                if self._is_free(reply):
                    self._want(Wish(aim=order.aim, camera=order.camera))
            case NewRun():
                if self._is_free(reply):
                    threading.Thread(target=self._new_run, args=(order,), name="check", daemon=True).start()

    def _is_free(self, reply: Reply) -> bool:
        with self._lock:
            if self._reply is None:
                self._reply = reply
                return True
        reply(_UNDER_WAY)
        return False

    def _new_run(self, order: NewRun) -> None:
        """Looks first whether it could begin: no race is ended for one that cannot."""
        reason: str | None = "it cannot be told whether a race could begin: the box's log says why"
        try:
            self._check(order.entry)
            reason = None
        except InputError as error:
            reason = " ".join(str(error).split())
        finally:
            # Whatever else goes wrong: no later order is to be refused for one that nobody answers any more.
            if reason is not None:
                self._refuse(reason)
        if reason is None:
            self._want(Wish(aim=False, entry=order.entry))

    def _refuse(self, reason: str) -> None:
        with self._lock:
            reply, self._reply = self._reply, None
        if reply is not None:
            reply(reason)

    def _want(self, wish: Wish) -> None:
        with self._lock:
            self._wish = wish


_UNDER_WAY = "something that was asked before is under way: wait for it, and ask again"
