"""The line to the daemon and the stream to browsers: nothing that lasts is lost or told twice, whoever goes away meanwhile."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.applications import Starlette
from web_box import app_in, served, settings_in
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from dnb_edge.live.messages import (
    PROTOCOL,
    AimCamera,
    Answer,
    Follow,
    Hello,
    Message,
    NewRun,
    Phase,
    Picture,
    ShowText,
    State,
    Told,
    WatchPictures,
    decode,
    encode,
)
from dnb_edge.web import app as web_app
from dnb_edge.web.app import make_app
from dnb_edge.web.daemon_line import DaemonLine
from dnb_edge.web.endpoint import Refused
from dnb_edge.web.kept import Kept
from dnb_edge.web.stream import Live
from dnb_edge.web.waiting import TooSlow, Waiting

PATIENCE_S = 20.0


class Pretended:
    """A daemon on a real socket, which says what a test wants."""

    def __init__(self, path: Path, epoch: str = "one") -> None:
        self.path = path
        self.epoch = epoch
        self.asked: list[Message] = []
        self.told: list[Told] = []
        self.state = State(phase=Phase.RACING, run="run-1")
        self.reason: str | None = None
        self._writers: list[asyncio.StreamWriter] = []
        self._server: asyncio.Server | None = None

    async def __aenter__(self) -> Pretended:
        self.path.unlink(missing_ok=True)
        self._server = await asyncio.start_unix_server(self._serve, self.path)
        return self

    async def __aexit__(self, *_: object) -> None:
        assert self._server is not None
        self._server.close()
        self.cut()
        await asyncio.sleep(0)

    def cut(self) -> None:
        """Breaks the line."""
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()

    def lap(self, number: int, kind: str = "lap") -> None:
        """Tells an event."""
        following = self.told[-1].sequence + 1 if self.told else self.state.first_sequence
        self.told.append(Told(sequence=following, event={"event": kind, "lap": number}))
        self.say(self.told[-1])

    def say(self, message: Message, raw: bytes | None = None) -> None:
        """Says anything to everybody."""
        for writer in self._writers:
            writer.write(encode(message) if raw is None else raw)

    def show(self, state: State) -> None:
        """Another state."""
        self.state = state
        self.say(state)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        first = self.told[0].sequence if self.told else 0
        following = self.told[-1].sequence + 1 if self.told else 0
        hello = Hello(protocol=PROTOCOL, version="0", epoch=self.epoch, next_sequence=following, first_sequence=first)
        writer.write(encode(hello) + encode(self.state))
        with contextlib.suppress(OSError):
            while line := await reader.readline():
                message = decode(line)
                assert message is not None
                self.asked.append(message)
                if isinstance(message, Follow):
                    assert message.since is not None
                    since = message.since if message.epoch == self.epoch else 0
                    for told in self.told:
                        if told.sequence >= since:
                            writer.write(encode(told))
                    self._writers.append(writer)
                elif not isinstance(message, WatchPictures):
                    assert isinstance(message, NewRun | AimCamera | ShowText)
                    writer.write(encode(Answer(ask=message.ask, done=self.reason is None, reason=self.reason)))
        writer.close()


async def until(true: Callable[[], object]) -> None:
    """Waits until something is so."""
    async with asyncio.timeout(PATIENCE_S):
        while not true():
            await asyncio.sleep(0.01)


@contextlib.asynccontextmanager
async def lined(path: Path) -> AsyncIterator[DaemonLine]:
    """A line that runs."""
    line = DaemonLine(path)
    task = asyncio.create_task(line.run())
    try:
        yield line
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def laps(line: DaemonLine) -> list[int]:
    """The laps that the line has kept."""
    return [told.event["lap"] for told in line.events() if told.event["event"] == "lap"]


def run(test: Callable[[], Awaitable[None]]) -> None:
    """Runs an asynchronous test."""

    async def limited() -> None:
        async with asyncio.timeout(3 * PATIENCE_S):
            await test()

    asyncio.run(limited())


def test_the_line_comes_back_and_keeps_what_lasts(tmp_path: Path) -> None:
    """Through a broken line in mid-race: all laps once, in order, and the state None in between."""

    async def test() -> None:
        async with Pretended(tmp_path / "live.sock") as daemon, lined(daemon.path) as line:
            await until(lambda: line.state)
            seen: list[Any] = []
            follower = asyncio.create_task(_collect(line.follow(), seen))
            daemon.lap(1)
            daemon.lap(1, "running")
            await until(lambda: laps(line) == [1])
            daemon.cut()
            await until(lambda: line.state is None)
            daemon.lap(2)
            await until(lambda: laps(line) == [1, 2])
            daemon.lap(3)
            await until(lambda: len(seen) >= 6)
            follower.cancel()
            kinds = [item.event["lap"] if isinstance(item, Told) else type(item).__name__ for item in seen]
            assert kinds == [1, 1, "NoneType", "State", 2, 3]
            follows = [asked for asked in daemon.asked if isinstance(asked, Follow)]
            assert [(asked.since, asked.epoch) for asked in follows] == [(0, "one"), (2, "one")]

    run(test)


def test_another_process_begins_anew(tmp_path: Path) -> None:
    """Its numbers have nothing to do with those before."""

    async def test() -> None:
        async with lined(tmp_path / "live.sock") as line:
            async with Pretended(line._path) as daemon:
                await until(lambda: line.state)
                for number in range(5):
                    daemon.lap(number)
                await until(lambda: len(laps(line)) == 5)
            await until(lambda: line.state is None)
            async with Pretended(line._path, "two") as daemon:
                daemon.lap(100)
                await until(lambda: line.epoch == "two" and laps(line) == [100])

    run(test)


def test_another_run_forgets_the_one_before(tmp_path: Path) -> None:
    """Whoever comes later is not told of laps of a race that is over."""

    async def test() -> None:
        async with Pretended(tmp_path / "live.sock") as daemon, lined(daemon.path) as line:
            await until(lambda: line.state)
            daemon.lap(1)
            await until(lambda: laps(line) == [1])
            daemon.show(State(phase=Phase.RACING, run="run-2", first_sequence=1))
            await until(lambda: laps(line) == [])
            daemon.lap(7)
            await until(lambda: laps(line) == [7])

    run(test)


@pytest.mark.parametrize(
    "raw",
    [
        b"nonsense\n",
        b"[]\n",
        b'{"say": "event", "sequence": "x"}\n',
        b'{"say": "picture", "blob_bytes": -1}\n',
        b"x" * (2 << 20),
    ],
)
def test_nonsense_breaks_the_line_and_nothing_else(tmp_path: Path, raw: bytes) -> None:
    """It comes back, and knows what it knew."""

    async def test() -> None:
        async with Pretended(tmp_path / "live.sock") as daemon, lined(daemon.path) as line:
            await until(lambda: line.state)
            daemon.lap(1)
            await until(lambda: laps(line) == [1])
            daemon.say(daemon.state, raw)
            await until(lambda: line.state is None)
            await until(lambda: line.state)
            assert laps(line) == [1]

    run(test)


def test_a_daemon_that_greets_and_dies_is_found_again(tmp_path: Path) -> None:
    """Also while pictures are wanted: what cannot be asked of it any more ends this connection, and not the line."""

    async def test() -> None:
        path, greeted = tmp_path / "live.sock", 0

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            nonlocal greeted
            greeted += 1
            hello = Hello(protocol=PROTOCOL, version="0", epoch="one", next_sequence=0, first_sequence=0)
            writer.write(encode(hello))
            if greeted == 1:
                with contextlib.suppress(OSError):
                    await asked_for_pictures(reader)
            writer.close()

        async def asked_for_pictures(reader: asyncio.StreamReader) -> None:
            while not isinstance(decode(await reader.readline()), WatchPictures):
                pass

        async with lined(path) as line, await asyncio.start_unix_server(serve, path):
            await until(lambda: line.epoch is not None)
            with pytest.raises(Refused):
                await line.picture(timeout_s=0.5)
            await until(lambda: greeted >= 4)

    run(test)


def test_messages_of_later_versions_are_passed_over(tmp_path: Path) -> None:
    """A kind that we do not know is no reason to hang up; a newer protocol is."""

    async def test() -> None:
        async with Pretended(tmp_path / "live.sock") as daemon, lined(daemon.path) as line:
            await until(lambda: line.state)
            daemon.say(daemon.state, b'{"say": "tea"}\n')
            daemon.lap(1)
            await until(lambda: laps(line) == [1])
            hello = Hello(protocol=PROTOCOL + 1, version="9", epoch="x", next_sequence=0, first_sequence=0)
            with pytest.raises(Exception, match="newer than these pages"):
                line._greet(hello)

    run(test)


def test_asking(tmp_path: Path) -> None:
    """What the daemon does not do is refused with its reason; a daemon that is down, at once."""

    async def test() -> None:
        async with lined(tmp_path / "live.sock") as line:
            with pytest.raises(Refused) as down:
                await line.ask(new_run=True)
            assert (down.value.status, down.value.code) == (503, "daemon-down")
            async with Pretended(line._path) as daemon:
                await until(lambda: line.state)
                await line.ask(new_run=True, entry="Ada")
                await line.ask(aim=True)
                await line.ask(show="hello", for_s=2.0)
                asked = [one for one in daemon.asked if not isinstance(one, Follow)]
                assert [type(one) for one in asked] == [NewRun, AimCamera, ShowText]
                assert isinstance(asked[0], NewRun)
                assert asked[0].entry == "Ada"
                daemon.reason = "no track yet"
                with pytest.raises(Refused, match="no track yet") as refused:
                    await line.ask(aim=False)
                assert refused.value.status == 409
            with pytest.raises(ValueError, match="cannot be asked"):
                await line.ask(tea=True)

    run(test)


def test_pictures_are_asked_for_only_while_somebody_looks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first look asks for them, the last one's end says so; each comes once to whoever waits for the next."""

    async def test() -> None:
        async with Pretended(tmp_path / "live.sock") as daemon, lined(daemon.path) as line:
            await until(lambda: line.state)
            with pytest.raises(Refused) as refused:
                await line.picture(timeout_s=0.1)
            assert (refused.value.status, refused.value.code) == (503, "no-picture")
            looks = [asyncio.create_task(line.picture()) for _ in range(3)]
            await asyncio.sleep(0)
            daemon.say(shot(1))
            assert [picture.jpeg for picture in await asyncio.gather(*looks)] == [b"jpeg1"] * 3
            following = asyncio.create_task(line.picture(newer_than_ns=1))
            await asyncio.sleep(0.05)
            assert not following.done()
            daemon.say(shot(2))
            assert (await following).t_ns == 2
            line._wanted_until_s = 0.0
            daemon.say(shot(3))
            await until(lambda: watches(daemon) == [0.1, None])
            await until(lambda: line._wanted_until_s is None)
            daemon.cut()
            await until(lambda: line.state is None)
            with pytest.raises(Refused, match="not running"):
                await line.picture()

    run(test)


