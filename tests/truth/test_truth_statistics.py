"""The certificate's arithmetic against known answers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.truth.statistics import (
    ErrorSeries,
    clustered_mean,
    clustered_share,
    correlation,
    quantiles,
    reliability,
    repeated_share,
    wilson,
    window_variance_ratio,
    without_place,
)


@pytest.mark.parametrize(
    ("share", "count", "low", "high"),
    [(0.5, 100, 0.40383, 0.59617), (0.0, 10, 0.0, 0.27753), (1.0, 10, 0.72247, 1.0), (0.95, 1000, 0.93469, 0.96187)],
)
def test_wilsons_interval(share, count, low, high):
    """Values of the published formula, computed by hand elsewhere."""
    assert wilson(share, count) == pytest.approx((low, high), abs=1e-5)


def test_nothing_tried_tells_nothing():
    """Without trials any share is possible."""
    assert wilson(0.0, 0) == (0.0, 1.0)
    assert clustered_share([]) is None
    assert clustered_share([[], []]) is None


@given(st.lists(st.lists(st.booleans(), min_size=1, max_size=30), min_size=1, max_size=20))
def test_a_clusters_interval_is_never_narrower(drives):
    """The interval holds the share and is at least as wide as that of as many independent trials."""
    found = clustered_share(drives)
    assert found is not None
    low, high = wilson(found.share, found.count)
    assert found.low <= low + 1e-12
    assert found.high >= high - 1e-12
    assert found.low - 1e-12 <= found.share <= found.high + 1e-12
    assert found.hits == sum(sum(drive) for drive in drives)


def test_drives_that_fail_as_a_whole_count_once():
    """Where all laps of a drive share their fate, twenty of them are worth one: the design effect is the drive's size."""
    random = np.random.default_rng(1)
    fates = random.random(400) < 0.9
    found = clustered_share([[bool(fate)] * 20 for fate in fates])
    assert found is not None
    assert found.design_effect == pytest.approx(20.0, rel=0.01)


def test_a_mean_over_shared_crossings_is_as_sure_as_it_is():
    """Laps whose errors are differences of crossings' errors: the interval reflects that their sum nearly vanishes, which the
    formula for independent laps does not know, and it holds the true mean 95 times of 100."""
    random = np.random.default_rng(2)
    held, halves = 0, []
    for _ in range(300):
        drives = [np.diff(random.normal(0.0, 1.0, 26)).tolist() for _ in range(20)]
        found = clustered_mean(drives)
        assert found is not None
        held += abs(found[0]) <= found[1]
        halves.append(found[1])
    plain = 1.96 * math.sqrt(2.0) / math.sqrt(500)
    assert np.mean(halves) < 0.45 * plain
    assert 0.88 < held / 300 < 0.985


def test_a_mean_of_one_drive():
    """One drive has no spread between drives: its own laps' must do."""
    assert clustered_mean([[1.0, 3.0]]) == pytest.approx((2.0, 12.7062), rel=1e-4)
    assert clustered_mean([[4.0]]) == (4.0, 0.0)
    assert clustered_mean([[]]) is None


def test_quantiles_and_reliability():
    """Plain percentiles, and shares of errors within so many sigmas."""
    assert quantiles([1.0, 2.0, 3.0]) == {"p50": 2.0, "p95": pytest.approx(2.9), "max": 3.0}
    assert quantiles([]) == {"p50": None, "p95": None, "max": None}
    assert reliability([0.5, -1.5, 2.5, -3.5], [1.0, 2.0, 3.0]) == [0.25, 0.5, 0.75]


def series(z, frame=None, place_m=None):
    count = len(z)
    return ErrorSeries(
        frame=np.arange(count) if frame is None else np.asarray(frame),
        place_m=np.zeros(count) if place_m is None else np.asarray(place_m, dtype=np.float64),
        z=np.asarray(z, dtype=np.float64),
    )


def test_the_correlation_of_a_fading_error():
    """Of an error of which 0.8 is kept from frame to frame, correlations are 0.8, 0.64 ..., lost frames or not."""
    random = np.random.default_rng(3)
    z = [0.0]
    for new in random.normal(0.0, 0.6, 20_000).tolist():
        z.append(0.8 * z[-1] + new)
    kept = np.flatnonzero(random.random(len(z)) < 0.7)
    for one in (series(z), series(np.array(z)[kept], frame=kept)):
        found = correlation([one], lags=4)
        assert found == pytest.approx([1.0, 0.8, 0.64, 0.512], abs=0.05)


def test_correlations_of_nothing():
    """Where no two frames are so far apart, nothing is told of that lag."""
    assert correlation([series([1.0, -1.0])], lags=3)[2] is None
    assert correlation([], lags=2) == [None, None]


def test_the_share_that_repeats_at_each_place():
    """An error that is half a pattern of the place and half chance repeats by half, chance alone not at all."""
    random = np.random.default_rng(4)
    place = np.tile(np.arange(100) * 0.05 + 0.01, 30)
    pattern = np.sin(place * 4.0) * math.sqrt(2.0)
    chance = random.normal(0.0, 1.0, len(place))
    assert repeated_share([series(pattern + chance, place_m=place)]) == pytest.approx(0.5, abs=0.04)
    assert repeated_share([series(chance, place_m=place)]) == pytest.approx(0.0, abs=0.02)
    assert repeated_share([series(pattern, place_m=place)]) == pytest.approx(1.0, abs=0.02)
    assert repeated_share([]) is None


def test_the_rest_keeps_the_chances_size():
    """What is left without the place's pattern is as large as the chance was, few laps or many."""
    random = np.random.default_rng(5)
    for laps in (3, 30):
        place = np.tile(np.arange(100) * 0.05 + 0.01, laps)
        z = 3.0 * np.sin(place * 4.0) + random.normal(0.0, 1.0, len(place))
        (rest,) = without_place([series(z, place_m=place)])
        assert float(np.sqrt(np.mean(rest.z**2))) == pytest.approx(1.0, abs=0.07)


def test_a_windows_mean():
    """Independent errors average out as they should; errors that are all one do not average at all."""
    assert window_variance_ratio([1.0, 0.0, 0.0], 3) == 1.0
    assert window_variance_ratio([1.0, 1.0, 1.0], 3) == pytest.approx(3.0)
    assert window_variance_ratio([1.0, None], 2) is None
