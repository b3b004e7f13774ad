"""Outliers, exchanged pairs and mirrored twins: what is named, and what is left alone."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from keypoint_samples import HEIGHT, SCALE, TWIN, WIDTH, seen
from scipy.stats import f as fisher

from dnb_edge.errors import InputError
from dnb_edge.view.advice import advise, hull_px
from dnb_edge.view.fit import fit_keypoints
from dnb_edge.view.keypoints import KeypointPairs
from dnb_edge.view.outliers import f_tail, most_outliers, variance_factor

MANY = np.vstack((TWIN, [[100.0, 350], [900, 600], [600, 120], [380, 930], [720, 820]]))
NAMES = tuple("ABCDEFGHIJKL")


def fitted(camera, twin, **options):
    pairs = KeypointPairs.from_arrays(camera, twin, source="k.yaml", names=NAMES[: len(twin)])
    return fit_keypoints(pairs, SCALE, width_px=WIDTH, height_px=HEIGHT, **options)


def clicks(seed, twin=MANY, sigma=1.0, moved=()):
    camera = seen(twin) + np.random.default_rng(seed).normal(0, sigma, twin.shape)
    for k, by in moved:
        camera[k] += by
    return np.clip(camera, 0, (WIDTH - 1, HEIGHT - 1))


@pytest.mark.parametrize(
    ("count", "moved"),
    [
        (12, [(4, (60, 0))]),
        (12, [(4, (0, -25))]),
        (12, [(4, (60, 10)), (8, (-70, 0))]),
        (12, [(4, (55, 10)), (8, (55, 10)), (10, (55, 10))]),
        (9, [(5, (80, -20))]),
        (8, [(4, (60, 0))]),
    ],
)
def test_wrong_clicks_are_named(count, moved):
    """One, two or three wrong clicks, even wrong alike, are named with how far off they are; sound ones are not."""
    for seed in range(5):
        found = fitted(clicks(seed, MANY[:count], moved=moved), MANY[:count])
        assert [outlier.name for outlier in found.outliers] == [NAMES[k] for k, _ in moved]
        for outlier, (_, by) in zip(found.outliers, moved, strict=True):
            assert outlier.apart_px == pytest.approx(math.hypot(*by), abs=8)
        named = zip(found.outliers, found.calibration.notes[: len(moved)], strict=True)
        assert all(f"--without {outlier.name}" in note for outlier, note in named)


def test_a_named_outlier_keeps_a_part_that_does_no_harm():
    """The map hardly moves, the error still counts the outlier in full, and leaving it out by hand agrees."""
    camera = clicks(1, moved=[(4, (60, 0))])
    kept = fitted(camera, MANY)
    without = fitted(np.delete(camera, 4, axis=0), np.delete(MANY, 4, axis=0))
    apart = kept.calibration.ground.to_track_m(seen(MANY)) - without.calibration.ground.to_track_m(seen(MANY))
    assert 0 < np.hypot(*apart.T).max() < 0.1 * kept.outliers[0].apart_twin_px * SCALE.metres_per_px
    assert kept.calibration.error.max_px > 0.9 * kept.outliers[0].apart_twin_px
    assert len(kept.calibration.error.per_point_px) == len(MANY)
    assert kept.click_sigma_px == pytest.approx(without.click_sigma_px, rel=0.15)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(5, 12))
def test_sound_clicks_are_hardly_ever_named(seed, count):
    """Clicks with half the stated noise: never a false alarm, from five keypoints on."""
    found = fitted(clicks(seed, MANY[:count], sigma=0.75), MANY[:count])
    assert not found.outliers
    assert not found.suspects


def test_false_alarms_are_rare_at_the_stated_noise():
    """At the full stated noise at most 3 of 100 sound sets have one named."""
    named = [fitted(clicks(seed, sigma=1.5), MANY) for seed in range(100)]
    assert sum(bool(found.outliers or found.suspects) for found in named) <= 3


@pytest.mark.parametrize("count", [5, 6])
def test_too_few_to_tell_which(count):
    """Of five any may be the wrong one, and it is said that one is; of six, one is named or a few are suspected."""
    found = fitted(clicks(3, MANY[:count], moved=[(4, (60, 0))]), MANY[:count])
    if count == 5:
        assert found.suspects == NAMES[:5]
        assert "too few to tell which" in found.calibration.notes[0]
    assert "E" in {*found.suspects, *(outlier.name for outlier in found.outliers)}


@pytest.mark.parametrize("count", [6, 7, 9, 12])
@pytest.mark.parametrize(("i", "j"), [(0, 1), (2, 5), (3, 4)])
def test_exchanged_pairs_are_refused_by_name(count, i, j):
    """Two twin points exchanged, near or far: one line with both names and both errors."""
    order = np.arange(count)
    order[[i, j]] = j, i
    with pytest.raises(InputError, match=rf"^k\.yaml: keypoints {NAMES[i]} and {NAMES[j]} seem swapped: .* twin px$"):
        fitted(clicks(2, MANY[:count]), MANY[:count][order])


def test_four_in_a_crossed_order_are_refused_by_name():
    """Of a quadrilateral with two neighbours exchanged only their exchange gives a floor."""
    with pytest.raises(InputError, match=r"keypoints (A and B|C and D|B and C|A and D) seem swapped, or the other two"):
        fitted(seen(TWIN[:4]), TWIN[[1, 0, 2, 3]])


@pytest.mark.parametrize("count", [4, 5, 9, 12])
def test_a_mirrored_twin_is_refused(count):
    """A drawing seen from below fits as well as any: the sense of turning tells."""
    with pytest.raises(
        InputError, match=r"^k\.yaml: the keypoints run the other way round on the twin .* mirror it back"
    ):
        fitted(clicks(4, MANY[:count]), MANY[:count] * (-1, 1) + (1000, 0))


def test_pairs_in_no_order_are_refused():
    """Rows of the two files that do not belong together at all: one line with what to check."""
    with pytest.raises(
        InputError, match=r"k\.yaml: no (homography|map) .*check that each camera point has its own twin point"
    ):
        fitted(clicks(5), MANY[np.random.default_rng(2).permutation(12)])


@pytest.mark.parametrize(
    ("f", "even", "other"), [(3.0, 2, 4), (1.2, 10, 4), (14.0, 4, 17), (0.0, 2, 4), (500.0, 2, 20)]
)
def test_fishers_tail(f, even, other):
    """The finite sum is the distribution function that SciPy has."""
    assert f_tail(f, even, other) == pytest.approx(fisher.sf(f, even, other), rel=1e-9)


def test_the_blend_of_the_stated_sigma_and_the_seen():
    """Four numbers' worth of the stated sigma, the rest by what is seen."""
    assert variance_factor(0.0, 0) == 1.0
    assert variance_factor(16.0, 16) == 1.0
    assert variance_factor(96.0, 16) == 5.0
    assert [most_outliers(count) for count in (4, 5, 6, 7, 8, 9, 12)] == [0, 0, 1, 1, 2, 2, 4]


