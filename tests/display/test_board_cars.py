"""Boards of a race of several cars, with countdown, penalties and the running lap."""

import io
import itertools
from dataclasses import replace

import pytest
from display_events import (
    board,
    crossing,
    incident,
    lap,
    race,
    race_state,
    run_summary,
    running,
    standings,
    target,
)
from hypothesis import given
from hypothesis import strategies as st
from pty_line import Firmware
from rich.console import Console

from dnb_edge.display import messages
from dnb_edge.display.car_board import Phase
from dnb_edge.display.picture import headline_text, picture, printed_lines
from dnb_edge.display.state import BoardState, news_since
from dnb_edge.values import PassStatus, RacePhase


def bodies(told):
    return [message.body() for message in told]


def painted(state):
    console = Console(file=io.StringIO(), width=100, height=30, force_terminal=False)
    console.print(picture(state))
    return console.file.getvalue()


def test_each_car_has_its_own_laps_and_the_leader_is_in_front():
    """Laps of two cars do not mix, and the figures in front are those of the car that leads."""
    state = board(
        crossing(1.0), crossing(1.5, car=2), lap(1, 1.0, 10.0), lap(1, 1.5, 9.0, car=2), standings(10.6, 2, 1)
    )
    assert [car.laps_done for car in state.cars] == [1, 1]
    assert (state.shown.car, state.best_lap.time_s, state.lap_number) == (2, 9.0, 2)
    assert board(standings(1.0, 1, 2)).shown.car == 1


def test_the_pass_status_begins_a_lap_whatever_the_phase():
    """Where every pass has a status, a lap begins where the race says so and nowhere else."""
    state = board(target(1.0), crossing(2.0, status=PassStatus.IGNORED))
    assert state.phase is Phase.OUT_LAP
    again = board(crossing(2.0, status=PassStatus.START, lap=1), crossing(5.0, status=PassStatus.START, lap=1)).at(6.0)
    assert (again.lap_number, again.running_s) == (1, pytest.approx(1.0))


def test_the_best_lap_counts_penalties():
    """A faster lap with two seconds of penalty is not the best."""
    state = board(crossing(1.0), lap(1, 1.0, 10.0, official_time_s=12.0, penalty_s=2.0), lap(2, 11.0, 11.0))
    assert state.best_lap.number == 2


def test_a_countdown_stands_in_large_digits_and_on_the_wire():
    """What is awaited, the seconds and the start are told; a start by chance tells no seconds."""
    waiting = board(race_state(0.0, RacePhase.WAITING, text="waiting for 2 cars to stand on the grid"))
    counting = waiting.after(race_state(1.0, RacePhase.COUNTDOWN, countdown_s=3.0))
    blind = waiting.after(race_state(1.0, RacePhase.COUNTDOWN))
    racing = counting.after(race_state(4.0, RacePhase.RACING, remaining_s=300.0))
    assert (headline_text(counting), headline_text(blind)) == ("3", "--.-")
    assert (waiting.state_line, counting.state_line) == ("waiting for 2 cars to stand on the grid", "countdown, 3 s")
    assert bodies(messages.news(waiting, counting))[0] == "COUNT 3.0"
    assert bodies(messages.news(waiting, blind))[0] == "COUNT -"
    assert bodies(messages.news(counting, racing))[0] == "GO 300.0"
    assert bodies(messages.repaint(waiting))[2] == "GRID waiting for 2 cars to stand on the grid"
    assert not [line for line in bodies(messages.repaint(race(1))) if line.split()[0] in {"GRID", "COUNT", "GO"}]


def test_the_running_lap_is_compared():
    """Delta and similarity of the running lap are told, and end with the lap."""
    begun = race(1)
    going = begun.after(running(13.0, delta_s=-0.214, similarity=95.8))
    done = going.after(lap(2, 12.0, 10.0))
    assert bodies(messages.news(begun, going)) == ["LIVE -0.214 95.8", "RUN 2 1.000"]
    assert "LIVE - -" in bodies(messages.news(going, done))
    assert "-0.21 s" in painted(going)
    assert "95.8 %" in painted(going)


