"""Start, finish and sector lines anywhere on a route, drawn or placed."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from twin_pictures import PINK, figure_eight, painted, ring, winding

from dnb_edge.errors import InputError
from dnb_edge.track.build import TrackSettings, track_from_route
from dnb_edge.track.layout import laid_out
from dnb_edge.track.line import line_across
from dnb_edge.track.model import Track, crossings_of
from dnb_edge.track.overlay import draw_track
from dnb_edge.track.route import find_route
from dnb_edge.track.scale import TwinScale

SCALE = TwinScale(metres_per_px=0.01, height_px=400)
RING = find_route(ring(), source="ring")
EIGHT = find_route(figure_eight(), source="eight")
WINDING, DRAWN = winding()
OPEN = find_route(WINDING, waypoints_px=(tuple(DRAWN[0]), tuple(DRAWN[-1])), closed=False, source="open")


def track(route=RING, **changes):
    return track_from_route(route, SCALE, TrackSettings(name="t", lane_colour=PINK, **changes), source="twin.png")


def place(built, line):
    ((s_m, forward),) = crossings_of(built.centreline, line)
    assert forward
    return s_m


def on_ring(degrees):
    return 200 + 130 * math.cos(math.radians(degrees)), 200 - 130 * math.sin(math.radians(degrees))


@given(degrees=st.floats(0, 360), away=st.floats(-15, 15))
def test_a_start_place_becomes_a_line_across_the_lane(degrees, away):
    """The lap starts at the route's place nearest to the pixel, and is driven anticlockwise."""
    u, v = on_ring(degrees)
    built = track(start_at_px=(u + away * math.cos(math.radians(degrees)), v - away * math.sin(math.radians(degrees))))
    x, y = np.array(built.start_line.start_m) / 2 + np.array(built.start_line.end_m) / 2 - 2.0
    assert math.hypot(x, y) == pytest.approx(1.3, abs=0.02)
    assert abs((math.degrees(math.atan2(y, x)) - degrees + 180) % 360 - 180) < 1
    assert abs(built.centreline.step_m(0.0, place(built, built.start_line))) < 1e-6
    assert built.start_line.length_m == pytest.approx(0.32, abs=0.02)
    assert np.mean(built.centreline.curvature_1pm) > 0


def test_finish_and_sector_lines_by_place_or_by_ends_are_sorted_and_turned():
    """Whatever the order and direction in which they come, a lap crosses each forward, in the order of their names."""

    def spoke(deg):
        return ((200 + 100 * math.cos(math.radians(deg)), 200 - 100 * math.sin(math.radians(deg))),
                             (200 + 160 * math.cos(math.radians(deg)), 200 - 160 * math.sin(math.radians(deg))))  # fmt: skip

    built = track(
        start_at_px=on_ring(10), finish_line_px=spoke(310), sector_lines_px=(spoke(200), spoke(100)[::-1]),
        sectors_at_px=(on_ring(150), on_ring(60)),
    )  # fmt: skip
    round_m = built.centreline.length_m
    degrees = [place(built, line) / round_m * 360 for line in built.sector_lines]
    assert degrees == pytest.approx([50, 90, 140, 190], abs=1.5)
    assert [line.name for line in built.sector_lines] == [f"sector {k}" for k in range(1, 5)]
    assert built.finish_line is not None
    assert place(built, built.finish_line) / round_m * 360 == pytest.approx(300, abs=1.5)
    start_m, lap_m = built.lap_m()
    assert min(start_m, round_m - start_m) < 1e-6
    assert lap_m == pytest.approx(place(built, built.finish_line), abs=1e-6)
    assert [line.name for line in built.lines] == ["start", "finish", *(f"sector {k}" for k in range(1, 5))]
    way = built.lap_route_m()
    assert np.hypot(*np.diff(way, axis=0).T).sum() == pytest.approx(lap_m, rel=1e-3)


def test_without_a_finish_line_a_lap_is_once_round():
    """A closed route's lap begins and ends at the start line."""
    built = track(start_at_px=on_ring(10))
    assert built.finish_line is None
    assert built.lap_m() == (0.0, built.centreline.length_m)
    assert np.array_equal(built.lap_route_m()[0], built.lap_route_m()[-1])


@pytest.mark.parametrize("turned", [False, True])
def test_an_open_route_has_its_lines_a_little_within_its_ends(turned):
    """By default one lane's width from either end, in the direction of the waypoints."""
    ends = (tuple(DRAWN[0]), tuple(DRAWN[-1]))
    route = find_route(WINDING, waypoints_px=ends[::-1] if turned else ends, closed=False, source="open")
    built = track(route, closed=False)
    start_m, lap_m = built.lap_m()
    length_m = built.centreline.length_m
    assert start_m == pytest.approx(0.32, abs=0.02)
    assert lap_m == pytest.approx(length_m - 0.64, abs=0.04)
    assert bool(built.centreline.points_m[0, 0] > 2) is turned
    assert Track.from_dict(built.to_dict()) == built


def test_lines_of_an_open_route_may_lie_anywhere_in_their_order():
    """Start, sectors and finish by place."""
    a, b, c, d = (tuple(DRAWN[k]) for k in (40, 90, 120, 170))
    built = track(OPEN, closed=False, start_at_px=a, finish_at_px=d, sectors_at_px=(c, b))
    places = [place(built, line) for line in (built.start_line, *built.sector_lines, built.finish_line)]
    assert places == sorted(places)
    drawn = built.scale.to_track_m(np.array([a, b, c, d]))
    assert built.centreline.points_at(np.array(places)) == pytest.approx(drawn, abs=0.05)


