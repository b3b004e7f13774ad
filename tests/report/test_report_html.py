"""The HTML report: whole, safe, readable, and asking no other machine for anything."""

import errno
import os
import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from importlib import resources
from pathlib import Path

import pytest

from dnb_edge.errors import InputError, WorkError
from dnb_edge.race.edit import Action, Edit, LapKey
from dnb_edge.race.marshal import apply
from dnb_edge.report.html import render, write_report
from dnb_edge.report.run import RulesInForce, RunResult
from dnb_edge.values import EntryInfo, Incident, IncidentKind, SectorTime

CALIBRATION = {
    "mean_px": 26.69,
    "sum_px": 240.23,
    "max_px": 51.2,
    "mean_m": 0.0667,
    "leave_one_out_mean_px": 57.96,
    "by_count": [{"points": 4, "mean_px": 1244.73, "sum_px": 11202.58}],
}


class Page(HTMLParser):
    """What a browser would see of a page: open tags, attributes, text."""

    VOID = frozenset({"meta", "img", "br", "link"})

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.links: list[str] = []
        self.text = ""
        self.feed(page)
        assert self.open == [], "tags that are never closed"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for name, value in attrs if name in {"src", "href", "srcset", "action", "data"}]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_page_asks_nobody_for_anything(result: Callable[..., RunResult]) -> None:
    """All pictures are inside, there is no script, and the policy forbids what might slip in."""
    page = render(result(calibration=CALIBRATION))
    seen = Page(page)
    assert len(seen.links) == 7
    assert all(link.startswith("data:image/png;base64,") for link in seen.links)
    assert not {"script", "link", "iframe", "object"} & set(seen.tags)
    assert "default-src 'none'" in page
    assert "url(" not in page
    assert "@import" not in page


def test_names_from_outside_are_text(result: Callable[..., RunResult]) -> None:
    """Whatever an entry, a source, a warning, a config value or a reason is called, it makes no element."""
    evil = "<script>alert(1)</script>\"'&\x1b[2J"
    run = result(
        entry=evil, source_uri=evil, warnings=(evil,), config={evil: evil}, hashes={evil: evil}, recording=evil
    )
    laps = tuple(replace(lap, valid=False, reasons=(evil,)) for lap in run.laps)
    page = render(replace(run, laps=laps))
    seen = Page(page)
    assert "script" not in seen.tags
    assert "\x1b" not in page
    assert seen.text.count("<script>alert(1)</script>") >= 8


def test_the_laps_are_told_in_full(result: Callable[..., RunResult]) -> None:
    """Number, time with sigma, similarity, distances and, where a lap is not valid, why."""
    text = Page(render(result(valid=(True, True, False)))).text
    for fact in (
        "12.4831 ± 0.0021",
        "97.50",
        "0.0210",
        "0.0640",
        "0.0190",
        "0.0580",
        "no: the car left the lane by 0.12 m",
        "2 valid of 3",
        "lap 2, 12.102 ± 0.003 s",
        "in 1188 of 1200 frames (99.0 %)",
    ):
        assert fact in text


def test_who_drove_under_which_rules_is_told_first(result: Callable[..., RunResult]) -> None:
    """Version, checkpoint, session, rule set with its digest, and what was changed since; nothing of it where unknown."""
    run = result()
    names = ("Version", "Checkpoint", "Session", "Rules", "Changed since")
    assert not any(name in Page(render(run)).text for name in names)
    driver = EntryInfo(name="Blue car", version="v2.1", checkpoint_sha256="ab" * 32, notes="<i>warm</i>")
    rules = RulesInForce(name="laps", version="3", digest="0123456789ab", changed="race.laps 3 (was 2)")
    text = Page(render(replace(run, driver=driver, session="Tuesday", rules=rules))).text
    for fact in (
        *names,
        "v2.1",
        "ab" * 32,
        "<i>warm</i>",
        "Tuesday",
        "laps, version 3, digest 0123456789ab",
        "(was 2)",
    ):
        assert fact in text


