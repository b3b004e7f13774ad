"""The list of parts: it adds up, keeps its promises, and says of every price whose it is and when."""

import datetime

import bom_page
import pytest

ROWS = bom_page.items()


def test_the_minimal_list_is_at_most_100_beyond_the_board():
    """Promised: 100 USD, beyond the board."""
    assert {row.currency for row in ROWS} == {"USD"}
    assert 0 < bom_page.minimal_beyond_board(ROWS) <= 100


@pytest.mark.parametrize("variant", ["max7219", "digits", "oled", "spi"])
def test_the_complete_list_is_at_most_200(variant):
    """Promised: 200 USD with board and display. The HUB75 panel, for halls, is dearer, and its total is told."""
    assert bom_page.complete(ROWS, variant) <= 200


def test_the_sums_are_those_of_the_page():
    """What the page says is what the rows come to."""
    text = bom_page.page()
    assert f"| minimal, beyond the board | {sum(r.price * r.minimal for r in ROWS if r.group != 'board')} |" in text
    for name, title in bom_page.DISPLAYS.items():
        total = sum(r.price * r.complete for r in ROWS) + sum(r.price for r in ROWS if name in r.display)
        assert f"| complete, with {title} | {total} |" in text


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_a_part_is_told_whole(row):
    """Each part has a price with its day, says what matters in it, and is in a list, for a display or instead of something."""
    assert row.price > 0
    assert datetime.date.fromisoformat(row.priced_on).year >= 2026
    assert len(row.matters) > 20
    assert set(row.display) <= set(bom_page.DISPLAYS)
    assert row.minimal or row.complete or row.display or row.group.endswith("instead")


@pytest.mark.parametrize("needed", ["board", "box", "camera", "mount", "paper"])
@pytest.mark.parametrize("wanted", ["minimal", "complete"])
def test_each_list_is_whole(needed, wanted):
    """Who buys a list can hang it up: nothing of what a box needs is left out, and no camera or board is bought twice."""
    count = sum(getattr(row, wanted) for row in ROWS if row.group == needed)
    assert count >= 1
    assert count == 1 or needed not in {"board", "camera", "paper"}
    assert any(getattr(row, wanted) for row in ROWS if row.name == "tether")
    assert len({row.name for row in ROWS}) == len(ROWS)


def test_prices_are_called_estimates():
    """The page says so, with day and currency."""
    text = bom_page.page()
    assert "**Prices are estimates**" in text
    assert f"made on {max(row.priced_on for row in ROWS)}, in USD" in text
