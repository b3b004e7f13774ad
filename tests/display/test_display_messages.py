"""What a serial display is told."""

from display_events import board, crossing, health, lap, race, run_summary, target
from hypothesis import given
from hypothesis import strategies as st
from pty_line import Firmware

from dnb_edge.display import messages, protocol
from dnb_edge.display.serial_port import WRITE_TIMEOUT_S
from dnb_edge.display.state import LAPS_KEPT, BoardState


def bodies(told):
    return [message.body() for message in told]


def test_a_lap_is_told_with_everything_that_it_changed():
    """The group of lines at the end of a lap: crossing, lap, best, state, running time, in this order."""
    before = race(0, laps_wanted=3)
    after = before.after(crossing(12.0)).after(lap(1, 2.0, 10.0)).at(12.05)
    assert bodies(messages.news(before, after)) == [
        "CROSS 12.000",
        "LAP 1 10.000 +-0.002 OK 95.8",
        "BEST 1 10.000",
        "STATE LAP 2 OF 3",
        "RUN 2 0.050",
    ]


def test_no_news_is_still_a_sign_of_life():
    """Where nothing happened only the running time is told."""
    state = race(1)
    assert bodies(messages.news(state, state.at(20.0))) == ["RUN 2 8.000"]


def test_an_invalid_lap_tells_why():
    """The reasons of an invalid lap follow it, two at most."""
    bad = lap(1, valid=False, similarity=None, reasons=("off the lane for 0.8 s", "car lost for 1.2 s", "third"))
    told = bodies(messages.news(race(0), race(0).after(bad)))
    assert told[:3] == [
        "LAP 1 12.483 +-0.002 BAD -",
        "WHY 1 off the lane for 0.8 s",
        "WHY 1 car lost for 1.2 s",
    ]
    assert not [line for line in told if "third" in line or line.startswith("BEST")]


def test_a_suspect_lap_tells_why_first():
    """A lap driven under a moved camera is told so even where it has reasons enough not to be valid; a valid one stays OK."""
    moved = ("the camera had moved by 12 mm",)
    bad = lap(1, valid=False, similarity=None, reasons=("off the lane for 0.8 s", "second"), suspect=moved)
    told = bodies(messages.lap_messages(bad))
    assert told[1:] == ["SUSPECT 1 the camera had moved by 12 mm", "WHY 1 off the lane for 0.8 s"]
    assert bodies(messages.lap_messages(lap(2, suspect=moved)))[0] == "LAP 2 12.483 +-0.002 OK 95.8"


def test_no_repaint_repeats_a_crossing():
    """A display that is switched on just after a crossing does not flash for it."""
    assert not [line for line in bodies(messages.repaint(race(2))) if line.startswith("CROSS")]


def test_warnings_come_and_go():
    """The health line is told again whenever the warnings change, with as many of them as it counts."""
    calm, dark = race(1).after(health(20.0)), race(1).after(health(20.0, warnings=("dark",)))
    assert bodies(messages.news(calm, dark))[:2] == ["HEALTH FPS 29.9 REC RECORDING WARNINGS 1", "WARN 1 dark"]
    assert bodies(messages.news(dark, calm))[:1] == ["HEALTH FPS 29.9 REC RECORDING WARNINGS 0"]


def test_saved_laps_are_told_when_their_number_changes():
    """A line of its own, which older displays pass over, once the disk has another lap; none without a recording."""
    none, one, two = (race(2).after(health(20.0, saved_laps=count)) for count in (None, 1, 2))
    assert bodies(messages.news(one, two))[:-1] == ["SAVED 2"]
    assert len(messages.news(two, two)) == 1
    assert "SAVED 2" in bodies(messages.repaint(two))
    assert not [line for line in bodies(messages.repaint(none)) if line.startswith("SAVED")]


def test_the_longest_repaint_fits_into_the_write_timeout():
    """At 115200 baud, ten bits a byte, even the fullest board passes a wire without buffers before it counts as stuck."""
    state = race(0).after(health(warnings=("w" * 99,) * 9, saved_laps=999_999))
    for number in range(1, LAPS_KEPT):
        state = state.after(lap(number, valid=False, reasons=("r" * 99,) * 9, suspect=("s" * 99,) * 9))
    size = sum(len(protocol.encode_line(message)) for message in messages.repaint(state))
    assert size <= protocol.BAUD / 10 * WRITE_TIMEOUT_S


happenings = st.lists(
    st.one_of(
        st.builds(target, st.floats(0, 100)),
        st.builds(crossing, st.floats(0, 100)),
        st.builds(health, st.floats(0, 100), warnings=st.lists(st.text(max_size=9), max_size=6).map(tuple)),
        st.builds(run_summary),
        st.tuples(st.floats(1, 50), st.booleans(), st.lists(st.text(max_size=9), max_size=3).map(tuple)),
    ),
    max_size=8,
)


@given(happenings, st.data())
def test_news_upon_news_shows_the_same_as_one_repaint(happened, data):
    """However the states are thinned out on their way, the display ends up showing what a fresh one would."""
    states = [BoardState(laps_wanted=5)]
    for event in happened:
        if isinstance(event, tuple):
            time_s, valid, reasons = event
            number = states[-1].laps_done + 1
            suspect = reasons if number % 2 else ()
            done = lap(number, 2.0, time_s, valid=valid, reasons=() if valid else reasons, suspect=suspect)
            states.append(states[-1].after(done))
        else:
            states.append(states[-1].after(event))
    kept = [state for state in states[1:-1] if data.draw(st.booleans())] + states[1:][-1:]
    following, fresh = Firmware(), Firmware()
    for message in messages.repaint(states[0]):
        following.obey(message)
    for earlier, later in zip([states[0], *kept], kept, strict=False):
        for message in messages.news(earlier, later):
            following.obey(message)
    for message in messages.repaint(states[-1]):
        fresh.obey(message)
    assert following.shown == fresh.shown


def test_board_is_empty_before_the_first_state():
    """A display that is on before the race says that the appliance waits."""
    assert bodies(messages.repaint(board())) == ["HELLO DNB-EDGE 1", "STATE WAITING", "RUN - -"]
