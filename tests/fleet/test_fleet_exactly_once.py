"""The hub's store and the box's queue by themselves: whatever a line does to parcels, each is stored once, in its order."""

import sqlite3

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.errors import InputError, WorkError
from dnb_edge.fleet import store as stores
from dnb_edge.fleet.messages import BoxState, Parcel
from dnb_edge.fleet.outbox import Heard, Outbox
from dnb_edge.fleet.store import Store


def parcel(number: int, queue: str = "q", first: int = 1) -> Parcel:
    return Parcel(
        queue=queue,
        number=number,
        first=first,
        run="r",
        track="t",
        wall_s=1.0,
        event={"event": "lap", "number": number},
    )


def numbers(store: Store, box: str = "a") -> list[int]:
    return [row.event["number"] for row in store.since(0, most=1000, box=box)]


COUNT = 12
batches = st.lists(
    st.tuples(st.integers(-3, 3), st.integers(1, COUNT), st.sets(st.integers(0, COUNT)), st.booleans()), max_size=5
)


@settings(max_examples=15, deadline=None)
@given(batches=batches)
def test_whatever_the_line_does_each_parcel_is_stored_once(batches, tmp_path_factory):
    """Batches that begin before or behind what is stored and lack parcels in between, with the hub killed in between: what is
    stored is always a beginning of all, and what is acknowledged is its length."""
    path = tmp_path_factory.mktemp("store") / "hub.sqlite"
    store = Store(path)
    stored = 0
    for shift, length, lost, restarted in (*batches, (0, COUNT, set(), True)):
        begin = max(1, stored + 1 + shift)
        came = [
            number for place, number in enumerate(range(begin, begin + length)) if place not in lost and number <= COUNT
        ]
        told = store.take([("a", parcel(number)) for number in came], wall_s=2.0)
        stored = told.get(("a", "q"), stored)
        assert numbers(store) == list(range(1, stored + 1))
        if restarted:
            store.close()
            store = Store(path)
            assert store.queues().get(("a", "q"), 0) == stored
    assert stored == COUNT
    store.close()


def test_queues_and_boxes_do_not_mix(tmp_path):
    """A box with a new queue begins anew; two boxes may have queues and numbers alike."""
    store = Store(tmp_path / "hub.sqlite")
    told = store.take([("a", parcel(1)), ("b", parcel(1)), ("a", parcel(1, "other")), ("a", parcel(2))], wall_s=2.0)
    assert told == {("a", "q"): 2, ("b", "q"): 1, ("a", "other"): 1}
    assert (numbers(store), numbers(store, "b")) == ([1, 1, 2], [1])
    store.close()


def test_what_a_box_has_no_more_is_not_waited_for(tmp_path):
    """The gap is counted once, however often it is told."""
    store = Store(tmp_path / "hub.sqlite")
    store.take([("a", parcel(1))], wall_s=2.0)
    for _ in range(2):
        assert store.take([("a", parcel(7, first=5))], wall_s=2.0) == {("a", "q"): 4}
    assert store.take([("a", parcel(5, first=5))], wall_s=2.0) == {("a", "q"): 5}
    assert (numbers(store), store.boxes()[0].missing) == ([1, 5], 3)
    store.close()


def test_a_flood_of_names_fills_no_disk(tmp_path, monkeypatch):
    """Whoever may speak to the broker may invent names; boxes that are known are served on."""
    monkeypatch.setattr(stores, "MOST_BOXES", 2)
    store = Store(tmp_path / "hub.sqlite")
    store.show({name: BoxState(phase=None) for name in "abcd"}, wall_s=1.0)
    told = store.take([("a", parcel(1)), ("z", parcel(1))], wall_s=1.0)
    assert ([box.name for box in store.boxes()], told) == (["a", "b"], {("a", "q"): 1})
    store.close()


def test_a_store_that_cannot_be_written_says_so_and_keeps_what_it_has(tmp_path):
    """A full disk, say: nothing is acknowledged that is not there."""
    store = Store(tmp_path / "hub.sqlite")
    store.take([("a", parcel(1))], wall_s=2.0)
    (pages,) = store._base.execute("PRAGMA page_count").fetchone()
    store._base.execute(f"PRAGMA max_page_count = {pages}")
    many = [("a", parcel(number)) for number in range(2, 2000)]
    with pytest.raises(WorkError, match="the store cannot be written: database or disk is full"):
        store.take(many, wall_s=2.0)
    assert (numbers(store), store.queues()) == ([1], {("a", "q"): 1})
    store.close()


def add(outbox: Outbox, number: int, key: str | None = None) -> bool:
    heard = Heard(epoch="e", sequence=number + 1)
    return outbox.add({"event": "lap", "number": number}, heard, run="r", track=None, wall_s=1.0, key=key)


def test_a_queue_goes_on_where_it_was(tmp_path):
    """Its parcels, its numbers, what was heard and its name; what is stored is gone, and its numbers come no more."""
    path = tmp_path / "queue.sqlite"
    outbox = Outbox(path)
    name = outbox.name
    for number in range(1, 6):
        assert add(outbox, number)
    outbox.stored(3)
    outbox.close()
    outbox = Outbox(path)
    assert (outbox.name, outbox.last, outbox.waiting, outbox.heard) == (name, 5, 2, Heard(epoch="e", sequence=6))
    assert [(one.number, one.first, one.event["number"]) for one in outbox.after(0, most=9)] == [(4, 4, 4), (5, 4, 5)]
    outbox.stored(5)
    add(outbox, 6)
    assert [(one.number, one.first) for one in outbox.after(0, most=9)] == [(6, 6)]
    outbox.close()


def test_the_same_under_one_key_is_queued_once(tmp_path):
    """What was heard goes on all the same."""
    outbox = Outbox(tmp_path / "queue.sqlite")
    assert [add(outbox, number, key) for number, key in ((1, "x"), (2, "y"), (3, "x"), (4, None), (5, None))] == [
        True, True, False, True, True,
    ]  # fmt: skip
    assert (outbox.last, outbox.waiting, outbox.heard.sequence) == (4, 4, 6)
    outbox.close()


@pytest.mark.parametrize(("kind", "option"), [(Outbox, "--queue"), (Store, "--store")])
def test_a_file_that_is_something_else_is_left_alone(kind, option, tmp_path):
    """Another program's database, a text, a folder that is not there, one of a later version."""
    other = tmp_path / "other.sqlite"
    base = sqlite3.connect(other)
    base.execute("CREATE TABLE precious (x)")
    base.close()
    (tmp_path / "text.sqlite").write_text("precious " * 200, encoding="utf-8")
    later = tmp_path / "later.sqlite"
    kind(later).close()
    base = sqlite3.connect(later)
    base.execute("PRAGMA user_version = 99")
    base.close()
    for path in (other, tmp_path / "text.sqlite", tmp_path / "missing" / "x.sqlite", later):
        before = path.read_bytes() if path.exists() else None
        with pytest.raises(InputError, match=f"{option} .*{path.name}: ") as error:
            kind(path)
        assert "\n" not in str(error.value)
        assert (path.read_bytes() if path.exists() else None) == before


def test_a_queue_has_one_publisher(tmp_path):
    """A second one is told so: the numbers are the first one's."""
    first = Outbox(tmp_path / "queue.sqlite")
    with pytest.raises(InputError, match="another process has it: one `fleet publish` a queue"):
        Outbox(tmp_path / "queue.sqlite")
    first.close()
    Outbox(tmp_path / "queue.sqlite").close()
