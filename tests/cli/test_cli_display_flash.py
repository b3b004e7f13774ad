"""`dnb-edge display flash` on a board at a pseudo-terminal."""

import json
import os
import subprocess
import sys
import tty
from pathlib import Path

import pytest
from typer.testing import CliRunner

from dnb_edge.cli.display import app
from dnb_edge.display import flash
from dnb_edge.errors import InputError

RAW_REPL = Path(__file__).parents[1] / "display" / "raw_repl.py"


@pytest.fixture
def board(tmp_path):
    """A port with MicroPython's raw REPL at its other end; its files are in `tmp_path`."""
    master, slave = os.openpty()
    tty.setraw(slave)
    process = subprocess.Popen([sys.executable, str(RAW_REPL)], stdin=master, stdout=master, cwd=tmp_path)
    yield os.ttyname(slave)
    process.kill()
    process.wait()
    os.close(slave)
    os.close(master)


def test_a_board_is_written(board, tmp_path):
    """The options become the board's settings, and a line says what was done."""
    done = CliRunner().invoke(app, ["flash", board, "--panel", "ssd1306-128x64", "--upside-down", "--brightness", "0"])
    assert done.exit_code == 0, done.output
    settings = json.loads((tmp_path / "settings.json").read_text())
    assert settings == {"panel": "ssd1306-128x64", "brightness": 0, "upside_down": True}
    count = len(flash.board_files()) + 1
    assert f"{board}: MicroPython 1.26.1, {count} files written, 0 as they were, 0 removed" in done.stdout


def test_as_json(board, tmp_path):
    """Without options for the panel there are no settings, and --json prints one object."""
    done = CliRunner().invoke(app, ["flash", board, "--json"])
    told = json.loads(done.stdout)
    assert told["port"] == board
    assert set(told["written"]) == set(flash.board_files())
    assert not (tmp_path / "settings.json").exists()


def test_wrong_options_touch_no_board():
    """A panel that there is no driver for is refused before any port is looked for."""
    done = CliRunner().invoke(app, ["flash", "--panel", "vt100"])
    assert isinstance(done.exception, InputError)
    assert "panel: one of " in str(done.exception)
