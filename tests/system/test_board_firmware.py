"""The drivers and the loop of the displays' firmware on real MicroPython, Debian 13's, unpacked beside the system."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "display"))

import on_board
from test_panel_firmware import micropython  # noqa: F401 a fixture


def test_the_drivers_light_the_chips(micropython, tmp_path):  # noqa: F811
    """Every check of drivers, settings and loop against the models of the chips passes on MicroPython."""
    on_board.passes_the_checks(micropython, tmp_path)


def test_the_firmware_shows_a_race(micropython, tmp_path):  # noqa: F811
    """From the appliance's serial display over a pseudo-terminal to the lit pixels: a race is shown."""
    on_board.shows_a_race(micropython, tmp_path)
