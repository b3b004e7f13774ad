"""Advice: where one more keypoint helps, against what it does when it is clicked."""

import numpy as np
import pytest
from keypoint_samples import HEIGHT, SCALE, TWIN, WIDTH, exact_pairs, seen

from dnb_edge.view.advice import advise, best_addition, compass, hull_px
from dnb_edge.view.fit import fit_keypoints
from dnb_edge.view.keypoints import KeypointPairs


def fitted(twin, **options):
    pairs = KeypointPairs.from_arrays(seen(twin), twin, source="k")
    return fit_keypoints(pairs, SCALE, width_px=WIDTH, height_px=HEIGHT, **options)


def say(length_m):
    return f"{1000 * length_m:.1f} mm"


LEFT_HALF = np.array([[30.0, 80], [480, 60], [470, 940], [20, 950], [250, 500], [90, 640], [430, 330], [200, 200]])
EVERYWHERE = seen(np.array([[x, y] for x in np.linspace(0, 1000, 9) for y in np.linspace(0, 1000, 9)]))


def test_the_advice_is_to_go_where_nothing_is():
    """With keypoints on the twin's left half only, the advised point lies on the other half, where sigma is great."""
    found = fitted(LEFT_HALF)
    addition = best_addition(found, seen(LEFT_HALF), EVERYWHERE)
    ((x, _),) = SCALE.to_twin_px(found.calibration.ground.to_track_m(np.array([addition.camera_px])))
    assert x > 750
    assert addition.sigma_m > 2 * found.calibration.sigma_m(seen(LEFT_HALF)).max()
    assert addition.greatest_after_m < 0.6 * addition.greatest_before_m


def test_what_is_foretold_comes_true():
    """Clicking the advised point lowers the greatest sigma to what was foretold (Student's factor aside), and no other place
    of a coarse grid would have lowered it more."""
    found = fitted(LEFT_HALF)
    addition = best_addition(found, seen(LEFT_HALF), EVERYWHERE)

    def greatest_with(camera_px):
        place = SCALE.to_twin_px(found.calibration.ground.to_track_m(np.array([camera_px])))
        more = fitted(np.vstack((LEFT_HALF, place)))
        share = (found.caution * found.click_sigma_px**2) / (more.caution * more.click_sigma_px**2)
        return more.calibration.sigma_m(EVERYWHERE).max() * share**0.5

    assert greatest_with(addition.camera_px) == pytest.approx(addition.greatest_after_m, rel=0.02)
    low, high = EVERYWHERE.min(axis=0), EVERYWHERE.max(axis=0)
    for u, v in EVERYWHERE[::5]:
        if (low < (u, v)).all() and ((u, v) < high).all():
            assert greatest_with((u, v)) > 0.97 * addition.greatest_after_m


def test_the_sentences():
    """At most three: where to click with its sigma before and after, what so many can tell, the lens if it may be that."""
    sentences = advise(fitted(LEFT_HALF), seen(LEFT_HALF), EVERYWHERE, say)
    assert len(sentences) == 2
    assert sentences[0].startswith("add a point near the ")
    assert "right of the picture, about (" in sentences[0]
    assert sentences[1] == "of 8 points up to 2 wrong ones can be named"
    four = exact_pairs(4).camera_array()
    assert advise(fitted(TWIN[:4]), four, hull_px(four), say)[-1].startswith("4 points are the least")
    assert "not which" in advise(fitted(TWIN[:5]), exact_pairs(5).camera_array(), hull_px(four), say)[-1]


def test_many_points_need_no_more():
    """Where a point more lowers the greatest sigma by less than a twentieth, that is said instead."""
    twin = np.array([[x, y] for x in np.linspace(0, 1000, 8) for y in np.linspace(0, 1000, 8)])
    assert advise(fitted(twin), seen(twin), EVERYWHERE, say)[0].startswith("one more point would hardly help")


@pytest.mark.parametrize(
    ("at", "words"),
    [((10, 10), "top left"), ((640, 10), "top"), ((1270, 10), "top right"), ((10, 360), "left"), ((640, 360), "middle"),
     ((1279, 719), "bottom right"), ((640, 719), "bottom")],
)  # fmt: skip
def test_the_words_for_a_place(at, words):
    """Thirds of the picture."""
    assert compass(at, width_px=WIDTH, height_px=HEIGHT) == words


def test_the_area_between_the_keypoints():
    """A grid inside the polygon of the keypoints, with its corners."""
    square = np.array([[100.0, 100], [300, 100], [300, 200], [100, 200], [200, 150]])
    inside = hull_px(square)
    assert len(inside) > 100
    assert inside.min(axis=0).tolist() == [100, 100]
    assert inside.max(axis=0).tolist() == [300, 200]
