"""The lane graph has the forks and ends that a person would draw."""

import cv2
import numpy as np
import pytest
from twin_pictures import canvas, figure_eight, ring, rounded, stroke, theta

from dnb_edge.track.graph import build_graph
from dnb_edge.track.skeleton import thin


def graph_of(mask):
    radius = cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5)
    return build_graph(thin(np.pad(mask, 1)), radius)


def with_branch():
    """A ring with a dead end a hundred pixels long."""
    mask = ring(110)
    stroke(mask, np.array([[310.0, 200.0], [395.0, 200.0]]), closed=False, half=12)
    return mask


def with_bumps():
    """A ring whose edge has bumps and nicks of a third of the lane's width."""
    mask = ring()
    for angle in np.radians([10, 75, 140, 230, 300]):
        cv2_centre = (200 + 146 * np.cos(angle), 200 + 146 * np.sin(angle))
        rows, columns = np.indices(mask.shape)
        mask |= np.hypot(columns - cv2_centre[0], rows - cv2_centre[1]) < 9
        mask &= np.hypot(columns - (400 - cv2_centre[0]), rows - (400 - cv2_centre[1])) > 5
    return mask


def crossroads():
    mask = canvas()
    stroke(mask, rounded(50, 50, 350, 350, 70))
    stroke(mask, np.array([[200.0, 50.0], [200.0, 350.0]]), closed=False)
    stroke(mask, np.array([[50.0, 200.0], [350.0, 200.0]]), closed=False)
    return mask


def bar():
    mask = canvas()
    stroke(mask, np.array([[60.0, 200.0], [340.0, 200.0]]), closed=False)
    return mask


CASES = [
    (ring, 1, [2], 0),
    (theta, 3, [3, 3], 0),
    (figure_eight, 2, [4], 0),
    (with_branch, 2, [1, 3], 1),
    (with_bumps, 1, [2], 0),
    (crossroads, 8, [3, 3, 3, 3, 4], 0),
    (bar, 1, [1, 1], 2),
    (canvas, 0, [], 0),
]


@pytest.mark.parametrize(("draw", "edges", "degrees", "ends"), CASES)
def test_forks_crossings_ends_and_ragged_edges(draw, edges, degrees, ends):
    """Rings, forks, crossings and dead ends are told apart, and ragged edges make none of them."""
    graph = graph_of(draw())
    assert len(graph.edges) == edges
    assert sorted(graph.degrees().values()) == degrees
    assert len(graph.dead_ends()) == ends


@pytest.mark.parametrize("angle_deg", [90, 75, 60, 52, 45])
@pytest.mark.parametrize("half", [8, 14])
def test_lanes_that_cross_at_a_slant_are_one_crossing(angle_deg, half):
    """Down to 45 degrees, whatever their width: four branches at one node, and nothing between."""
    t = np.arange(480) * (2 * np.pi / 480)
    height = 170 * np.tan(np.radians(angle_deg / 2)) / 2
    mask = canvas()
    stroke(mask, np.column_stack((200 + 170 * np.cos(t), 200 + height * np.sin(2 * t))), half=half)
    assert sorted(graph_of(mask).degrees().values()) == [4]


def test_two_forks_a_lane_apart_stay_two():
    """A lane that leaves to the left and another to the right, a little later, are no crossing."""
    mask = canvas()
    stroke(mask, rounded(40, 40, 360, 360, 60), half=10)
    for x, v in ((170, 40), (230, 360)):
        stroke(mask, np.array([[float(x), v], [float(x), 200.0]]), closed=False, half=10)
    stroke(mask, np.array([[40.0, 200.0], [360.0, 200.0]]), closed=False, half=10)
    assert sorted(graph_of(mask).degrees().values()) == [3] * 6


@pytest.mark.parametrize("draw", [ring, theta, figure_eight, with_branch, crossroads, bar])
def test_edges_are_walks_without_jumps(draw):
    """An edge's points lead from one node to the other without a jump, so that their length is the lane's."""
    for edge in graph_of(draw()).edges:
        steps = np.hypot(*np.diff(edge.points, axis=0).T)
        assert steps.max() < 20
        assert np.median(steps) <= 1.5
        if edge.a == edge.b:
            assert np.allclose(edge.points[0], edge.points[-1])


def test_lengths_are_those_of_the_drawing():
    """The square's outer stretches and its middle lane come out at the length they were drawn with."""
    lengths = sorted(edge.length for edge in graph_of(theta()).edges)
    half_round = 2 * 80 + 160 + np.pi * 70
    # A skeleton is drawn into each fork's mouth by up to half the lane's half-width.
    assert 300 - 2 * 10 < lengths[0] <= 302
    # A walk over pixels is a staircase, up to 8 % longer than the curve.
    assert lengths[1] == pytest.approx(half_round, rel=0.08)
    assert lengths[2] == pytest.approx(half_round, rel=0.08)
