"""`dnb-edge table` over real recordings: who is compared, what is refused, and that files may come in any order."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from table_runs import GROUND, Car, circle, entry, record, setup
from typer.testing import CliRunner, Result

from dnb_edge.archive.replayed import replay
from dnb_edge.archive.trials import raced
from dnb_edge.cli.main import app
from dnb_edge.errors import InputError
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.crossing import CrossingSettings
from dnb_edge.race.rules import CarSetup, LapRules
from dnb_edge.record.identity import identity_of
from dnb_edge.values import Lap, Standing, Standings

STEADY = Car((2.5, 2.6, 2.4))
CLOSE = Car((2.52, 2.45, 2.58))
SLOW = Car((3.5, 3.6, 3.4), off_m=0.05)


def table(*words: object) -> Result:
    return CliRunner().invoke(app, ["table", *map(str, words)])


def rows(*words: object) -> list[dict]:
    ran = table(*words, "--json")
    assert ran.exit_code == 0, ran.exception
    return [json.loads(line) for line in ran.stdout.splitlines()]


def refusal(*words: object) -> str:
    ran = table(*words)
    assert isinstance(ran.exception, InputError), ran.stdout
    assert ran.stdout == ""
    return str(ran.exception)


def test_three_entries_are_compared(tmp_path: Path) -> None:
    """Means, intervals and who is alike come out as driven: two that drive alike, and one that does not."""
    record(tmp_path, "1.mcap", STEADY, entry=entry("Driver 1"))
    record(tmp_path, "2.mcap", CLOSE, entry=entry("Driver 2"))
    record(tmp_path, "3.mcap", SLOW, entry=entry("Driver 3"))
    one, two, three = rows(tmp_path)
    assert [row["entry"] for row in (one, two, three)] == ["Driver 1", "Driver 2", "Driver 3"]
    assert one["completion_time_s"] == pytest.approx(2.5, abs=0.01)
    assert one["completion_time_sd_s"] == pytest.approx(0.1, abs=0.01)
    assert one["completion_time_ci95_low_s"] == pytest.approx(2.5 - 4.303 * 0.1 / 3**0.5, abs=0.03)
    assert one["best_lap_s"] == pytest.approx(2.4, abs=0.01)
    assert 0 < one["best_lap_sigma_s"] < 0.05
    assert [row["completion_time_group"] for row in (one, two, three)] == ["a", "a", "b"]
    assert one["indistinguishable_from"]["completion_time_s"] == ["Driver 2"]
    assert three["indistinguishable_from"]["completion_time_s"] == []
    assert one["track"] == three["track"] != ""
    assert one["rules"] == three["rules"] != []
    text = table(tmp_path).stdout
    assert "Driver 1 and Driver 2 cannot be told apart by completion time (p = " in text
    assert table(tmp_path, "--format", "latex").stdout.count(r" \\") == 4


def test_the_order_of_files_changes_nothing(tmp_path: Path) -> None:
    """The same table, to the last letter, whatever the order, and a file that is named twice counts once."""
    files = [
        record(tmp_path, "1.mcap", STEADY, entry=entry("net", "v1")),
        record(tmp_path, "2.mcap", CLOSE, entry=entry("net", "v1")),
        record(tmp_path, "3.mcap", SLOW, entry=entry("net", "v2")),
    ]
    for form in ("text", "json"):
        first = table(*files, "--format", form).stdout
        assert table(*reversed(files), files[0], tmp_path, "--format", form).stdout == first
    assert [(row["label"], row["runs"], row["interval_over"]) for row in rows(*files)] == [
        ("net v1", 2, "runs"),
        ("net v2", 1, "laps"),
    ]


def test_a_row_for_each_run(tmp_path: Path) -> None:
    """`--by run` keeps the runs of one entry apart."""
    record(tmp_path, "b.mcap", STEADY)
    record(tmp_path, "a.mcap", SLOW)
    assert [(row["entry"], row["run"]) for row in rows(tmp_path, "--by", "run")] == [
        ("net", "a.mcap"),
        ("net", "b.mcap"),
    ]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"track": circle(reverse=True)}, "opposite directions round the track 'circle'"),
        ({"track": circle("other", radius_m=1.3)}, "different tracks ('circle' and 'other')"),
        ({"track": circle(line_at_m=1.0)}, "different lines or widths of the track 'circle'"),
        (
            {"crossing": CrossingSettings(hysteresis_m=0.07)},
            "different rules, crossing.hysteresis_m is the default and 0.07: score both by one value with --set crossing.hys",
        ),
        (
            {"laps": LapRules(min_lap_s=3.0)},
            "different rules, race.min_lap_s is the default and 3.0: score both by one rule set",
        ),
    ],
)
def test_other_conditions_are_refused_in_one_line(tmp_path: Path, change: dict, expected: str) -> None:
    """Other tracks, directions and rules: one line with both files and what differs, whichever comes first, and no table."""
    one = record(tmp_path, "1.mcap", STEADY)
    other = record(tmp_path, "2.mcap", STEADY, made=setup(**change))
    told = refusal(one, other)
    assert f"{one} and {other}: {expected}" in told
    assert refusal(other, one) == told


def test_the_same_track_and_camera_on_another_processor_are_the_same(tmp_path: Path) -> None:
    """Linear algebra differs in its last digits, which may turn any digit of a digest; a nanometre is no other track."""
    track = circle()
    route = replace(track.centreline, points_m=track.centreline.points_m + 3e-9)
    ground = replace(GROUND, camera_to_twin=(0.4 + 1e-7, 0, 0, 0, 0.4, 0, 0, 0, 1.0))
    made = setup(track=replace(track, centreline=route), ground=ground)
    assert identity_of(made).track != identity_of(setup()).track
    assert identity_of(made).calibration != identity_of(setup()).calibration
    one = record(tmp_path, "1.mcap", STEADY, session="monday")
    other = record(tmp_path, "2.mcap", CLOSE, session="monday", made=made)
    ran = table(one, other)
    assert (ran.exit_code, ran.stderr) == (0, "")


def test_the_length_of_a_run_is_no_rule(tmp_path: Path) -> None:
    """Laps of a run that was to have three are compared with those of an endless one; both rules' digests are told."""
    record(tmp_path, "1.mcap", STEADY, made=setup(laps=LapRules(laps=3)))
    record(tmp_path, "2.mcap", STEADY)
    assert [(row["runs"], len(row["rules"])) for row in rows(tmp_path)] == [(2, 2)]


