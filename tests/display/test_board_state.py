"""The board's reducer."""

import pytest
from display_events import board, crossing, health, lap, race, run_summary, target
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge import values
from dnb_edge.display.state import FLASH_S, LAPS_KEPT, BoardState, Phase, laps_since


@pytest.mark.parametrize(
    ("events", "line"),
    [
        ([], "waiting for the car"),
        ([target(1.0, values.TargetState.TENTATIVE)], "waiting for the car"),
        ([target(1.0)], "out lap"),
        ([target(1.0), crossing(2.0, direction=values.Direction.REVERSE)], "out lap"),
        ([target(1.0), crossing(2.0, line="sector 1")], "out lap"),
        ([target(1.0), crossing(2.0)], "lap 1 of 3"),
        ([crossing(2.0)], "lap 1 of 3"),
        ([target(1.0), crossing(2.0), crossing(14.483), lap()], "lap 2 of 3"),
        ([crossing(2.0), lap(1), lap(2), lap(3)], "finished"),
        ([target(1.0), run_summary()], "finished"),
        ([run_summary(), target(9.0), crossing(9.0), lap()], "finished"),
    ],
)
def test_state_line(events, line):
    """Each event moves the run on as the words on the board say, and no event moves it on by mistake."""
    assert board(*events, laps_wanted=3).state_line == line


def test_endless_run_names_no_number_of_laps():
    """Without a number of laps wanted, the line has none and the run never finishes by laps."""
    assert race(7).state_line == "lap 8"


def test_running_time_starts_at_the_crossing_not_at_its_news():
    """A crossing is confirmed late but stamped early: the running lap counts from the stamp."""
    state = board(target(1.0), crossing(2.0)).at(2.5)
    assert state.running_s == pytest.approx(0.5)
    assert board(target(5.0)).at(9.0).running_s is None


def test_running_time_restarts_at_the_lap_end():
    """The next lap starts where the last one ended, to the lap's own figures."""
    state = board(crossing(2.0), lap(1, 2.0, 10.0)).at(13.0)
    assert (state.lap_number, state.running_s) == (2, pytest.approx(1.0))


def test_a_crossing_that_ends_no_lap_leaves_the_running_lap_alone():
    """A second crossing within the minimum lap flashes but does not restart the clock."""
    state = board(crossing(2.0), crossing(2.5)).at(4.0)
    assert (state.lap_number, state.running_s, state.crossed_s) == (1, pytest.approx(2.0), 2.5)


def test_best_lap_is_the_fastest_valid_one():
    """An invalid lap is never best; of equals the earliest is."""
    laps = [lap(1, time_s=12.0), lap(2, time_s=9.0, valid=False), lap(3, time_s=11.0), lap(4, time_s=11.0)]
    state = board(crossing(2.0), *laps)
    assert state.best_lap == laps[2]
    assert state.last_lap == laps[3]


def test_flash_ends():
    """A crossing flashes for FLASH_S and no longer."""
    state = board(crossing(2.0))
    assert state.at(2.0 + FLASH_S * 0.9).flashing
    assert not state.at(2.0 + FLASH_S * 1.1).flashing
    assert not board(target(1.0)).flashing


def test_unseen_car_is_told():
    """On track, two seconds without an estimate from a detection mean that the car is not seen; off it, nothing."""
    on_track = board(target(1.0), crossing(2.0), target(2.5))
    assert not on_track.after(target(4.0, values.TargetState.COASTING)).unseen
    assert on_track.after(target(5.0, values.TargetState.COASTING)).unseen
    assert not on_track.after(run_summary()).at(60.0).unseen


def test_health_is_the_latest():
    """A health report replaces the one before."""
    assert board(health(3.0), health(4.0, warnings=("dark",))).health == health(4.0, warnings=("dark",))


def test_a_long_practice_keeps_its_last_laps_and_its_best():
    """The lap table is bounded, the count and the best lap are of the whole run."""
    best = lap(1, time_s=5.0)
    state = board(crossing(2.0), best, *(lap(number) for number in range(2, LAPS_KEPT + 20)))
    assert len(state.laps) == LAPS_KEPT
    assert state.laps_done == LAPS_KEPT + 19
    assert state.best_lap == best


def test_laps_since():
    """What a display has missed is told by the laps' numbers."""
    earlier, later = race(1), race(3)
    assert [told.number for told in laps_since(earlier, later)] == [2, 3]
    assert [told.number for told in laps_since(None, later)] == [1, 2, 3]


events = st.one_of(
    st.builds(target, st.floats(0, 100), st.sampled_from(values.TargetState)),
    st.builds(crossing, st.floats(0, 100), direction=st.sampled_from(values.Direction)),
    st.builds(lap, st.integers(1, 9), st.floats(0, 100), st.floats(1, 50), valid=st.booleans()),
    st.builds(health, st.floats(0, 100)),
    st.builds(run_summary),
)


@given(st.lists(events, max_size=12))
def test_any_events_leave_a_board_that_makes_sense(happened):
    """Whatever comes in whatever order: time never runs back, and a lap runs exactly where the phase says so."""
    state = BoardState(laps_wanted=5)
    for event in happened:
        later = state.after(event)
        assert later.t_s >= state.t_s
        state = later
    running = state.phase is Phase.LAP
    assert (state.lap_number is not None) == (state.lap_start_s is not None) == (state.running_s is not None) == running
    assert state.running_s is None or state.running_s >= 0


def test_lap_and_its_crossing_come_in_either_order():
    """Whether the lap or the crossing that ends it is told first does not change the board."""
    begun = board(target(1.0), crossing(2.0))
    done, ended = lap(1, 2.0, 10.0), crossing(12.0)
    assert begun.after(done).after(ended) == begun.after(ended).after(done)
