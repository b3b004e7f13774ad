"""`dnb-edge score`: the live numbers again, bit for bit, or what other lines, thresholds and rules would have given."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edge_command import Race, edge
from table_runs import Car, circle, record, setup
from typer.testing import CliRunner, Result

from dnb_edge.archive.replayed import replay
from dnb_edge.cli.main import app
from dnb_edge.config.rules import PRESETS
from dnb_edge.config.track_file import track_file
from dnb_edge.errors import InputError
from dnb_edge.race.rules import LapRules
from dnb_edge.track.layout import laid_out
from dnb_edge.track.line import line_across
from dnb_edge.track.scale import TwinScale
from dnb_edge.values import Running

CAR = Car((3.0, 3.1, 2.9, 3.2))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A recording of one car with four laps on a circle of 1 m about (200, 200) twin px, the start line at its right."""
    return record(tmp_path, "run.mcap", CAR)


def score(*words: object) -> Result:
    return CliRunner().invoke(app, ["score", *map(str, words)])


def events(*words: object) -> list[dict]:
    ran = score(*words, "--json")
    assert ran.exit_code == 0, ran.exception
    return [json.loads(line) for line in ran.stdout.splitlines()]


def laps(*words: object) -> list[dict]:
    return [event for event in events(*words) if event["event"] == "lap"]


def refusal(*words: object) -> str:
    ran = score(*words)
    assert isinstance(ran.exception, InputError), ran.output
    assert ran.stdout == ""
    assert "\n" not in str(ran.exception)
    return str(ran.exception)


def test_every_event_of_the_live_run_comes_again(race: Race) -> None:
    """With no option, `score --json` prints all that the live run said of the race, in its order, bit for bit: crossings, laps,
    scores, incidents, standings and whatever else the core says. Only the appliance's own health is not said again."""
    again = edge("score", race.recording, "--json")
    assert (again.code, again.err) == (0, "")
    live = [line for line in race.ran.out.splitlines() if json.loads(line)["event"] != "health"]
    assert again.out.splitlines() == live
    assert {"crossing", "lap", "score", "run"} <= {json.loads(line)["event"] for line in live}


def test_nothing_is_said_of_changes_where_there_are_none(run: Path) -> None:
    """Neither as JSON nor as text."""
    assert "rescored" not in {event["event"] for event in events(run)}
    assert "changed" not in score(run).stdout


def test_what_was_changed_is_said_first(run: Path) -> None:
    """JSON: the first object, with every key's old and new value, the rule set and its digest; text: one line."""
    words = ("--set", "race.min_lap_s=4", "--line", "half=AT:100,200")
    first, *rest = events(run, *words)
    assert first["event"] == "rescored"
    assert first["changes"]["race.min_lap_s"] == {"was": 2.0, "is": 4.0}
    assert first["changes"]["line half"]["was"] is None
    assert set(first["changes"]) == {"race.min_lap_s", "line half"}
    assert first["rules"] == "practice"
    assert len(first["digest"]) == 12
    assert "rescored" not in {event["event"] for event in rest}
    lines = score(run, *words).stdout.splitlines()
    assert "changed: race.min_lap_s 4.0 (was 2.0), line half added; rules practice" in lines[1]


def test_a_start_line_half_way_round_times_from_there(run: Path) -> None:
    """Laps begin where the line is now: half of one lap and half of the next."""
    before = [event["t_s"] for event in events(run) if event["event"] == "crossing"]
    moved = laps(run, "--line", "start=AT:100,200")
    assert moved[0]["start_s"] == pytest.approx((before[0] + before[1]) / 2, abs=0.01)
    assert [lap["time_s"] for lap in moved] == pytest.approx([3.05, 3.0, 3.05], abs=0.01)


def test_sector_lines_that_nobody_drew_give_sectors(run: Path) -> None:
    """Named as they are given, in the order of the route whatever the order of the options, and gone with `none`."""
    words = ("--line", "last=AT:200,300", "--line", "first=AT:200,100")
    one = laps(run, *words)[0]
    assert [sector["line"] for sector in one["sectors"]] == ["first", "last", "start"]
    assert [sector["time_s"] for sector in one["sectors"]] == pytest.approx([0.75, 1.5, 0.75], abs=0.01)
    assert one["time_s"] == laps(run)[0]["time_s"]
    drawn = circle()
    line = line_across(drawn.centreline, 1.5, name="one", margin_m=0.05)
    own = record(run.parent, "own.mcap", CAR, made=setup(track=replace(drawn, sector_lines=(line,))))
    assert len(laps(own)[0]["sectors"]) == 2
    assert laps(own, "--line", "one=none")[0]["sectors"] == []


