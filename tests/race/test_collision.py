"""Hits of things that stand on the track: when one is told, how often, in which lap, and what it is worth as evidence."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from race_drive import at, drive, incidents_of, laps_of, ring

from dnb_edge.race.car import Passed
from dnb_edge.race.collision import JOIN_S, Collision, Footprint
from dnb_edge.race.fix import Fix
from dnb_edge.race.rules import LapRules, Obstacle
from dnb_edge.values import Incident, IncidentKind

LENGTH_M, WIDTH_M, RADIUS_M = 0.24, 0.16, 0.05
TOUCHES_M = WIDTH_M / 2 + RADIUS_M
"""Beside the car's middle, metres."""


def rules(*obstacles: tuple[float, float], collision_m: float = 0.01) -> LapRules:
    """Obstacles at (angle on the ring, distance from its middle)."""
    return LapRules(
        car_length_m=LENGTH_M,
        car_width_m=WIDTH_M,
        obstacles=tuple(Obstacle(at_m=at(angle, away_m), radius_m=RADIUS_M) for angle, away_m in obstacles),
        collision_m=collision_m,
        off_lane_margin_m=1.0,
    )


def fix_at(t_s: float) -> Fix:
    return Fix(
        t_ns=round(t_s * 1e9), t_s=t_s, target_id=1, observed_m=(0.0, 0.0), covariance_m2=(1e-6, 0.0, 1e-6), track_m=(0.0, 0.0),
        s_m=0.0, d_m=0.0, outside_m=-0.1, progress_m=0.0,
    )  # fmt: skip


def collisions(told: list[Passed]) -> list[Incident]:
    return [one for one in incidents_of(told) if one.kind is IncidentKind.COLLISION]


@pytest.mark.parametrize(
    ("beside_m", "hits"),
    [
        (0.0, 1),
        (TOUCHES_M - 0.02, 1),
        (TOUCHES_M + 0.001, 1),
        (TOUCHES_M + 0.03, 0),
        (-TOUCHES_M + 0.02, 1),
        (-TOUCHES_M - 0.03, 0),
    ],
)
def test_a_car_hits_what_its_footprint_comes_near(beside_m: float, hits: int) -> None:
    """Within 10 mm of the car's side, left or right, an obstacle is hit, once a lap; 30 mm beside it is not."""
    told = drive(ring(4.0), lambda t: at(0.5 * t - 0.1, 4.0), seconds=13, rules=rules((1.0, 4.0 + beside_m)))
    (driven,) = laps_of(told)
    found = collisions(told)
    assert len(found) == hits
    assert [one.lap for one in found] == [driven.lap.number] * hits
    assert all(one.worst_t_ns * 1e-9 == pytest.approx((1.0 + 0.1) / 0.5, abs=0.1) for one in found)


@pytest.mark.parametrize(("collision_m", "hits"), [(0.0, 0), (0.01, 1), (0.02, 1)])
def test_how_near_is_a_hit_is_a_rule(collision_m: float, hits: int) -> None:
    """An obstacle 7 mm beside the car's side, on a bend so wide that its corners come 2 mm nearer."""
    limits = rules((1.0, 4.0 + TOUCHES_M + 0.007), collision_m=collision_m)
    assert len(collisions(drive(ring(4.0), lambda t: at(0.5 * t - 0.1, 4.0), seconds=4, rules=limits))) == hits


@pytest.mark.parametrize("fps", [5.0, 10.0, 30.0])
def test_a_thin_thing_is_not_jumped_over_between_two_frames(fps: float) -> None:
    """At 3 m/s and 5 frames per second the car goes 0.6 m a frame, more than its length: what stands there is hit."""
    told = drive(ring(2.0), lambda t: at(1.5 * t - 0.3, 2.0), seconds=4.6, fps=fps, rules=rules((2.0, 2.0)))
    assert len(collisions(told)) == 1


def test_a_car_that_is_held_is_told_of_once_with_how_long() -> None:
    """It stands against the obstacle for 3 s, springs back and forth by 20 mm, is freed: one incident, of the whole time."""

    def where(t_s: float) -> tuple[float, float]:
        free, stuck_rad = t_s - 0.2, 1.0 - (LENGTH_M / 2 + RADIUS_M)
        held = stuck_rad - (0.02 if int(t_s / (JOIN_S / 2)) % 2 else 0.0)
        if free < stuck_rad:
            return at(free)
        return at(held) if free < stuck_rad + 3.0 else at(free - 3.0, 1.3)

    told = drive(ring(), where, seconds=9.8, rules=rules((1.0, 1.0)))
    (incident,) = collisions(told)
    assert incident.lasted_s == pytest.approx(3.0, abs=0.3)
    assert incident.text == f"the car hit obstacle 1, which stands at ({math.cos(1):.2f}, {math.sin(1):.2f}) m"


