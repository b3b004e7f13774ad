"""What is seen of a car against the paint that was written down for it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.race.paint import paint_cost

Bgr = tuple[float, float, float]

PAINTS: dict[str, Bgr] = {
    "red": (40.0, 36.0, 214.0),
    "blue": (214.0, 96.0, 20.0),
    "yellow": (24.0, 208.0, 240.0),
    "green": (60.0, 170.0, 40.0),
    "white": (240.0, 242.0, 242.0),
    "purple": (190.0, 40.0, 130.0),
    "orange": (20.0, 120.0, 246.0),
    "cyan": (230.0, 200.0, 30.0),
    "black": (20.0, 20.0, 20.0),
}


def nearest(seen: Bgr) -> str:
    return min(PAINTS, key=lambda name: paint_cost(seen, PAINTS[name]))


@pytest.mark.parametrize(
    ("seen", "name"),
    [
        ((74.0, 62.0, 127.0), "red"),
        ((115.0, 59.0, 23.0), "blue"),
        ((32.0, 111.0, 125.0), "yellow"),
        ((58.0, 114.0, 66.0), "green"),
        ((144.0, 144.0, 144.0), "white"),
        ((95.0, 40.0, 75.0), "purple"),
        ((59.0, 89.0, 114.0), "orange"),
        ((147.0, 129.0, 33.0), "cyan"),
        ((46.0, 45.0, 44.0), "black"),
    ],
)
def test_what_the_detector_sees_of_painted_cars_is_told_apart(seen: Bgr, name: str) -> None:
    """The mean colours of simulated cars in their first frames fit their own paints best, though other paints lie nearer."""
    assert nearest(seen) == name


@given(st.sampled_from(sorted(PAINTS)), st.floats(0.4, 0.9), st.floats(25.0, 50.0))
def test_a_paint_in_half_light_over_dark_tyres_is_still_that_paint(name: str, share: float, dark: float) -> None:
    """Mixed with as much dark grey as leaves the paint between 40 and 90 per cent, every paint costs less than the others."""
    blue, green, red = PAINTS[name]
    seen = tuple(share * one + (1.0 - share) * dark for one in (blue, green, red))
    assert nearest((seen[0], seen[1], seen[2])) == name


@given(st.tuples(*[st.floats(0.0, 255.0)] * 3), st.tuples(*[st.floats(0.0, 255.0)] * 3), st.floats(0.0, 4000.0))
def test_a_cost_is_a_number_from_nought_up(seen: Bgr, paint: Bgr, variance: float) -> None:
    """Greys too, whose hue is none; what scatters more costs less."""
    cost = paint_cost(seen, paint, variance)
    assert 0.0 <= cost <= paint_cost(seen, paint) < 10_000.0
