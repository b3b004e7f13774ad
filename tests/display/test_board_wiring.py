"""The wiring diagrams show the pins that the firmware uses, and docs/ shows the diagrams that the code draws."""

import itertools
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from dnb_edge.display.panel.board import settings, wires

sys.path.insert(0, str(Path(__file__).parents[2]))

from hardware.wiring import boards, diagrams, pictures

DOCS = Path(__file__).parents[2] / "docs"


def gpio(pin):
    """The GPIO of a Pico's pin by its number."""
    name = boards.PICO_LEFT[pin - 1] if pin <= 20 else boards.PICO_RIGHT[40 - pin]
    return int(name.removeprefix("GP")) if name.startswith("GP") else name


def of_small(name):
    return {wire.to: gpio(wire.pin) for wire in diagrams.SMALL[name].wires}


@pytest.mark.parametrize("name", ["pico-max7219-32x8", "pico-max7219-8-digits"])
def test_max7219(name):
    """As `wires.py` has it, with 5 V."""
    assert of_small(name) == {
        "VCC": "VBUS", "GND": "GND", "DIN": wires.SPI_DATA, "CS": wires.SPI_SELECT, "CLK": wires.SPI_CLOCK,
    }  # fmt: skip


def test_tm1637_and_oled():
    """As `wires.py` has it, with 3.3 V: both pull their wires up to their supply."""
    assert of_small("pico-tm1637") == {"VCC": "3V3", "GND": "GND", "CLK": wires.TM_CLOCK, "DIO": wires.TM_DATA}
    assert of_small("pico-oled") == {"VCC": "3V3", "GND": "GND", "SCL": wires.I2C_CLOCK, "SDA": wires.I2C_DATA}


def test_hub75():
    """Pins from the first one on, in the order of the driver's table; one ground."""
    order = ("R1", "G1", "B1", "R2", "G2", "B2", "A", "B", "C", "D", "E", "LAT", "OE", "CLK")
    wanted = {name: wires.HUB75_FIRST + place for place, name in enumerate(order)}
    assert {wire.to: gpio(wire.pin) for wire in diagrams.HUB75_WIRES} == wanted | {"GND": "GND"}


def test_the_box_itself():
    """SPI 0 with its first selection, as /dev/spidev0.0 is, with 5 V."""
    wanted = {"VCC": "5V", "GND": "GND", "DIN": "GPIO10 MOSI", "CS": "GPIO8 CE0", "CLK": "GPIO11 SCLK"}
    assert {wire.to: boards.PI_HEADER[wire.pin - 1] for wire in diagrams.PI_WIRES} == wanted


def test_the_pinouts_are_those_of_the_boards():
    """Known pins stand where the data sheets have them: a shift by one row would melt something."""
    assert len(boards.PICO_LEFT) == len(boards.PICO_RIGHT) == 20
    known = {1: 0, 3: "GND", 8: "GND", 13: "GND", 17: 13, 18: "GND", 20: 15, 21: 16, 23: "GND", 28: "GND", 30: "RUN",
             33: "AGND", 36: "3V3", 37: "3V3_EN", 38: "GND", 39: "VSYS", 40: "VBUS"}  # fmt: skip
    assert {pin: gpio(pin) for pin in known} == known
    numbers = [gpio(pin) for pin in range(1, 41)]
    assert sorted(one for one in numbers if isinstance(one, int)) == [*range(23), 26, 27, 28]
    header = {1: "3V3", 2: "5V", 4: "5V", 6: "GND", 9: "GND", 14: "GND", 17: "3V3", 20: "GND", 25: "GND"}
    assert {pin: boards.PI_HEADER[pin - 1] for pin in header} == header


def test_the_page_shows_them_all():
    """Every diagram is on the page, as the code draws it now, and every panel of the settings is named there."""
    page = (DOCS / "wiring.md").read_text(encoding="utf-8")
    for name, text in pictures().items():
        assert (DOCS / "pictures" / "hardware" / name).read_text(encoding="utf-8") == text, (
            "python -m hardware build --docs"
        )
        assert f"pictures/hardware/{name}" in page
    for panel in settings.PANELS:
        assert f"`{panel}`" in page
    shown = re.findall(r"pictures/hardware/(wiring-[^)]+)\)", page)
    assert set(shown) == set(pictures())


@pytest.mark.parametrize("name", sorted(pictures()))
def test_every_wire_can_be_followed(name):
    """Well-formed, every text within the sheet, and no two wires of one diagram run along the same line."""
    tree = ElementTree.fromstring(pictures()[name])
    width, height = float(tree.get("width")), float(tree.get("height"))
    for text in tree.iter("{http://www.w3.org/2000/svg}text"):
        assert 0 < float(text.get("x")) < width
        assert 0 < float(text.get("y")) < height
    paths = [path.get("d") for path in tree.iter("{http://www.w3.org/2000/svg}path") if path.get("stroke") != "#ffffff"]
    runs = [run for number, path in enumerate(paths) for run in level_runs(number, path)]
    for one in runs:
        for other in runs:
            along = min(one[3], other[3]) - max(one[2], other[2])
            assert one[0] == other[0] or abs(one[1] - other[1]) >= 6 or along <= 0, (one, other)


def level_runs(number, path):
    """Which wire, height, from and to of the horizontal stretches of a path."""
    numbers = [float(word) for word in re.findall(r"-?[0-9.]+", path)]
    points = list(zip(numbers[::2], numbers[1::2], strict=True))
    for (x0, y0), (x1, y1) in itertools.pairwise(points):
        if y0 == y1 and abs(x1 - x0) > 12:
            yield number, y0, min(x0, x1), max(x0, x1)