def test_lines_can_come_from_a_file(run: Path, tmp_path: Path) -> None:
    """The same as on the command line: two ends, a place, or null."""
    lines = tmp_path / "lines.yaml"
    lines.write_text("start: {at: [100, 200]}\nhalf: [[280, 200], [320, 200]]\n")
    one, two = (
        laps(run, "--line", lines),
        laps(run, "--line", "start=AT:100,200", "--line", "half=280,200:320,200"),
    )
    assert one == two
    assert [sector["line"] for sector in one[0]["sectors"]] == ["half", "start"]


def test_a_line_turned_round_is_driven_the_other_way(run: Path) -> None:
    """The start line says which way cars drive: turned, no lap is complete, and the change is told."""
    first, *rest = events(run, "--line", "start=320,200:280,200")
    assert first["changes"]["direction"] == {"was": "anticlockwise", "is": "clockwise"}
    assert not [event for event in rest if event["event"] == "lap"]
    assert len(laps(run, "--line", "start=280,200:320,200")) == 4


def test_thresholds_and_rule_sets_apply_after_the_fact(run: Path, tmp_path: Path) -> None:
    """A least lap time that swallows every second crossing; a rule set by name and by file, single keys winning over it."""
    assert [lap["time_s"] for lap in laps(run, "--set", "race.min_lap_s=5")] == pytest.approx([6.1, 6.1], abs=0.01)
    (tmp_path / "mine.yaml").write_text(
        "name: mine\nversion: 3\nrace: {max_lap_s: 3.05}\npenalties: {too_slow: {seconds: 9}}\n"
    )
    mine = laps(run, "--rules", tmp_path / "mine.yaml")
    assert [(lap["valid"], lap["penalty_s"]) for lap in mine] == [(True, 0), (True, 9), (True, 0), (True, 9)]
    both = laps(run, "--rules", tmp_path / "mine.yaml", "--set", "race.max_lap_s=3.15")
    assert [lap["penalty_s"] for lap in both] == [0, 0, 0, 9]
    assert events(run, "--rules", "deepracer")[0]["rules"] == "deepracer"


def test_a_rule_set_leaves_what_belongs_to_the_run(tmp_path: Path) -> None:
    """The wanted laps, the car's size and the score's scale stay; what else a rule set does not say is as by default."""
    base = setup()
    made = replace(
        base,
        laps=replace(base.laps, laps=4, car_length_m=0.2, max_lap_s=9.0),
        score=replace(base.score, baseline_m=0.3),
    )
    run = record(tmp_path, "run.mcap", CAR, made=made)
    changes = events(run, "--rules", "deepracer")[0]["changes"]
    assert changes["race.max_lap_s"] == {"was": 9.0, "is": None}
    assert not {"race.laps", "race.car_length_m", "score.baseline_m"} & set(changes)


def test_every_rule_set_fits_a_run_that_was_to_have_so_many_laps(tmp_path: Path) -> None:
    """Also that for survival, which has no wanted laps: those of the run are left out."""
    run = record(tmp_path, "5.mcap", CAR, made=setup(laps=LapRules(laps=5)))
    for name in PRESETS:
        told = events(run, "--rules", name)[0]
        assert told["rules"] == name
        assert ("race.laps" in told["changes"]) == (name in ("laps", "carla", "aido")), name


def test_another_scoring_changes_the_scores_alone(run: Path) -> None:
    """Times stay bit for bit; similarity follows the metric and the baseline."""
    before, after = laps(run), laps(run, "--set", "score.metric=frechet", "--set", "score.baseline_m=0.1")
    assert [lap["time_s"] for lap in after] == [lap["time_s"] for lap in before]
    assert all(a["similarity_percent"] != b["similarity_percent"] for a, b in zip(after, before, strict=True))


def test_another_track_file_of_the_same_twin_is_taken(run: Path, tmp_path: Path) -> None:
    """Its lines and its route are raced."""
    other = circle("other", line_at_m=np.pi)
    track = laid_out(other.centreline, name="other", scale=other.scale, start=other.start_line, source="test")
    (tmp_path / "track.yaml").write_bytes(track_file(track))
    moved = laps(run, "--track", tmp_path / "track.yaml")
    assert [lap["time_s"] for lap in moved] == pytest.approx([3.05, 3.0, 3.05], abs=0.01)


