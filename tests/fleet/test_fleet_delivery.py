"""Laps from boxes to the hub through a real broker that is killed, cut off and restarted: each arrives once, in its order."""

import contextlib

import pytest
from fleet_rig import plain, racing
from mqtt_broker import Cable, Mosquitto, needs_mosquitto, until

from dnb_edge.fleet import link
from dnb_edge.live.messages import Phase, State

pytestmark = needs_mosquitto


def test_laps_arrive_once_and_the_queue_is_empty_then(broker, make_box, make_hub):
    """The plain way: what happened before the publisher came, and what happens while it is there."""
    box, hub = make_box("a", plain(broker.url)), make_hub(plain(broker.url))
    box.race(1, 3)
    box.start()
    hub.start()
    hub.wait_for("a", 3)
    box.race(4, 250)
    hub.wait_for("a", 250)
    until(lambda: box.outbox.waiting == 0, "the queue to be empty")
    row = hub.store.latest(kind="lap", most=1)[0]
    assert (row.box, row.run, row.track) == ("a", "run-0badcafe-0001", "oval")


@pytest.mark.parametrize("persistent", [False, True])
def test_a_killed_broker_loses_and_doubles_nothing(persistent, tmp_path, make_box, make_hub):
    """Killed in the middle of the traffic, three times, with its memory on a disk or nowhere."""
    broker = Mosquitto(tmp_path, persistent=persistent)
    with broker:
        box, hub = make_box("a", plain(broker.url)), make_hub(plain(broker.url))
        hub.start()
        box.start()
        last = 0
        for _ in range(3):
            box.race(last + 1, last + 120)
            last += 120
            until(lambda wanted=last - 90: len(hub.laps("a")) > wanted, "some of them")
            broker.kill()
            box.race(last + 1, last + 30)
            last += 30
            broker.start()
        hub.wait_for("a", last)
        until(lambda: box.outbox.waiting == 0, "the queue to be empty")


def test_a_cut_cable_loses_and_doubles_nothing(broker, make_box, make_hub):
    """The broker knows the box no more, with parcels under way; the hub goes on with other boxes meanwhile."""
    with contextlib.closing(Cable(broker.port)) as cable:
        box = make_box("a", plain(f"mqtt://127.0.0.1:{cable.port}"))
        other, hub = make_box("b", plain(broker.url)), make_hub(plain(broker.url))
        for one in (hub, box, other):
            one.start()
        for turn in range(3):
            box.race(turn * 100 + 1, turn * 100 + 100)
            until(lambda wanted=turn * 100 + 10: len(hub.laps("a")) > wanted, "some of them")
            cable.cut()
            until(lambda: any("queue waits" in words for words in box.said), "the box to notice")
            other.race(turn * 10 + 1, turn * 10 + 10)
            hub.wait_for("b", turn * 10 + 10)
            cable.mend()
        hub.wait_for("a", 300)


def test_a_line_that_says_nothing_any_more_is_given_up(broker, make_box, make_hub, monkeypatch):
    """Packets vanish and nobody is told, as where a router is switched off: the box notices by the silence and calls again."""
    monkeypatch.setattr(link, "KEEPALIVE_S", 1)
    with contextlib.closing(Cable(broker.port)) as cable:
        box, hub = make_box("a", plain(f"mqtt://127.0.0.1:{cable.port}")), make_hub(plain(broker.url))
        hub.start()
        box.start()
        box.race(1, 10)
        hub.wait_for("a", 10)
        cable.freeze()
        box.race(11, 60)
        hub.wait_for("a", 60)


def test_publisher_and_hub_may_be_restarted_at_any_time(broker, make_box, make_hub):
    """What happens while the publisher is away it hears afterwards; what comes while the hub is away waits on the box."""
    box, hub = make_box("a", plain(broker.url)), make_hub(plain(broker.url))
    box.start()
    box.race(1, 20)
    until(lambda: box.outbox.last == 20, "the queue to fill without a hub")
    assert box.outbox.waiting == 20
    hub.start()
    hub.wait_for("a", 20)
    box.stop()
    box.race(21, 30)
    box.start()
    hub.wait_for("a", 30)
    hub.stop()
    box.race(31, 200)
    hub.start()
    hub.wait_for("a", 200)


def test_a_queue_that_is_full_loses_the_oldest_and_says_how_many(broker, make_box, make_hub):
    """The newest results are kept; the hub goes on behind the gap and shows what never came."""
    box, hub = make_box("a", plain(broker.url), most=100), make_hub(plain(broker.url))
    box.start()
    box.race(1, 150)
    until(lambda: box.outbox.last == 150, "all of them to be heard")
    hub.start()
    until(lambda: hub.laps("a")[-1:] == [150], "the last one")
    assert hub.laps("a") == list(range(51, 151))
    until(lambda: (state := hub.seen("a").box.state) and state.thrown_away == 50, "its state to say so")
    assert hub.seen("a").box.missing == 50


def test_a_race_that_goes_on_after_its_process_was_killed_is_told_once(broker, make_box, make_hub):
    """The new process tells again what the old one had not saved. Of sources that may repeat, alike laps are two."""
    box, hub = make_box("a", plain(broker.url)), make_hub(plain(broker.url))
    hub.start()
    box.start()
    for source, wanted in (("v4l2:/dev/video0", [1, 2, 3]), ("sim:", [1, 2, 3, 1, 2, 2, 3])):
        for first, last, run in ((1, 2, "run-0badcafe-0001"), (2, 3, "run-0badcafe-0002")):
            box.daemon.begin_run()
            box.daemon.show(racing(run, source))
            until(
                lambda run=run, source=source: (box.listener.state.run, box.listener.state.source) == (run, source),
                "the state",
            )
            heard = box.outbox.heard.sequence
            box.race(first, last)
            until(lambda heard=heard, count=last - first + 1: box.outbox.heard.sequence == heard + count, "the laps")
        until(lambda wanted=wanted: hub.laps("a") == wanted, f"{wanted}, not {hub.laps('a')}")


def test_the_hub_knows_who_is_there(broker, make_box, make_hub):
    """Online with what it does; offline with the reason where it was stopped; offline by the last will where it is cut off."""
    with contextlib.closing(Cable(broker.port)) as cable:
        box = make_box("a", plain(f"mqtt://127.0.0.1:{cable.port}"))
        hub = make_hub(plain(broker.url))
        hub.start()
        box.start()
        seen = until(lambda: (found := hub.seen("a")) and found.online and found.box.state and found, "the box")
        assert (seen.box.state.phase, seen.box.state.track) == ("racing", "oval")
        box.daemon.show(State(phase=Phase.FAULT, reason="no camera"))
        until(lambda: hub.seen("a").box.state.reason == "no camera", "its reason")
        box.stop()
        until(lambda: (hub.seen("a").online, hub.seen("a").gone) == (False, "stopped"), "its farewell")
        box.start()
        until(lambda: hub.seen("a").online, "its return")
        cable.cut()
        until(lambda: (hub.seen("a").online, hub.seen("a").gone) == (False, None), "its last will")