def shot(number: int) -> Picture:
    return Picture(t_ns=number, frame=number, width_px=2, height_px=2, jpeg=b"jpeg%d" % number)


def watches(daemon: Pretended) -> list[float | None]:
    return [asked.every_s for asked in daemon.asked if isinstance(asked, WatchPictures)]


async def _collect(items: AsyncIterator[Any], into: list[Any]) -> None:
    async for item in items:
        into += (item,)


@given(st.lists(st.booleans(), max_size=60), st.integers(1, 8))
def test_what_waits_is_bounded_and_loses_only_what_may_be_lost(fleeting: list[bool], most: int) -> None:
    """In any order of items: no more than so many wait, and those that last are all there, in order, or the reader is told."""
    waiting: Waiting[int] = Waiting(most)
    for number, may_go in enumerate(fleeting):
        waiting.put(number, fleeting=may_go)
    lasting = [number for number, may_go in enumerate(fleeting) if not may_go]

    async def read() -> list[int]:
        return [await waiting.get() for _ in range(len(waiting._items))]

    if len(lasting) > most:
        with pytest.raises(TooSlow):
            asyncio.run(read())
        return
    assert len(waiting._items) <= most
    found = asyncio.run(read())
    assert [number for number in found if not fleeting[number]] == lasting
    assert found == sorted(found)


