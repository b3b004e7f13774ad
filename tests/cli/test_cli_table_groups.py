"""`dnb-edge table` over all that may stand in it: real and simulated runs, groups of conditions, cards, files of one name."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from table_runs import SOURCE, Car, circle, entry, record, setup
from typer.testing import CliRunner, Result

from dnb_edge.archive.comparable import grouped
from dnb_edge.archive.replayed import replay
from dnb_edge.archive.trials import raced, told_apart
from dnb_edge.cli.main import app
from dnb_edge.errors import InputError
from dnb_edge.nut.bench_card import BenchCard, ColdStart, Host, Latency, Memory, Spread, WarmUp, card_name, card_text
from dnb_edge.race.rules import LapRules
from dnb_edge.values import Clock, Incident, IncidentKind, VehicleReport

STEADY = Car((2.5, 2.6, 2.4))
CLOSE = Car((2.52, 2.45, 2.58))
CAMERA = replace(SOURCE, uri="v4l2:/dev/video0", clock=Clock.MONOTONIC)
BROAD = circle("broad", radius_m=1.3)


def loop(task: str, seed: int) -> Any:
    return replace(SOURCE, uri=f"loop:net?task={task}&seed={seed}&laps=3")


def table(*words: object) -> Result:
    return CliRunner().invoke(app, ["table", *map(str, words)])


def rows(*words: object) -> list[dict]:
    ran = table(*words, "--json")
    assert ran.exit_code == 0, ran.exception
    return [json.loads(line) for line in ran.stdout.splitlines()]


def card(name: str, p50_ms: float, *, sha: str = "c" * 64, host: str = "pi5", **changes: Any) -> BenchCard:
    times = [Spread(all_ms=p50_ms * k, least_ms=p50_ms * k, most_ms=p50_ms * k) for k in (1, 2, 3)]
    made = BenchCard(
        entry=name, model_file="net.onnx", model_sha256=sha, model_bytes=9, input_shape=(1, 3, 96, 128), input_type="float32",
        host=Host(name=host, cpu="Cortex-A76", cores=4, architecture="aarch64"), threads=1, measured_at="2026-11-23T12:00:00Z",
        software={}, repeats=5, passes=100, warm_up=WarmUp(passes=10, first_ms=9.0),
        inference=Latency(p50=times[0], p95=times[1], p99=times[2], mean_ms=p50_ms, max_ms=9 * p50_ms), fps=1000 / p50_ms,
        memory=Memory(grown_bytes=1, peak_bytes=2),
        cold_start=ColdStart(starts=1, process_ms=1, import_ms=1, load_ms=1, first_answer_ms=1, total_ms=4),
    )  # fmt: skip
    return replace(made, **changes)


def keep(directory: Path, *cards: BenchCard) -> None:
    for number, one in enumerate(cards):
        (directory / f"{number}-{card_name(one.entry)}").write_text(card_text(one), encoding="utf-8")


def test_other_conditions_are_groups_when_asked(tmp_path: Path) -> None:
    """Refused without `--group`, and the line says so; with it a table each, in the same order whatever comes first, compared
    within a group and never across."""
    files = [
        record(tmp_path, "1.mcap", STEADY, entry=entry("a")),
        record(tmp_path, "2.mcap", CLOSE, entry=entry("b")),
        record(tmp_path, "3.mcap", CLOSE, entry=entry("a"), made=setup(track=BROAD), source=CAMERA),
        record(tmp_path, "4.mcap", STEADY, entry=entry("a"), made=setup(laps=LapRules(min_lap_s=1.0))),
    ]
    refused = table(*files)
    assert isinstance(refused.exception, InputError)
    assert str(refused.exception).endswith("compare one track at a time, or tell them in groups with --group")
    told = rows(*files, "--group")
    first = "Track 'broad' (8.17 m), rules practice 1"
    second = "Track 'circle' (6.28 m), in simulation, rules practice 1"
    third = f"{second} (group 2: different rules, race.min_lap_s is the default and 1.0)"
    assert [(row["label"], row["conditions"]) for row in told] == [
        ("a", first), ("a", second), ("b", second), ("a", third)
    ]  # fmt: skip
    assert [row["indistinguishable_from"]["completion_time_s"] for row in told] == [[], ["b"], ["a"], []]
    text = table(*files, "--group").stdout
    assert table(*reversed(files), "--group").stdout == text
    assert [text.count(f"{title}\n\nEntry") for title in (first, second, third)] == [1, 1, 1]
    assert len(list(csv.DictReader(io.StringIO(table(*files, "--group", "--format", "csv").stdout)))) == 4


def test_seeds_of_a_task_are_one_group_and_tasks_are_not(tmp_path: Path) -> None:
    """Closed-loop drives of one task differ by their seed alone; another task is another condition; the usual is to follow."""
    one = record(tmp_path, "1.mcap", STEADY, source=loop("lane-following", 1))
    two = record(tmp_path, "2.mcap", CLOSE, source=loop("lane-following", 2))
    real = record(tmp_path, "3.mcap", CLOSE, source=CAMERA, entry=entry("pilot"))
    dark = record(tmp_path, "4.mcap", CLOSE, source=loop("changing-light", 1))
    assert [(row["label"], row["runs"], row["simulated"]) for row in rows(one, two, real)] == [
        ("net (simulated)", 2, True),
        ("pilot", 1, False),
    ]
    again = record(tmp_path, "5.mcap", STEADY, source=loop("lane-following", 1))
    assert table(one, two, real).stderr == ""
    assert f"{one} and {again}: both are seed 1 of net: leave one out" in table(again, two, one).stderr
    assert [raced(replay(path)).trials[0].seed for path in (one, two, real)] == ["1", "2", None]
    refused = table(one, dark).exception
    assert isinstance(refused, InputError)
    assert "different tasks (lane-following and changing-light): compare one task at a time" in str(refused)
    assert ["changing-light" in row["conditions"] for row in rows(one, two, dark, "--group")] == [True, False]


def test_laps_that_a_closed_loop_drive_was_to_have_and_had_not_failed(tmp_path: Path) -> None:
    """Who gets stuck before the first lap ends has not driven it; who stops a real run early has failed in nothing."""
    made = setup(laps=LapRules(laps=5))
    simulated = record(tmp_path, "1.mcap", STEADY, source=loop("lane-following", 1), made=made)
    nothing = record(tmp_path, "2.mcap", source=loop("lane-following", 2), made=made)
    real = record(tmp_path, "3.mcap", STEADY, source=CAMERA, made=made)
    net, pilot = rows(simulated, nothing, real)[::-1]
    assert (net["valid_laps"], net["attempted_laps"], net["success_rate"]) == (3, 10, 0.3)
    assert (pilot["valid_laps"], pilot["attempted_laps"]) == (3, 3)


def test_a_calibration_within_a_session_is_refused_in_groups_too(tmp_path: Path) -> None:
    """Groups are for other conditions; a session whose camera was calibrated anew is a mistake."""
    moved = setup(ground=replace(setup().ground, camera_to_twin=(0.4, 0, 0.3, 0, 0.4, 0, 0, 0, 1.0)))
    record(tmp_path, "1.mcap", STEADY, session="monday")
    record(tmp_path, "2.mcap", CLOSE, session="monday", made=moved)
    refused = table(tmp_path, "--group").exception
    assert isinstance(refused, InputError)
    assert "in one session, 'monday'" in str(refused)


def test_files_of_one_name_in_several_directories_are_runs_of_their_own(tmp_path: Path) -> None:
    """By run each has its row, named by as much of its path as it takes, and none is counted twice."""
    record(tmp_path / "x" / "day", "a.mcap", STEADY)
    record(tmp_path / "y" / "day", "a.mcap", CLOSE)
    record(tmp_path / "y" / "day", "b.mcap", CLOSE)
    found = rows(tmp_path / "x" / "day", tmp_path / "y" / "day", "--by", "run")
    assert [(row["run"], row["runs"], row["laps"]) for row in found] == [
        ("b.mcap", 1, 3),
        ("x/day/a.mcap", 1, 3),
        ("y/day/a.mcap", 1, 3),
    ]
    (whole,) = rows(tmp_path / "x" / "day", tmp_path / "y" / "day")
    assert (whole["runs"], whole["laps"]) == (3, 9)


def test_inference_comes_from_the_cards_beside_the_recordings(tmp_path: Path) -> None:
    """By the checkpoint's hash, else by name and version, else by the name alone if it is no other's; people have none."""
    record(tmp_path, "1.mcap", STEADY, entry=entry("net", "v1", "a" * 64))
    record(tmp_path, "2.mcap", CLOSE, entry=entry("net", "v2", "b" * 64))
    record(tmp_path, "3.mcap", CLOSE, entry=entry("other"))
    record(tmp_path, "4.mcap", CLOSE, entry=entry("pilot"))
    record(tmp_path, "5.mcap", CLOSE, entry=entry("net", "v3"))
    cards = card("net v2", 6.0), card("other", 7.0), card("net", 8.0), card("other", 5.0, sha="a" * 64)
    keep(tmp_path, *cards)
    found = {row["label"].partition(" [")[0]: row for row in rows(tmp_path)}
    assert {name: row["inference_p50_ms"] for name, row in found.items()} == {
        "net v1": 5.0, "net v2": 6.0, "net v3": None, "other": 7.0, "pilot": None
    }  # fmt: skip
    assert found["other"]["inference_p95_ms"] == 14.0
    assert found["other"]["inference_source"] == "pi5: Cortex-A76, 4 cores, 1 thread"
    assert "5 / 10" in table(tmp_path).stdout
    assert table(tmp_path).stderr == ""


def test_without_a_card_what_the_vehicle_told_is_shown(tmp_path: Path) -> None:
    """Over all its runs; of the car that raced, whatever others said; a benchmark's figures come first."""
    words = [(12.0, 1), (14.0, 1), (None, 1), (99.0, 7)]
    record(tmp_path, "1.mcap", STEADY, entry=entry("net"), vehicle=[vehicle(k, *word) for k, word in enumerate(words)])
    record(tmp_path, "2.mcap", CLOSE, entry=entry("net"), vehicle=[vehicle(0, 13.0, 1)])
    (row,) = rows(tmp_path)
    assert (row["inference_p50_ms"], row["inference_p99_ms"]) == (13.0, 14.0)
    assert row["inference_source"] == "told by the vehicle"
    (first, _) = rows(tmp_path, "--by", "run")
    assert first["inference_p50_ms"] == 12.0
    keep(tmp_path, card("net", 5.0))
    assert rows(tmp_path)[0]["inference_p50_ms"] == 5.0


