"""Which loop or way through the lanes is the route, and what is said where the picture does not tell."""

import math
import re

import cv2
import numpy as np
import pytest
from twin_pictures import (
    PINK,
    canvas,
    circle,
    figure_eight,
    open_eight,
    painted,
    ring,
    rounded,
    stroke,
    theta,
    two_rings,
    winding,
)

from dnb_edge.errors import InputError
from dnb_edge.track.build import TrackSettings, build_route, build_track
from dnb_edge.track.loop import SeveralLoops
from dnb_edge.track.overlay import draw_loops
from dnb_edge.track.route import find_route
from dnb_edge.track.twin import load_twin


def nearest(points, to):
    return np.array([np.hypot(*(to - point).T).min() for point in points])


def rings_in_rings():
    mask = canvas()
    stroke(mask, circle((200, 200), 150), half=12)
    stroke(mask, circle((200, 200), 80), half=12)
    return mask


def dumbbell():
    mask = two_rings()
    stroke(mask, np.array([[170.0, 200.0], [230.0, 200.0]]), closed=False, half=10)
    return mask


def two_thetas():
    """Two rings, each with a lane across: a waypoint on one of its sides alone would choose half of it."""
    mask = canvas()
    for x in (100, 300):
        stroke(mask, rounded(x - 70, 80, x + 70, 320, 50), half=10)
        stroke(mask, np.array([[x - 70.0, 200.0], [x + 70.0, 200.0]]), closed=False, half=10)
    return mask


def limacon():
    """A loop within a loop: one lane that crosses itself."""
    t = np.arange(360) * (2 * math.pi / 360)
    radius = 60 + 120 * np.cos(t)
    mask = canvas()
    stroke(mask, np.column_stack((110 + radius * np.cos(t), 200 + radius * np.sin(t))), half=9)
    return mask


def trefoil():
    """A lane that crosses itself three times."""
    t = np.arange(600) * (2 * math.pi / 600)
    x, y = np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t)
    mask = canvas()
    stroke(mask, np.column_stack((200 + 55 * x, 190 + 55 * y)), half=9)
    return mask


def drawn_length(mask_of):
    return {
        "figure_eight": closed_length(lambda t: (150 * np.cos(t), 110 * np.sin(2 * t))),
        "limacon": closed_length(lambda t: ((60 + 120 * np.cos(t)) * np.cos(t), (60 + 120 * np.cos(t)) * np.sin(t))),
        "trefoil": closed_length(
            lambda t: (55 * (np.sin(t) + 2 * np.sin(2 * t)), 55 * (np.cos(t) - 2 * np.cos(2 * t)))
        ),
    }[mask_of.__name__]


def closed_length(curve):
    x, y = curve(np.linspace(0, 2 * math.pi, 20_000))
    return float(np.hypot(np.diff(x), np.diff(y)).sum())


@pytest.mark.parametrize("draw", [figure_eight, limacon, trefoil])
def test_a_lane_that_crosses_itself_is_driven_as_it_was_drawn(draw):
    """With no waypoints, straight over every crossing, all of it once, without a kink."""
    route = find_route(draw(), source="crossing")
    assert route.closed
    assert route.length_px == pytest.approx(drawn_length(draw), rel=0.015)
    chords = np.roll(route.points_px, -1, axis=0) - route.points_px
    heading = np.arctan2(chords[:, 1], chords[:, 0])
    turned = (np.diff(heading, append=heading[:1]) + math.pi) % (2 * math.pi) - math.pi
    assert abs(turned).max() < math.radians(12)