@given(st.lists(st.sampled_from(["lap", "running", "health", "standings"]), max_size=50), st.integers(0, 60))
def test_kept(kinds: list[str], since: int) -> None:
    """Every lap, the last of health and standings, nothing of where the cars were."""
    kept = Kept()
    events = [Told(sequence=2 * number, event={"event": kind}) for number, kind in enumerate(kinds)]
    assert all(kept.add(told) for told in events)
    assert not any(kept.add(told) for told in events)
    found = kept.since(since)
    assert [told for told in found if told.event["event"] == "lap"] == [
        told for told in events if told.event["event"] == "lap" and told.sequence >= since
    ]
    for kind in ("health", "standings"):
        last = [told for told in events if told.event["event"] == kind][-1:]
        assert [told for told in found if told.event["event"] == kind] == [t for t in last if t.sequence >= since]
    assert list(found) == sorted(found, key=lambda told: told.sequence)


class Browser:
    """A page's script: keeps what it has heard, as live.js does."""

    def __init__(self) -> None:
        self.heard: list[dict[str, Any]] = []
        self.laps: list[int] = []
        self.next: int | None = None
        self.epoch: str | None = None
        self.states: list[Any] = []
        self.resumed: list[bool] = []

    async def hear(self, socket: ClientConnection, enough: Callable[[], object]) -> None:
        """Listens until it has heard enough."""
        async with asyncio.timeout(PATIENCE_S):
            while not enough():
                message = json.loads(await socket.recv())
                match message["kind"]:
                    case "hello":
                        self.epoch = message["epoch"]
                        self.resumed.append(message["resumed"])
                        if not message["resumed"]:
                            self.laps, self.next = [], None
                    case "state":
                        self.states.append(message["state"])
                    case "event":
                        assert self.next is None or message["sequence"] >= self.next, "told twice"
                        self.next = message["sequence"] + 1
                        if message["event"]["event"] == "lap":
                            self.laps.append(message["event"]["lap"])

    def address(self, port: int) -> str:
        """Where it goes on."""
        asked = "" if self.next is None else f"?since={self.next}&epoch={self.epoch}"
        return f"ws://127.0.0.1:{port}/api/v1/live{asked}"


