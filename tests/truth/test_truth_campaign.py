"""The campaign keeps what is done, does the rest, and its certificate says what came of it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.report.truth import render_certificate
from dnb_edge.truth import campaign as room
from dnb_edge.truth import certificate as certificate_room
from dnb_edge.truth.campaign import Plan, run_campaign, run_unit, scenario_laps, units
from dnb_edge.truth.certificate import certificate
from dnb_edge.truth.counts import cases
from dnb_edge.truth.scenarios import DRIVERS, catalogue

NAMES = ("30fps-1mps", "score-15fps", "score-60fps", "sweep-1mps-30fps", "u-turn")
PLAN = Plan(seed=3, laps=30, rendered_laps=0, trials=1, only=NAMES)


@pytest.fixture(scope="module", autouse=True)
def _same_code():
    """Nobody edits the package while these tests run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room, "code_sha256", lambda: "1" * 64)
        yield


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """(directory, results) of a finished small campaign."""
    directory = tmp_path_factory.mktemp("campaign")
    return directory, run_campaign(PLAN, directory, jobs=1, done=lambda unit: None)


def test_a_plan_has_all_laps_in_whole_drives():
    """The drives' laps add up to each scenario's share; the longest units come first."""
    every = units(replace(PLAN, only=(), rendered_laps=20))
    for scenario in catalogue():
        mine = [unit for unit in every if unit.name == scenario.name]
        assert sum(unit.laps for unit in mine) == scenario_laps(scenario, replace(PLAN, rendered_laps=20))
        assert all(unit.laps <= scenario.laps_per_drive for unit in mine)
    works = [unit.work for unit in every]
    assert works == sorted(works, reverse=True)
    assert {case.name for case in cases()} <= {unit.name for unit in every}
    assert len({unit.file_name for unit in every}) == len(every)


def test_without_rendered_laps_nothing_is_rendered():
    """No rendered scenario and no rendered case is planned."""
    names = {unit.name for unit in units(replace(PLAN, only=()))}
    assert not names & {scenario.name for scenario in catalogue() if scenario.rendered}
    assert "hand" not in names
    assert "u-turn" in names


def test_an_unknown_name_is_refused():
    """The error names it and what there is."""
    with pytest.raises(InputError, match=r"--only nonsense: .*30fps-1mps"):
        units(replace(PLAN, only=("nonsense",)))


def test_the_catalogue_covers_the_figures():
    """The three figures are there fast and rendered, with their limits and all their laps."""
    by_name = {scenario.name: scenario for scenario in catalogue()}
    for name, p95_ms in (("30fps-1mps", 4.0), ("60fps-1mps", 2.5), ("30fps-0.5mps", 10.0)):
        for kind in ("", "-rendered"):
            scenario = by_name[name + kind]
            limits = {limit.figure: (limit.least, limit.most) for limit in scenario.limits}
            assert limits["p95_ms"] == (None, p95_ms)
            assert limits["coverage_percent"] == (93.0, 97.0)
            assert limits["missed"] == limits["phantom"] == (None, 0.0)
            assert scenario.share == 1.0
            assert scenario.rendered == bool(kind)
    assert set(DRIVERS) <= set(by_name)


def test_only_what_is_missing_is_done_again(kept, monkeypatch):
    """Of a finished campaign nothing is done again; of a damaged or missing file only its own unit; results are the same."""
    directory, results = kept
    ran = []
    monkeypatch.setattr(room, "run_unit", lambda unit: ran.append(unit.file_name) or run_unit(unit))
    assert run_campaign(PLAN, directory, jobs=1, done=lambda unit: None) == results
    assert ran == []
    (directory / "drives" / "u-turn-000.json").unlink()
    (directory / "drives" / "score-15fps-000.json").write_text('{"key": "')
    assert run_campaign(PLAN, directory, jobs=1, done=lambda unit: None) == results
    assert sorted(ran) == ["score-15fps-000.json", "u-turn-000.json"]


def test_results_of_other_code_are_not_used(kept, monkeypatch):
    """Where the code has changed, all is done anew."""
    directory, _ = kept
    monkeypatch.setattr(room, "code_sha256", lambda: "0" * 64)
    ran = []
    monkeypatch.setattr(room, "run_unit", lambda unit: ran.append(unit.name) or {"kept": False})
    run_campaign(replace(PLAN, only=("u-turn",)), directory, jobs=1, done=lambda unit: None)
    assert ran == ["u-turn"]
    monkeypatch.undo()
    run_campaign(PLAN, directory, jobs=1, done=lambda unit: None)


def test_two_processes_find_what_one_finds(kept, tmp_path):
    """Results do not depend on how many processes are at work."""
    _, results = kept
    only = replace(PLAN, only=("u-turn", "score-15fps"))
    together = run_campaign(only, tmp_path, jobs=2, done=lambda unit: None)
    assert together == {name: results[name] for name in only.only}


def test_a_folder_that_cannot_be_is_named(tmp_path):
    """Where the results cannot be kept, that is said before anything is driven."""
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(InputError, match="taken"):
        run_campaign(PLAN, tmp_path / "taken", jobs=1, done=lambda unit: None)