def vehicle(k: int, inference_ms: float | None, car: int) -> VehicleReport:
    return VehicleReport(
        t_ns=k + 1, t_s=1e-9, came_ns=k, car=car, seq=k, inference_ms=inference_ms, steering=None, throttle=None,
        rate_hz=None, missing=0, refused=0,
    )  # fmt: skip


def test_the_newest_card_of_one_machine_counts_and_several_machines_are_told_of(tmp_path: Path) -> None:
    """Measured again: the later one. On two machines: none for that entry, with a line; entries on several: a line too."""
    runs, cards = tmp_path / "runs", tmp_path / "cards"
    cards.mkdir()
    record(runs, "1.mcap", STEADY, entry=entry("net"))
    record(runs, "2.mcap", CLOSE, entry=entry("other"))
    keep(cards, card("net", 6.0, measured_at="2026-11-24T12:00:00Z"), card("net", 5.0), card("other", 7.0, host="nano"))
    ran = table(runs, "--bench", cards, "--json")
    assert [json.loads(line)["inference_p50_ms"] for line in ran.stdout.splitlines()] == [6.0, 7.0]
    assert "inference times are of several machines and not to be compared: nano: " in ran.stderr
    keep(runs, card("net", 5.0), card("net", 6.0, threads=2))
    ran = table(runs, "--json")
    assert [json.loads(line)["inference_p50_ms"] for line in ran.stdout.splitlines()] == [None, None]
    assert "net was measured on several machines: name one card with --bench" in ran.stderr


