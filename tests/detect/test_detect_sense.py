"""Which way along its axis a thing drives."""

import math

import pytest

from dnb_edge.detect.sense import AxisSeen, AxisSense


def _seen(u: float, v: float, axis: float | None = 0.0, length: float = 40.0) -> AxisSeen:
    return AxisSeen(camera_px=(u, v), length_px=length, axis_rad=axis)


@pytest.mark.parametrize(
    ("axis", "step", "heading"),
    [
        (0.0, (12, 0), 0.0),
        (0.0, (-12, 0), math.pi),
        (math.pi, (12, 0), 0.0),
        (math.pi / 2, (0, -12), math.pi / 2),
        (-math.pi / 2, (0, -12), math.pi / 2),
        (math.pi / 4, (-9, 9), -3 * math.pi / 4),
    ],
)
def test_movement_tells_the_sense_of_an_axis(axis, step, heading):
    """The axis points where the thing has gone, whichever way round the detector gave it; v is counted downwards."""
    sense = AxisSense()
    assert sense.headings([_seen(100, 100, axis)]) == [None]
    (told,) = sense.headings([_seen(100 + step[0], 100 + step[1], axis)])
    assert told is not None
    assert math.cos(told - heading) == pytest.approx(1.0)


def test_slow_movement_adds_up_and_a_stop_keeps_the_sense():
    """Steps of a pixel tell the sense once they make a quarter of the length; standing and jitter do not change it."""
    sense = AxisSense()
    headings = [sense.headings([_seen(100 + step, 100)])[0] for step in range(15)]
    assert headings[:10] == [None] * 10
    assert headings[10:] == [0.0] * 5
    assert sense.headings([_seen(112, 101, math.pi)]) == [pytest.approx(0.0)]


def test_reversing_turns_the_sense():
    """A car that goes back by a quarter of its length heads the other way: the value is the direction of travel."""
    sense = AxisSense()
    for u in (100, 112, 102):
        (told,) = sense.headings([_seen(u, 50)])
    assert told == pytest.approx(math.pi)


def test_two_cars_keep_their_own_senses():
    """Cars that pass in opposite directions a length and more apart are told apart."""
    sense = AxisSense()
    for step in range(5):
        told = sense.headings([_seen(100 + 12 * step, 50), _seen(150 - 12 * step, 110)])
    assert told == [pytest.approx(0.0), pytest.approx(math.pi)]


def test_what_has_no_axis_or_is_new_has_no_heading():
    """Upright boxes never get a heading, and neither does a thing that appears far from all others."""
    sense = AxisSense()
    sense.headings([_seen(100, 100, None)])
    assert sense.headings([_seen(120, 100, None)]) == [None]
    assert sense.headings([_seen(300, 100)]) == [None]
