"""The page of several runs: what it tells of each and of all together, and how large it may become."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from test_report_html import Page

from dnb_edge.report import session
from dnb_edge.report.compare_plots import best_laps_picture, entries_picture, quickest
from dnb_edge.report.run import RunResult
from dnb_edge.report.session import SessionParts, render_session
from dnb_edge.report.table import ResultTable, Trial, result_table
from dnb_edge.values import EntryInfo

SLOW, QUICK = (12.5, 12.1, 13.0), (10.2, 10.4, 10.1)


@pytest.fixture
def runs(result: Callable[..., RunResult]) -> list[RunResult]:
    """Two entries, a run each."""
    return [
        result(entry="$x^2$ <b>slow</b>", recording="slow.mcap", lap_times_s=SLOW, warnings=("<i>warm</i>",)),
        result(entry="quick", recording="quick.mcap", lap_times_s=QUICK),
    ]


def gathered(runs: list[RunResult], **limits: int) -> tuple[SessionParts, ResultTable, list[Trial]]:
    parts = SessionParts(**limits)
    for run in runs:
        parts.add(run, {1: run.entry})
    trials = [Trial(entry=EntryInfo(name=run.entry), laps=run.laps, run=run.recording or "") for run in runs]
    return parts, result_table(trials), trials


def test_the_page_tells_of_all_and_of_each(runs: list[RunResult]) -> None:
    """The table of entries, the best laps with the quickest first, the comparison, and each run folded away; whole, without a
    script, asking nobody, names as text."""
    page = render_session("Tuesday <night>", *gathered(runs), ("they differ & more",))
    seen = Page(page)
    for fact in (
        "Tuesday <night>",
        "2 runs, 2 entries, 6 valid of 6 laps",
        "they differ & more",
        "$x^2$ <b>slow</b>",
        "10.1000 ± 0.0041",
        "12.5000 ± 0.0021",
        "quick, quick.mcap, 3 valid of 3 laps, best 10.100 s",
    ):
        assert fact in seen.text, fact
    best = page[page.index("<h2>Best laps</h2>") : page.index("<h2>Runs</h2>")]
    assert best.index("quick.mcap") < best.index("slow.mcap")
    assert not {"script", "b", "i", "link", "iframe"} & set(seen.tags)
    assert all(link.startswith("data:image/") for link in seen.links)
    assert seen.tags.count("details") == 2
    assert "<h3>Laps</h3>" in page
    assert "Of 2 runs there are no pictures" not in page
    assert page == render_session("Tuesday <night>", *gathered(runs), ("they differ & more",))


def test_a_page_does_not_grow_without_end(runs: list[RunResult], monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs for whose pictures there is no room are told without them, and the page says of how many."""
    monkeypatch.setattr(session, "_pictures", lambda _: "p" * 400_000)
    parts, table, trials = gathered(runs * 3, most_bytes=1_000_000)
    assert parts.without_pictures == 4
    page = render_session("many", parts, table, trials)
    assert "Of 4 runs there are no pictures here" in page
    assert page.count("p" * 400_000) == 2
    assert page.count('<details class="run">') == 6


def test_entries_are_drawn_side_by_side(runs: list[RunResult]) -> None:
    """Another lap, another picture; an entry without valid laps has a row all the same, and no name is a formula."""
    _, table, trials = gathered(runs)
    picture = entries_picture(table.rows, trials)
    assert picture == entries_picture(table.rows, trials)
    laps = tuple(replace(lap, valid=False, reasons=("off",)) for lap in trials[0].laps)
    failed = [replace(trials[0], laps=laps), trials[1]]
    assert entries_picture(result_table(failed).rows, failed) != picture


def test_best_laps_are_compared_along_the_route(runs: list[RunResult]) -> None:
    """The quickest first; one lap alone is nothing to compare."""
    parts, _, _ = gathered(runs)
    best = [one for part in parts.parts for one in part.best]
    assert [one.lap.time_s for one in quickest(best)] == [10.1, 12.1]
    assert best_laps_picture(best, runs[0].track) is not None
    assert best_laps_picture(best[:1], runs[0].track) is None
    assert best_laps_picture([replace(one, trace=None) for one in best], runs[0].track) is None
