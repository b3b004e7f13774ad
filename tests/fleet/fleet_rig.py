"""Boxes and hubs in this process, each in a thread of its own, on real sockets, files and brokers."""

import threading
from pathlib import Path

from mqtt_broker import PATIENCE_S, until

from dnb_edge.fleet import hub as hubs
from dnb_edge.fleet import publisher as publishers
from dnb_edge.fleet.broker import Broker, broker
from dnb_edge.fleet.link import Link
from dnb_edge.fleet.listener import Listener
from dnb_edge.fleet.messages import topics
from dnb_edge.fleet.outbox import Outbox
from dnb_edge.fleet.store import Store
from dnb_edge.live.messages import Phase, State
from dnb_edge.live.server import LiveServer
from dnb_edge.values import Lap

TOPICS = topics("dnb-edge")
WAITS_S = (0.1,)


def plain(url: str) -> Broker:
    """The broker at `url`, without certificates and password."""
    return broker(url, ca=None, user=None, password_file=None)


def lap(number: int, car: int = 1) -> Lap:
    """A lap that no other lap is like."""
    return Lap(
        number=number,
        start_t_ns=number * 10**9,
        end_t_ns=(number + 1) * 10**9,
        start_s=float(number),
        time_s=1.0 + number * 1e-6,
        sigma_s=0.002,
        valid=True,
        reasons=(),
        similarity_percent=91.5,
        observed_fraction=1.0,
        car=car,
    )


def racing(run: str | None = "run-0badcafe-0001", source: str = "sim:") -> State:
    return State(phase=Phase.RACING, run=run, track="oval", source=source)


class Spoken:
    """A peer and its line in a thread, until it is stopped."""

    def __init__(self, link: Link, peer) -> None:
        self._stop = threading.Event()
        self.failed: Exception | None = None
        self._link, self._peer = link, peer
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._link.run(self._peer, self._stop.is_set)
        except Exception as error:  # noqa: BLE001 the test looks at it
            self.failed = error

    def stop(self) -> None:
        self._stop.set()
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()


class Box:
    """A box: its daemon's socket, its queue, its publisher. The daemon lives on when the publisher is stopped."""

    def __init__(self, folder: Path, name: str, to: Broker, *, most: int = 100_000) -> None:
        self.name, self.said = name, []
        self.path = folder / f"{name}.sock"
        self.queue = folder / f"{name}.sqlite"
        self.daemon = LiveServer(self.path, version="1")
        self.daemon.show(racing())
        self._to, self._most = to, most
        self._spoken: Spoken | None = None

    def start(self) -> None:
        self.outbox = Outbox(self.queue, most=self._most)
        self.listener = Listener(self.path, self.outbox)
        self.listener.start()
        peer = publishers.Publisher(
            box=self.name, topics=TOPICS, outbox=self.outbox, listener=self.listener, say=self.said.append
        )
        names = (TOPICS, self.name, self.outbox.name)
        link = Link(self._to, client_id=publishers.client_id(*names), will=publishers.will(*names), waits_s=WAITS_S)
        self._spoken = Spoken(link, peer)

    @property
    def failed(self) -> Exception | None:
        assert self._spoken is not None
        return self._spoken.failed

    def race(self, first: int, last: int) -> None:
        """Laps number `first` to `last` happen."""
        for number in range(first, last + 1):
            self.daemon.tell(lap(number))

    def stop(self) -> None:
        """Only the publisher."""
        if self._spoken is not None:
            self._spoken.stop()
            self.listener.close()
            self.outbox.close()
            self._spoken = None

    def close(self) -> None:
        self.stop()
        self.daemon.close()


class HubRig:
    """A hub whose store stays when it is stopped."""

    def __init__(self, folder: Path, to: Broker) -> None:
        self.file, self.said = folder / "hub.sqlite", []
        self._to = to
        self._spoken: Spoken | None = None

    def start(self) -> None:
        self.store = Store(self.file)
        self.hub = hubs.Hub(topics=TOPICS, store=self.store, say=self.said.append)
        link = Link(self._to, client_id=hubs.client_id(TOPICS), will=hubs.will(TOPICS), waits_s=WAITS_S)
        self._spoken = Spoken(link, self.hub)

    @property
    def failed(self) -> Exception | None:
        assert self._spoken is not None
        return self._spoken.failed

    def laps(self, box: str) -> list[int]:
        """Numbers of the laps that are stored of a box, in the order in which they were stored."""
        return [
            row.event["number"] for row in self.store.since(0, most=100_000, box=box) if row.event["event"] == "lap"
        ]

    def wait_for(self, box: str, last: int) -> None:
        """Until all laps up to `last` are there, each once, in order."""
        until(lambda: len(self.laps(box)) >= last, f"{last} laps of {box}: {self.said}")
        assert self.laps(box) == list(range(1, last + 1))

    def seen(self, box: str):
        return next((one for one in self.hub.glance().boxes if one.box.name == box), None)

    def stop(self) -> None:
        if self._spoken is not None:
            self._spoken.stop()
            self._spoken = None
            self.store.close()