@settings(deadline=None, max_examples=150)
@given(st.integers(0, 2**32 - 1), st.integers(4, 9), st.sampled_from([0.0, 30.0, 300.0, 3000.0]))
def test_whatever_is_clicked_there_is_a_map_or_one_line(seed, count, sigma):
    """Clicks from sound to senseless: a calibration with a sigma that is a number, or an error for the user; nothing else."""
    chance = np.random.default_rng(seed)
    camera = np.clip(seen(MANY[:count]) + chance.normal(0, sigma, (count, 2)), 0, (WIDTH - 1, HEIGHT - 1))
    camera += chance.uniform(0, 0.4, camera.shape)
    found, fault = None, "k.yaml"
    try:
        found = fitted(camera, MANY[:count])
    except InputError as error:
        fault = str(error)
    assert fault.startswith("k.yaml")
    assert "\n" not in fault
    if found is not None:
        assert np.isfinite(found.calibration.sigma_m(camera)).all()
        assert len(advise(found, camera, hull_px(camera), str)) in (1, 2, 3)


def test_a_click_beyond_the_horizon_is_refused_by_name():
    """One click in the sky: the others have no place on the floor for it."""
    steep = seen(MANY) * (1, 0.5) + (0, 300)
    steep[5] = (640, 5)
    with pytest.raises(
        InputError, match=r"^k\.yaml: keypoint F lies beyond the horizon of the map that the others make: .* F$"
    ):
        fitted(steep + np.random.default_rng(1).normal(0, 0.5, steep.shape), MANY)


def test_of_six_no_sound_one_is_named_in_place_of_the_wrong_one():
    """A click 25 px off among six, in 60 draws: named, or among the suspects, or unnoticed; never another one instead."""
    seen_through = 0
    for seed in range(60):
        wrong, towards = seed % 6, seed * 1.7
        moved = [(wrong, (25 * math.cos(towards), 25 * math.sin(towards)))]
        found = fitted(clicks(seed, MANY[:6], moved=moved), MANY[:6])
        named = {outlier.name for outlier in found.outliers}
        assert named <= {NAMES[wrong]}
        assert not found.suspects or NAMES[wrong] in found.suspects
        seen_through += bool(named or found.suspects)
    assert seen_through > 30


def test_careless_clicks_hardly_make_outliers():
    """Nine clicks of three times the stated noise, in 80 draws: at most five have one named, for all scatter."""
    found = [fitted(clicks(seed, MANY[:9], sigma=4.5), MANY[:9]) for seed in range(80)]
    assert sum(bool(one.outliers or one.suspects) for one in found) <= 5
