"""The panels' drivers and the firmware's loop against models of the chips: `board_checks.py`, on both Pythons."""

import io
import os
import select
import sys

import board_checks
import on_board
import pytest

from dnb_edge.display.panel import face
from dnb_edge.display.panel.board import firmware, hub75, settings


@pytest.fixture(autouse=True)
def host_modules(monkeypatch):
    """What a check puts in the place of a board's modules is gone behind it."""
    for name in ("machine", "rp2", "uctypes"):
        monkeypatch.setitem(sys.modules, name, None)


@pytest.mark.parametrize("check", board_checks.CHECKS, ids=lambda check: check.__name__.removeprefix("check_"))
def test_on_cpython(check):
    """The check's own docstring says what it pins."""
    check()


def test_on_micropython(tmp_path):
    """The same checks by the interpreter that boards have, with the files that are written to a board."""
    on_board.passes_the_checks(on_board.here(), tmp_path)


def test_a_race_on_micropython(tmp_path):
    """From the appliance's serial display over a pseudo-terminal to the lit pixels."""
    on_board.shows_a_race(on_board.here(), tmp_path)


def test_bytes_are_read_as_they_come():
    """What is there is read and no more is waited for; a buffer's worth at most; an end is an end."""
    read, write = os.pipe()
    with io.FileIO(read) as stream:
        inbox = firmware.Inbox(stream, select)
        assert inbox.read(0) == b""
        os.write(write, b"RUN" * 200)
        assert inbox.read(1000) == (b"RUN" * 200)[: firmware.READ_BYTES]
        assert len(inbox.read(0) + inbox.read(0)) == 600 - firmware.READ_BYTES
        assert inbox.read(1) == b""
        os.close(write)
        with pytest.raises(EOFError):
            inbox.read(1000)


def test_every_layout_has_a_panel():
    """Whatever can be drawn can be shown by some panel, and every panel's layout can be drawn."""
    assert set(settings.PANELS.values()) == set(face.LAYOUTS)


def test_hub75_tells_colours_apart():
    """Each colour of the canvas is another one on a panel whose lamps are only on or off."""
    table = hub75.Table()
    told = set()
    for colour in range(len(board_checks.COLOURS)):
        table.take(bytes([colour]) * (hub75.WIDTH * hub75.HEIGHT), board_checks.COLOURS)
        told.add(table.words[hub75.IDLE] & 7)
    assert len(told) == len(board_checks.COLOURS)
