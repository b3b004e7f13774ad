"""`dnb-edge judge`: decisions beside the recording, checked, shown, applied by every other verb, and never lost."""

import csv
import getpass
import hashlib
import io
import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from edge_command import Race, edge
from table_runs import Car, circle, on_circle, record, setup
from typer.testing import CliRunner, Result

from dnb_edge.archive.replayed import replay
from dnb_edge.cli.main import app
from dnb_edge.cli.results import make_report
from dnb_edge.errors import InputError
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.rules import CarSetup, Effect, LapRules, PenaltyRules
from dnb_edge.record.edits import edits_path
from dnb_edge.report.race import race_sections
from dnb_edge.track.line import DirectedLine

CAR = Car((3.0, 3.1, 2.9, 3.2))
WHY = ("--because", "a hand", "--by", "Ada")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A recording of one car with four laps."""
    return record(tmp_path, "run.mcap", CAR)


def dnb_edge(*words: object) -> Result:
    return CliRunner().invoke(app, [*map(str, words)])


def done(*words: object) -> str:
    ran = dnb_edge(*words)
    assert ran.exit_code == 0, ran.exception
    return ran.stdout


def refusal(*words: object) -> str:
    ran = dnb_edge(*words)
    assert isinstance(ran.exception, InputError), ran.output
    assert ran.stdout == ""
    assert "\n" not in str(ran.exception)
    return str(ran.exception)


def scored(run: Path, *words: object, kind: str = "lap") -> list[dict]:
    events = [json.loads(line) for line in done("score", run, "--json", *words).splitlines()]
    return [event for event in events if event["event"] == kind]


def test_a_removed_lap_is_gone_from_every_result_and_listed_with_its_reason(run: Path) -> None:
    """`score`, `table` and `judge list` leave it out; the list says who took it away and why; --no-edits brings it back."""
    raw = scored(run)
    shown = done("judge", "remove", run, "--lap", 2, *WHY)
    assert "removed (3.099 s" in shown
    assert "4 laps, 4 valid" in shown
    assert "3 laps, 3 valid" in shown
    assert [lap["number"] for lap in scored(run)] == [1, 3, 4]
    assert scored(run, kind="run")[0]["laps"] == 3
    assert [score["lap"] for score in scored(run, kind="score")] == [1, 3, 4]
    (edits,) = scored(run, kind="edits")
    assert [(gone["number"], gone["edited_by"]) for gone in edits["removed"]] == [(2, [1])]
    assert scored(run, "--no-edits") == raw
    assert json.loads(done("table", run, "--json"))["laps"] == 3
    listed = done("judge", "list", run)
    assert "Ada" in listed
    assert "a hand" in listed
    assert "removed: lap 2" in done("score", run)


def test_a_lap_put_in_by_its_passes_is_the_lap_that_the_race_made(run: Path) -> None:
    """Removed and added again from the same two crossings: time, sigma, similarity and share seen come out bit for bit."""
    (raw,) = [lap for lap in scored(run) if lap["number"] == 2]
    done("judge", "remove", run, "--lap", 2, *WHY)
    done("judge", "add", run, "--from", "pass:2", "--to", "pass:3", *WHY)
    laps = scored(run)
    assert [lap["number"] for lap in laps] == [1, 5, 3, 4]
    one = laps[1]
    assert {key for key in raw if raw[key] != one[key]} == {"number"}
    assert (one["raw"], one["edited_by"]) == ([], [2])


def test_a_lap_can_be_given_in_seconds(run: Path) -> None:
    """Seconds from the first frame; its sigma is a hand's. What runs into another lap is refused, with what to do."""
    start_s, time_s = (scored(run)[1][key] for key in ("start_s", "time_s"))
    in_seconds = ("judge", "add", run, "--from", f"{start_s:.3f}", "--to", f"{start_s + time_s + 0.1:.3f}", *WHY)
    done("judge", "remove", run, "--lap", 2, *WHY)
    assert "lap 3 is driven in the same time" in refusal(*in_seconds)
    done("judge", "add", run, "--from", f"{start_s + 0.004:.3f}", "--to", "pass:3", *WHY)
    one = scored(run)[1]
    assert one["time_s"] == pytest.approx(time_s, abs=0.01)
    assert 0.05 < one["sigma_s"] < 0.06
    assert one["similarity_percent"] == pytest.approx(100, abs=1.5)


