"""The route is closed, ordered, even, and in the lane's middle; where it cannot be, one line says why."""

import itertools
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from twin_pictures import (
    HALF_WIDTH,
    PINK,
    canvas,
    circle,
    figure_eight,
    painted,
    ring,
    rounded,
    stroke,
    theta,
    with_seams,
)

from dnb_edge.errors import InputError
from dnb_edge.track.build import TrackSettings, build_route
from dnb_edge.track.route import find_route
from dnb_edge.track.twin import load_twin


def nearest(points, to):
    return np.array([np.hypot(*(to - point).T).min() for point in points])


def turns(points):
    """Angle from each chord to the next, radians."""
    chords = np.roll(points, -1, axis=0) - points
    heading = np.arctan2(chords[:, 1], chords[:, 0])
    return (np.diff(heading, append=heading[:1]) + math.pi) % (2 * math.pi) - math.pi


def even(points):
    chords = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
    return chords.max() / chords.min()


def test_a_circle_is_found_to_a_fraction_of_a_pixel():
    """A circular lane gives its circle, its circumference and its half-widths."""
    route = find_route(ring(), source="ring")
    radii = np.hypot(*(route.points_px - 200).T)
    assert abs(radii - 130).max() < 0.5
    assert route.length_px == pytest.approx(2 * math.pi * 130, rel=2e-3)
    assert even(route.points_px) < 1.01
    assert abs(route.half_left_px - HALF_WIDTH).max() < 1.0
    assert abs(route.half_right_px - HALF_WIDTH).max() < 1.0


@settings(max_examples=12, deadline=None)
@given(x=st.floats(170, 230), y=st.floats(170, 230), radius=st.floats(70, 140), half=st.floats(6, 20))
def test_every_circle_is_found(x, y, radius, half):
    """Place, size and lane width do not matter."""
    mask = canvas()
    stroke(mask, circle((x, y), radius), half=half)
    route = find_route(mask, source="circle")
    assert abs(np.hypot(*(route.points_px - (x, y)).T) - radius).max() < 0.8


def test_the_default_route_is_the_outer_loop_and_passes_forks_straight():
    """Forks leave neither kink nor pull in the route: along the straight past a fork it keeps to the drawn middle."""
    route = find_route(theta(), source="theta")
    drawn = rounded(50, 50, 350, 350, 70)
    dense = np.vstack([drawn + (np.roll(drawn, -1, axis=0) - drawn) * k / 40 for k in range(40)])
    assert nearest(route.points_px, dense).max() < 2.5
    assert route.length_px == pytest.approx(4 * 160 + 2 * math.pi * 70, rel=0.01)
    assert abs(turns(route.points_px)).max() < math.radians(4)
    # The mouth of a fork is no lane: its half-width is bounded.
    assert max(route.half_left_px.max(), route.half_right_px.max()) <= 1.3 * 17


def merging(x, radius, half):
    """A lane that leaves the outer loop's round corner at a slant, wider or narrower than the loop."""
    mask = canvas()
    stroke(mask, rounded(40, 40, 360, 360, radius))
    stroke(mask, np.array([[x, 60.0], [x, 360.0]]), closed=False, half=half)
    return mask


@pytest.mark.parametrize("half", [16, 24, 30])
@pytest.mark.parametrize(("x", "radius"), [(110, 150), (120, 150), (120, 180), (150, 100)])
def test_a_lane_that_merges_at_a_slant_leaves_no_bulge(x, radius, half):
    """The paper's own hard fork: a wide lane off the outside of a bend pulls the route by a quarter of a half-width."""
    drawn = rounded(40, 40, 360, 360, radius)
    dense = np.vstack([drawn + (np.roll(drawn, -1, axis=0) - drawn) * k / 20 for k in range(20)])
    assert nearest(find_route(merging(x, radius, half), source="fork").points_px, dense).max() < HALF_WIDTH / 4


def test_a_narrow_place_is_lane_like_any_other():
    """Where the lane narrows to half on a bend, the route stays in its middle and the half-widths say so."""
    mask = canvas()
    points = circle((200, 200), 130, 360)
    stroke(mask, points)
    narrow = np.zeros_like(mask)
    stroke(narrow, points, half=HALF_WIDTH * 0.6)
    mask[:, 240:] = narrow[:, 240:]
    route = find_route(mask, source="narrow")
    assert abs(np.hypot(*(route.points_px - 200).T) - 130).max() < 1.0
    right = route.points_px[:, 0] > 250
    assert np.median(route.half_left_px[right]) == pytest.approx(HALF_WIDTH * 0.6, abs=0.7)


@pytest.mark.parametrize(
    ("waypoints", "passes", "avoids"),
    [
        (((50, 200), (200, 200)), (50, 200), (350, 200)),
        (((200, 200), (350, 200)), (350, 200), (50, 200)),
        (((50, 200), (350, 200)), (50, 200), (200, 200)),
    ],
)
def test_waypoints_choose_the_loop(waypoints, passes, avoids):
    """Each of the three loops of a square with a middle lane is found by two points on it, in either order."""
    for order in itertools.permutations(waypoints):
        route = find_route(theta(), waypoints_px=order, source="theta")
        assert nearest(np.array([passes]), route.points_px)[0] < 8
        assert nearest(np.array([avoids]), route.points_px)[0] > 60


