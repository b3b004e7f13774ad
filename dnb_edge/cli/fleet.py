"""`dnb-edge fleet`: several boxes on one broker. `publish` on each of them, `hub` on one machine that shows all."""

from __future__ import annotations

import contextlib
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import typer

from dnb_edge.display.service import ServiceNotifier
from dnb_edge.fleet import hub as hubs
from dnb_edge.fleet import publisher as publishers
from dnb_edge.fleet.broker import Broker, broker
from dnb_edge.fleet.link import Line, Link, Peer, Will
from dnb_edge.fleet.listener import Listener
from dnb_edge.fleet.messages import box_name, topics
from dnb_edge.fleet.outbox import Outbox
from dnb_edge.fleet.pages import make_app
from dnb_edge.fleet.serve import PageServer
from dnb_edge.fleet.store import Store

SYSTEM_SOCKET = Path("/run/dnb-edge/live.sock")

app = typer.Typer(help="Several boxes: what each publishes over MQTT, and a page that shows all.", no_args_is_help=True)

Address = Annotated[
    str,
    typer.Option(
        "--broker", envvar="DNB_EDGE_FLEET_BROKER", help="The MQTT broker: mqtts://HOST[:PORT], or mqtt:// without TLS."
    ),
]
Ca = Annotated[
    Path | None,
    typer.Option(envvar="DNB_EDGE_FLEET_CA", help="Certificates (PEM) to trust instead of the machine's own."),
]
User = Annotated[str | None, typer.Option(envvar="DNB_EDGE_FLEET_USER", help="The user's name at the broker.")]
PasswordFile = Annotated[
    Path | None,
    typer.Option(envvar="DNB_EDGE_FLEET_PASSWORD_FILE", help="A file that holds the password and nothing else."),
]
Prefix = Annotated[
    str,
    typer.Option(envvar="DNB_EDGE_FLEET_PREFIX", help="What all topics begin with: one for each fleet on a broker."),
]


@app.command()
def publish(
    address: Address,
    box: Annotated[
        str | None,
        typer.Option(
            envvar="DNB_EDGE_FLEET_BOX", help="This box's name, another one for each. Default: the machine's."
        ),
    ] = None,
    queue: Annotated[
        Path, typer.Option(envvar="DNB_EDGE_FLEET_QUEUE", help="File for what the hub has not stored yet.")
    ] = Path("fleet-queue.sqlite"),
    live: Annotated[Path, typer.Option("--live", help="The live socket of dnb-edge run.")] = SYSTEM_SOCKET,
    ca: Ca = None,
    user: User = None,
    password_file: PasswordFile = None,
    prefix: Prefix = "dnb-edge",
) -> None:
    """Publish this box's laps, results and health, until Ctrl-C is pressed.

    Laps and results wait in --queue until the hub has stored them, whatever happens to the network, the broker, this process or
    the hub. Needs the extra: pip install 'dnb-edge[fleet]'.
    """
    to = broker(address, ca=ca, user=user, password_file=password_file)
    name = box_name(socket.gethostname().partition(".")[0] if box is None else box)
    places = topics(prefix)
    outbox = Outbox(queue)
    listener = Listener(live, outbox)
    try:
        notifier = ServiceNotifier()
        listener.start()
        peer = publishers.Publisher(
            box=name, topics=places, outbox=outbox, listener=listener, say=_sayer(notifier, f"{name}, {to.text}")
        )
        client_id = publishers.client_id(places, name, outbox.name)
        _speak(to, client_id, publishers.will(places, name, outbox.name), peer, notifier)
    finally:
        listener.close()
        outbox.close()


@app.command()
def hub(
    address: Address,
    store_file: Annotated[
        Path, typer.Option("--store", envvar="DNB_EDGE_FLEET_STORE", help="File for all that the boxes deliver.")
    ] = Path("fleet.sqlite"),
    host: Annotated[
        str, typer.Option(help="Address to listen at; 0.0.0.0 shows the page to the network.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 for any that is free.")] = 8090,
    name: Annotated[
        list[str] | None,
        typer.Option(help="A name by which browsers may call this machine. May be given several times."),
    ] = None,
    ca: Ca = None,
    user: User = None,
    password_file: PasswordFile = None,
    prefix: Prefix = "dnb-edge",
) -> None:
    """Store what the boxes deliver, each once, and show all of them on a page, until Ctrl-C is pressed.

    Whoever reaches the port sees all of it without a code, and can change nothing. One hub for each prefix.
    """
    to = broker(address, ca=ca, user=user, password_file=password_file)
    places = topics(prefix)
    store = Store(store_file)
    try:
        notifier = ServiceNotifier()
        peer = hubs.Hub(topics=places, store=store, say=_sayer(notifier, f"hub, {to.text}"))
        with PageServer(make_app(peer, store, names=tuple(name or ())), host=host, port=port) as server:
            _say(server.address)
            _speak(to, hubs.client_id(places), hubs.will(places), peer, notifier)
    finally:
        store.close()


def _speak(to: Broker, client_id: str, will: Will, peer: Peer, notifier: ServiceNotifier) -> None:
    """Keeps the line until a signal comes. Raises `InputError` where nobody but a person can mend it."""
    with _signals(notifier) as stop:
        notifier.ready()
        Link(to, client_id=client_id, will=will).run(_Fed(peer, notifier), stop)


class _Fed:
    """A peer whose every turn feeds the service manager's watchdog."""

    def __init__(self, peer: Peer, notifier: ServiceNotifier) -> None:
        self._peer = peer
        self._notifier = notifier
        self.topics = peer.topics
        self.greeted = peer.greeted
        self.heard = peer.heard
        self.broken = peer.broken
        self.farewell = peer.farewell

    def turn(self, line: Line | None) -> None:
        """As `Peer`."""
        self._peer.turn(line)
        self._notifier.feed(progressed=True)


@contextlib.contextmanager
def _signals(notifier: ServiceNotifier) -> Iterator[Callable[[], bool]]:
    """SIGTERM and Ctrl-C end it cleanly: the broker is told before."""
    ended = threading.Event()

    def end(_number: int, _frame: object) -> None:
        ended.set()

    before = {one: signal.signal(one, end) for one in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield ended.is_set
    finally:
        notifier.stopping()
        for one, handler in before.items():
            signal.signal(one, handler)


def _sayer(notifier: ServiceNotifier, who: str) -> Callable[[str], None]:
    """Lines for whoever looks at the terminal, the log or the service's status."""

    def say(words: str) -> None:
        _say(f"{who}: {words}")
        notifier.status(words)

    return say


def _say(text: str) -> None:
    typer.echo(text)
    sys.stdout.flush()