ELSEWHERE = [
    ("another scale", replace(circle(), scale=TwinScale(metres_per_px=0.02, height_px=400.0)), "at 10 mm a px"),
    ("another height", replace(circle(), scale=TwinScale(metres_per_px=0.01, height_px=300.0)), "400 px high"),
    ("another route", circle(radius_m=0.5), "their routes lie in different places"),
]


@pytest.mark.parametrize(("track", "text"), [row[1:] for row in ELSEWHERE], ids=[row[0] for row in ELSEWHERE])
def test_a_recording_of_another_track_is_refused(run: Path, tmp_path: Path, track, text: str) -> None:
    """One line that names both files and what differs."""
    path = tmp_path / "track.yaml"
    path.write_bytes(track_file(track))
    said = refusal(run, "--track", path)
    assert f"{run}: recorded on another track than {path}" in said
    assert text in said


REFUSED = [
    (
        "off the route",
        "--line",
        "start=10,10:20,20",
        "the line 'start' from (10, 10) to (20, 20) twin px crosses the route 0",
    ),
    ("crossed twice", "--line", "start=50,200:350,200", "crosses the route 2 times, at "),
    ("place far off", "--line", "half=AT:200,200", "the place (200, 200) twin px of the line 'half' is"),
    ("three numbers", "--line", "start=1,2,3:4,5", "--line start=1,2,3:4,5: 1,2,3: must be 2 numbers"),
    ("one end", "--line", "start=1,2", "--line start=1,2: must be NAME=u,v:u,v"),
    ("no start", "--line", "start=none", "--line start=none: a race needs a start line"),
    (
        "unknown line",
        "--line",
        "half=none",
        "--line half=none: the track has no line of that name; its sector lines: none",
    ),
    ("no file", "--line", "lines.yaml", "--line lines.yaml: neither NAME=u,v:u,v nor a file of lines"),
    ("finish on the start", "--line", "finish=AT:300,200", "the finish line is the start line: leave it out"),
    (
        "unknown key",
        "--set",
        "race.min_lap=3",
        "--set race.min_lap=3: race.min_lap: unknown key, did you mean min_lap_s?",
    ),
    (
        "no number",
        "--set",
        "race.min_lap_s=x",
        "--set race.min_lap_s=x: race.min_lap_s: input should be a valid number",
    ),
    ("no value", "--set", "race.min_lap_s", "--set race.min_lap_s: must have the form key.path=value"),
    ("not after the fact", "--set", "detector.kind=markers", "a recording holds what was detected: only race, start"),
    ("a whole section", "--set", "race=3", "--set race=3: race: "),
    ("contradiction", "--set", "race.max_lap_s=1", "race.max_lap_s: 1"),
    (
        "two that contradict",
        "--set",
        "format.rank_by=driving_score",
        "the rules contradict one another: format.rank_by: driving",
    ),
    ("no rule set", "--rules", "deepraser", "did you mean deepracer?"),
    ("no rules file", "--rules", "./no.yaml", "no.yaml: cannot read the rule set"),
    ("no track", "--track", "no.yaml", "no.yaml: cannot read the track file"),
]


@pytest.mark.parametrize(("option", "value", "text"), [row[1:] for row in REFUSED], ids=[row[0] for row in REFUSED])
def test_what_does_not_fit_is_refused_with_one_line(run: Path, option: str, value: str, text: str) -> None:
    """And no number is printed."""
    assert text in refusal(run, option, value)


BAD_FILES = [
    ("start: 3\n", "line 1: start: must be [[u, v], [u, v]]"),
    ("# lines\nstart: [[1, 2], [3, x]]\n", "line 2: start: [3, 'x'] is no point [u, v]"),
    ("start: {at: 5}\n", "line 1: start: 5 is no point"),
    ("start: [[1, 2]\n", "not valid YAML"),
    ("- 1\n", "must be a mapping"),
]


@pytest.mark.parametrize(("text", "said"), BAD_FILES)
def test_a_bad_file_of_lines_is_refused_with_its_line(run: Path, tmp_path: Path, text: str, said: str) -> None:
    """The file's name and the line in it."""
    lines = tmp_path / "lines.yaml"
    lines.write_text(text)
    assert said in refusal(run, "--line", lines)


def test_running_laps_are_told_only_where_somebody_wants_them(run: Path) -> None:
    """A replay without them is faster and otherwise the same, event for event."""
    whole = replay(run, tell_running=True).events
    assert any(isinstance(event, Running) for event in whole)
    assert replay(run).events == tuple(event for event in whole if not isinstance(event, Running))
