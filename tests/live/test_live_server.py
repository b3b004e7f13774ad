"""The server with real clients: what they hear, how they come back, who is cut off."""

import itertools
import random
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from caller import Caller
from live_events import Desk, health, long_incident, seen, standings, state, summary

from dnb_edge.errors import TemporaryFault
from dnb_edge.live import pictures
from dnb_edge.live import server as server_module
from dnb_edge.live.messages import (
    AimCamera,
    Answer,
    FromDaemon,
    NewRun,
    Phase,
    Picture,
    ShowText,
    State,
    Told,
    WatchPictures,
)
from dnb_edge.live.server import MOST_CLIENTS, LiveServer
from dnb_edge.values import Frame, StampSource

Serve = Callable[..., LiveServer]


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Serve]:
    """Starts a server at `tmp_path / "s"`."""
    made: list[LiveServer] = []

    def start(**options: object) -> LiveServer:
        made.append(LiveServer(tmp_path / "s", version="1", **options))  # type: ignore[arg-type]
        return made[-1]

    yield start
    for one in made:
        one.close()


@pytest.fixture
def call(tmp_path: Path) -> Iterator[Callable[[], Caller]]:
    """Connects clients to it."""
    made: list[Caller] = []

    def connect() -> Caller:
        made.append(Caller(tmp_path / "s"))
        return made[-1]

    yield connect
    for one in made:
        one.close()


def frame(number: int, *, jpeg: bytes | None = None) -> Frame:
    """A picture of 8 x 6."""
    bgr = None if jpeg is not None else np.full((6, 8, 3), number % 256, np.uint8)
    return Frame(
        sequence=number,
        t_ns=number * 1000,
        stamp_source=StampSource.MEDIA,
        width_px=8,
        height_px=6,
        jpeg=jpeg,
        bgr=bgr,
    )


def is_told(text: str) -> Callable[[FromDaemon], bool]:
    """True of the event that `state(int(text))` makes."""
    return lambda one: isinstance(one, Told) and one.event.get("text") == text