def test_merged_laps_are_scored_as_one(run: Path) -> None:
    """Start of the first, end of the second; the path of both is compared with the route."""
    first, second = scored(run)[1:3]
    done("judge", "merge", run, "--lap", 2, *WHY)
    one = scored(run)[1]
    assert (one["number"], one["start_t_ns"], one["end_t_ns"]) == (2, first["start_t_ns"], second["end_t_ns"])
    assert [lap["number"] for lap in one["raw"]] == [2, 3]
    assert one["similarity_percent"] < first["similarity_percent"]
    assert one["sigma_s"] < first["sigma_s"] + second["sigma_s"]
    (score,) = [score for score in scored(run, kind="score") if score["lap"] == 2]
    assert score["path_length_m"] == pytest.approx(2 * scored(run, kind="score")[0]["path_length_m"], rel=0.01)


def test_penalties_and_pardons_change_official_times_only(run: Path) -> None:
    """The measured time stays; seconds, factor, validity and reasons follow, under other rules, too."""
    done("judge", "penalty", run, "--lap", 1, "--seconds", 5, "--factor", 0.5, *WHY)
    done("judge", "penalty", run, "--lap", 3, "--invalid", *WHY)
    one, two, three, _ = scored(run)
    assert one["official_time_s"] == pytest.approx(one["time_s"] + 5)
    assert (one["penalty_factor"], one["raw"][0]["penalties"]) == (0.5, [])
    assert (two.get("edited_by"), three["valid"]) == (None, False)
    slow = ("--set", "race.max_lap_s=3.05")
    assert [lap["valid"] for lap in scored(run, *slow)] == [True, False, False, False]


def test_an_undo_brings_back_what_the_race_said(run: Path) -> None:
    """Line for line, but for the line that lists the edits."""
    raw = done("score", run, "--json").splitlines()
    done("judge", "merge", run, "--lap", 1, *WHY)
    assert done("score", run, "--json").splitlines()[1:] != raw
    done("judge", "undo", run, "--edit", 1, *WHY)
    assert done("score", run, "--json").splitlines()[1:] == raw
    assert "undone" in done("judge", "list", run)


def test_a_dry_run_shows_and_saves_nothing(run: Path) -> None:
    """The same table, and no file."""
    shown = done("judge", "remove", run, "--lap", 2, "--dry-run", *WHY)
    assert "would be" in shown
    assert not edits_path(run).exists()


def test_no_verb_ever_changes_the_recording(run: Path, tmp_path: Path) -> None:
    """Its bytes are the same after every decision and every result made of it."""
    before = hashlib.sha256(run.read_bytes()).digest()
    for words in (
        ("judge", "remove", run, "--lap", 4, *WHY),
        ("judge", "add", run, "--from", "pass:4", "--to", "pass:5", *WHY),
        ("judge", "merge", run, "--lap", 1, *WHY),
        ("judge", "penalty", run, "--lap", 3, "--dnf", *WHY),
        ("judge", "note", run, "--lap", 3, "--text", "wind"),
        ("judge", "undo", run, "--edit", 5, *WHY),
        ("judge", "list", run, "--passes"),
        ("score", run, "--line", "half=AT:100,200", "--rules", "deepracer", "--set", "race.min_lap_s=1", "--json"),
        ("table", run),
        ("runs", "export", run),
    ):
        done(*words)
        assert hashlib.sha256(run.read_bytes()).digest() == before, words
    make_report(run, tmp_path / "report")
    assert hashlib.sha256(run.read_bytes()).digest() == before