def test_a_browser_resumes_where_it_was(tmp_path: Path) -> None:
    """Reloads, broken lines on either side and a restarted daemon: each lap once, in order, and fresh starts said as such."""

    async def test(port: int) -> None:
        path = tmp_path / "live.sock"
        browser = Browser()
        async with Pretended(path) as daemon:
            async with connect(browser.address(port)) as socket:
                await browser.hear(socket, lambda: browser.states and browser.states[-1] is not None)
                daemon.lap(1)
                daemon.lap(0, "running")
                daemon.lap(2)
                await browser.hear(socket, lambda: browser.laps == [1, 2])
            daemon.lap(3)
            async with connect(browser.address(port)) as socket:
                daemon.lap(4)
                await browser.hear(socket, lambda: browser.laps == [1, 2, 3, 4])
                assert browser.resumed[-1] is True
                daemon.cut()
                await browser.hear(socket, lambda: browser.states[-1] is None)
                daemon.lap(5)
                await browser.hear(socket, lambda: browser.laps == [1, 2, 3, 4, 5])
                daemon.show(State(phase=Phase.RACING, run="run-2", first_sequence=6))
                await browser.hear(socket, lambda: browser.states[-1] and browser.states[-1]["run"] == "run-2")
            stale = Browser()
            stale.next, stale.epoch = 2, "one"
            async with connect(stale.address(port)) as socket:
                daemon.lap(6)
                await stale.hear(socket, lambda: stale.laps == [6])
                assert stale.resumed == [False]
        async with connect(browser.address(port)) as socket:
            await browser.hear(socket, lambda: browser.states[-1] is None)
            async with Pretended(path, "two") as daemon:
                daemon.lap(9)
                await browser.hear(socket, lambda: browser.laps == [9])
                assert browser.resumed[-1] is False
                assert browser.epoch == "two"

    with served(app_in(tmp_path)) as port:
        run(lambda: test(port))


class Talker:
    """A daemon in the same process, for the fan-out alone."""

    def __init__(self) -> None:
        self.epoch: str | None = "one"
        self.state: State | None = State(phase=Phase.RACING)
        self.kept = Kept()
        self.queue: asyncio.Queue[Told | State | None] = asyncio.Queue()

    @property
    def first(self) -> int:
        return self.kept.first

    def events(self, since: int | None = None) -> tuple[Told, ...]:
        return self.kept.since(since)

    async def follow(self) -> AsyncIterator[Told | State | None]:
        while True:
            yield await self.queue.get()

    async def picture(self, **_: Any) -> Picture:
        raise NotImplementedError

    async def ask(self, **_: Any) -> None:
        raise NotImplementedError

    def say(self, sequence: int, kind: str = "lap") -> None:
        """An event, kept at once and handed on when its turn comes."""
        told = Told(sequence=sequence, event={"event": kind, "lap": sequence})
        self.kept.add(told)
        self.queue.put_nowait(told)


