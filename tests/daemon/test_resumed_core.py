"""A core that goes on with a run which was cut short, against one that saw all of it."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[1] / "core"))
from circle import circle_setup, frames, on_circle

from dnb_edge.core import Core
from dnb_edge.daemon.catchup import ResumedCore
from dnb_edge.daemon.resume import SHOWN
from dnb_edge.display.state import BoardState
from dnb_edge.values import Event, FrameDetections, Lap, PointM

OMEGA = 2.2
SETUP = circle_setup()


def drive(t_s: float) -> PointM | None:
    """Steadily round, unseen now and then."""
    return None if math.fmod(t_s, 1.9) < 0.15 else on_circle(-0.6 + OMEGA * t_s)


FRAMES = tuple(frames(drive, seconds=12, fps=15.0, noise_px=0.6))
CORE = Core(SETUP)
TOLD = tuple(tuple(CORE.step(found)) for found in FRAMES)
LAST = tuple(CORE.finish())


def resumed(saved: tuple[FrameDetections, ...], after_last: int, laps: list[Lap]) -> ResumedCore:
    return ResumedCore(SETUP, lambda: saved, frames=len(saved), after_last=after_last, laps=laps, name="run-0.mcap")


def laps_in(events: list[Event]) -> list[Lap]:
    return [event for event in events if isinstance(event, Lap)]


@settings(max_examples=40, deadline=None)
@given(killed=st.integers(1, len(FRAMES) - 1), share=st.floats(0, 1), meanwhile=st.integers(0, 30))
def test_a_resumed_core_goes_on_as_if_nothing_had_happened(killed: int, share: float, meanwhile: int) -> None:
    """Killed after any frame, with any of its events saved: what was saved and what is told then is what one core tells, in
    order, however many frames come while the saved ones are raced again."""
    after_last = round(share * len(TOLD[killed - 1]))
    before = [event for told in TOLD[: killed - 1] for event in told] + list(TOLD[killed - 1][:after_last])
    core = resumed(FRAMES[:killed], after_last, laps_in(before))
    after = [event for found in FRAMES[killed : killed + meanwhile] for event in core.step(found)]
    core.wait()
    after += [event for found in FRAMES[killed + meanwhile :] for event in core.step(found)]
    after += core.finish()
    whole = [event for told in TOLD for event in told] + list(LAST)
    assert len(laps_in(whole)) == 4
    assert before + after == whole
    assert core.notes()[0] == "going on with run-0.mcap, which was cut short"


class Held:
    """Saved detections that do not go on until they may."""

    def __init__(self) -> None:
        self.go = threading.Event()

    def __call__(self) -> Iterator[FrameDetections]:
        yield FRAMES[0]
        assert self.go.wait(10)
        yield from FRAMES[1:60]


def test_frames_that_come_meanwhile_wait_and_the_detector_is_told_where_to_look() -> None:
    """While the saved frames are raced again nothing is told, a car is followed all the same, and then all of it comes."""
    saved = Held()
    laps = laps_in([event for told in TOLD[:60] for event in told])
    core = ResumedCore(SETUP, saved, frames=60, after_last=len(TOLD[59]), laps=laps, name="r")
    assert [event for found in FRAMES[60:90] for event in core.step(found)] == []
    assert len(core.windows(FRAMES[90].t_ns)) == 1
    assert core.notes() == ("going on with r, which was cut short: 1 % of its frames are raced again",)
    assert not core.caught_up
    saved.go.set()
    core.wait()
    assert tuple(core.step(FRAMES[90])) == tuple(event for told in TOLD[60:91] for event in told)
    assert core.caught_up


def test_a_stop_does_not_wait_for_the_earlier_run() -> None:
    """A race that is stopped before it has caught up ends at once and tells nothing."""
    saved = Held()
    core = ResumedCore(SETUP, saved, frames=60, after_last=0, laps=[], name="r")
    core.step(FRAMES[60])
    threading.Timer(0.05, saved.go.set).start()
    assert core.finish() == []


def test_laps_that_come_out_otherwise_are_told_of() -> None:
    """Where the saved laps are not those of the saved detections, a note says so in every Health."""
    core = resumed(FRAMES[:120], 0, [])
    core.wait()
    core.step(FRAMES[120])
    assert "other laps" in core.notes()[0]


def test_what_fails_in_the_thread_is_raised_in_the_race() -> None:
    """A malformed saved frame ends the run with its own error, not with a hang."""
    core = resumed((FRAMES[1], FRAMES[0]), 0, [])
    core.wait()
    with pytest.raises(ValueError, match="is not later than"):
        core.step(FRAMES[2])


def test_a_board_of_what_was_saved_shows_the_same_standings() -> None:
    """The kinds of events that are given to boards at a restart make up laps, standings and the race's state."""
    told = [event for events in TOLD for event in events]
    before, again = BoardState(), BoardState()
    for event in told:
        before = before.after(event)
        again = again.after(event) if isinstance(event, SHOWN) else again
    assert len(laps_in(told)) == 3
    assert again.standings == before.standings
    assert again.standings is not None
    assert (again.race, again.told, again.told_count) == (before.race, before.told, before.told_count)
    assert (again.shown.lap_number, again.phase) == (before.shown.lap_number, before.phase)
