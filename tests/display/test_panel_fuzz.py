"""Rubbish on the line: no crash, no picture that differs from a new panel's after the next repaint, no memory that grows."""

import re

import micropython
import panel_cases
import panel_pictures
import pytest
from panel_fuzz import Fuzz

from dnb_edge.display.panel import face, state

SIZE = 1_000_000
FUZZ = "tests/display/panel_fuzz.py"


@pytest.mark.parametrize("seed", [1, 2])
def test_half_a_megabyte_of_rubbish(seed):
    """A million bytes in all. Every thousand a repaint, after which state and pictures are a new panel's; see `panel_fuzz`."""
    fuzz = Fuzz(state, face, panel_cases, seed)
    fuzz.run(SIZE // 2)
    assert fuzz.repaints > 400
    assert fuzz.panel.dropped > 1000
    assert fuzz.panel.lines > 10_000


def test_micropython_draws_the_same_pixels():
    """Every picture of every face, drawn by MicroPython, is bit for bit the one that this Python draws."""
    lines = micropython.run("tests/display/panel_pictures.py", heap="1m").splitlines()
    here = [
        f"{layout} {name} {surface.buffer.hex()}"
        for layout in face.LAYOUTS
        for name, surface in panel_pictures.drawn(state, face, layout)
    ]
    assert lines == here


def test_micropython_stands_a_megabyte_of_rubbish():
    """The same bytes as a microcontroller's Python reads them, in half a megabyte of memory for the panel and its twin."""
    fed, repaints = map(
        int, re.match(r"(\d+) bytes, (\d+) repaints", micropython.run(FUZZ, SIZE, 1, heap="640k")).groups()
    )
    assert fed >= SIZE
    assert repaints > 900
