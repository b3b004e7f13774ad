"""Frames that were lost: every missing number has one reason."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.daemon.losses import Ledger, added, as_lost, since
from dnb_edge.values import LostFrames


def counts(lost: tuple[LostFrames, ...]) -> dict[str, int]:
    return {one.reason: one.frames for one in lost}


@pytest.mark.parametrize(
    ("frames", "told"),
    [
        ([(0, {}), (1, {}), (2, {})], {}),
        ([(7, {"damaged": 3}), (8, {"damaged": 3})], {}),
        ([(0, {}), (4, {})], {"gap": 3}),
        ([(0, {}), (4, {"overtaken": 2, "short": 1})], {"overtaken": 2, "short": 1}),
        ([(0, {}), (4, {"damaged": 1}), (6, {"damaged": 1})], {"damaged": 1, "gap": 3}),
        ([(0, {}), (1, {"damaged": 1}), (3, {"damaged": 1})], {"gap": 1}),
    ],
    ids=[
        "none",
        "before the first",
        "nobody knows",
        "the source knows",
        "both",
        "a source that numbers only whole ones",
    ],
)
def test_each_missing_number_has_a_reason(frames: list[tuple[int, dict[str, int]]], told: dict[str, int]) -> None:
    """The source's own losses first, the rest is a gap; never more than are missing."""
    ledger = Ledger()
    for sequence, lost in frames:
        ledger.frame(sequence, as_lost(lost))
    assert counts(ledger.lost) == told


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), max_size=30), st.integers(0, 10**6))
def test_reasons_add_up_to_what_is_missing(steps: list[tuple[int, int]], first: int) -> None:
    """Whatever a source says of itself, the reasons together are the numbers that are missing."""
    ledger, sequence, overtaken = Ledger(), first, 0
    ledger.frame(sequence, ())
    for missing, more in steps:
        sequence, overtaken = sequence + missing + 1, overtaken + more
        ledger.frame(sequence, as_lost({"overtaken": overtaken}))
    assert sum(counts(ledger.lost).values()) == sequence - first - len(steps)


def test_a_source_that_came_back_counts_anew() -> None:
    """Its numbers and its own counts begin again, and no loss is made of that; ours go on."""
    ledger = Ledger()
    ledger.frame(10, as_lost({"damaged": 5}))
    ledger.frame(12, as_lost({"damaged": 6}))
    ledger.reopened()
    ledger.frame(900, ())
    ledger.frame(902, as_lost({"damaged": 1}))
    assert counts(ledger.lost) == {"damaged": 2}


def test_accounts_are_added_and_compared() -> None:
    """Reasons in the order of the alphabet, none without frames."""
    first, second = as_lost({"queue": 2, "gap": 1}), as_lost({"gap": 4, "stamp": 0})
    assert counts(added(first, second)) == {"gap": 5, "queue": 2}
    assert [one.reason for one in added(first, second)] == ["gap", "queue"]
    assert counts(since(first, added(first, second))) == {"gap": 4}