def test_a_card_that_cannot_be_read(tmp_path: Path) -> None:
    """Beside a recording it is left out with a line; named, the command ends with one; so with a directory without any."""
    record(tmp_path, "1.mcap", STEADY)
    bad = tmp_path / "net.nut.json"
    bad.write_text("{}")
    ran = table(tmp_path)
    assert ran.exit_code == 0
    assert f"{bad}: no benchmark's card" in ran.stderr
    (tmp_path / "empty").mkdir()
    for words, expected in (
        (bad, "no benchmark's card"),
        (tmp_path / "empty", "no card (*.nut.json) in this directory"),
    ):
        refused = table(tmp_path, "--bench", words).exception
        assert isinstance(refused, InputError)
        assert expected in str(refused)


@pytest.mark.parametrize(("warm_up", "expected"), [(0, 2), (1, 1)])
def test_collisions_are_counted_but_in_warm_up_laps(tmp_path: Path, warm_up: int, expected: int) -> None:
    """As the race told them, for each car; other incidents are none."""
    replayed = replay(record(tmp_path, "1.mcap", STEADY))
    made = replace(replayed.setup, format=replace(replayed.setup.format, warm_up_laps=warm_up))
    hits = [
        incident(IncidentKind.COLLISION, 1), incident(IncidentKind.COLLISION, 2), incident(IncidentKind.OFF_TRACK, 2)
    ]  # fmt: skip
    (trial,) = raced(replace(replayed, setup=made, events=(*replayed.events, *hits))).trials
    assert trial.collisions == expected