@pytest.mark.parametrize(("draw", "loops"), [(two_rings, 2), (rings_in_rings, 2), (dumbbell, 2), (two_thetas, 2)])
def test_several_loops_are_named_and_each_waypoint_chooses_its_own(draw, loops):
    """One line names each loop by letter, length and waypoints; with those the route is that loop; the picture shows both."""
    mask = draw()
    with pytest.raises(
        SeveralLoops, match=rf"^twin\.png: the lanes form {loops} loops, A \(about \d+ px long, waypoint"
    ) as caught:
        find_route(mask, source="twin.png")
    assert "\n" not in str(caught.value)
    found = caught.value.loops
    assert [loop.letter for loop in found] == ["A", "B"]
    for loop in found:
        for u, v in loop.waypoints_px:
            assert f"{u:.0f},{v:.0f}" in str(caught.value)
        waypoints = tuple((round(u), round(v)) for u, v in loop.waypoints_px)
        route = find_route(mask, waypoints_px=waypoints, source="twin.png")
        assert nearest(route.points_px, loop.points_px).max() < 10
        assert nearest(loop.points_px, route.points_px).max() < 10
    drawn = draw_loops(painted(mask), found)
    assert drawn.shape == (*mask.shape, 3)
    colours = [
        tuple(drawn[round(v), round(u)]) for u, v in (loop.points_px[len(loop.points_px) // 3] for loop in found)
    ]
    assert len(set(colours)) == 2


def test_a_broken_loop_beside_a_whole_one_is_not_offered():
    """Only what closes is a loop: the whole ring is the route, without a question."""
    mask = two_rings()
    mask[190:210, :80] = False
    route = find_route(mask, source="t")
    assert np.hypot(*(route.points_px - (290, 200)).T).max() < 63


@pytest.mark.parametrize("towards_deg", range(0, 360, 90))
@pytest.mark.parametrize(("inner", "outer"), [(60, 130), (90, 170), (130, 170)])
def test_a_branch_within_a_loop_or_a_mark_across_it_leaves_the_loop(towards_deg, inner, outer):
    """Whichever way a dead end within points, and where a start line's ends stick out of the lane, the ring is the route."""
    mask = ring()
    way = np.array([math.cos(math.radians(towards_deg)), math.sin(math.radians(towards_deg))])
    stroke(mask, np.array([200 + inner * way, 200 + outer * way]), closed=False, half=6)
    assert find_route(mask, source="ring").length_px == pytest.approx(2 * math.pi * 130, rel=0.01)


@pytest.mark.parametrize("towards_deg", range(0, 360, 90))
def test_a_lane_that_leaves_a_loop_and_ends_is_asked_about(towards_deg):
    """Longer than a mark, it may be the outer lane, broken off: whichever way it points, its end is named."""
    mask = canvas()
    stroke(mask, circle((200, 200), 90))
    way = np.array([math.cos(math.radians(towards_deg)), math.sin(math.radians(towards_deg))])
    stroke(mask, np.array([200 + 90 * way, 200 + 180 * way]), closed=False)
    with pytest.raises(InputError, match="the outer lane is not closed: it ends at"):
        find_route(mask, source="ring")


def test_three_waypoints_say_in_which_order_and_direction():
    """The route passes them as they were given, and a start place does not turn it round."""
    clockwise = ((200, 70), (330, 200), (200, 330))
    for waypoints in (clockwise, clockwise[::-1]):
        settings = TrackSettings(
            name="ring", lane_colour=PINK, metres_per_px=0.01, waypoints_px=waypoints, start_at_px=(70, 200)
        )
        built = build_track(painted(ring()), settings, source="ring")
        places, _ = built.centreline.locate(built.scale.to_track_m(np.array(waypoints, float)))
        assert list(places) == sorted(places)


def test_waypoints_in_an_order_that_no_loop_has_choose_all_the_same():
    """A loop that passes them all is found in whatever order they come."""
    mixed = ((50, 120), (350, 280), (350, 120), (50, 280))
    route = find_route(theta(), waypoints_px=mixed, source="theta")
    assert route.length_px == pytest.approx(4 * 160 + 2 * math.pi * 70, rel=0.01)


def test_an_open_lane_runs_from_its_first_waypoint_to_its_last():
    """In the waypoints' order, down the lane's middle, to near both ends, and smooth at them."""
    mask, drawn = winding()
    ends = (tuple(drawn[0]), tuple(drawn[-1]))
    for waypoints in (ends, ends[::-1]):
        route = find_route(mask, waypoints_px=waypoints, closed=False, source="open")
        assert not route.closed
        assert nearest(route.points_px, drawn).max() < 2.5
        assert math.dist(route.points_px[0], waypoints[0]) < 6
        assert math.dist(route.points_px[-1], waypoints[-1]) < 6
        chords = np.hypot(*np.diff(route.points_px, axis=0).T)
        assert chords.max() / chords.min() < 1.02


def test_an_open_lane_that_crosses_itself_goes_straight_over():
    """From end to end all of it, not round the corner at the crossing; a waypoint on the way asks for the same."""
    mask, drawn = open_eight()
    length = float(np.hypot(*np.diff(drawn, axis=0).T).sum())
    for middle in ((), ((50, 200),)):
        waypoints = (tuple(drawn[2]), *middle, tuple(drawn[-3]))
        route = find_route(mask, waypoints_px=waypoints, closed=False, source="open eight")
        assert route.length_px == pytest.approx(length, rel=0.03)
        assert nearest(route.points_px, drawn).max() < 4


def test_ordered_waypoints_lead_an_open_route_through_forks():
    """Through the middle lane of a theta, or round by either side, as the waypoints say; twice round, too."""
    ends = ((200, 50), (200, 350))
    by = {name: find_route(theta(), waypoints_px=(ends[0], at, ends[1]), closed=False, source=name)
          for name, at in (("middle", (200, 200)), ("left", (50, 200)), ("right", (350, 200)))}  # fmt: skip
    assert by["middle"].length_px == pytest.approx(300, abs=12)
    assert by["left"].length_px == pytest.approx(540, abs=20)
    assert by["right"].points_px[:, 0].max() > 340
    assert by["left"].points_px[:, 0].min() < 60
    back = ((50, 150), (50, 250), (350, 250), (350, 150), (50, 150), (50, 250))
    twice = find_route(theta(), waypoints_px=back, closed=False, source="twice")
    assert twice.length_px == pytest.approx(1080 + 100, rel=0.05)


def gap():
    mask = ring()
    mask[185:215, :120] = False
    return mask


@pytest.mark.parametrize(
    ("mask", "waypoints", "pattern"),
    [
        (gap(), (), r"two waypoints, its two ends; the lane ends at \(\d+, \d+\) and \(\d+, \d+\) twin px: give them"),
        (gap(), ((200, 70),), r"needs at least two waypoints"),
        (gap(), ((200, 70), (200, 200)), r"waypoint \(200, 200\) twin px is 1\d\d px from"),
        (gap(), ((200, 70), (205, 70)), r"shorter than two lane widths"),
        (
            two_rings(),
            ((110, 140), (290, 140)),
            r"no way along the lanes leads on from waypoint \(110, 140\) to waypoint",
        ),
    ],
)
def test_what_cannot_be_an_open_route_is_refused(mask, waypoints, pattern):
    """Too few waypoints, off the lane, too near, or on lanes that do not meet: one line that says what to do."""
    with pytest.raises(InputError, match=pattern) as caught:
        find_route(mask, waypoints_px=waypoints, closed=False, source="twin.png")
    assert str(caught.value).startswith("twin.png: ")
    assert "\n" not in str(caught.value)


def test_a_lane_that_is_not_closed_names_its_ends_and_three_remedies():
    """Close the gap, raise the setting, or say that it is open; and what it advises works."""
    with pytest.raises(
        InputError, match=r"it ends at .* and .* twin px: draw the lane through, raise .*--close-gap-px.*--open"
    ) as caught:
        find_route(gap(), source="gap")
    ends = [tuple(map(float, pair)) for pair in re.findall(r"\((\d+), (\d+)\)", str(caught.value))]
    route = find_route(gap(), waypoints_px=tuple(ends), closed=False, source="gap")
    assert route.length_px > 0.85 * 2 * math.pi * 130


def test_the_papers_inner_routes_by_waypoints(real_dir):
    """On the paper's drawing each pair of waypoints gives a whole, smooth loop that passes them, shorter than the outer one."""
    image = load_twin(real_dir / "drivenetbench" / "digital-twin.jpg")
    lanes = np.load(real_dir / "drivenetbench" / "all_path.npy").reshape(-1, 2).astype(float)
    every = lanes[::25]
    outer = build_route(image, TrackSettings(name="paper", lane_colour=PINK), source="paper")
    inside = every[nearest(every, outer.points_px) > 150]
    assert len(inside) > 50
    lengths = set()
    for waypoint in inside[:: len(inside) // 3]:
        settings = TrackSettings(name="paper", lane_colour=PINK, waypoints_px=(tuple(waypoint),))
        route = build_route(image, settings, source="paper")
        assert nearest(np.array([waypoint]), route.points_px)[0] < 25
        assert nearest(route.points_px[::20], lanes).mean() < 12
        assert route.length_px < outer.length_px
        lengths.add(round(route.length_px, -1))
    assert len(lengths) >= 2


def test_drawings_are_as_they_are_described():
    """The thetas of this file are two pieces with three loops each, so that one waypoint cannot choose an outer loop."""
    count, _ = cv2.connectedComponents(two_thetas().astype(np.uint8))
    assert count == 3