def test_each_obstacle_and_each_lap_has_its_own() -> None:
    """Two obstacles, two laps: four incidents, in their order, those of a lap in it."""
    told = drive(ring(), lambda t: at(t - 0.2), seconds=13, rules=rules((1.0, 1.0), (4.0, 0.95)))
    assert [one.text.split(",")[0][-1] for one in collisions(told)] == ["1", "2", "1", "2"]
    assert [[one.kind for one in driven.incidents] for driven in laps_of(told)] == [[IncidentKind.COLLISION] * 2] * 2


def test_a_car_that_stays_against_it_is_told_of_at_the_end() -> None:
    """Stuck until the last frame, in its first lap: the incident comes with the end, and with it that the car stood."""
    told = drive(ring(), lambda t: at(min(t - 0.2, 0.85)), seconds=8, rules=rules((1.0, 1.0)))
    assert {one.kind for one in incidents_of(told)} == {IncidentKind.COLLISION, IncidentKind.STALLED}


def test_a_hit_that_goes_on_is_told_from_its_second_fix_on() -> None:
    """A race that a hit ends must hear of it before the car is free, and not for one fix that may be a slip."""
    watch = Collision(rules((1.0, 1.0)), 0)
    near, far = ((Footprint(centre_m=at(angle), heading_rad=0.0, length_m=0.2, width_m=0.1),) for angle in (1.0, 2.0))
    told = []
    for k, swept in enumerate((far, near, near, far)):
        assert watch.feed(fix_at(k / 30), swept) is None
        told.append(watch.so_far())
    assert [one is not None for one in told] == [False, False, True, True]
    assert told[2] is not None
    assert told[2].start_t_ns < told[2].end_t_ns
    assert watch.close() == told[3]
    assert watch.close() is None


def test_noise_of_a_few_millimetres_makes_no_hit() -> None:
    """Passing at 30 mm with observations that scatter by 3 mm (one sigma, unfiltered), four laps: none."""
    told = drive(ring(), lambda t: at(t - 0.2), seconds=26, noise_m=0.003, rules=rules((1.0, 1.0 + TOUCHES_M + 0.03)))
    assert len(laps_of(told)) == 4
    assert collisions(told) == []


@pytest.mark.parametrize("wrong", [{"car_length_m": None}, {"collision_m": -0.1}])
def test_obstacles_need_the_cars_size(wrong: dict[str, float | None]) -> None:
    """Whether a point hits something is no question; a distance is not negative."""
    given_rules: dict[str, Any] = {"car_length_m": 0.2, "car_width_m": 0.1} | wrong
    with pytest.raises(ValueError, match=r"^race\.(obstacles|collision_m): "):
        LapRules(obstacles=(Obstacle(at_m=(0.0, 0.0), radius_m=0.1),), **given_rules)


@settings(max_examples=60, deadline=None)
@given(
    st.floats(-3, 3), st.floats(-1, 1), st.floats(-1, 1), st.floats(0.01, 1), st.floats(0.01, 1),
)  # fmt: skip
def test_the_gap_is_that_to_the_nearest_point_of_the_rectangle(
    heading: float, x: float, y: float, long_m: float, wide_m: float
) -> None:
    """Against the least distance to many points of the rectangle's edge; the sign says whether it lies within."""
    shape = Footprint(centre_m=(0.3, -0.2), heading_rad=heading, length_m=long_m, width_m=wide_m)
    cos, sin = math.cos(heading), math.sin(heading)
    steps = [k / 100 for k in range(-100, 101)]
    edge = [(side * long_m / 2, k * wide_m / 2) for side in (-1, 1) for k in steps]
    edge += [(k * long_m / 2, side * wide_m / 2) for side in (-1, 1) for k in steps]
    least = min(math.hypot(0.3 + a * cos - b * sin - x, -0.2 + a * sin + b * cos - y) for a, b in edge)
    gap = shape.gap_m((x, y))
    assert abs(gap) == pytest.approx(least, abs=0.012)
    inside_x = abs((x - 0.3) * cos + (y + 0.2) * sin) < long_m / 2
    inside_y = abs((y + 0.2) * cos - (x - 0.3) * sin) < wide_m / 2
    assert (gap < 0) == (inside_x and inside_y) or abs(gap) < 1e-9