def test_a_penalty_is_told_with_its_lap():
    """The lap's own time, the seconds added and why."""
    from dnb_edge.values import Penalty  # noqa: PLC0415

    penalty = Penalty(offence="off_track", seconds=2.0, reason="the car left the lane for 0.8 s")
    done = lap(1, 2.0, 10.0, penalties=(penalty,), penalty_s=2.0, official_time_s=12.0)
    told = bodies(messages.news(race(0), race(0).after(done)))
    assert told[:3] == [
        "LAP 1 10.000 +-0.002 OK 95.8",
        "PENALTY 1 2.000 the car left the lane for 0.8 s",
        "BEST 1 12.000",
    ]
    assert "+2.000 s penalty" in printed_lines(race(0), race(0).after(done))[0]


def test_the_standings_are_painted_and_sent():
    """Place, ties, gaps and names; another leader begins a repaint."""
    one = board(crossing(1.0), crossing(1.5, car=2), standings(9.0, 1, 2))
    two = one.after(lap(1, 1.5, 9.0, car=2)).after(standings(10.6, 2, 1, tied=True))
    assert bodies(messages.repaint(one))[:2] == ["HELLO DNB-EDGE 1", "CAR 1 car 1"]
    told = bodies(messages.news(one, two))
    assert told[:2] == ["HELLO DNB-EDGE 1", "CAR 2 car 2"]
    assert "PLACE 1= 2 3 10.100 - IN car 2" in told
    assert "PLACE 1= 1 3 10.200 0.100 IN car 1" in told
    text = painted(two)
    assert "1=" in text
    assert "+0.100" in text


def test_who_takes_the_lead_on_the_line_flashes():
    """Another leader's repaint is followed by its crossing where that is news; one that the display knows is not told again."""
    one = board(crossing(1.0), crossing(1.5, car=2), standings(9.0, 1, 2))
    ahead = one.after(crossing(10.5, car=2)).after(lap(1, 1.5, 9.0, car=2)).after(standings(10.6, 2, 1))
    told = bodies(messages.news(one, ahead))
    assert told[:-2] == bodies(messages.repaint(ahead))
    assert told[-2:] == ["CROSS 10.500", told[-3]]
    by_penalty = one.after(standings(10.6, 2, 1))
    assert bodies(messages.news(one, by_penalty)) == bodies(messages.repaint(by_penalty))


def test_a_car_with_fewer_laps_is_laps_behind():
    """On the board in laps; on the wire, which tells gaps in seconds, as none."""
    told = standings(9.0, 1, 2, 3)
    first, second, third = told.rows
    rows = (first, replace(second, gap=None, gap_laps=1), replace(third, gap=None, gap_laps=2))
    one = board(crossing(1.0), crossing(1.5, car=2), replace(told, rank_by="total_time", rows=rows))
    assert "+1 lap " in painted(one)
    assert "+2 laps" in painted(one)
    assert "PLACE 3 3 3 10.300 - IN car 3" in bodies(messages.repaint(one))


def test_what_is_awaited_no_more_leaves_the_display():
    """No message takes a line back, so a display is painted anew where nothing is awaited any more."""
    one = board(race_state(0.0, RacePhase.WAITING, text="for 2 cars"))
    two = one.after(race_state(1.0, RacePhase.WAITING, text=""))
    assert bodies(messages.news(one, two)) == bodies(messages.repaint(two))
    assert not any(body.startswith("GRID") for body in bodies(messages.news(one, two)))


def test_another_cars_lap_is_told_as_such():
    """Laps of cars that do not lead have their own line."""
    one = board(crossing(1.0), crossing(1.5, car=2), standings(9.0, 1, 2))
    assert "CARLAP 2 1 9.000 OK" in bodies(messages.news(one, one.after(lap(1, 1.5, 9.0, car=2))))
    assert printed_lines(one, one.after(lap(1, 1.5, 9.0, car=2)))[0].startswith("car 2  lap 1")