def test_what_is_kept_and_on_its_way_comes_once() -> None:
    """A browser that opens while events wait to be handed on is told them by one way only."""

    async def test() -> None:
        daemon = Talker()
        live = Live(daemon, 3)
        task = asyncio.create_task(live.run())
        await asyncio.sleep(0)
        # Said while the browser is being let in: kept by then, and handed on only afterwards.
        socket = Socket(at_the_door=lambda: [daemon.say(number) for number in range(5)])
        viewing = asyncio.create_task(live.serve(socket))  # type: ignore[arg-type]
        await asyncio.sleep(0)
        for number in range(5, 8):
            daemon.say(number)
        await until(lambda: len(socket.laps()) >= 8)
        daemon.state = None
        daemon.queue.put_nowait(None)
        await until(lambda: json.loads(socket.sent[-1]) == {"kind": "state", "state": None})
        assert socket.laps() == list(range(8))
        assert live.viewers == 1
        socket.leave.set()
        await viewing
        assert live.viewers == 0
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run(test)


async def heard_by(live: Live, socket: Socket) -> list[dict[str, Any]]:
    """What a browser is told at once."""
    viewing = asyncio.create_task(live.serve(socket))  # type: ignore[arg-type]
    for _ in range(200):
        await asyncio.sleep(0)
    socket.leave.set()
    await viewing
    return [json.loads(text) for text in socket.sent]


def test_who_lacks_what_nobody_keeps_begins_anew() -> None:
    """A browser that slept longer than events are kept is not told that it goes on where it was."""

    async def test() -> None:
        daemon = Talker()
        daemon.kept = Kept(most=20)
        for number in range(50):
            daemon.say(number)
        live = Live(daemon, 3)
        oldest = daemon.kept.since(None)[0].sequence
        late = await heard_by(live, Socket(epoch="one", since=str(oldest - 1)))
        assert (late[0]["resumed"], late[2]["sequence"]) == (False, oldest)
        just = await heard_by(live, Socket(epoch="one", since=str(oldest)))
        assert (just[0]["resumed"], just[2]["sequence"]) == (True, oldest)

    run(test)


def test_pages_that_have_just_begun_tell_nothing_twice() -> None:
    """The daemon's line is there and its kept events are not yet: a browser that has them hears only what comes after them."""

    async def test() -> None:
        daemon = Talker()
        live = Live(daemon, 3)
        task = asyncio.create_task(live.run())
        await asyncio.sleep(0)
        socket = Socket(epoch="one", since="5")
        viewing = asyncio.create_task(live.serve(socket))  # type: ignore[arg-type]
        await asyncio.sleep(0)
        for number in range(8):
            daemon.say(number)
        await until(lambda: 7 in socket.laps())
        assert json.loads(socket.sent[0])["resumed"] is True
        assert socket.laps() == [5, 6, 7]
        socket.leave.set()
        task.cancel()
        await asyncio.gather(viewing, task, return_exceptions=True)

    run(test)


def test_browsers_that_come_together_share_their_texts() -> None:
    """A hundred pages that come back at once after a long race take no hundredfold memory; another daemon's are others."""

    async def test() -> None:
        daemon = Talker()
        for number in range(50):
            daemon.say(number)
        live = Live(daemon, 3)
        one, two = Socket(), Socket()
        await heard_by(live, one)
        await heard_by(live, two)
        assert all(first is second for first, second in zip(one.sent[2:], two.sent[2:], strict=True))
        daemon.epoch, daemon.kept = "two", Kept()
        daemon.say(0, "race_state")
        assert [text["event"]["event"] for text in (await heard_by(live, Socket()))[2:]] == ["race_state"]

    run(test)


