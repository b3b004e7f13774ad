"""What is kept of an epoch's events, and for how long."""

from collections.abc import Callable
from typing import TypeAlias

from hypothesis import given
from hypothesis import strategies as st
from live_events import health, seen, standings, state

from dnb_edge.live.backlog import FLEETING, LAST_ONLY, Backlog
from dnb_edge.values import Event

Kind: TypeAlias = Callable[[int], Event]
KINDS = st.sampled_from([state, state, state, seen, standings, health])


def filled(kinds: list[Kind], most: int) -> tuple[Backlog, list[Event]]:
    """A backlog to which one event of each kind was added, and all of them by their numbers."""
    backlog, told = Backlog(most=most), []
    for number, kind in enumerate(kinds):
        told.append(kind(number))
        assert backlog.add(told[-1]).sequence == number
    return backlog, told


@given(st.lists(KINDS, max_size=80), st.integers(1, 30), st.integers(0, 80), st.integers(1, 50))
def test_nothing_that_lasts_is_missing_from_the_first_number_on(
    kinds: list[Kind], most: int, since: int, batch: int
) -> None:
    """Read in batches of any size from any number on: in order, each once, all that last from `first` on, the last of its
    kind of what is replaced, nothing fleeting; and never more than the backlog may keep."""
    backlog, told = filled(kinds, most)
    read, cursor = [], since
    while batch_read := backlog.since(cursor, most=batch):
        assert len(batch_read) <= batch
        read += batch_read
        cursor = batch_read[-1].sequence + 1
    numbers = [one.sequence for one in read]
    assert numbers == sorted(set(numbers))
    assert all(one.event == told[one.sequence] for one in read)
    lasting = [n for n, event in enumerate(told) if not isinstance(event, FLEETING + LAST_ONLY)]
    last = {type(event): n for n, event in enumerate(told) if isinstance(event, LAST_ONLY)}
    wanted = {n for n in lasting if n >= max(since, backlog.first)} | {n for n in last.values() if n >= since}
    assert wanted <= set(numbers)
    assert not [n for n in numbers if isinstance(told[n], FLEETING)]
    assert len(backlog.since(0, most=10**6)) <= most + len(LAST_ONLY)


@given(st.lists(KINDS, max_size=20), st.lists(KINDS, max_size=20))
def test_a_new_run_forgets_and_counts_on(before: list[Kind], after: list[Kind]) -> None:
    """Numbers go on; of the run before nothing is left, its last standings neither."""
    backlog, _ = filled(before, 100)
    backlog.begin_run()
    assert (backlog.first, backlog.run_first) == (len(before), len(before))
    for number, kind in enumerate(after):
        assert backlog.add(kind(number)).sequence == len(before) + number
    assert all(one.sequence >= len(before) for one in backlog.since(0, most=1000))
