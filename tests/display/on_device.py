"""What MicroPython must do with the panel's code, whichever it is: assertions for `make test` and `make system-test`."""

import re

import micropython
import panel_pictures

from dnb_edge.display.panel import face, state

SIZE = 1_000_000


def draws_the_same(layout, command=None):
    """Every picture is bit for bit the one that this Python draws, and a microcontroller's memory is enough."""
    there = micropython.run("tests/display/panel_pictures.py", layout, command=command).splitlines()
    here = [f"{name} {surface.buffer.hex()}" for name, surface in panel_pictures.drawn(state, face, layout)]
    assert there == here


def stands_rubbish(command=None):
    """A million bytes: no crash, no memory that grows, after each repaint what a new panel knows and draws."""
    # Room for the eight surfaces of the comparison.
    said = micropython.run("tests/display/panel_fuzz.py", SIZE, 1, heap="640k", command=command)
    fed, repaints = map(int, re.match(r"(\d+) bytes, (\d+) repaints", said).groups())
    assert fed >= SIZE
    assert repaints > 900