def test_the_certificate_says_what_was_found(kept):
    """Every scenario, limit and case is in it; it is plain JSON, the same for the same results."""
    _, results = kept
    made = certificate(PLAN, results)
    assert json.loads(json.dumps(made, allow_nan=False)) == made
    assert made == certificate(PLAN, results)
    assert [one["name"] for one in made["scenarios"]] == list(NAMES[:-1])
    figures = made["scenarios"][0]["figures"]
    assert (figures["laps"], figures["told"], figures["missed"], figures["phantom"]) == (30, 30, 0, 0)
    assert 0.0 < figures["p50_ms"] < figures["p95_ms"] <= figures["max_ms"] < 10.0
    assert sum(figures["histogram"]["counts"]) == 30
    assert (
        0.0
        <= figures["coverage_low_percent"]
        <= figures["coverage_percent"]
        <= figures["coverage_high_percent"]
        <= 100.0
    )
    limits = {(row["scenario"], row["figure"]): row for row in made["limits"]}
    assert limits["30fps-1mps", "p95_ms"]["holds"]
    assert limits["score-15fps", "score_difference_points"]["value"] < 1.5
    assert not made["enough_laps"]
    assert [count["told"] for count in made["counts"]] == [[3]]
    for row in made["limits"]:
        assert row["laps"] < row["wanted_laps"]


def test_a_missed_limit_shows_as_missed(kept):
    """Laps that come out ten milliseconds off, or not at all, miss their limits, in the certificate and on its page."""
    _, results = kept
    worse = json.loads(json.dumps(results))
    for drive in worse["30fps-1mps"]:
        for lap in drive["laps"]:
            lap["error_s"] += 0.01
        drive["laps"][0] = {"lap": 1, "true_s": 2.5, "told": False}
    worse["u-turn"][0]["told"] = 4
    made = certificate(PLAN, worse)
    held = {row["figure"]: row["holds"] for row in made["limits"] if row["scenario"] == "30fps-1mps"}
    assert held == {"bias_ms": False, "p95_ms": False, "coverage_percent": False, "missed": False, "phantom": True}
    assert not made["counts"][0]["holds"]
    assert not made["holds"]
    page = render_certificate(made)
    assert f"{made['missed_limits']} of " in page
    assert page.count(">missed") == made["missed_limits"]


def test_the_page_needs_nothing_from_elsewhere(kept):
    """One self-contained page: pictures inside, no script, no address but data."""
    _, results = kept
    page = render_certificate(certificate(PLAN, results))
    assert page == render_certificate(certificate(PLAN, results))
    assert "http" not in page.replace('http-equiv="Content-Security-Policy"', "")
    assert "<script" not in page
    assert page.count('src="data:image/svg+xml;base64,') == 3
    assert "$" not in page


def test_the_page_tells_of_the_detectors_errors(kept):
    """Where frames were rendered, the page shows how the detector's errors hang together."""
    _, results = kept
    rendered = json.loads(json.dumps(results["30fps-1mps"]))
    random = np.random.default_rng(1)
    for drive in rendered:
        count = 300
        errors = {
            f"{axis}_{unit}": random.normal(0, 1, count).tolist()
            for axis in ("along", "across")
            for unit in ("z", "mm")
        }
        drive["series"] = {"frame": list(range(count)), "place_m": (np.arange(count) * 0.033 % 2.7).tolist(), **errors}
    plan = replace(PLAN, rendered_laps=30, only=("30fps-1mps-rendered",))
    made = certificate(plan, {"30fps-1mps-rendered": rendered})
    detector = made["scenarios"][0]["figures"]["detector"]
    for axis in ("along", "across"):
        assert detector[axis]["z_rms"] == pytest.approx(1.0, abs=0.15)
        assert detector[axis]["rest"]["z_rms"] == pytest.approx(1.0, abs=0.2)
        assert detector[axis]["window_variance_ratio"] == pytest.approx(1.0, abs=0.6)
        assert detector[axis]["repeated_share"] < 0.3
    assert json.dumps(made, allow_nan=False)
    page = render_certificate(made)
    assert "30fps-1mps-rendered, along the way" in page
    assert page.count('src="data:image/svg+xml;base64,') == 3


@pytest.mark.parametrize(
    ("similarities", "half", "laps", "holds"),
    [
        ((96.0, 93.0, 90.0, 85.0), 1.0, 100, True),
        ((96.0, 93.0, 90.0, 85.0), 1.6, 100, False),
        ((96.0, 93.0, 94.0, 85.0), 0.1, 100, False),
        ((96.0, 93.0, 90.0, 85.0), 1.6, 20, True),
        ((96.0, 93.0, 94.0, 85.0), 0.1, 20, False),
    ],
)
def test_the_papers_drivers_keep_their_order(similarities, half, laps, holds):
    """With all laps their intervals must be disjoint, with few their means in order."""
    figures = {
        name: {
            "similarity_percent": similarity,
            "similarity_half_width_percent": half,
            "lap_s": 40.0 - k,
            "lap_half_width_s": 0.1,
            "laps": laps,
        }
        for k, (name, similarity) in enumerate(zip(DRIVERS, similarities, strict=True))
    }
    by_figure = {row["figure"]: row for row in certificate_room._drivers(figures)}
    assert by_figure["similarity_order_gap_percent"]["holds"] is holds
    assert by_figure["time_order_gap_s"]["value"] == pytest.approx(0.8)
    assert by_figure["time_order_gap_s"]["enough_laps"] is (laps == 100)
    assert certificate_room._drivers({DRIVERS[0]: figures[DRIVERS[0]]}) == []
