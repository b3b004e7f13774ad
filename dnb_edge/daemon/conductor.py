"""The life of the process that others on the box can talk to: race after race, and pictures only in between.

Knows what follows what: a run that ends, is ended by a wish, or cannot begin. How a run is made of a configuration, and where a
camera is while there is none, it is told by whoever knows files (`Means`).
"""

from __future__ import annotations

import logging
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any, Protocol, TypeAlias

from dnb_edge.capture.source import FrameSource
from dnb_edge.daemon.aim import Board, give_pictures
from dnb_edge.daemon.live_run import LiveRun
from dnb_edge.daemon.notices import Notices
from dnb_edge.daemon.orders import Orders, Wish
from dnb_edge.display.base import Display
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.state import BoardState
from dnb_edge.errors import InputError, TemporaryFault, WorkError
from dnb_edge.live.messages import Phase, State
from dnb_edge.live.server import LiveServer
from dnb_edge.values import RacePhase, RaceState

WAITS_S = (1.0, 1.0, 2.0)
"""Waits between attempts to begin where not even a camera is there; the last one repeats."""
RETRY_S = 10.0
"""How often a race is tried again that a track and a camera are there for, while nobody looks at pictures."""
SLICE_S = 0.2
BUILD_S = 60.0
"""How long a run may take to be built, an earlier one's files being looked through: as long as the unit gives its start."""

log = logging.getLogger(__name__)


Asked: TypeAlias = Mapping[str, Any]
"""Keys of the configuration's section `capture`."""


class Means(Protocol):
    """What needs files, options and devices to be known."""

    def race(self, live: LiveRun, entry: str | None) -> None:
        """One run, from the configuration as it is now to the finished recording. Raises as `run_appliance` does."""

    def camera_uri(self) -> str:
        """The source to open where there is no run. Raises `InputError` where there is none."""

    def open_camera(self, uri: str, asked: Asked | None = None) -> FrameSource:
        """That source, open; `asked` of it over what the configuration asks. Raises `InputError` where that cannot be."""

    def displays(self, *, terminal: bool) -> AbstractContextManager[Sequence[Display]]:
        """The displays, where there is no run."""

    @property
    def notifier(self) -> ServiceNotifier:
        """The service manager's."""

    @property
    def files(self) -> tuple[Path, ...]:
        """The configuration's file, or the places where one may appear."""


