"""What cars tell of themselves, on the board's page in a browser."""

import pytest
from board_page import Stream, hello, site, state, told
from board_races import made

from dnb_edge.values import VehicleReport


@pytest.fixture(scope="module")
def page():
    with site() as pages:
        stream = Stream()
        stream.greeting = [hello(), state(), *told([made.lap(1, 0.0, 5.0)])]
        page = pages.page(stream)
        page.goto("/")
        page.locator("[data-show=line]:has-text('live')").wait_for(state="attached")
        page.locator("[data-show=laps] tr").wait_for()
        yield page, stream
        assert pages.faults == []


def said(car, inference_ms=None, **members):
    known = {"seq": None, "steering": 0.5, "throttle": None, "rate_hz": None, "missing": 0, "refused": 0}
    return VehicleReport(t_ns=0, t_s=1e6, came_ns=0, car=car, inference_ms=inference_ms, **(known | members))


def test_cars_are_shown_beside_the_laps_and_grow_old(page):
    """A line for each car that speaks, none before one does; the race's clock is not moved; silence is told."""
    board, stream = page
    place = board.locator("[data-show=vehicles]")
    assert not place.is_visible()
    clock = board.locator("[data-show=clock]").text_content()
    stream.send(*told([said(2, 12.34, rate_hz=29.7), said(1, missing=3)], first=1))
    place.locator("dt").nth(1).wait_for()
    assert place.locator("dt").all_text_contents() == ["Car 1", "Car 2"]
    assert place.locator("dd").all_text_contents() == ["3 missing, now", "inference 12.3 ms, 30 a second, now"]
    assert board.locator("[data-show=laps] tr").count() == 1
    assert board.locator("[data-show=clock]").text_content() == clock
    place.locator("dd.is-warn", has_text="inference 12.3 ms, silent for 2 s").wait_for()
    stream.send(state(run="run-2", first_sequence=50))
    place.wait_for(state="hidden")
