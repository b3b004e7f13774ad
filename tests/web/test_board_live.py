"""The client of the live stream: order, resumption, back-off, and what it says of the line."""

import pytest
from board_page import DOWN, Stream, hello, site, state

FOLLOW = """
async () => {
  const { follow } = await import("/static/live.js");
  globalThis.told = [];
  globalThis.line = follow({
    onHello: (hello) => told.push(`hello ${hello.epoch} ${hello.resumed}`),
    onState: (state) => told.push(`state ${state?.phase ?? "down"}`),
    onEvent: (event, { sequence, past }) => told.push(`event ${sequence}${past ? " past" : ""}`),
    onLine: (line) => told.push(`line ${line}`),
  });
}
"""


@pytest.fixture(scope="module")
def pages():
    with site() as pages:
        yield pages


@pytest.fixture
def stream():
    return Stream()


@pytest.fixture
def page(pages, stream):
    """A page of ours on which nothing else follows the stream."""
    page = pages.page(stream)
    page.goto("/static/live.js")
    yield page
    page.context.close()


def event(sequence):
    return {"kind": "event", "sequence": sequence, "event": {"event": "health", "t_s": float(sequence)}}


def heard(page, last):
    """All that was told, once `last` was."""
    page.wait_for_function("last => told.at(-1) === last", arg=last)
    return page.evaluate("told.splice(0)")


def test_events_come_in_order_and_none_twice(page, stream):
    """Numbers that are left out are no loss, repeated ones are dropped, and what had happened before is told as past."""
    stream.greeting = [hello(following=3), state(), event(0), event(2)]
    page.evaluate(FOLLOW)
    page.wait_for_function("() => told.length === 6")
    stream.send(event(2), event(1), {"kind": "beat"}, event(7))
    assert heard(page, "event 7") == [
        "line connecting",
        "line connected",
        "hello e1 false",
        "state racing",
        "event 0 past",
        "event 2 past",
        "event 7",
    ]


def test_a_broken_line_is_resumed_where_it_broke(page, stream):
    """After a break the page asks for what follows the last event of that epoch, and says meanwhile that it tries again."""
    stream.greeting = [hello(following=0), state(), event(4)]
    page.evaluate(FOLLOW)
    heard(page, "event 4")
    stream.greeting = [hello(resumed=True), state(), event(5)]
    stream.drop()
    assert heard(page, "event 5") == ["line reconnecting", "line connected", "hello e1 true", "state racing", "event 5"]
    assert "since=" not in stream.asked[0]
    assert stream.asked[1].endswith("?epoch=e1&since=5")


def test_another_epoch_begins_anew(page, stream):
    """A daemon that was started again numbers from 0: nothing of the old epoch hides its events."""
    stream.greeting = [hello(), state(), event(100)]
    page.evaluate(FOLLOW)
    heard(page, "event 100")
    stream.greeting = [hello("e2", resumed=False), state(), event(0)]
    stream.drop()
    assert heard(page, "event 0")[-3:] == ["hello e2 false", "state racing", "event 0"]


def test_a_daemon_that_is_down_is_told_and_comes_back_by_itself(page, stream):
    """The line to the web stays while the daemon is away; its return is told without anybody's doing."""
    stream.greeting = [hello(), state()]
    page.evaluate(FOLLOW)
    heard(page, "state racing")
    stream.send(DOWN)
    assert heard(page, "state down") == ["line daemon-down", "state down"]
    stream.send(hello("e2"), state("starting"))
    assert heard(page, "state starting") == ["hello e2 false", "line connected", "state starting"]
    assert len(stream.sockets) == 1


WAITS = """
async (closes) => {
  const { follow } = await import("/static/live.js");
  const waits = [], timers = [], sockets = [], told = [];
  const world = {
    open: (url) => { const socket = { url, close() {} }; sockets.push(socket); return socket; },
    now: () => 0,
    chance: () => 0.5,
    after: (ms, run) => { timers.push(run); waits.push(ms); return timers.length; },
    stop: () => {},
  };
  const line = follow({ onLine: (line) => told.push(line) }, world);
  for (let k = 0; k < closes; k += 1) { sockets.at(-1).onclose(); timers.at(-1)(); }
  const pauses = waits.filter((ms) => ms !== 20000);
  sockets.at(-1).onmessage({ data: JSON.stringify({ kind: "hello", epoch: "e", next: 0, resumed: false }) });
  sockets.at(-1).onclose();
  const last = waits.at(-1);
  timers.at(-1)();
  timers.findLast((_, at) => waits[at] === 20000)();
  const silent = sockets.length;
  sockets.at(-2).onclose();
  line.close();
  return { pauses, last, silent, after: sockets.length };
}
"""


def test_tries_grow_apart_and_begin_anew_once_it_works(page):
    """A server that is away is asked less and less often, at least every eight seconds; a line that worked is tried at once."""
    found = page.evaluate(WAITS, 7)
    assert found["pauses"] == [250, 500, 1000, 2000, 4000, 8000, 8000]
    assert found["last"] == 250


def test_a_silent_line_is_opened_again(page):
    """A connection on which nothing comes for twenty seconds is left, and its late end changes nothing."""
    found = page.evaluate(WAITS, 1)
    assert found["silent"] == 4
    assert found["after"] == found["silent"]


def test_what_is_not_ours_is_passed_over(page, stream):
    """Text that is no message and messages of a later version break nothing."""
    stream.greeting = [hello(), state()]
    page.evaluate(FOLLOW)
    heard(page, "state racing")
    stream.sockets[-1].send("<html>")
    stream.sockets[-1].send("null")
    stream.send({"kind": "something new"}, event(1))
    assert heard(page, "event 1") == ["event 1"]