def wait_for(true: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 10.0
    while not true():
        assert time.monotonic() < deadline_s, "waited in vain"
        time.sleep(0.005)


def test_a_client_is_told_who_speaks_and_what_is_done(serve: Serve, call: Callable[[], Caller]) -> None:
    """Hello and State at once, a State with each change; events only once they are asked for."""
    server = serve()
    server.tell(state(0))
    client = call()
    assert (client.hello.epoch, client.hello.next_sequence, client.hello.first_sequence) == (server.epoch, 1, 0)
    assert client.hear() == State(phase=Phase.STARTING)
    server.tell(state(1))
    server.show(State(phase=Phase.FAULT, reason="no camera"))
    assert client.hear() == State(phase=Phase.FAULT, reason="no camera")
    client.follow()
    assert [one.sequence for one in client.hear_until(is_told("1")) if isinstance(one, Told)] == [0, 1]


def test_two_servers_have_two_epochs(serve: Serve) -> None:
    """Numbers of the one mean nothing to the other."""
    first = serve()
    first.close()
    assert serve().epoch != first.epoch


@pytest.mark.parametrize(
    ("since", "epoch", "numbers"),
    [
        (0, None, [0, 1, 3, 4, 5]),
        (1, None, [1, 3, 4, 5]),
        (4, None, [4, 5]),
        (6, None, []),
        (None, None, []),
        (7, None, [0, 1, 3, 4, 5]),
        (4, "another", [0, 1, 3, 4, 5]),
    ],
    ids=["all", "some", "the last ones", "none yet", "from now on", "a number not given yet", "another epoch"],
)
def test_a_client_gets_what_it_lacks(
    serve: Serve, call: Callable[[], Caller], since: int | None, epoch: str | None, numbers: list[int]
) -> None:
    """Kept events from its number on, all where it is not one of ours, then what happens; what was fleeting is gone."""
    server = serve()
    server.clients = 1  # so that the fleeting one is numbered as well
    for event in (state(0), state(1), seen(2), state(3), standings(4), health(5)):
        server.tell(event)
    client = call()
    client.follow(since, epoch)
    client.say(WatchPictures, every_s=None)
    heard = client.hear_until(lambda one: isinstance(one, Answer))
    server.tell(state(6))
    heard += client.hear_until(is_told("6"))
    told = [one.sequence for one in heard if isinstance(one, Told)]
    assert told == [*numbers, 6]


@pytest.mark.parametrize("seed", range(3))
def test_no_event_is_lost_or_told_twice_over_reconnections(serve: Serve, call: Callable[[], Caller], seed: int) -> None:
    """A client that hangs up at moments of chance, in the middle of what is told, and asks from its next number on: all lasting
    events, once, in their order, while others go on being told."""
    chance = random.Random(seed)
    server, most = serve(), 1500
    done = threading.Event()

    def race() -> None:
        for number in range(most):
            server.tell(state(number) if number % 3 else seen(number))
            if number % 40 == 0:
                time.sleep(0.002)
        server.tell(summary())
        done.set()

    teller = threading.Thread(target=race)
    teller.start()
    texts: list[str] = []
    numbers: list[int] = []
    ended = False
    while not ended:
        with call() as client:
            client.follow(numbers[-1] + 1 if numbers else 0)
            for _ in range(chance.randrange(1, 300)):
                message = client.hear()
                if isinstance(message, Told):
                    numbers.append(message.sequence)
                    texts += [message.event["text"]] if message.event["event"] == "race" else []
                    ended = message.event["event"] == "run"
                if ended:
                    break
    teller.join()
    assert numbers == sorted(set(numbers))
    assert texts == [str(number) for number in range(most) if number % 3]


def test_a_reader_that_does_not_read_is_cut_off_and_no_other(serve: Serve, call: Callable[[], Caller]) -> None:
    """It comes back and asks from its number on; who reads has heard all, in order, meanwhile."""
    server = serve(stall_s=0.3)
    lazy, keen = call(), call()
    lazy.follow()
    keen.follow()
    count = 120
    heard: list[int] = []

    def read() -> None:
        while len(heard) < count:
            message = keen.hear()
            if isinstance(message, Told):
                heard.append(message.event["number"])

    reader = threading.Thread(target=read)
    reader.start()
    for number in range(count):
        server.tell(long_incident(number))
    reader.join(20.0)
    assert heard == list(range(count))
    wait_for(lambda: server.clients == 1)
    numbers = []
    while (message := lazy.hear_or_end()) is not None:
        numbers += [message.sequence] if isinstance(message, Told) else []
    assert len(numbers) < count
    again = call()
    again.follow(numbers[-1] + 1)
    last = again.hear_until(lambda one: isinstance(one, Told) and one.event["number"] == count - 1)
    numbers += [one.sequence for one in last if isinstance(one, Told)]
    assert numbers == list(range(count))


def test_who_lags_behind_all_that_is_kept_is_cut_off(serve: Serve, call: Callable[[], Caller]) -> None:
    """And is told by the next Hello that it must begin anew."""
    server = serve(most_kept=20, stall_s=60.0)
    lazy = call()
    lazy.follow()
    server.tell(long_incident(0))
    lazy.hear_until(lambda one: isinstance(one, Told))
    for number in range(1, 200):
        server.tell(long_incident(number))
        time.sleep(0.001)
    while lazy.hear_or_end() is not None:
        pass
    assert call().hello.first_sequence > 100


def test_fleeting_events_give_way_first(serve: Serve, call: Callable[[], Caller]) -> None:
    """Of a reader that is behind, all laps and no more than some of the rest; the order stays."""
    server = serve()
    lazy = call()
    lazy.follow()
    for number in range(3000):
        server.tell(seen(number))
        if number % 10 == 0:
            server.tell(state(number))
            time.sleep(0.001)
    server.tell(summary())
    told = lazy.hear_until(lambda one: isinstance(one, Told) and one.event["event"] == "run")
    events = [one for one in told if isinstance(one, Told)]
    assert [one.sequence for one in events] == sorted({one.sequence for one in events})
    assert [one.event["text"] for one in events if one.event["event"] == "race"] == [
        str(number) for number in range(0, 3000, 10)
    ]
    assert 0 < sum(one.event["event"] == "observation" for one in events) < 3000


def test_a_new_run_is_told_before_its_events(serve: Serve, call: Callable[[], Caller]) -> None:
    """Its State names its first number; whoever comes then hears nothing of the run before."""
    server = serve()
    client = call()
    client.follow()
    server.tell(state(0))
    client.hear_until(is_told("0"))
    server.begin_run()
    server.show(State(phase=Phase.RACING, run="b"))
    server.tell(state(1))
    heard = client.hear_until(is_told("1"))
    assert [type(one) for one in heard] == [State, Told]
    assert heard[0] == State(phase=Phase.RACING, run="b", first_sequence=1)
    late = call()
    assert late.hello.first_sequence == 1
    late.follow()
    assert [one.sequence for one in late.hear_until(is_told("1")) if isinstance(one, Told)] == [1]


def test_eight_clients_and_no_more(serve: Serve, tmp_path: Path, call: Callable[[], Caller]) -> None:
    """The ninth is shown the door; when one goes there is room again."""
    server = serve()
    clients = [call() for _ in range(MOST_CLIENTS)]
    with pytest.raises(TemporaryFault, match="has gone"):
        Caller(tmp_path / "s")
    clients[0].close()
    wait_for(lambda: server.clients == MOST_CLIENTS - 1)
    call()


@pytest.mark.parametrize(
    "line",
    [
        b"GET / HTTP/1.1\r\n",
        b'{"say": "follow"}\n',
        b'{"say": "answer", "ask": 1, "done": true}\n',
        b"x" * 100_000,
        b"\n",
    ],
    ids=["a browser", "a member is missing", "what we say ourselves", "no end", "nothing"],
)
def test_who_talks_nonsense_is_cut_off(
    serve: Serve, call: Callable[[], Caller], line: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    """With one line in the log; the others go on."""
    server = serve()
    rude, polite = call(), call()
    rude.say_bytes(line)
    while rude.hear_or_end() is not None:
        pass
    polite.follow()
    server.tell(state(0))
    polite.hear_until(is_told("0"))
    (told,) = caplog.messages
    assert told.startswith("live socket: a client is cut off: ")


def test_newer_questions_are_passed_over(serve: Serve, call: Callable[[], Caller]) -> None:
    """A client of a later version is not cut off for them."""
    server = serve()
    client = call()
    client.say_bytes(b'{"say": "sing", "ask": 9}\n')
    client.follow()
    server.tell(state(0))
    client.hear_until(is_told("0"))


def test_orders_are_passed_on_and_answered(serve: Serve, call: Callable[[], Caller]) -> None:
    """Whoever asks gets the answer with its own number, whenever it comes, from whatever thread, and nobody else does."""
    desk = Desk()
    serve(on_order=desk)
    first, second = call(), call()
    asks = [first.say(NewRun, entry="net"), first.say(AimCamera, aim=True)]
    wait_for(lambda: len(desk.orders) == 2)
    other = second.say(ShowText, text="4711", for_s=5.0)
    wait_for(lambda: len(desk.orders) == 3)
    assert [type(one) for one in desk.orders] == [NewRun, AimCamera, ShowText]
    desk.replies[1]("somebody else does")
    assert first.answer(asks[1]) == Answer(ask=asks[1], done=False, reason="somebody else does")
    desk.replies[2](None)
    assert second.answer(other) == Answer(ask=other, done=True)
    first.close()
    desk.replies[0](None)


def test_without_a_desk_orders_are_refused(serve: Serve, call: Callable[[], Caller]) -> None:
    """In words."""
    serve()
    client = call()
    assert client.answer(client.say(NewRun)).reason == "this dnb-edge takes no NewRun"


def test_pictures_are_the_cameras_own_or_made_of_what_it_gives(serve: Serve, call: Callable[[], Caller]) -> None:
    """A camera's JPEG goes through byte for byte; other pictures become JPEG; the newest one at once, others as they come."""
    server = serve()
    server.offer(frame(1, jpeg=b"\xff\xd8 a camera's \n own \xff\xd9"))
    client = call()
    client.say(WatchPictures, every_s=0.02)
    (own,) = [one for one in client.hear_until(lambda one: isinstance(one, Picture)) if isinstance(one, Picture)]
    assert (own.jpeg, own.frame, own.t_ns) == (b"\xff\xd8 a camera's \n own \xff\xd9", 1, 1000)
    server.offer(frame(200))
    last = client.hear_until(lambda one: isinstance(one, Picture))[-1]
    assert isinstance(last, Picture)
    image = cv2.imdecode(np.frombuffer(last.jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert (image.shape, (last.width_px, last.height_px)) == ((6, 8, 3), (8, 6))
    assert abs(float(image.mean()) - 200.0) < 3.0


def test_nothing_is_made_while_nobody_watches(
    serve: Serve, call: Callable[[], Caller], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not before anybody asks, not after he asks for no more, nor when he has gone; two who watch share one."""
    made: list[int] = []
    real = pictures.picture_of

    def counting(one: Frame) -> Picture | None:
        made.append(one.sequence)
        return real(one)

    monkeypatch.setattr(server_module, "picture_of", counting)
    server = serve()
    numbers = itertools.count()
    clients = call(), call()
    for _ in range(20):
        server.offer(frame(next(numbers)))
    assert (made, server.watched) == ([], False)
    for client in clients:
        client.answer(client.say(WatchPictures, every_s=0.01))
        client.hear_until(lambda one: isinstance(one, Picture))
    assert set(made) == {19}
    clients[0].answer(clients[0].say(WatchPictures, every_s=None))
    clients[1].close()
    wait_for(lambda: not server.watched)
    time.sleep(0.05)
    before = len(made)
    for _ in range(20):
        server.offer(frame(next(numbers)))
        time.sleep(0.001)
    assert len(made) == before


def test_pictures_come_no_more_often_than_asked(serve: Serve, call: Callable[[], Caller]) -> None:
    """However many frames there are; between two of them at least half the time that was asked for."""
    server = serve()
    client = call()
    client.say(WatchPictures, every_s=0.2)
    stop = threading.Event()

    def film() -> None:
        for number in itertools.count():
            server.offer(frame(number))
            if stop.wait(0.005):
                return

    camera = threading.Thread(target=film)
    camera.start()
    began_s = time.monotonic()
    for _ in range(5):
        client.hear_until(lambda one: isinstance(one, Picture))
    lasted_s = time.monotonic() - began_s
    stop.set()
    camera.join()
    assert lasted_s >= 4 * 0.2 * 0.5


def test_nobody_waits_for_who_wants_pictures_seldom(serve: Serve, call: Callable[[], Caller]) -> None:
    """However seldom that is, and however large the number."""
    server = serve()
    for every_s in (1e300, 1e9, 30.0):
        seldom = call()
        seldom.say(WatchPictures, every_s=every_s)
        wait_for(lambda: server.watched)
        server.offer(frame(1))
        seldom.hear_until(lambda one: isinstance(one, Picture))
    often = call()
    often.answer(often.say(WatchPictures, every_s=0.02))
    for number in (2, 3):
        server.offer(frame(number))
        often.hear_until(lambda one: isinstance(one, Picture))


def test_last_words_are_heard(serve: Serve, call: Callable[[], Caller]) -> None:
    """What was told just before the end reaches whoever reads; then the connection ends, and the file is gone."""
    server = serve()
    client = call()
    client.follow()
    client.answer(client.say(WatchPictures, every_s=None))
    # What follows is asked for already: questions are taken in their order.
    for number in range(300):
        server.tell(state(number))
    closer = threading.Thread(target=server.close)
    closer.start()
    client.hear_until(is_told("299"))
    assert client.hear_or_end() is None
    closer.join()
    server.tell(state(300))
    server.show(State(phase=Phase.FAULT))
    server.offer(frame(1))
    server.close()