REFUSED = [
    ("no such lap", ("remove", "--lap", 9), "there is no lap 9: car 1 has laps 1, 2, 3, 4"),
    ("no such car", ("remove", "--lap", 1, "--car", 2), "there is no lap 1: car 2 has no laps"),
    ("last lap merged", ("merge", "--lap", 4), "there is no lap after lap 4"),
    ("free penalty", ("penalty", "--lap", 1), "a penalty must cost something"),
    ("negative", ("penalty", "--lap", 1, "--seconds", "-1"), "--seconds -1: must lie between 0 and 86400"),
    ("endless", ("penalty", "--lap", 1, "--seconds", "nan"), "--seconds nan: must lie between"),
    ("a slip", ("penalty", "--lap", 1, "--seconds", "1e308"), "--seconds 1e+308: must lie between"),
    ("factor", ("penalty", "--lap", 1, "--factor", "1.5"), "--factor 1.5: must lie between 0 and 1"),
    ("nothing to forgive", ("forgive", "--lap", 1), "lap 1 has no penalty of the rules, and is valid"),
    ("no edit", ("undo", "--edit", 3), "undo edit 3: there is no such edit, there is none"),
    ("add over a lap", ("add", "--from", "1.0", "--to", "2.0"), "is driven in the same time"),
    ("backwards", ("add", "--from", "2.0", "--to", "1.0"), "--to 1.0: must be later than --from 2.0"),
    ("beyond the end", ("add", "--from", "2.0", "--to", "99"), "--to 99: must be seconds from the first frame, 0 to 1"),
    ("no time", ("add", "--from", "x", "--to", "9"), "--from x: must be seconds from the first frame"),
    ("no pass", ("add", "--from", "pass:0", "--to", "9"), "--from pass:0: there are passes 1 to 5"),
    ("another's pass", ("add", "--from", "pass:1", "--to", "9", "--car", 2), "--from pass:1: that pass is car 1's"),
]


@pytest.mark.parametrize(("words", "text"), [row[1:] for row in REFUSED], ids=[row[0] for row in REFUSED])
def test_what_makes_no_sense_is_refused_with_one_line(run: Path, words: tuple, text: str) -> None:
    """And nothing is saved."""
    verb, *options = words
    assert text in refusal("judge", verb, run, *options, *WHY)
    assert not edits_path(run).exists()


def test_an_author_and_a_reason_are_needed(run: Path) -> None:
    """The author is whoever is logged in unless somebody says otherwise; a blank one, or a blank reason, is refused."""
    assert "--by: is blank" in refusal("judge", "remove", run, "--lap", 1, "--because", "x", "--by", " ")
    assert "--because: is blank" in refusal("judge", "remove", run, "--lap", 1, "--because", " ")
    assert dnb_edge("judge", "remove", run, "--lap", 1).exit_code == 2
    done("judge", "remove", run, "--lap", 1, "--because", "x")
    line = json.loads(edits_path(run).read_text().splitlines()[1])
    assert (line["author"], line["reason"], line["number"]) == (getpass.getuser(), "x", 1)
    assert line["time"].endswith("Z")


def test_decisions_that_were_tampered_with_stop_every_result(run: Path) -> None:
    """`score` and `judge` name the file and the line; --no-edits still gives what the race said."""
    done("judge", "penalty", run, "--lap", 1, "--seconds", 5, *WHY)
    path = edits_path(run)
    path.write_text(path.read_text().replace('"seconds": 5.0', '"seconds": 0.5'))
    for words in (("score", run), ("table", run), ("judge", "list", run), ("judge", "note", run, "--text", "x")):
        assert "run.edits.jsonl, line 2" in refusal(*words)
    assert len(scored(run, "--no-edits")) == 4


def test_the_decisions_of_another_recording_are_refused(run: Path, tmp_path: Path) -> None:
    """A file of edits copied beside another recording is not applied to it."""
    other = record(tmp_path, "other.mcap", CAR, name="other net")
    done("judge", "remove", run, "--lap", 1, *WHY)
    edits_path(other).write_bytes(edits_path(run).read_bytes())
    assert "another recording" in refusal("score", other)


def test_a_decision_that_was_cut_short_is_left_out_with_a_warning(run: Path) -> None:
    """As after a power cut: those before it hold, stderr says so, and the next one is saved."""
    done("judge", "remove", run, "--lap", 1, *WHY)
    done("judge", "remove", run, "--lap", 2, *WHY)
    path = edits_path(run)
    path.write_bytes(path.read_bytes()[:-40])
    ran = dnb_edge("score", run, "--json")
    assert "cut short" in ran.stderr
    assert [lap["number"] for lap in scored(run)] == [2, 3, 4]
    done("judge", "remove", run, "--lap", 3, *WHY)
    assert [lap["number"] for lap in scored(run)] == [2, 4]


