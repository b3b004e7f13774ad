"""What a box sends and when, on a clock of the test's own: the window, what is sent again, how often it tells its state."""

import pytest
from fleet_rig import TOPICS

from dnb_edge.fleet.messages import BoxState, HubStatus, Parcel, Status, Stored, decode, encode
from dnb_edge.fleet.outbox import Heard, Outbox
from dnb_edge.fleet.publisher import RESEND_S, STATE_S, WINDOW, Publisher


class Line:
    def __init__(self) -> None:
        self.said: list[tuple[str, bytes]] = []

    def publish(self, topic, payload, *, retain=False, qos=1):
        self.said.append((topic, payload))

    def numbers(self) -> list[int]:
        """Of the parcels that were sent since this was asked last."""
        said, self.said = self.said, []
        return [decode(Parcel, payload).number for topic, payload in said if topic == TOPICS.parcel("a")]

    def of(self, topic: str) -> list[bytes]:
        return [payload for where, payload in self.said if where == topic]


class Ear:
    """What the listener has heard."""

    state = BoxState(phase="racing")

    def check(self) -> None:
        pass


class Rig:
    def __init__(self, path) -> None:
        self.now_s = 100.0
        self.outbox = Outbox(path)
        self.ear = Ear()
        self.line = Line()
        self.box = Publisher(
            box="a",
            topics=TOPICS,
            outbox=self.outbox,
            listener=self.ear,
            say=lambda words: None,
            clock_s=lambda: self.now_s,
        )
        self.box.greeted(self.line)

    def race(self, count: int) -> None:
        for _ in range(count):
            number = self.outbox.last + 1
            self.outbox.add(
                {"event": "lap"}, Heard(epoch="e", sequence=number), run=None, track=None, wall_s=0.0, key=None
            )

    def hub(self, connection: str) -> None:
        self.box.heard(
            self.line, TOPICS.hub, encode(HubStatus(online=bool(connection), connection=connection)), retained=True
        )

    def stored(self, number: int) -> None:
        message = Stored(queue=self.outbox.name, stored=number)
        self.box.heard(self.line, TOPICS.stored("a"), encode(message), retained=False)

    def sent(self, after_s: float = 0.0) -> list[int]:
        """What is sent in a turn, so long from now."""
        self.now_s += after_s
        self.box.turn(self.line)
        return self.line.numbers()


@pytest.fixture
def rig(tmp_path):
    made = Rig(tmp_path / "queue.sqlite")
    yield made
    made.outbox.close()


def test_nothing_is_sent_without_a_hub_and_at_most_a_window_to_one(rig):
    """As much as the hub stores comes after it."""
    rig.race(WINDOW + 50)
    assert rig.sent() == []
    rig.hub("x")
    assert rig.sent() == list(range(1, WINDOW + 1))
    assert rig.sent() == []
    rig.stored(30)
    assert rig.sent() == list(range(WINDOW + 1, WINDOW + 31))
    assert rig.outbox.waiting == WINDOW + 20


def test_another_hub_connection_gets_what_is_not_stored_at_once(rig):
    """What was under way to the one before may never have come; the same one is not told again."""
    rig.race(10)
    rig.hub("x")
    rig.sent()
    rig.stored(4)
    rig.hub("x")
    assert rig.sent() == []
    rig.hub("y")
    assert rig.sent() == list(range(5, 11))


def test_what_is_not_stored_in_time_is_sent_again(rig):
    """Whatever is sent behind it meanwhile; as long as the hub goes on storing, nothing is."""
    rig.race(5)
    rig.hub("x")
    assert rig.sent() == [1, 2, 3, 4, 5]
    for number in range(6, 10):
        rig.race(1)
        assert rig.sent(0.24 * RESEND_S) == [number]
    rig.stored(2)
    assert rig.sent(0.9 * RESEND_S) == []
    assert rig.sent(0.2 * RESEND_S) == [3, 4, 5, 6, 7, 8, 9]


def test_a_word_for_another_queue_is_none_for_this_one(rig):
    """That of the box's queue before it, which the broker has kept."""
    rig.race(3)
    rig.box.heard(rig.line, TOPICS.stored("a"), encode(Stored(queue="other", stored=99)), retained=True)
    rig.hub("x")
    assert (rig.sent(), rig.outbox.waiting) == ([1, 2, 3], 3)


def test_a_state_is_told_soon_where_it_changes_and_now_and_then_where_not(rig):
    """A heartbeat, by which a hub tells boxes that died together with their broker."""
    topic = TOPICS.state("a")
    rig.box.turn(rig.line)
    rig.now_s += 0.5 * STATE_S
    rig.box.turn(rig.line)
    assert len(rig.line.of(topic)) == 1
    rig.ear.state = BoxState(phase="fault", reason="no camera")
    rig.box.turn(rig.line)
    assert [decode(BoxState, payload).phase for payload in rig.line.of(topic)] == ["racing", "fault"]
    rig.now_s += STATE_S
    rig.box.turn(rig.line)
    assert len(rig.line.of(topic)) == 3


def test_a_state_that_is_too_long_goes_without_its_standings(rig):
    """Rather than not at all."""
    rig.ear.state = BoxState(phase="racing", standings={"rows": ["x" * 70_000]})
    rig.box.turn(rig.line)
    (payload,) = rig.line.of(TOPICS.state("a"))
    assert (decode(BoxState, payload).standings, decode(BoxState, payload).phase) == (None, "racing")


@pytest.mark.parametrize("status", [Status(online=False, queue="other"), Status(online=False, queue="mine")])
def test_whoever_says_that_it_is_gone_is_answered(status, rig):
    """The last will of another one of its name, or its own of a line before."""
    rig.line.said.clear()
    queue = rig.outbox.name if status.queue == "mine" else status.queue
    rig.box.heard(rig.line, TOPICS.status("a"), encode(Status(online=False, queue=queue)), retained=False)
    (payload,) = rig.line.of(TOPICS.status("a"))
    assert decode(Status, payload).online
