"""The plain client against the real server: asks, waits for its answer alone, and says in a line what is the matter."""

import contextlib
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dnb_edge.errors import TemporaryFault, WorkError
from dnb_edge.live.caller import Caller
from dnb_edge.live.messages import AimCamera, Hello, Phase, ShowText, State, encode
from dnb_edge.live.server import LiveServer, Order, Reply


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "live.sock"


@contextmanager
def answering(path: Path, said: bytes) -> Iterator[None]:
    """Something that is no dnb-edge: says `said` to the first who calls, and goes."""
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen()

        def serve() -> None:
            connection, _ = listener.accept()
            with connection, contextlib.suppress(BrokenPipeError, ConnectionResetError):
                connection.sendall(said)

        thread = threading.Thread(target=serve)
        thread.start()
        yield
        thread.join()


def test_it_asks_and_waits_for_the_answer(path: Path) -> None:
    """The order arrives as it was meant, and what is told before its answer is passed over."""
    heard: list[Order] = []

    def obey(order: Order, reply: Reply) -> None:
        heard.append(order)
        server.show(State(phase=Phase.RACING))
        reply(None)

    with LiveServer(path, version="1.2.3", on_order=obey) as server, Caller(path) as caller:
        assert (caller.hello.version, caller.hello.epoch) == ("1.2.3", server.epoch)
        caller.ask(ShowText, text="stick: 3 runs", for_s=5.0)
        caller.ask(AimCamera, aim=True)
    assert heard == [ShowText(ask=1, text="stick: 3 runs", for_s=5.0), AimCamera(ask=2, aim=True)]


def test_a_refusal_is_told_with_its_reason(path: Path) -> None:
    """What the daemon will not do is a `WorkError` in its words, and the line goes on."""
    with (
        LiveServer(path, version="1", on_order=lambda _, reply: reply("there is no camera")),
        Caller(path) as caller,
    ):
        for _ in range(2):
            with pytest.raises(WorkError, match="there is no camera"):
                caller.ask(AimCamera, aim=True)


def test_a_daemon_that_does_not_answer_is_waited_for_no_longer_than_said(path: Path) -> None:
    """However much else it tells meanwhile."""

    def chatter(_: Order, reply: Reply) -> None:
        del reply

    with LiveServer(path, version="1", on_order=chatter) as server, Caller(path, timeout_s=0.4) as caller:
        ended = threading.Event()

        def tell() -> None:
            while not ended.wait(0.02):
                server.show(State(phase=Phase.RACING, reason=str(time.monotonic())))

        teller = threading.Thread(target=tell)
        teller.start()
        try:
            with pytest.raises(TemporaryFault, match="does not answer in time"):
                caller.ask(AimCamera, aim=True)
        finally:
            ended.set()
            teller.join()


def test_a_daemon_that_goes_is_told(path: Path) -> None:
    """Gone while the answer is waited for, and for every question after it."""
    server = LiveServer(path, version="1", on_order=lambda _, __: None)
    with Caller(path) as caller:
        ask = threading.Timer(0.1, server.close)
        ask.start()
        for _ in range(2):
            with pytest.raises(TemporaryFault, match="has gone"):
                caller.ask(AimCamera, aim=True)
        ask.join()


def test_no_daemon_is_told(path: Path) -> None:
    """Nothing there, or only what a dead one left."""
    with pytest.raises(TemporaryFault, match="no dnb-edge answers there"):
        Caller(path)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
    with pytest.raises(TemporaryFault, match="no dnb-edge answers there"):
        Caller(path)


@pytest.mark.parametrize(
    ("said", "kind", "words"),
    [
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", WorkError, "no JSON"),
        (encode(State(phase=Phase.RACING)), WorkError, "another version"),
        (
            encode(Hello(protocol=2, version="9", epoch="x", next_sequence=0, first_sequence=0)),
            WorkError,
            "another version",
        ),
        (b"x" * (1 << 21), WorkError, "a line of more than"),
        (b"", TemporaryFault, "has gone"),
    ],
)
def test_what_is_no_dnb_edge_is_told(path: Path, said: bytes, kind: type[Exception], words: str) -> None:
    """Another server, another protocol, a line without end, or nothing at all."""
    with answering(path, said), pytest.raises(kind, match=words):
        Caller(path)


def test_a_longer_wait_for_one_question(path: Path) -> None:
    """`timeout_s` of a question stands over the caller's own."""

    def later(_: Order, reply: Reply) -> None:
        threading.Timer(0.5, reply, (None,)).start()

    with LiveServer(path, version="1", on_order=later), Caller(path, timeout_s=0.1) as caller:
        caller.ask(AimCamera, aim=True, timeout_s=20.0)