def test_decisions_find_their_laps_under_other_lines_and_rules(run: Path) -> None:
    """A line that moved a little: the penalty stays with its lap, and stderr says how far that moved. One that takes the laps
    apart: the decision changes nothing, and is told."""
    done("judge", "penalty", run, "--lap", 2, "--seconds", 5, *WHY)
    ran = dnb_edge("score", run, "--json", "--line", "start=AT:299,190")
    (lap,) = [event for event in map(json.loads, ran.stdout.splitlines()) if event.get("edited_by")]
    assert (lap["number"], lap["penalty_s"]) == (2, 5.0)
    assert "edit 1 (penalty lap 2, Ada): lap 2 begins +0.0" in ran.stderr
    ran = dnb_edge("score", run, "--json", "--line", "start=AT:100,200")
    events = [json.loads(line) for line in ran.stdout.splitlines()]
    assert not [event for event in events if event.get("edited_by")]
    assert [event["without_effect"][0]["number"] for event in events if event["event"] == "edits"] == [1]
    assert "no such lap any more" in ran.stderr


def test_what_the_rules_gave_is_forgiven(tmp_path: Path) -> None:
    """A lap that is too slow for the rules counts again, and its penalty is gone; the raw lap stands beside it."""
    run = record(tmp_path, "slow.mcap", CAR, made=setup(laps=LapRules(max_lap_s=3.05)))
    assert [lap["valid"] for lap in scored(run)] == [True, False, True, False]
    assert "lap 2 has no penalty for off_track: it has too_slow" in refusal(
        "judge", "forgive", run, "--lap", 2, "--offence", "off_track", *WHY
    )
    done("judge", "forgive", run, "--lap", 2, "--offence", "too_slow", *WHY)
    done("judge", "forgive", run, "--lap", 4, *WHY)
    laps = scored(run)
    assert [(lap["valid"], lap["reasons"]) for lap in laps] == [(True, [])] * 4
    assert [lap["raw"][0]["valid"] for lap in laps if lap.get("edited_by")] == [False, False]


def test_the_end_of_a_race_is_forgiven_with_its_offence(tmp_path: Path) -> None:
    """The rules ended it with lap 1, whose sector line was missed: forgiven, the car is in the standings like any other."""
    line = DirectedLine(name="half", start_m=on_circle(2.0, 1.03), end_m=on_circle(2.0, 0.97))
    track = replace(circle(), sector_lines=(line,))
    prices = PenaltyRules(missed_line=Effect(dnf=True))
    run = record(tmp_path, "end.mcap", Car((3.0, 3.1), off_m=0.1), made=setup(track=track, penalties=prices))
    (row,) = scored(run, kind="standings")[-1]["rows"]
    assert (row["laps"], "half" in row["dnf"]) == (1, True)
    done("judge", "forgive", run, "--lap", 1, "--offence", "missed_line", *WHY)
    (row,) = scored(run, kind="standings")[-1]["rows"]
    assert (row["laps"], row["dnf"]) == (1, None)
    done("judge", "undo", run, "--edit", 1, *WHY)
    assert scored(run, kind="standings")[-1]["rows"][0]["dnf"] is not None


def test_several_cars_are_judged_each_by_itself(tmp_path: Path) -> None:
    """--car says whose lap; the list names the cars."""
    cars = (CarSetup(name="Ann"), CarSetup(name="Bob"))
    made = setup(motion=replace(MotionSettings(), cars=2), cars=cars)
    run = record(tmp_path, "two.mcap", CAR, Car((3.3, 3.4, 3.5), start_rad=-1.8), made=made)
    before = scored(run)
    assert {lap["car"] for lap in before} == {1, 2}
    assert [row["name"] for row in scored(run, kind="standings")[-1]["rows"]] == ["Ann", "Bob"]
    shown = done("judge", "remove", run, "--lap", 2, "--car", 2, *WHY)
    assert "Bob  3.300 s" in shown
    after = scored(run)
    assert [(lap["car"], lap["number"]) for lap in after] == [
        (lap["car"], lap["number"]) for lap in before if (lap["car"], lap["number"]) != (2, 2)
    ]
    done("judge", "penalty", run, "--lap", 1, "--dnf", *WHY)
    first, last = scored(run, kind="standings")[-1]["rows"]
    assert (first["name"], first["laps"], last["name"], last["laps"]) == ("Bob", 2, "Ann", 1)
    assert (first["dnf"], last["dnf"]) == (None, "a hand (judge Ada)")
    told = [line.strip() for line in done("score", run).splitlines()]
    assert [line[:12] for line in told if line.startswith(("car", "removed"))] == [
        "car 1  lap 1",
        "car 2  lap 1",
        "car 1  lap 2",
        "car 1  lap 3",
        "car 2  lap 3",
        "car 1  lap 4",
        "removed: car",
    ]
    assert told[-3:] == ["1. Bob  3.300 s", "2. Ann  3.000 s, DNF: a hand (judge Ada)", "6 laps in 392 frames"]
    assert "2 of car 1" in done("judge", "remove", run, "--lap", 2, "--dry-run", *WHY)


