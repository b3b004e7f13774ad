"""The table's pictures and its page: what they show, that names are text, and that they need nothing else."""

from dataclasses import replace
from pathlib import Path

import pytest
from test_report_html import Page
from test_report_table import lap, laps_of, trial

from dnb_edge.errors import InputError
from dnb_edge.report.inference import Inference
from dnb_edge.report.table import RowsBy, Trial, result_table
from dnb_edge.report.table_page import TablePart, render_table, table_figures, write_table_figures
from dnb_edge.report.table_plots import boxes_picture, radar_picture, radar_spokes, ranks_picture
from dnb_edge.values import Penalty

SPEED = Inference(p50_ms=4.0, p95_ms=5.0, p99_ms=6.0, source="pi5")
FINE = Penalty(offence="collision", seconds=1.0, reason="it hit something")


@pytest.fixture
def trials() -> list[Trial]:
    """Three entries of four runs: a quick one, a slow one with a network, and one that never finishes a lap."""
    fined = replace(lap(12.0, 80.0), penalties=(FINE,), penalty_s=1.0, official_time_s=13.0)
    slow = replace(SPEED, p95_ms=10.0)
    return [
        one
        for k in range(4)
        for one in (
            trial("$x^2$ <b>quick</b>", *laps_of(10.0, 10.1 + k / 50), run=f"q{k}", inference=SPEED),
            trial("slow", fined, lap(12.5, 81.0), run=f"s{k}", inference=slow, collisions=1),
            trial("stuck", run=f"x{k}", wanted_laps=2),
        )
    ]


def part(trials: list[Trial], **words: str) -> TablePart:
    return TablePart(table=result_table(trials, **words), trials=tuple(trials))


def test_spokes_are_shares_of_the_best(trials: list[Trial]) -> None:
    """Similarity and success as they are, pace and inference as the quickest's for the own, laps without a penalty of the
    attempted; nothing done is 0, nothing known is a gap."""
    spokes = {spoke.name: spoke.shares for spoke in radar_spokes(result_table(trials).rows)}
    assert list(spokes) == ["similarity", "success", "clean laps", "pace", "inference"]
    assert spokes["similarity"] == (pytest.approx(0.9), pytest.approx(0.805), 0.0)
    assert spokes["success"] == (1.0, 1.0, 0.0)
    assert spokes["clean laps"] == (1.0, 0.5, 0.0)
    assert spokes["pace"] == (1.0, pytest.approx(10.065 / 12.75), 0.0)
    assert spokes["inference"] == (1.0, 0.5, None)
    bare = radar_spokes(result_table([trial("a", lap(9.0, None))]).rows)
    assert [(spoke.name, spoke.shares) for spoke in bare] == [
        ("success", (1.0,)), ("clean laps", (1.0,)), ("pace", (1.0,))
    ]  # fmt: skip


def test_pictures_show_what_they_are_of(trials: list[Trial]) -> None:
    """The same table, the same bytes; another lap, other boxes; another success, another radar; other runs, other ranks."""
    table = result_table(trials)
    other = [replace(trials[0], laps=laps_of(10.0, 14.0)), *trials[1:]]
    changed = result_table(other)
    assert boxes_picture(table, trials) == boxes_picture(table, trials) != boxes_picture(changed, other)
    assert radar_picture(table) == radar_picture(table) != radar_picture(changed)
    assert ranks_picture(result_table([trial("a", *laps_of(9.0))])) is None
    assert radar_picture(result_table([])) is None


def test_a_row_of_one_run_shows_that_runs_laps(trials: list[Trial], monkeypatch: pytest.MonkeyPatch) -> None:
    """By run a row's dots are its own run's, not all of its entry's."""
    shown: list[int] = []
    monkeypatch.setattr("dnb_edge.report.table_plots._box", lambda _axes, _place, values: shown.append(len(values)))
    boxes_picture(result_table(trials, RowsBy.RUN), trials)
    assert shown == [2, 2] * 8 + [0, 0] * 4


@pytest.mark.parametrize("count", [1, 13])
def test_any_number_of_entries_is_drawn(count: int) -> None:
    """One entry with one lap, and more than there is room for, which the caption says."""
    many = [trial(f"driver {k}", *laps_of(9.0 + k), run=f"{k}") for k in range(count)]
    captions = {figure.name: figure.caption for figure in table_figures(part(many))}
    assert list(captions) == ["boxes", "means", "radar"]
    assert ("The first 12 entries of 13." in captions["radar"]) == (count == 13)
    assert table_figures(part([])) == ()


def test_the_page_holds_all_groups_and_needs_nothing_else(trials: list[Trial]) -> None:
    """Headings, rows, notes, ranks and pictures within the page; what a user wrote is text."""
    groups = [part(trials, conditions="Track <i>a</i>"), part(trials[:3], conditions="Track b")]
    page = render_table(groups, ("cards & more",))
    seen = Page(page)
    for fact in (
        "6 entries, 12 runs",
        "Track <i>a</i>",
        "Track b",
        "$x^2$ <b>quick</b>",
        "cards & more",
        "0% [0, 49]",
        "Collisions",
        "4 / 5",
        "Order by completion time: $x^2$ <b>quick</b>, then slow, then stuck; holds in 100 % of 2000 resamples",
        "2 [2, 2] 100 %",
    ):
        assert fact in seen.text, fact
    assert not {"script", "b", "i", "link", "iframe"} & set(seen.tags)
    assert all(link.startswith("data:image/") for link in seen.links)
    assert seen.tags.count("img") == 4 + 4


def test_figures_are_files_numbered_by_their_group(tmp_path: Path, trials: list[Trial]) -> None:
    """One group: plain names. Several: the group's number before each."""
    one = write_table_figures([part(trials[:3])], tmp_path / "new" / "one", "svg")
    assert [path.name for path in one] == ["boxes.svg", "means.svg", "radar.svg", "ranks.svg"]
    assert all(path.read_bytes().startswith(b"<?xml") for path in one)
    two = write_table_figures([part(trials[:1]), part(trials[:1])], tmp_path, "png")
    assert [path.name for path in two] == [f"{k}-{name}.png" for k in (1, 2) for name in ("boxes", "means", "radar")]


def test_figures_that_cannot_be_written(tmp_path: Path, trials: list[Trial]) -> None:
    """A file where the directory should be is one line."""
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="figures cannot be written there"):
        write_table_figures([part(trials[:1])], tmp_path / "file", "png")
