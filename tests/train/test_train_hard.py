"""Hard places: the network's mistakes, and windows cut round them. Skipped where torch is not installed."""

import math

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs the extra 'train' (torch)")

from dnb_edge.train.batches import WINDOW_PX, make_window  # noqa: E402
from dnb_edge.train.hard import mine, mistakes  # noqa: E402
from dnb_edge.train.scene import SCENE_PX  # noqa: E402

CELLS = SCENE_PX // 4


def _heat(*peaks):
    """A map of logits with maxima (row, column, confidence) on a low floor."""
    heat = np.full((CELLS, CELLS), -6.0, dtype=np.float32)
    for row, column, confidence in peaks:
        heat[row, column] = math.log(confidence / (1 - confidence))
    return heat


@pytest.mark.parametrize(
    ("peaks", "wanted"),
    [
        ([], []),
        ([(10, 20, 0.9)], [(81.5, 41.5)]),
        ([(10, 20, 0.1)], []),  # not confident
        ([(30, 30, 0.9)], []),  # on the car
        ([(30, 33, 0.9)], []),  # beside its middle, within 0.7 lengths
        ([(10, 20, 0.5), (40, 5, 0.8)], [(21.5, 161.5), (81.5, 41.5)]),  # surest first
        ([(10, 20, 0.5), (10, 21, 0.8)], [(85.5, 41.5)]),  # one maximum
    ],
)
def test_mistakes_are_confident_peaks_away_from_every_label(peaks, wanted):
    """What counts is a local maximum of at least 0.2 that lies on no car, strongest first."""
    labels = np.array([[121.5, 121.5, 30.0, 1.0, 0.0, 1.0], [0, 0, 0, 0, 0, 0]], dtype=np.float32)
    assert [at for at, _ in mistakes(_heat(*peaks), labels)] == wanted


class _SeesBright(torch.nn.Module):
    """Takes every bright cell for a car."""

    def forward(self, pixels):
        bright = torch.nn.functional.avg_pool2d(pixels[:, :1], 4)
        return (20.0 * bright - 10.0,)


def test_mining_finds_what_the_network_takes_for_a_car():
    """A bright spot without a label is a hard place of its sample; one with a label is none; the mode is left as it was."""
    blank = np.zeros((2, SCENE_PX, SCENE_PX, 3), dtype=np.uint8)
    spot = blank.copy()
    spot[0, 100:104, 60:64] = 255
    none, car = np.zeros((1, 6), np.float32), np.array([[61.5, 101.5, 30.0, 1.0, 0.0, 1.0]], dtype=np.float32)
    network = _SeesBright()
    places = mine(network, iter([(0, 0, blank, none), (0, 1, spot, none), (0, 2, spot, car), (None, 7, spot, none)]))
    assert [(place.shard, place.row, place.centre_px) for place in places] == [
        (0, 1, (61.5, 101.5)),
        (None, 7, (61.5, 101.5)),
    ]
    assert network.training


def test_a_window_about_a_place_shows_it():
    """Whatever scale is drawn, the place lies in the window."""
    picture = np.zeros((2, SCENE_PX, SCENE_PX, 3), dtype=np.uint8)
    picture[0, 97:106, 57:66] = 255
    labels = np.zeros((1, 6), np.float32)
    for seed in range(30):
        window, _ = make_window(picture, labels, np.random.default_rng(seed), about_px=(61.0, 101.0))
        assert window.shape == (WINDOW_PX, WINDOW_PX, 6)
        assert window[:, :, :3].max() > 100
