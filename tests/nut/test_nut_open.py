"""Words for drivers: each kind is found, another name may stand before it, and what is none is refused."""

import pytest
from nut_driving import BRIEFING, sight
from nut_models import write_model

from dnb_edge.errors import InputError
from dnb_edge.nut.open import SHIPPED, open_driver


def test_a_driver_may_be_given_another_name(tmp_path):
    """The name stands in tables; all else is the driver's own."""
    path = write_model(tmp_path / "net.onnx")
    plain, named = open_driver(str(path)), open_driver(f"run-2.b={path}")
    assert (plain.name, named.name, named.knows_truth) == ("net", "run-2.b", False)
    for driver in (plain, named):
        driver.start(BRIEFING)
    assert named.drive(sight()) == plain.drive(sight())
    named.close()


@pytest.mark.parametrize("word", ["", "fast", "net.pt", "http://x", "a=", "network2"])
def test_a_word_that_means_no_driver_is_refused(word):
    """The line says what may be given."""
    with pytest.raises(InputError, match=r"pure-pursuit, .*FILE\.onnx, python:MODULE:CALLABLE, tcp:HOST:PORT"):
        open_driver(word)


def test_the_shipped_drivers_have_words():
    """The three that the package has."""
    assert set(SHIPPED) == {"pure-pursuit", "lane-follower", "network"}
