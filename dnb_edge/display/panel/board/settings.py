"""What `settings.json` on the board says: which panel is at which pins, how bright, how it hangs.

Knows every key, its default and what it may be. Knows no pin and no chip. The tool that writes the file judges it by this
module too.
"""

import json

PANELS = {
    "max7219-32x8": "matrix-32x8",
    "max7219-8-digits": "digits-8",
    "tm1637-6-digits": "digits-8",
    "ssd1306-128x64": "oled-128x64",
    "sh1106-128x64": "oled-128x64",
    "hub75-64x32": "matrix-64x32",
}
"""Each panel that there is a driver for, and the layout of what it shows."""

DEFAULTS = {
    "panel": "max7219-32x8",
    "brightness": 3,
    "turn": 0,
    "reverse": False,
    "mirror": False,
    "upside_down": False,
    "checksums": True,
}
"""What holds where the file says nothing. `turn`, `reverse` and `mirror` are for MAX7219 alone; digits of seven segments know
no `upside_down`. `checksums` false lets lines typed by hand pass without one."""


def judge(settings) -> str:
    """What is wrong with `settings`, in a line; nothing where it may be written to a board."""
    if not isinstance(settings, dict):
        return "not an object"
    for key in settings:
        if key not in DEFAULTS:
            return "unknown key " + str(key)
        complaint = _judge_value(key, settings[key])
        if complaint:
            return complaint
    return ""


def read(text: str):
    """The settings of a file's `text`, whole, and what is wrong with it; a wrong file means the defaults."""
    try:
        told = json.loads(text)
    except ValueError:
        return dict(DEFAULTS), "not JSON"
    complaint = judge(told)
    settings = dict(DEFAULTS)
    if not complaint:
        settings.update(told)
    return settings, complaint


def load(path: str):
    """As `read`, of the file at `path`; without a file the defaults hold and nothing is wrong."""
    try:
        with open(path) as file:  # noqa: PTH123 there is no pathlib on a board
            return read(file.read())
    except OSError:
        return dict(DEFAULTS), ""
    except UnicodeError:
        return dict(DEFAULTS), "not text"


def _judge_value(key: str, value) -> str:
    if key == "panel":
        return "" if isinstance(value, str) and value in PANELS else "panel: one of " + " ".join(sorted(PANELS))
    if key == "brightness":
        fits = isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 15
        return "" if fits else "brightness: 0 to 15"
    if key == "turn":
        return "" if value in (0, 90, 180, 270) and not isinstance(value, bool) else "turn: 0, 90, 180 or 270"
    return "" if isinstance(value, bool) else key + ": true or false"