def test_the_lap_table_tells_what_is_doubtful(result: Callable[..., RunResult]) -> None:
    """Official times with their penalties, suspect and estimated laps, where the car was farthest off and how fast it was."""
    run = result()
    one, two, three = run.laps
    laps = (
        replace(one, penalty_s=5.0, official_time_s=17.4831),
        replace(two, suspect=("the camera was bumped",)),
        replace(three, estimated=True),
    )
    scores = (
        replace(run.scores[0], lateral_p95_m=0.0441, lateral_max_s_m=7.25, speed_mean_mps=1.08, speed_max_mps=1.76),
        *run.scores[1:],
    )
    text = Page(render(replace(run, laps=laps, scores=scores))).text
    for fact in (
        "17.4831 (+5.000)",
        "but suspect: the camera was bumped",
        "yes, estimated",
        "0.0441",
        "7.25",
        "1.08",
        "1.76",
    ):
        assert fact in text
    assert "lap 2, 12.102" in text, "the best one by official time"


def test_a_judges_decision_stands_with_its_lap(result: Callable[..., RunResult]) -> None:
    """Who decided what and why, as text, beside the lap that it is about."""
    run = result()
    edit = Edit(
        number=1,
        time="2026-01-01T00:00:00Z",
        author="<b>Ada</b>",
        action=Action.NOTE,
        reason="wind & rain",
        laps=(LapKey.of(run.laps[1]),),
    )
    made = apply(run.laps, [edit])
    page = render(replace(run, marshalled=made, edits=(edit,)))
    rows = page[page.index("<h2>Laps</h2>") : page.index("</table>")].split("</tr>")
    assert ["wind &amp; rain" in row for row in rows[1:4]] == [False, True, False]
    assert "note by &lt;b&gt;Ada&lt;/b&gt;" in rows[2]
    assert "<b>Ada" not in page


def test_cars_are_told_apart(result: Callable[..., RunResult]) -> None:
    """With several cars each lap has its car's name, and the best lap says whose it is; alone it is not repeated."""
    run = result()
    assert 'scope="col">Car<' not in render(run)
    laps = (run.laps[0], replace(run.laps[1], car=2), replace(run.laps[2], car=2))
    page = render(replace(run, laps=laps))
    assert 'scope="col">Car<' in page
    assert "car 2, lap 2, 12.102" in Page(page).text


def test_laps_that_are_not_drawn_are_counted(result: Callable[..., RunResult]) -> None:
    """Pictures show 14 laps and 40 bars at most, and say how many they leave out; the tables have all."""
    text = Page(render(result(lap_times_s=(2.0,) * 45))).text
    assert "Drawn are 14 of 45 laps, the best ones and the last ones; 31 are left out." in text
    assert "Drawn are 40 of 45 laps" in text
    assert text.count("2.0000 ±") == 45


def test_each_section_has_something_to_show(result: Callable[..., RunResult]) -> None:
    """Without laps or stamps no empty heading stands on the page."""
    assert "Along the route" in render(result())
    for run in (result(lap_times_s=()), replace(result(), stamps_ns=())):
        assert "Along the route" not in render(run)


def test_a_run_without_laps_did_not_finish(result: Callable[..., RunResult]) -> None:
    """The page of a failure says so and still stands."""
    text = Page(render(result(lap_times_s=()))).text
    assert "did not finish (DNF)" in text


def test_a_lap_without_a_score_has_dashes(result: Callable[..., RunResult]) -> None:
    """A lap that was not scored shows no zero."""
    run = result(lap_times_s=(9.0, 9.1))
    laps = (run.laps[0], replace(run.laps[1], similarity_percent=None))
    text = Page(render(replace(run, laps=laps, scores=run.scores[:1]))).text
    assert text.count("–") >= 9


def test_the_transformation_error_is_shown(result: Callable[..., RunResult]) -> None:
    """Mean, accumulated, largest and leave-one-out error, and the error by number of keypoints."""
    text = Page(render(result(calibration=CALIBRATION))).text
    for figure in ("26.69", "240.23", "51.20", "57.96", "0.0667", "1244.73", "11202.58"):
        assert figure in text


