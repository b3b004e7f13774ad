"""How a run's health is folded and shown: bounded, and never better than it was."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.report.health import (
    MOST_INTERRUPTIONS,
    MOST_SLOTS,
    MOST_WARNINGS,
    HealthFold,
    HealthHistory,
    Interruption,
    interruptions,
)
from dnb_edge.report.health_plots import health_picture, time_unit
from dnb_edge.report.health_section import clock, health_section
from dnb_edge.report.html import render
from dnb_edge.report.run import RunResult
from dnb_edge.values import Health, LostFrames

GOOD = Health(
    t_ns=0,
    t_s=0.0,
    frames=0,
    detected_frames=0,
    dropped_frames=0,
    fps=30.0,
    latency_ms=20.0,
    display="none",
    recording="recording",
    view_error_mean_px=None,
    view_error_mean_m=None,
    disk_free_bytes=9_000_000_000,
    temperature_c=55.0,
    throttled=False,
    latency_p95_ms=25.0,
    latency_p99_ms=31.5,
)


def at(second: int, **facts: object) -> Health:
    """A `Health` at this second of a run of 30 frames a second."""
    return replace(GOOD, t_s=float(second), t_ns=second * 10**9, frames=30 * second, **facts)


def folded(healths: list[Health], away: list[Interruption] | None = None) -> HealthHistory:
    fold = HealthFold()
    for health in healths:
        fold.add(health)
    history = fold.history(away or [])
    assert history is not None
    return history


@settings(deadline=None, max_examples=40)
@given(
    st.lists(
        st.tuples(
            st.integers(1, 4000),
            st.floats(1.0, 400.0),
            st.integers(0, 9),
            st.booleans(),
            st.integers(10**6, 10**10),
        ),
        min_size=1,
        max_size=60,
    )
)
def test_the_worst_stays(told: list[tuple[int, float, int, bool, int]]) -> None:
    """However long the run: few slots, and in them the highest latency, all lost frames, any throttling, the least room."""
    second, lost, healths = 0, 0, []
    for step, latency_ms, gone, throttled, room in told:
        second, lost = second + step, lost + gone
        queue = (LostFrames(reason="queue", frames=lost),) if lost else ()
        healths.append(at(second, latency_ms=latency_ms, lost=queue, throttled=throttled, disk_free_bytes=room))
    history = folded(healths)
    assert len(history.slots) <= MOST_SLOTS
    assert [slot.start_s for slot in history.slots] == sorted({slot.start_s for slot in history.slots})
    assert max(slot.latency_ms or 0.0 for slot in history.slots) == max(one[1] for one in told)
    assert min(slot.disk_free_bytes or 0 for slot in history.slots) == min(one[4] for one in told)
    assert any(slot.throttled for slot in history.slots) == any(one[3] for one in told)
    assert history.lost == ({"queue": lost} if lost else {})
    assert history.frames == 30 * second


def test_the_worst_stands_where_it_was() -> None:
    """A single bad second of a day is in the slot of its time, and its lost frames are not spread over that."""
    healths = [at(second, latency_ms=400.0 if second == 50_000 else 20.0) for second in range(0, 86_400, 10)]
    bad = [slot for slot in folded(healths).slots if slot.latency_ms == 400.0]
    assert len(bad) == 1
    assert bad[0].start_s <= 50_000 < bad[0].end_s
    losing = [
        at(second, lost=(LostFrames(reason="gap", frames=60),) if second > 5000 else ()) for second in range(9000)
    ]
    assert max(slot.lost_share for slot in folded(losing).slots) == pytest.approx(60 / 90)


def test_a_counter_that_begins_anew_loses_nothing() -> None:
    """A race that went on in another process counts from zero again; old recordings have no reasons."""
    lost = [at(1, lost=(LostFrames(reason="gap", frames=7),)), at(2, lost=(LostFrames(reason="gap", frames=2),))]
    assert folded(lost).lost == {"gap": 9}
    again = [at(10), replace(at(11), frames=15)]
    assert folded(again).frames == 315
    assert folded([at(1, dropped_frames=4)]).lost == {"lost": 4}


def test_a_warning_whose_number_grows_is_one() -> None:
    """Its first and last words, when, how often, and in how many spells."""
    texts = ["3 % of frames lost", "5 % of frames lost", None, "4.5 % of frames lost"]
    history = folded([at(i, warnings=(text,) if text else ()) for i, text in enumerate(texts)])
    (one,) = history.warnings
    assert (one.text, one.last_text) == ("3 % of frames lost", "4.5 % of frames lost")
    assert (one.first_s, one.last_s, one.told, one.spells) == (0.0, 3.0, 3, 2)


def test_warnings_and_interruptions_are_bounded() -> None:
    """Of thousands of different ones the first, and of the interruptions the longest, are kept; the rest is counted."""
    names = ["".join(chr(97 + int(digit)) for digit in str(i)) for i in range(3 * MOST_WARNINGS)]
    away = [Interruption(start_s=10.0 * i, end_s=10.0 * i + 1 + i % 7) for i in range(3 * MOST_INTERRUPTIONS)]
    history = folded([at(i, warnings=(name,)) for i, name in enumerate(names)], away)
    assert (len(history.warnings), history.more_warnings) == (MOST_WARNINGS, 2 * MOST_WARNINGS)
    assert (len(history.interruptions), history.more_interruptions) == (MOST_INTERRUPTIONS, 2 * MOST_INTERRUPTIONS)
    assert min(one.lasted_s for one in history.interruptions) >= 5
    assert history.interrupted_s == pytest.approx(sum(one.lasted_s for one in away))


def test_interruptions_are_between_frames() -> None:
    """From the last frame before to the first after, seconds from the first one."""
    t_ns = [5_000_000_000 + round(t * 1e9) for t in (0.0, 0.5, 1.0, 4.0, 4.5)]
    (one,) = interruptions(t_ns, longer_than_s=1.0)
    assert (one.start_s, one.end_s) == (1.0, 4.0)
    assert interruptions([], longer_than_s=1.0) == []


@pytest.mark.parametrize(
    ("t_s", "words"), [(0.0, "0:00.0"), (9.96, "0:10.0"), (61.25, "1:01.2"), (3599.99, "1:00:00"), (86_399, "23:59:59")]
)
def test_times_are_told_as_on_a_clock(t_s: float, words: str) -> None:
    """Tenths within the first hour, then hours."""
    assert clock(t_s) == words


@pytest.mark.parametrize(("end_s", "unit"), [(59.0, "s"), (900.0, "min"), (86_400.0, "h")])
def test_the_axis_has_a_unit_to_read(end_s: float, unit: str) -> None:
    """Seconds, minutes or hours."""
    assert time_unit(end_s)[1] == unit


def test_the_picture_shows_what_happened() -> None:
    """An interruption is shaded where it was; lost frames and heat change the picture."""
    plain = folded([at(second) for second in range(100)])
    away = folded([at(second) for second in range(100)], [Interruption(start_s=60.0, end_s=70.0)])
    lost = folded([at(second, lost=(LostFrames(reason="queue", frames=second),)) for second in range(1, 100)])
    pictures = [health_picture(one) for one in (plain, away, lost)]
    assert len(set(pictures)) == 3
    shaded = _reddish(pictures[1])
    assert _reddish(pictures[0]).sum() == 0
    columns = np.nonzero(shaded.any(axis=0))[0]
    middle = columns.mean() / shaded.shape[1]
    assert 0.6 < middle < 0.72, "60 to 70 of 100 s, right of the axis"
    assert health_picture(plain) == pictures[0]


def _reddish(png: bytes) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR).astype(int)
    return np.asarray((np.abs(image - (0xCC, 0xC6, 0xF3)) < 6).all(axis=2))


def test_a_file_has_no_panel_of_heat() -> None:
    """What was never told has no panel: the picture of a file's run is less high."""
    bare = [replace(one, latency_ms=None, temperature_c=None, disk_free_bytes=None) for one in map(at, range(20))]
    heights = [
        cv2.imdecode(np.frombuffer(health_picture(folded(healths)), np.uint8), cv2.IMREAD_COLOR).shape[0]
        for healths in (bare, [at(second) for second in range(20)])
    ]
    assert heights[0] < 0.6 * heights[1]