A, B, C = (tuple(DRAWN[k]) for k in (40, 100, 170))
EAST = ((300, 200), (360, 200))
_ACROSS = line_across(track(OPEN, closed=False).centreline, 1.0, name="start")
BACKWARDS = tuple(map(tuple, SCALE.to_twin_px(np.array([_ACROSS.end_m, _ACROSS.start_m])).tolist()))


@pytest.mark.parametrize(
    ("route", "changes", "pattern"),
    [
        (RING, {"start_at_px": (200, 200)}, r"the place \(200, 200\) twin px of the line 'start' is 1\d\d px from the route"),
        (RING, {"start_at_px": (330, 200), "start_line_px": EAST}, "the start line is given by its ends and by a place"),
        (RING, {"finish_at_px": (330, 200), "finish_line_px": EAST}, "the finish line is given by its ends"),
        (RING, {"sectors_at_px": ((0, 0),)}, "line 'sector 1' is"),
        (RING, {"finish_line_px": ((0, 200), (400, 200))}, "line 'finish' .* crosses the route 2 times"),
        (RING, {"start_at_px": on_ring(0), "finish_at_px": on_ring(0)}, "the finish line is the start line: leave it out"),
        (RING, {"start_at_px": on_ring(0), "finish_at_px": on_ring(90), "sectors_at_px": (on_ring(180),)},
         "'sector 1' lies outside of the lap"),
        (EIGHT, {"start_at_px": (200, 200)}, r"the line 'start' .* crosses the route 2 times, at \(2\d\d, 2\d\d\) and"),
        (EIGHT, {"sectors_at_px": ((201, 199),)}, "crosses the route 2 times"),
        (OPEN, {"start_at_px": C, "finish_at_px": A}, "the finish line lies before the start line: swap the two"),
        (OPEN, {"start_at_px": B, "sectors_at_px": (A,)}, "'sector 1' lies outside of the lap"),
        (OPEN, {"start_line_px": BACKWARDS}, "from its first to its last waypoint crosses the start line backwards"),
    ],
)  # fmt: skip
def test_lines_that_cannot_be_are_refused(route, changes, pattern):
    """Off the route, twice given, out of order, at a crossing, or backwards: one line that says what to do."""
    with pytest.raises(InputError, match=pattern) as caught:
        track(route, closed=route.closed, **changes)
    assert str(caught.value).startswith("twin.png: ")
    assert "\n" not in str(caught.value)


def test_an_open_route_without_a_finish_line_is_no_track():
    """Where its laps end must be said."""
    built = track(OPEN, closed=False)
    with pytest.raises(InputError, match="needs a finish line"):
        Track(name="x", scale=SCALE, centreline=built.centreline, start_line=built.start_line)


def test_laying_out_what_is_laid_out_changes_nothing():
    """Bit for bit: a stored track may be checked as often as one likes."""
    for built in (track(start_at_px=on_ring(33)), track(EIGHT, start_at_px=(350, 200)), track(OPEN, closed=False)):
        again = laid_out(
            built.centreline, name=built.name, scale=SCALE, start=built.start_line, finish=built.finish_line, source="t"
        )
        assert again == built


def test_a_moved_start_line_begins_the_lap_anew():
    """Laid out with another start line, s = 0 is there."""
    built = track(start_at_px=on_ring(0))
    moved = line_across(built.centreline, 2.0, name="start")
    again = laid_out(built.centreline, name="t", scale=SCALE, start=moved, source="t")
    assert again.centreline.point_at(0.0) == pytest.approx(built.centreline.point_at(2.0), abs=1e-3)


def test_the_picture_of_an_open_track_shows_its_ends_and_its_lines():
    """No way is drawn from the last point to the first; red, blue and purple lines are there."""
    built = track(OPEN, closed=False, sectors_at_px=(B,))
    drawn = draw_track(painted(WINDING), built).astype(int)
    middle = (DRAWN[0] + DRAWN[-1]) / 2
    chord = drawn[round(middle[1]) - 3 : round(middle[1]) + 4, round(middle[0])]
    assert chord.min() > 100
    colours = ((0, 0, 210), (160, 0, 120), (200, 90, 0))
    for line, colour in zip(built.lines, colours, strict=True):
        u, v = built.scale.to_twin_px(np.array([line.start_m]) * 0.75 + np.array([line.end_m]) * 0.25)[0]
        near = drawn[round(v) - 2 : round(v) + 3, round(u) - 2 : round(u) + 3].reshape(-1, 3)
        assert abs(near - colour).sum(axis=1).min() < 60


def test_where_nobody_says_the_start_line_keeps_off_a_crossing():
    """An eight is straightest where it crosses itself: the line lies elsewhere, a lane's width clear of the other branch."""
    built = track(EIGHT)
    place(built, built.start_line)
    (x0, y0), (x1, y1) = built.start_line.start_m, built.start_line.end_m
    assert math.hypot((x0 + x1) / 2 - 2.0, (y0 + y1) / 2 - 2.0) > 0.24
