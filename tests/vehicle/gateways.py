"""A gateway that runs beside a test, and what tests of it wait for."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from dnb_edge.daemon.vehicle import VehicleInbox
from dnb_edge.live.messages import State, VehicleSays
from dnb_edge.live.server import LiveServer, Order, Reply
from dnb_edge.live.vehicle_word import VehicleWord
from dnb_edge.values import RacePhase, RaceState
from dnb_edge.vehicle.channel import Channel
from dnb_edge.vehicle.gateway import Gateway
from dnb_edge.vehicle.link import Link

PATIENCE_S = 60.0


def until(true: Callable[[], object], what: str = "it") -> None:
    """Waits for it."""
    deadline_s = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < deadline_s, f"{what} did not come"
        time.sleep(0.005)


class Box:
    """A daemon's live socket, that keeps the words it is handed."""

    def __init__(self, path: Path) -> None:
        self.words: list[VehicleWord] = []
        self.inbox = VehicleInbox()
        self.server = LiveServer(path, version="1", on_order=self._take)

    def _take(self, order: Order, reply: Reply) -> None:
        assert isinstance(order, VehicleSays)
        self.words += order.words
        self.inbox.put(order.words)
        reply(None)

    def races(self, phase: RacePhase, *, start: str = "grid") -> None:
        """The race is there now."""
        self.server.tell(RaceState(t_ns=1, t_s=0.0, phase=phase))

    def begins(self, state: State) -> None:
        """A run begins."""
        self.server.begin_run()
        self.server.show(state)


@contextmanager
def running(path: Path, channels: Sequence[Channel]) -> Iterator[Gateway]:
    """A gateway in a thread; what it fails with is raised at its end."""
    gateway, failures = Gateway(Link(path), channels), list[BaseException]()

    def run() -> None:
        try:
            gateway.run()
        except BaseException as error:  # noqa: BLE001 the test's thread raises it
            failures.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield gateway
    finally:
        gateway.stop()
        thread.join(PATIENCE_S)
    for failure in failures:
        raise failure