def incident(kind: IncidentKind, lap: int) -> Incident:
    return Incident(
        number=1, kind=kind, car=1, target_id=1, lap=lap, start_t_ns=1, end_t_ns=2, start_s=0.0, lasted_s=0.1, greatest_m=None,
        worst_t_ns=1, track_m=(0.0, 0.0), camera_px=None, s_m=None, text="it hit something",
    )  # fmt: skip


def test_many_recordings_are_told_apart_and_grouped_at_once(tmp_path: Path) -> None:
    """A thousand recordings of one name: every one has its own, and comparable ones are one group."""
    one = raced(replay(record(tmp_path, "a.mcap", STEADY)))
    many = [replace(one, path=tmp_path / str(k) / "a.mcap") for k in range(1000)]
    assert {run.trials[0].run for run in told_apart(many)} == {f"{k}/a.mcap" for k in range(1000)}
    assert [len(group.runs) for group in grouped(many)] == [1000]


def test_pictures_and_the_page_are_written_beside_the_table(tmp_path: Path) -> None:
    """The table itself comes on stdout as ever; each file is named on stderr; a page that cannot be written is one line."""
    record(tmp_path, "1.mcap", STEADY, entry=entry("a"))
    record(tmp_path, "2.mcap", CLOSE, entry=entry("b"))
    page, pictures = tmp_path / "table.html", tmp_path / "pictures"
    ran = table(tmp_path, "--json", "--html", page, "--figures", pictures, "--figure-format", "svg")
    assert ran.stdout == table(tmp_path, "--json").stdout
    names = ["boxes.svg", "means.svg", "radar.svg", "ranks.svg"]
    assert sorted(path.name for path in pictures.iterdir()) == names
    assert ran.stderr.splitlines() == [f"Written: {path}" for path in (*(pictures / name for name in names), page)]
    assert page.read_text().count("<img ") == 4
    refused = table(tmp_path, "--html", tmp_path / "nowhere" / "table.html").exception
    assert isinstance(refused, InputError)
    assert "there is no directory" in str(refused)