def test_the_page_tells_the_run_s_health(result: Callable[..., RunResult]) -> None:
    """Frames, losses by reason, percentiles, heat, room, interruptions and warnings with their times; all of it text."""
    healths = [
        at(second, lost=(LostFrames(reason="queue", frames=second),), temperature_c=50.0 + second)
        for second in range(30)
    ]
    healths.append(at(30, warnings=("<b>hot</b>",), throttled=True))
    history = folded(healths, [Interruption(start_s=12.0, end_s=15.5)])
    page = render(result(health=history, began="2026-01-02 03:04:05 UTC"))
    section = page[page.index("<h2>Health</h2>") : page.index("<h2>Transformation error</h2>")]
    for fact in (
        "29 (3.12 %): 29 queue",
        "p95 25.0 ms, p99 31.5 ms",
        "79.0",
        "9.00 GB at least",
        "1 times, 0:03.5 in all",
        "<td>0:15.5</td><td>3.50</td>",
        "&lt;b&gt;hot&lt;/b&gt;",
        "0:30.0",
        "Throttled",
    ):
        assert fact in section, fact
    assert "2026-01-02 03:04:05 UTC" in page
    assert section.count("<img") == 1


def test_no_health_is_no_section(result: Callable[..., RunResult]) -> None:
    """A result of events alone has none."""
    assert health_section(None, "") == ""
    assert "<h2>Health</h2>" not in render(result())
    assert HealthFold().history() is None
