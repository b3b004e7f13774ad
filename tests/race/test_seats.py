"""Which car a target is."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.motion.appearance import UNKNOWN, Appearance
from dnb_edge.race.rules import CarSetup
from dnb_edge.race.seats import Seats

RED, BLUE = (40.0, 40.0, 190.0), (180.0, 70.0, 40.0)


def marked(number: int) -> Appearance:
    return Appearance(marker_id=number, reads=5)


def coloured(colour: tuple[float, float, float]) -> Appearance:
    return Appearance(colour_bgr=colour, colours=10)


def test_without_descriptions_cars_are_numbered_as_they_turn_up() -> None:
    """First come, first numbered; a target keeps its number when others come and go."""
    seats = Seats(3)
    assert [seats.of(target, UNKNOWN, {7, 9}) for target in (7, 9, 7)] == [0, 1, 0]
    assert seats.of(11, UNKNOWN, {7, 9, 11}) == 2
    assert seats.of(7, UNKNOWN, {9, 11}) == 0


def test_a_newcomer_takes_the_seat_of_a_car_that_is_away_once_all_are_taken() -> None:
    """A car whose target was lost for good comes back under a new target's number and is still that car."""
    seats = Seats(2)
    assert seats.of(1, UNKNOWN, {1}) == 0
    assert seats.of(2, UNKNOWN, {1, 2}) == 1
    assert seats.of(3, UNKNOWN, {2, 3}) == 0


def test_more_cars_than_seats_leave_the_last_one_out() -> None:
    """A third car in a race for two is nobody's, rather than an error."""
    seats = Seats(2)
    assert [seats.of(target, UNKNOWN, {1, 2, 3}) for target in (1, 2, 3)] == [0, 1, None]


def test_a_marker_decides_whatever_the_order() -> None:
    """Numbers on roofs go before order, and a number that nobody entered does not take part."""
    seats = Seats(2, [CarSetup(name="a", marker_id=4), CarSetup(name="b", marker_id=9)])
    assert seats.of(1, marked(9), {1}) == 1
    assert seats.of(2, marked(4), {1, 2}) == 0
    assert seats.of(3, marked(5), {1, 2, 3}) is None
    assert seats.of(4, marked(9), {2, 4}) == 1, "the same marker under a new target's number is the same car"


def test_colour_decides_between_free_seats() -> None:
    """The blue car that turns up first is the blue one of the list, not its first."""
    seats = Seats(2, [CarSetup(name="red", colour_bgr=RED), CarSetup(name="blue", colour_bgr=BLUE)])
    assert seats.of(5, coloured((175.0, 75.0, 50.0)), {5}) == 1
    assert seats.of(6, coloured((60.0, 50.0, 180.0)), {5, 6}) == 0


def test_a_paint_is_known_though_it_looks_darker() -> None:
    """A yellow car is seen half as bright as the yellow that was written down, which lies nearer to the red: it is yellow."""
    cars = [
        CarSetup(name="red", colour_bgr=(40.0, 36.0, 214.0)),
        CarSetup(name="yellow", colour_bgr=(24.0, 208.0, 240.0)),
    ]
    assert Seats(2, cars).of(1, coloured((32.0, 117.0, 131.0)), {1}) == 1


def test_one_car_is_every_target_but_not_another_ones_marker() -> None:
    """In a race of one, a car found again under any number is that car; a foreign marker is not."""
    assert [Seats(1).of(target, UNKNOWN, set()) for target in (1, 2)] == [0, 0]
    seats = Seats(1, [CarSetup(name="a", marker_id=4)])
    assert seats.of(1, marked(4), {1}) == 0
    assert seats.of(2, marked(5), {1, 2}) is None


@given(st.lists(st.integers(1, 12), min_size=1, max_size=40), st.integers(1, 8))
def test_no_two_followed_targets_share_a_seat(order: list[int], count: int) -> None:
    """Whoever comes in whatever order, two targets that are followed at once are two cars, in a race of several."""
    seats = Seats(count)
    followed: dict[int, int] = {}
    for target in order:
        seat = seats.of(target, UNKNOWN, {*followed, target})
        if seat is not None:
            assert 0 <= seat < count
            followed[target] = seat
    if count > 1:
        assert len(set(followed.values())) == len(followed)