def test_the_same_run_gives_the_same_page(result: Callable[..., RunResult]) -> None:
    """No date: a report can be compared with the one before."""
    assert render(result()) == render(result())


def test_the_report_appears_whole_under_its_name(tmp_path: Path, result: Callable[..., RunResult]) -> None:
    """The folder is made, the old report replaced, and nothing else is left in it."""
    run = result()
    path = write_report(run, tmp_path / "new" / "folder")
    path.write_text("old")
    assert write_report(run, path.parent) == path
    assert path.read_text(encoding="utf-8") == render(run)
    assert list(path.parent.iterdir()) == [path]


def test_a_folder_that_cannot_be_is_the_callers_mistake(tmp_path: Path, result: Callable[..., RunResult]) -> None:
    """A file where the folder should be: one line that names it."""
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match=r"taken: the report cannot be written there"):
        write_report(result(), tmp_path / "taken")


def test_a_full_disk_leaves_no_half_report(
    tmp_path: Path, result: Callable[..., RunResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The old report stays as it was and the unfinished one is gone."""
    run = result()
    path = write_report(run, tmp_path)
    path.write_text("old")

    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(WorkError, match="No space left"):
        write_report(run, tmp_path)
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("report.html", "old")]


@pytest.mark.parametrize("scheme", [0, 1, 2], ids=["light", "dark", "paper"])
@pytest.mark.parametrize("ink", ["ink", "quiet", "bad"])
@pytest.mark.parametrize("paper", ["paper", "stripe"])
def test_text_has_the_contrast_of_wcag_aa(scheme: int, ink: str, paper: str) -> None:
    """At least 4.5 to 1 on both screens and on paper, as WCAG 2.2, 1.4.3, asks of text."""
    page = resources.files("dnb_edge.report").joinpath("page.html").read_text(encoding="utf-8")
    blocks = re.findall(r":root \{([^}]*)\}", page)
    assert len(blocks) == 3
    colours = dict(re.findall(r"--(\w+): #([0-9a-f]{6})", blocks[scheme]))
    bright, dark = sorted((luminance(colours[ink]), luminance(colours[paper])), reverse=True)
    assert (bright + 0.05) / (dark + 0.05) >= 4.5


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2.2 of a colour rrggbb."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (0, 2, 4)]
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_a_day_fits_on_a_page(result: Callable[..., RunResult]) -> None:
    """Tens of thousands of laps with sectors and thousands of incidents: what is left out is said, and the page stays below
    10 MB."""
    run = result()
    lap, score = run.laps[0], run.scores[0]
    sectors = tuple(SectorTime(number=k, line=f"s{k}", time_s=3.1234, sigma_s=0.0021) for k in (1, 2, 3))
    count = 12_000
    laps = tuple(replace(lap, number=i + 1, sectors=sectors, official_time_s=lap.time_s) for i in range(count))
    incident = Incident(
        number=1,
        kind=IncidentKind.OFF_TRACK,
        car=1,
        target_id=1,
        lap=1,
        start_t_ns=0,
        end_t_ns=10,
        start_s=1.0,
        lasted_s=0.5,
        greatest_m=0.2,
        worst_t_ns=5,
        track_m=(1.0, 1.0),
        camera_px=(100.0, 100.0),
        s_m=2.0,
        text="left the lane by 0.2 m for 0.5 s",
    )
    incidents = tuple(replace(incident, number=i + 1) for i in range(3000))
    run = replace(
        run,
        laps=laps,
        paths_m=(run.paths_m[0],) * count,
        stamps_ns=(run.stamps_ns[0],) * count,
        scores=tuple(replace(score, lap=i + 1) for i in range(count)),
        incidents=incidents,
        thumbnails={(1, i + 1): b"\xff" * 15_000 for i in range(48)},
    )
    page = render(run)
    assert len(page.encode()) < 10_000_000
    assert "The first 2000 laps are left out" in page
    assert "Left out, later than these: 2000 off track." in page
    assert f'<th scope="row">{count}</th>' in page