def test_cars_are_called_by_their_names():
    """Where standings have named the cars, the title says whose the large digits are, and printed lines say whose lap it is."""
    told = standings(9.0, 1, 2)
    rows = tuple(replace(row, name=name) for row, name in zip(told.rows, ("red", "[blue]"), strict=True))
    one = board(crossing(1.0, status=PassStatus.START), crossing(1.5, car=2), replace(told, rows=rows))
    assert painted(one).splitlines()[0].startswith("╭─  car 1 red, lap 1")
    assert printed_lines(one, one.after(lap(1, 1.5, 9.0, car=2)))[0].startswith("car 2 [blue]  lap 1")
    assert printed_lines(None, one)[-1] == "car 1 red crosses the start line, lap 1 begins"


def test_a_race_is_not_called_finished_while_a_car_drives():
    """The leader's end is told as the leader's; the race is finished when all cars are."""
    first = board(crossing(1.0, status=PassStatus.START), crossing(1.5, car=2), laps_wanted=1).after(lap(1, 1.0, 9.0))
    assert painted(first).splitlines()[0].startswith("╭─  car 1, finished")
    assert painted(first.after(lap(1, 1.5, 9.0, car=2))).splitlines()[0].startswith("╭─  finished")


def test_incidents_are_printed():
    """What happened to a car is said at once, with its number where there are several."""
    one = race(1)
    assert printed_lines(one, one.after(incident())) == ["the car left the lane for 0.8 s, by up to 120 mm"]
    several = board(crossing(1.0), crossing(1.5, car=2))
    assert printed_lines(several, several.after(incident(car=2)))[0].startswith("car 2  the car left the lane")


happenings = st.lists(
    st.one_of(
        st.builds(lambda t, car: crossing(t, car=car, status=PassStatus.START), st.floats(0, 99), st.integers(1, 3)),
        st.builds(
            lambda t, car: running(t, car=car, delta_s=t - 50, similarity=t), st.floats(0, 99), st.integers(1, 3)
        ),
        st.builds(race_state, st.floats(0, 99), st.sampled_from(RacePhase), text=st.sampled_from(["", "why"])),
        st.builds(lambda t, cars: standings(t, *cars), st.floats(0, 99), st.permutations([1, 2, 3])),
        st.builds(lambda car, time_s: (car, time_s), st.integers(1, 3), st.floats(1, 50)),
        st.builds(run_summary),
    ),
    max_size=10,
)


@given(happenings, st.data())
def test_news_upon_news_shows_the_same_as_one_repaint(happened, data):
    """However the states of several cars are thinned out on their way, the display ends up showing what a fresh one would."""
    states = [BoardState(laps_wanted=5)]
    for event in happened:
        if isinstance(event, tuple):
            number, time_s = event
            done = next((car.laps_done for car in states[-1].cars if car.car == number), 0)
            states.append(states[-1].after(lap(done + 1, 2.0, time_s, car=number)))
        else:
            states.append(states[-1].after(event))
    kept = [state for state in states[1:-1] if data.draw(st.booleans())] + states[1:][-1:]
    following, fresh = Firmware(), Firmware()
    for message in messages.repaint(states[0]):
        following.obey(message)
    for earlier, later in itertools.pairwise([states[0], *kept]):
        for message in messages.news(earlier, later):
            following.obey(message)
    for message in messages.repaint(states[-1]):
        fresh.obey(message)
    assert following.shown == fresh.shown


def test_what_was_missed_is_bounded_by_what_is_kept():
    """A display that slept through a day gets the latest laps and no error."""
    state = board(*(lap(number) for number in range(1, 200)))
    assert len(news_since(None, state)) == 50
    assert news_since(state, board(lap(1))) == ()