class Conductor:
    """Runs until the process is to end."""

    def __init__(
        self,
        means: Means,
        server: LiveServer,
        orders: Orders,
        notices: Notices,
        *,
        stays: bool,
    ) -> None:
        """`stays`: whether the process lives on behind a run that came to its end, and where none can begin."""
        self._means = means
        self._server = server
        self._notifier = means.notifier
        self._orders = orders
        self._notices = notices
        self._stays = stays
        self._told: str | None = None
        self._tries = 0
        self._raced = False

    def conduct(self) -> None:
        """Raises what ends a run badly, and why none can begin where nobody could mend that meanwhile."""
        with _signals(self._orders.end):
            self._go_on()
        self._notifier.stopping()

    def _go_on(self) -> None:
        wish = Wish(aim=False, resumes=True)
        while not self._orders.quits:
            if wish.aim:
                self._orders.aims = True
                self._aim(wish.camera)
                self._orders.aims = False
            else:
                over = self._race(wish)
                if over and not self._stays and not self._orders.waits:
                    return
            wish = self._orders.take() or Wish(aim=False, resumes=True)

    def _race(self, wish: Wish) -> bool:
        """One attempt at a run; True where it came to its end, False where it did not begin and may be tried again."""
        orders = self._orders
        live = LiveRun(
            self._server,
            stop=orders,
            notices=self._notices,
            vehicles=orders.vehicles,
            goes_on=lambda: not orders.quits and (self._stays or orders.waits),
            on_begin=self._begun,
            # What this process has raced itself it has ended itself.
            resumes=wish.resumes and not self._raced,
        )
        failure = obstacle = None
        self._notifier.was_ready = False
        self._notifier.feed_now(for_s=BUILD_S)
        try:
            self._means.race(live, wish.entry)
        except (InputError, TemporaryFault) as error:
            if self._notifier.was_ready or not (self._stays or self._notifier.active):
                raise
            obstacle = " ".join(str(error).split())
        except WorkError as error:
            if orders.quits or not (self._stays or orders.waits):
                raise
            # Whoever watches is told, and the next race matters more than the recording that failed.
            failure = " ".join(str(error).split())
            log.warning("%s", failure)
        finally:
            orders.races = False
            self._notifier.feed_now()
        if obstacle is not None:
            self._cannot_begin(obstacle)
            return False
        over = replace(self._server.state, phase=Phase.FINISHED, reason=failure)
        while self._stays and not orders.waits and not orders.quits:
            self._pictures(over, live.board, terminal=False, until=lambda: False)
        return True

    def _begun(self) -> None:
        self._told, self._tries, self._raced = None, 0, True
        self._orders.races = True
        self._notifier.feed_now()
        self._orders.done()

    def _cannot_begin(self, reason: str) -> None:
        """Says why, gives pictures where it may, and returns when it may be tried again."""
        self._orders.done(reason)
        if reason != self._told:
            log.warning("cannot start yet: %s", reason)
            self._told = reason
        self._notifier.status(f"cannot start yet: {reason}")
        if self._stays:
            before = _signature(self._means.files)
            retry_s = None if not any(before) else time.monotonic() + RETRY_S

            def mended() -> bool:
                late = retry_s is not None and time.monotonic() > retry_s and not self._server.watched
                return late or _signature(self._means.files) != before

            self._pictures(State(phase=Phase.SETUP, reason=reason), _BEING_SET_UP, terminal=True, until=mended)
        else:
            self._fault(reason)

    def _aim(self, asked: Asked | None) -> None:
        state = State(phase=Phase.SETUP)
        self._pictures(state, _BEING_SET_UP, terminal=True, until=lambda: False, asked=asked)

    def _pictures(
        self,
        state: State,
        board: BoardState,
        *,
        terminal: bool,
        until: Callable[[], bool],
        asked: Asked | None = None,
    ) -> None:
        """Pictures only, until somebody wishes something else or `until()` holds; a fault is told where no camera is there."""
        wanted = {} if asked is None else dict(asked)
        named = wanted.pop("source", None)
        try:
            uri = self._means.camera_uri() if named is None else str(named)
            with self._means.displays(terminal=terminal) as displays:
                going = True
                while going:
                    source = self._means.open_camera(uri, wanted)
                    self._server.show(replace(state, source=uri))
                    self._orders.done()
                    going = not give_pictures(
                        source,
                        lambda again: self._means.open_camera(again, wanted),
                        self._server,
                        self._notifier,
                        Board(displays, board, self._notices, logs=not terminal),
                        until=lambda: self._orders.is_set() or until(),
                    )
                    if going:
                        # A clip begins anew, at its leisure.
                        time.sleep(SLICE_S)
        except (InputError, TemporaryFault) as error:
            reason = " ".join(str(error).split())
            self._orders.done(reason)
            self._fault(state.reason or reason)

    def _fault(self, reason: str) -> None:
        """Says what is wrong, and waits a little."""
        self._server.show(State(phase=Phase.FAULT, reason=reason))
        # All that can be done is done: who starts services need not wait for a camera, nor start this one again and again.
        self._notifier.ready()
        until_s = time.monotonic() + WAITS_S[min(self._tries, len(WAITS_S) - 1)]
        self._tries += 1
        self._notifier.feed_now()
        while not self._orders.is_set() and time.monotonic() < until_s:
            time.sleep(SLICE_S)


_BEING_SET_UP = BoardState(race=RaceState(t_ns=0, t_s=0.0, phase=RacePhase.WAITING, text="being set up"))


def _signature(files: Sequence[Path]) -> tuple[tuple[int, int, int] | None, ...]:
    """What changes when one of the files does; None for one that is not there."""
    return tuple(_stamp(path) for path in files)


def _stamp(path: Path) -> tuple[int, int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns


@contextmanager
def _signals(end: Callable[[], None]) -> Iterator[None]:
    """SIGINT and SIGTERM call `end` meanwhile."""

    def request(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        end()

    before = {number: signal.signal(number, request) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