def test_a_crossing_is_driven_straight():
    """Waypoints on both lobes of an eight give the eight, not two lobes that touch: the route crosses itself."""
    route = find_route(figure_eight(), waypoints_px=((345, 210), (55, 190)), source="eight")
    turned = turns(route.points_px)
    assert abs(turned.sum()) < 0.1
    assert abs(turned).max() < math.radians(12)
    t = np.arange(2000) * (2 * math.pi / 2000)
    drawn = np.column_stack((200 + 150 * np.cos(t), 200 + 110 * np.sin(2 * t)))
    assert nearest(route.points_px, drawn).mean() < 2


def test_seams_and_ragged_edges_do_not_cut_the_lane():
    """Hair lines across the lane, JPEG noise and soft edges leave the route where it was."""
    settings_ = TrackSettings(name="t", lane_colour=PINK, close_gap_px=3)
    plain = build_route(painted(theta()), settings_, source="plain")
    seamed = build_route(with_seams(painted(theta())), settings_, source="seamed")
    assert nearest(seamed.points_px, plain.points_px).max() < plain.length_px / len(plain.points_px)


def cut(mask, box):
    u0, v0, u1, v1 = box
    mask = mask.copy()
    mask[v0:v1, u0:u1] = False
    return mask


def ends_in(message):
    return [tuple(map(float, pair)) for pair in re.findall(r"\((\d+), (\d+)\)", message)]


@pytest.mark.parametrize(
    ("mask", "pattern"),
    [
        (cut(ring(), (0, 190, 120, 214)), r"not closed: it ends at .* twin px: draw the lane through"),
        (
            cut(theta(), (0, 190, 120, 214)),
            r"outer lane is not closed: it ends at .*or choose another loop by waypoints",
        ),
    ],
)
def test_a_gap_is_named_with_its_place(mask, pattern):
    """A break wider than a seam is an error that says where the lane ends; nothing is guessed across it."""
    with pytest.raises(InputError, match=pattern) as caught:
        find_route(mask, source="gap.png")
    assert str(caught.value).startswith("gap.png: ")
    places = ends_in(str(caught.value))
    assert len(places) == 2
    assert sorted(v < 200 for _, v in places) == [False, True]
    assert all(40 < u < 90 and 165 < v < 240 for u, v in places)


def test_the_gap_can_be_closed_or_avoided():
    """What the message advises works: a wider gap setting, or waypoints on a loop that is whole."""
    image = painted(cut(theta(), (0, 196, 120, 204)))
    wide = TrackSettings(name="t", lane_colour=PINK, close_gap_px=14)
    assert build_route(image, wide, source="t").length_px == pytest.approx(1080, rel=0.02)
    other = TrackSettings(name="t", lane_colour=PINK, waypoints_px=((200, 200), (350, 200)))
    assert build_route(image, other, source="t").length_px < 900


def dumbbell():
    mask = canvas()
    stroke(mask, circle((110, 200), 60), half=10)
    stroke(mask, circle((290, 200), 60), half=10)
    stroke(mask, np.array([[170.0, 200.0], [230.0, 200.0]]), closed=False, half=10)
    return mask


@pytest.mark.parametrize(
    ("mask", "waypoints", "pattern"),
    [
        (ring(), ((200, 200),), r"waypoint \(200, 200\) twin px is 1\d\d px from the middle of the nearest lane"),
        (canvas(), (), r"the lane is not closed: draw"),
        (dumbbell(), (), r"the lanes form 2 loops, A \(about \d+ px long, waypoint 50,200\), B"),
        (
            dumbbell(),
            ((60, 200), (340, 200)),
            r"no closed loop of lanes passes the waypoints \(60, 200\), \(340, 200\)",
        ),
        (cut(ring(), (0, 190, 120, 214)), ((330, 200),), r"no closed loop .*: it ends at"),
    ],
)
def test_what_cannot_be_a_route_is_refused(mask, waypoints, pattern):
    """A waypoint off the lane, no lane, or no loop: one line that names the picture and says what to do."""
    with pytest.raises(InputError, match=pattern) as caught:
        find_route(mask, waypoints_px=waypoints, source="twin.png")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("twin.png: ")


def test_the_papers_twin_gives_its_outer_loop(real_dir):
    """The paper's own drawing, seams, ragged edges and four forks included: length within 1 %, 8 px on average."""
    image = load_twin(real_dir / "drivenetbench" / "digital-twin.jpg")
    route = build_route(image, TrackSettings(name="paper", lane_colour=PINK), source="paper")
    assert route.length_px == pytest.approx(8076, rel=0.01)
    centre = np.load(real_dir / "drivenetbench" / "center_path.npy").reshape(-1, 2).astype(float)
    assert nearest(route.points_px, centre).mean() < 8
    assert nearest(route.points_px, centre).max() < 12
    assert nearest(centre[::8], route.points_px).max() < 16
    assert abs(turns(route.points_px)).max() < math.radians(3)
    assert even(route.points_px) < 1.02
