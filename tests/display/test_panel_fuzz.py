"""Rubbish on the line: no crash, no picture that differs from a new panel's after the next repaint, no memory that grows."""

import on_device
import panel_cases
import pytest
from panel_fuzz import Fuzz

from dnb_edge.display.panel import face, state

SIZE = 1_000_000


@pytest.mark.parametrize("seed", [1, 2])
def test_half_a_megabyte_of_rubbish(seed):
    """A million bytes in all. Every thousand a repaint, after which state and pictures are a new panel's; see `panel_fuzz`."""
    fuzz = Fuzz(state, face, panel_cases, seed)
    fuzz.run(SIZE // 2)
    assert fuzz.repaints > 400
    assert fuzz.panel.dropped > 1000
    assert fuzz.panel.lines > 10_000


@pytest.mark.parametrize("layout", face.LAYOUTS)
def test_micropython_draws_the_same_pixels(layout):
    """Every picture of every face, drawn by MicroPython in a microcontroller's memory, is bit for bit the one drawn here."""
    on_device.draws_the_same(layout)


def test_micropython_stands_a_megabyte_of_rubbish():
    """The same bytes as a microcontroller's Python reads them."""
    on_device.stands_rubbish()