def test_the_list_comes_as_json_lines(run: Path) -> None:
    """Laps, removed laps, edits with their state, and passes with their numbers."""
    done("judge", "remove", run, "--lap", 2, *WHY)
    done("judge", "undo", run, "--edit", 1, *WHY)
    done("judge", "remove", run, "--lap", 3, *WHY)
    lines = [json.loads(line) for line in done("judge", "list", run, "--json", "--passes").splitlines()]
    kinds = [line["event"] for line in lines]
    assert kinds == ["lap"] * 3 + ["removed"] + ["edit"] * 3 + ["crossing"] * 5
    assert [(one["number"], one["undone"]) for one in lines if one["event"] == "edit"] == [
        (1, True),
        (2, False),
        (3, False),
    ]
    assert [one["pass"] for one in lines if one["event"] == "crossing"] == [1, 2, 3, 4, 5]


def test_reports_get_edited_and_raw_laps(run: Path) -> None:
    """`replay(...).result()` has the laps that count, those of the race, and the edits; the page shows all, escaped."""
    assert (replay(run).result().raw_laps, replay(run).result().marshalled) == ((), None)
    done("judge", "remove", run, "--lap", 2, *WHY)
    result = replay(run).result()
    assert ([lap.number for lap in result.laps], [lap.number for lap in result.raw_laps]) == ([1, 3, 4], [1, 2, 3, 4])
    assert [edit.author for edit in result.edits] == ["Ada"]
    assert len(result.paths_m) == 3
    assert "decisions" not in race_sections(replay(run, edits=False).result())
    page = race_sections(result)
    assert page.count("removed: lap 2, 3.0") == 1
    assert "<td>Ada</td><td>remove lap 2</td><td>a hand</td>" in page
    done("judge", "note", run, "--text", "<b>wind</b>", "--by", "<i>")
    page = race_sections(replay(run).result())
    assert "<td>&lt;i&gt;</td><td>note the run</td><td>&lt;b&gt;wind&lt;/b&gt;</td>" in page


def test_an_export_shows_edited_and_raw_laps(race: Race, tmp_path: Path) -> None:
    """The laps that count and those taken away, who decided what, and what the race said; --no-edits gives that alone."""
    run = Path(shutil.copy(race.recording, tmp_path))
    raw = list(csv.DictReader(io.StringIO(done("runs", "export", run))))
    assert {(row["removed"], row["edited_by"]) for row in raw} == {("false", "")}
    assert all(row["raw_time_s"] == row["time_s"] for row in raw)
    done("judge", "remove", run, "--lap", 3, *WHY)
    done("judge", "penalty", run, "--lap", 1, "--seconds", 5, *WHY)
    rows = list(csv.DictReader(io.StringIO(done("runs", "export", run))))
    assert [(row["number"], row["removed"]) for row in rows] == [("1", "false"), ("2", "false"), ("3", "true")]
    assert (rows[0]["edited_by"], rows[2]["edited_by"]) == ("2 penalty by Ada: a hand", "1 remove by Ada: a hand")
    assert float(rows[0]["official_time_s"]) == pytest.approx(float(rows[0]["raw_official_time_s"]) + 5)
    assert list(csv.DictReader(io.StringIO(done("runs", "export", run, "--no-edits")))) == raw


def test_the_shell_gets_one_line_and_its_exit_code(run: Path) -> None:
    """As a process of its own: 0 for a decision, 2 for one that makes no sense."""
    assert edge("judge", "remove", run, "--lap", 2, *WHY).code == 0
    again = edge("judge", "remove", run, "--lap", 2, *WHY)
    assert (again.code, again.out) == (2, "")
    assert again.complaint() == "dnb-edge: lap 2 is removed already, by edit 1 of Ada: undo that to have it back"