def test_other_rules_are_compared_once_all_are_scored_by_the_same(tmp_path: Path) -> None:
    """`--set` and `--rules` give all recordings one set of rules, and laps are judged by those."""
    one = record(tmp_path, "1.mcap", STEADY, entry=entry("a"))
    other = record(tmp_path, "2.mcap", STEADY, entry=entry("b"), made=setup(laps=LapRules(min_lap_s=1.0)))
    assert "--rules" in refusal(one, other)
    for words in (("--set", "race.min_lap_s=1.5"), ("--rules", "practice")):
        told = rows(one, other, *words)
        assert [row["valid_laps"] for row in told] == [3, 3]
        assert told[0]["rules"] == told[1]["rules"]


def test_another_calibration_is_refused_within_a_session_and_told_of_between_two(tmp_path: Path) -> None:
    """Within one session the camera must not have been calibrated anew; between sessions it may, with a warning."""
    moved = setup(ground=replace(GROUND, camera_to_twin=(0.4, 0, 0.3, 0, 0.4, 0, 0, 0, 1.0)))
    monday = record(tmp_path, "1.mcap", STEADY, session="monday")
    again = record(tmp_path, "2.mcap", CLOSE, session="monday", made=moved)
    tuesday = record(tmp_path, "3.mcap", CLOSE, session="tuesday", made=moved)
    unnamed = record(tmp_path, "4.mcap", CLOSE, made=moved)
    told = refusal(again, monday)
    assert f"{monday} and {again}: different calibrations" in told
    assert "in one session, 'monday'" in told
    nameless = record(tmp_path, "0.mcap", STEADY)
    assert table(nameless, unnamed).exit_code == 0
    for other in (tuesday, unnamed):
        ran = table(monday, other)
        assert ran.exit_code == 0
        assert f"{monday} and {other}: different calibrations" in ran.stderr
    (row,) = rows(monday, tuesday)
    assert (row["sessions"], len(row["calibrations"])) == (["monday", "tuesday"], 2)
    assert table(tuesday, unnamed).stderr == ""


def test_warm_up_laps_are_in_no_figure(tmp_path: Path) -> None:
    """As in the standings: neither attempted, nor the best, nor in a mean."""
    record(tmp_path, "1.mcap", STEADY)
    (row,) = rows(tmp_path, "--set", "format.warm_up_laps=2")
    assert (row["laps"], row["attempted_laps"]) == (1, 1)
    assert row["best_lap_s"] == row["completion_time_s"] == pytest.approx(2.4, abs=0.01)


def test_each_of_several_cars_is_an_entry(tmp_path: Path) -> None:
    """By the names in the setup, or by their numbers; a car of the entry's name keeps the entry's version."""
    named = (CarSetup(name="red", marker_id=1), CarSetup(name="net", marker_id=2))
    replayed = replay(record(tmp_path, "1.mcap", STEADY, entry=entry("net", "v2")))
    lap = next(event for event in replayed.events if isinstance(event, Lap))
    for cars, expected in (
        (named, {"red": ("", 2, None), "net": ("v2", 1, "it stood for 20 s")}),
        ((), {"net car 1": ("v2", 2, None), "net car 2": ("v2", 1, "it stood for 20 s")}),
    ):
        two = setup(motion=MotionSettings(cars=2), cars=cars)
        driven = [replace(lap, car=car, number=number) for car, number in ((1, 1), (2, 1), (1, 2))]
        final = Standings(
            t_ns=9, t_s=9.0, rank_by="best_lap", unit="s", final=True,
            rows=(standing(1, 2), replace(standing(2, 1), dnf="it stood for 20 s")),
        )  # fmt: skip
        trials = raced(replace(replayed, setup=two, events=(*driven, final))).trials
        assert {one.entry.name: (one.entry.version, len(one.laps), one.dnf) for one in trials} == expected


def standing(car: int, laps: int) -> Standing:
    return Standing(
        place=car, tied=False, car=car, name=str(car), laps=laps, valid_laps=laps, value=None, sigma=None, best_lap_s=None,
        last_lap_s=None, gap=None, interval=None,
    )  # fmt: skip


def test_an_old_recording_is_an_entry_by_its_name(tmp_path: Path) -> None:
    """Recordings from before there were versions take part under their name; without a lap it did not finish."""
    (row,) = rows(record(tmp_path, "1.mcap", name="old"))
    assert (row["entry"], row["version"], row["finished"], row["laps"]) == ("old", "", False, 0)
