"""Float against int8: what is lost, what is new, and how far common finds moved."""

import numpy as np
import pytest

from dnb_edge.train.quantise_compare import Spot, apart


def spot(u: float, confidence: float = 0.8) -> Spot:
    return Spot(at_px=(u, 0.0), reach_px=5.0, confidence=confidence)


@pytest.mark.parametrize(
    ("before", "after", "lost", "new", "moved"),
    [
        ([], [], 0, 0, None),
        ([spot(0)], [spot(3)], 0, 0, 3.0),
        ([spot(0)], [spot(6)], 1, 1, None),
        ([spot(0), spot(4, 0.9)], [spot(3)], 1, 0, 1.0),  # the surer one takes it
        ([], [spot(0), spot(9)], 0, 2, None),
    ],
)
def test_finds_are_matched_once_within_reach(before, after, lost, new, moved):
    """A find is the same within its reach, each once, the surest first; the rest is lost or new."""
    result = apart([(before, after)])
    assert (result.finds, result.lost, result.new, result.moved_p95_px) == (len(before), lost, new, moved)
    assert result.output_largest is None


def test_outputs_and_confidences_are_compared():
    """The largest and the mean difference of raw outputs, and the largest of common finds' confidences."""
    ones = np.ones((2, 2), np.float32)
    result = apart([([spot(0, 0.8)], [spot(0, 0.6)])], [(ones, ones * 1.5), (ones, ones)])
    assert result.confidence_largest == pytest.approx(0.2)
    assert (result.output_largest, result.output_mean) == (0.5, 0.25)