def test_what_fails_unforeseen_is_begun_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Neither the line nor the fan-out ends for ever, silently, while the pages go on."""
    monkeypatch.setattr(web_app, "AGAIN_S", 0.0)
    begun: list[int] = []

    async def work() -> None:
        begun.append(1)
        if len(begun) < 3:
            raise ZeroDivisionError
        await asyncio.Event().wait()

    async def test() -> None:
        task = asyncio.create_task(web_app.lasting(work))
        await until(lambda: len(begun) == 3)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run(test)
    assert caplog.text.count("begun again") == 2


def test_a_browser_that_does_not_listen_is_cut_off() -> None:
    """After as many events as may wait; where the cars are is dropped first; the others go on."""

    async def test() -> None:
        daemon = Talker()
        live = Live(daemon, 3)
        task = asyncio.create_task(live.run())
        await asyncio.sleep(0)
        deaf, good = Socket(deaf=True), Socket()
        viewing = [asyncio.create_task(live.serve(one)) for one in (deaf, good)]  # type: ignore[arg-type]
        await until(lambda: live.viewers == 2)
        for number in range(600):
            daemon.say(number, "running")
            await asyncio.sleep(0)
        assert deaf.closed is None
        for number in range(600, 900):
            daemon.say(number)
            await asyncio.sleep(0)
        await until(lambda: len(good.laps()) == 300)
        deaf.deaf.set()
        await until(lambda: deaf.closed == 1013)
        assert good.closed is None
        good.leave.set()
        await asyncio.gather(*viewing)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run(test)


class Socket:
    """As much of a WebSocket as `Live.serve` uses."""

    def __init__(self, *, deaf: bool = False, at_the_door: Callable[[], object] = list, **query: str) -> None:
        self.at_the_door = at_the_door
        self.query_params = query
        self.sent: list[str] = []
        self.closed: int | None = None
        self.leave = asyncio.Event()
        self.deaf = asyncio.Event()
        if not deaf:
            self.deaf.set()

    async def accept(self) -> None:
        self.at_the_door()

    async def receive(self) -> dict[str, Any]:
        await self.leave.wait()
        return {"type": "websocket.disconnect"}

    async def send_text(self, text: str) -> None:
        await self.deaf.wait()
        self.sent.append(text)

    async def close(self, code: int) -> None:
        self.closed = code

    def laps(self) -> list[int]:
        messages = [json.loads(text) for text in self.sent]
        return [one["sequence"] for one in messages if one["kind"] == "event" and one["event"]["event"] == "lap"]


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A served application whose daemon is down."""
    app: Starlette = app_in(tmp_path_factory.mktemp("box"))
    with served(app) as port:
        yield port


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Host": "evil.example"}, 421),
    ],
)
def test_foreign_pages_hear_nothing(port: int, headers: dict[str, str], status: int) -> None:
    """A WebSocket asks no permission of browsers, so the box looks itself who it is: the upgrade is refused."""

    async def test() -> None:
        if "Host" in headers:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(
                b"GET /api/v1/live HTTP/1.1\r\nHost: evil.example\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
            )
            assert (await reader.readline()).split()[1] == str(status).encode()
            writer.close()
            return
        with pytest.raises(InvalidStatus) as refused:
            async with connect(f"ws://127.0.0.1:{port}/api/v1/live", additional_headers=headers):
                pass
        assert refused.value.response.status_code == status

    run(test)


def test_own_pages_and_scripts_listen(port: int) -> None:
    """With this page's origin, or with none; while the daemon is down they are told so."""

    async def test() -> None:
        for headers in ({}, {"Origin": f"http://127.0.0.1:{port}"}):
            async with connect(f"ws://127.0.0.1:{port}/api/v1/live?since=x", additional_headers=headers) as socket:
                hello = {"kind": "hello", "epoch": None, "next": 0, "resumed": False}
                assert json.loads(await socket.recv()) == hello
                assert json.loads(await socket.recv()) == {"kind": "state", "state": None}

    run(test)


@pytest.mark.parametrize(("said", "code"), [("hello", 1003), ("x" * 5000, 1009), (b"\x00", 1003)])
def test_browsers_have_nothing_to_say(port: int, said: Any, code: int) -> None:
    """Whoever talks is hung up on, at length or not."""

    async def test() -> None:
        async with connect(f"ws://127.0.0.1:{port}/api/v1/live") as socket:
            await socket.send(said)
            with pytest.raises(ConnectionClosed) as closed:
                await Browser().hear(socket, lambda: False)
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == code

    run(test)


def test_no_more_viewers_than_so_many(tmp_path: Path) -> None:
    """One more is refused with 503, and let in when another one has gone."""

    async def test(port: int) -> None:
        address = f"ws://127.0.0.1:{port}/api/v1/live"
        async with connect(address), connect(address):
            with pytest.raises(InvalidStatus) as refused:
                async with connect(address):
                    pass
            assert refused.value.response.status_code == 503
        async with asyncio.timeout(PATIENCE_S):
            while True:
                try:
                    async with connect(address) as socket:
                        await socket.recv()
                        return
                except InvalidStatus:
                    await asyncio.sleep(0.05)

    with served(make_app(settings_in(tmp_path, most_viewers=2))) as port:
        run(lambda: test(port))
