"""What docs/numbers.md and the guides' drawings say is what the published certificate says, and what the code draws."""

import json
import re
from pathlib import Path

import guides_pictures
import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "numbers.md").read_text(encoding="utf-8")
CERTIFICATE = json.loads((ROOT / "docs" / "certificates" / "0.1.0.json").read_text(encoding="utf-8"))
ROWS = {
    ("1 m/s, 30 a second", "places drawn from a model"): "30fps-1mps",
    ("1 m/s, 30 a second", "pictures drawn, car found in them"): "30fps-1mps-rendered",
    ("1 m/s, 60 a second", "places drawn from a model"): "60fps-1mps",
    ("1 m/s, 60 a second", "pictures drawn, car found in them"): "60fps-1mps-rendered",
    ("0.5 m/s, 30 a second", "places drawn from a model"): "30fps-0.5mps",
    ("0.5 m/s, 30 a second", "pictures drawn, car found in them"): "30fps-0.5mps-rendered",
}


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


@pytest.mark.parametrize(("row", "scenario"), ROWS.items(), ids=ROWS.values())
def test_the_table_is_the_certificates(row, scenario):
    """Each row of the table of lap errors has the figures of its scenario, rounded as they are shown."""
    (found,) = [cells(line) for line in PAGE.splitlines() if cells(line)[:2] == list(row)]
    figures = next(one["figures"] for one in CERTIFICATE["scenarios"] if one["name"] == scenario)
    assert found[2:] == [
        f"{figures['laps']:,}",
        f"{figures['p50_ms']:.1f}",
        f"{figures['p95_ms']:.1f}",
        f"{figures['stated_sigma_ms']:.1f}",
        f"{figures['coverage_percent']:.1f} %",
        f"{figures['missed']}, {figures['phantom']}",
    ]


def test_the_count_of_limits_is_the_certificates():
    """The sentence on limits held and missed counts them as the certificate does."""
    tried = [one["holds"] for one in CERTIFICATE["limits"]] + [one["holds"] for one in CERTIFICATE["counts"]]
    assert f"{sum(tried)} of the certificate's {len(tried)} limits hold" in PAGE


def test_distances_follow_from_the_formula():
    """The table of similarities and mean distances is the formula with a baseline of half a metre."""
    rows = re.findall(r"^\| (\d+) % \| (\d+)[ :].*\|$", PAGE, re.MULTILINE)
    assert len(rows) == 7
    for percent, millimetres in rows:
        assert int(percent) == pytest.approx(100 * (1 - int(millimetres) / 500))


@pytest.mark.parametrize("name", guides_pictures.PICTURES)
def test_drawings_are_drawn_again_identically(name):
    """Each committed drawing of the guides is, byte for byte, what docs/tools/guides_pictures.py makes of its sources."""
    assert (guides_pictures.FOLDER / name).read_text(encoding="utf-8") == guides_pictures.PICTURES[name]()


def test_no_drawing_is_left_over():
    """Every SVG in the guides' folder is drawn by code."""
    assert {path.name for path in guides_pictures.FOLDER.glob("*.svg")} == set(guides_pictures.PICTURES)


@pytest.mark.parametrize("page", ["quick-start", "race-day", "numbers", "teaching", "extending", "by-hand"])
def test_pictures_of_the_guides_are_there(page):
    """Each picture that a guide shows is in the repository, and says in words what it shows."""
    folder = ROOT / "docs"
    for words, target in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", (folder / f"{page}.md").read_text(encoding="utf-8")):
        assert (folder / target).is_file(), target
        assert len(words) > 10, target
