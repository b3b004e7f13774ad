"""Judging detections against boxes: one detection a box, the surest first, and figures that follow from it."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.detect.check import Rates, above, figures, judge, missed, rates, worst
from dnb_edge.values import Detection


def seen(u: float, v: float, confidence: float) -> Detection:
    return Detection(camera_px=(u, v), sigma_px=1.0, length_px=20.0, confidence=confidence)


LEFT, RIGHT = (0.0, 0.0, 20.0, 10.0), (100.0, 0.0, 120.0, 10.0)
OVERLAPPING = (12.0, 0.0, 32.0, 10.0)


@pytest.mark.parametrize(
    ("found", "boxes", "matched"),
    [
        ([seen(10, 5, 0.9)], [LEFT], [0]),
        ([seen(20, 10, 0.9)], [LEFT], [0]),  # the edge is inside
        ([seen(20.1, 5, 0.9)], [LEFT], [None]),
        ([seen(10, 5, 0.9), seen(11, 5, 0.8)], [LEFT], [0, None]),
        (
            [seen(11, 5, 0.8), seen(19, 5, 0.9)],
            [LEFT],
            [0, None],
        ),  # the surer one, though it is farther from the middle
        ([seen(110, 5, 0.5), seen(10, 5, 0.9)], [LEFT, RIGHT], [0, 1]),
        ([seen(17, 5, 0.9), seen(15, 5, 0.8)], [LEFT, OVERLAPPING], [1, 0]),  # the nearer centre, then what is left
        ([], [LEFT], []),
        ([seen(10, 5, 0.9)], [], [None]),
    ],
)
def test_who_is_matched_with_what(found, boxes, matched):
    """The surest detection takes the nearest box that it lies in; each box once."""
    assert [find.box for find in judge(found, boxes).finds] == matched


def test_figures_by_hand():
    """Precision, recall, errors, offset and the best threshold of a small example worked out by hand."""
    pictures = [
        judge([seen(13, 9, 0.9), seen(50, 50, 0.6), seen(110, 5, 0.3)], [LEFT, RIGHT]),
        judge([seen(10, 8, 0.7)], [LEFT]),
    ]
    result = figures(pictures, 0.5)
    assert result.at == Rates(confidence=0.5, precision=2 / 3, recall=2 / 3)
    assert (result.images, result.cars, result.found, result.false) == (2, 3, 2, 1)
    assert result.centre_error_px is not None
    assert result.centre_error_px.p50 == pytest.approx(4.0)  # 5 and 3
    assert result.centre_error_px.p95 == pytest.approx(4.9)
    assert result.mean_offset_px == pytest.approx((1.5, 3.5))
    assert result.best == Rates(confidence=0.3, precision=3 / 4, recall=1.0)
    assert [one.confidence for one in result.table] == [0.5, 0.6, 0.7, 0.8, 0.9]
    assert result.table[2] == Rates(confidence=0.7, precision=1.0, recall=2 / 3)


def test_nothing_is_told_where_nothing_is_known():
    """Without finds there is no precision, without cars no recall, without matches no error: None, not 0 or NaN."""
    nothing = figures([judge([], [LEFT])], 0.5)
    assert (nothing.at.precision, nothing.at.recall, nothing.centre_error_px, nothing.best) == (None, 0.0, None, None)
    empty = figures([judge([seen(1, 1, 0.9)], [])], 0.5)
    assert (empty.at.precision, empty.at.recall, empty.at.f1, empty.mean_offset_px) == (0.0, None, 0.0, None)


def test_the_worst_come_first():
    """Pictures by their missed cars and false finds, then by the surest false find; perfect ones are left out."""
    perfect = judge([seen(10, 5, 0.9)], [LEFT])
    one_missed = judge([], [LEFT])
    one_false = judge([seen(10, 5, 0.9), seen(70, 5, 0.6)], [LEFT])
    both = judge([seen(70, 5, 0.6)], [LEFT])
    unsure_false = judge([seen(10, 5, 0.9), seen(70, 5, 0.2)], [LEFT])
    pictures = [perfect, one_missed, one_false, both, unsure_false]
    assert worst(pictures, 0.5, 10) == [3, 2, 1]
    assert worst(pictures, 0.5, 1) == [3]
    assert missed(both) == (0,)


points = st.tuples(st.integers(0, 60), st.integers(0, 60), st.sampled_from([0.2, 0.4, 0.6, 0.8]))
corners = st.tuples(st.integers(0, 40), st.integers(0, 40), st.integers(1, 20), st.integers(1, 20))


@settings(deadline=None, max_examples=60)
@given(found=st.lists(points, max_size=8), boxes=st.lists(corners, max_size=5), least=st.sampled_from([0.1, 0.3, 0.5]))
def test_a_threshold_only_cuts_the_tail(found, boxes, least):
    """Judging only what is sure enough gives what judging all and then leaving out the rest gives, and no box twice."""
    detections = [seen(float(u), float(v), confidence) for u, v, confidence in found]
    edges = [(float(u), float(v), float(u + w), float(v + h)) for u, v, w, h in boxes]
    whole = judge(detections, edges)
    assert above(whole, least) == judge([one for one in detections if one.confidence >= least], edges)
    taken = [find.box for find in whole.finds if find.box is not None]
    assert len(taken) == len(set(taken))
    assert len(missed(whole)) + len(taken) == len(edges)
    assert all(math.isfinite(find.offset_px[0]) for find in whole.finds if find.box is not None)


@settings(deadline=None, max_examples=60)
@given(found=st.lists(points, max_size=12), boxes=st.lists(corners, max_size=5))
def test_best_is_the_best(found, boxes):
    """No threshold gives a higher F1 than the one that is told."""
    picture = judge(
        [seen(float(u), float(v), confidence) for u, v, confidence in found],
        [(float(u), float(v), float(u + w), float(v + h)) for u, v, w, h in boxes],
    )
    best = figures([picture], 0.2).best
    highest = max(rates([picture], level).f1 for level in (0.2, 0.4, 0.6, 0.8))
    assert (0.0 if best is None else best.f1) == pytest.approx(highest)
