"""The page's reducer against the displays' own, event by event, and its words against Python's."""

import pytest
from board_page import site
from board_races import AFTER_EACH_JS, after_each, by_hand, made, one_car, plain, two_cars
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.display.state import BoardState
from dnb_edge.values import Direction, Lap, PassStatus, RacePhase, TargetState


@pytest.fixture(scope="module")
def page():
    with site() as pages:
        page = pages.page()
        page.goto("/overlay")
        yield page
        assert pages.faults == []


@pytest.mark.parametrize(
    ("race", "laps_wanted"), [(one_car, 3), (one_car, None), (two_cars, None), (by_hand, 3), (by_hand, None)]
)
def test_the_page_says_what_the_displays_say_after_each_event(page, race, laps_wanted):
    """Over whole races, one car and several, page and displays never differ: phase, laps, best, times, words, figures."""
    events = race()
    assert sum(isinstance(event, Lap) for event in events) >= 2
    said = page.evaluate(AFTER_EACH_JS, [plain(events), laps_wanted])
    for event, theirs, ours in zip(events, said, after_each(events, laps_wanted), strict=True):
        assert theirs == ours, event


times = st.floats(0, 100).map(lambda value: round(value, 3))
cars = st.integers(1, 3)
events = st.one_of(
    st.builds(made.target, times, st.sampled_from(TargetState)),
    st.builds(
        made.crossing,
        times,
        line=st.sampled_from(["start", "sector 1"]),
        direction=st.sampled_from(Direction),
        car=cars,
        status=st.none() | st.sampled_from(PassStatus),
        lap=st.none() | st.integers(1, 5),
    ),
    st.builds(
        made.lap,
        st.integers(1, 5),
        times,
        st.floats(1, 20).map(lambda value: round(value, 3)),
        valid=st.booleans(),
        car=cars,
    ),
    st.builds(
        made.race_state,
        times,
        st.sampled_from(RacePhase),
        countdown_s=st.none() | st.sampled_from([0.5, 1.5, 2.5, 3.0]),
    ),
    st.builds(made.standings, times, cars, st.just(4)),
    st.builds(made.health, times),
    st.builds(made.running, times, car=cars),
    st.builds(made.incident, car=cars, start_s=times),
    st.builds(made.run_summary),
)


@settings(max_examples=40)
@given(stream=st.lists(events, max_size=25), laps_wanted=st.none() | st.integers(1, 4))
def test_any_stream_is_reduced_alike(page, stream, laps_wanted):
    """Whatever order events come in, however odd, both boards say the same."""
    assert page.evaluate(AFTER_EACH_JS, [plain(stream), laps_wanted]) == after_each(stream, laps_wanted)


def test_a_reload_in_mid_lap_loses_nothing(page):
    """What is kept for late-comers, everything but where the cars were, gives the same laps and the same running lap."""
    every = one_car()
    for end in range(50, len(every), 50):
        kept = [one for one in every[:end] if type(one).__name__ not in {"Observation", "Target", "Running"}]
        last = page.evaluate(AFTER_EACH_JS, [plain(kept), 3])[-1:]
        state = BoardState(laps_wanted=3)
        for event in every[:end]:
            state = state.after(event)
        if kept and state.lap_start_s is not None:
            assert last[0]["cars"][0]["lap_start_s"] == state.lap_start_s
            assert last[0]["cars"][0]["laps"] == [lap.number for lap in state.laps]


FIXED = "async (pairs) => { const W = await import('/static/board_words.js'); return pairs.map(([v, d]) => W.fixed(v, d)); }"


@settings(max_examples=30)
@given(
    st.lists(st.tuples(st.one_of(st.floats(0, 1e6), st.integers(0, 80_000).map(lambda n: n / 8)), st.integers(0, 3)))
)
def test_numbers_are_rounded_as_in_python(page, pairs):
    """A time on the page has the same digits as on a display and in a table, halves included."""
    assert page.evaluate(FIXED, pairs) == [f"{value:.{decimals}f}" for value, decimals in pairs]


CLOCK = """
async (heard) => {
  const { SourceClock } = await import("/static/board_clock.js");
  const clock = new SourceClock();
  return heard.map(([t_s, now_ms]) => {
    if (t_s !== null) clock.heard(t_s, now_ms);
    return [clock.at(now_ms), clock.held(now_ms)];
  });
}
"""


def test_the_clock_follows_the_least_late_event(page):
    """Late events do not set the running clock back; a source that stopped stops it, and one that goes on sets it again."""
    said = page.evaluate(CLOCK, [[10.0, 1000], [10.05, 1100], [None, 1200], [10.3, 1300], [None, 9000], [20.0, 9100]])
    assert [round(at, 3) for at, _ in said] == [10.0, 10.1, 10.2, 10.3, 12.8, 20.0]
    assert [held for _, held in said] == [False, False, False, False, True, False]


FORWARD = """
async (values) => {
  const { Forward } = await import("/static/board_clock.js");
  const forward = new Forward();
  return values.map(([key, value]) => forward.of(key, value));
}
"""


def test_a_running_lap_never_steps_back_a_little(page):
    """Small corrections are waited out, true ones and another lap are shown at once."""
    values = [["1", 5.0], ["1", 4.9], ["1", 5.1], ["1", 4.0], ["2", 0.02]]
    assert page.evaluate(FORWARD, values) == [5.0, 5.0, 5.1, 4.0, 0.02]


TRACES = """
async ([events, t_s]) => {
  const [B, { Traces }] = await Promise.all([import("/static/board_state.js"), import("/static/board_trace.js")]);
  let board = B.newBoard();
  const traces = new Traces();
  for (const event of events) { board = B.after(board, event); traces.after(board, event); }
  const car = board.cars[0];
  return {start_s: car.lap_start_s, path: traces.path(1), best: traces.best(1), best_s: car.best_lap.time_s,
          ghost: traces.ghost(1, t_s), place: traces.place(1, board.t_s)};
}
"""


def test_path_and_ghost_are_those_of_the_laps(page):
    """The path begins with the running lap, the best lap's reaches from its start to its end, and the ghost lies on it."""
    every = one_car()
    cut = next(at for at, event in enumerate(every) if getattr(event, "t_s", 0.0) >= 11.0)
    found = page.evaluate(TRACES, [plain(every[:cut]), 1.0])
    assert found["path"][0]["t_s"] == pytest.approx(found["start_s"], abs=0.1)
    assert found["best"][0]["t_s"] == pytest.approx(0.0, abs=0.1)
    assert found["best"][-1]["t_s"] == pytest.approx(found["best_s"], abs=0.1)
    near = min(found["best"], key=lambda point: abs(point["t_s"] - 1.0))
    assert found["ghost"] == pytest.approx([near["x"], near["y"]], abs=0.06)
    assert (found["place"]["x"] - 2) ** 2 + (found["place"]["y"] - 2) ** 2 == pytest.approx(1.0, abs=0.1)
