"""What scripts may rely on: the lines of `run --json`, the same numbers again from the recording, tables and report."""

import csv
import io
import json
import re
from pathlib import Path

import pytest
import yaml
from edge_command import CLIP_FRAMES, LAPS, Race, Ran, edge

from dnb_edge.sim.rig import Rig


@pytest.fixture(scope="module")
def watched(pristine: Path, clip: Path) -> Ran:
    """`run --json --observations` over the clip."""
    return edge("run", "--config", pristine / "demo.yaml", "--source", f"file:{clip}", "--json", "--observations")


def test_the_demo_times_every_lap_and_writes_recording_and_report(race: Race, rig: Rig) -> None:
    """The demo makes exactly its laps, each within 20 ms of how it was driven, and ends with `run` naming the recording."""
    laps = race.ran.of("lap")
    assert [lap["number"] for lap in laps] == [lap.number for lap in rig.truth.laps] == [1, 2, 3]
    for lap, true in zip(laps, rig.truth.laps, strict=True):
        assert lap["time_s"] == pytest.approx(true.time_s, abs=0.020)
        assert (lap["valid"], lap["reasons"]) == (True, [])
    crossings = [crossing["t_s"] for crossing in race.ran.of("crossing")]
    assert crossings == pytest.approx(rig.truth.crossings_s, abs=0.020)
    assert [score["lap"] for score in race.ran.of("score")] == [1, 2, 3]
    end = race.ran.events[-1]
    assert (end["event"], end["laps"], Path(end["recording"])) == ("run", LAPS, race.recording)
    assert end["detected_frames"] >= 0.98 * end["frames"]
    assert len(list(race.directory.glob("*.html"))) == 1
    assert not list(race.directory.glob("*.part"))
    assert "Traceback" not in race.ran.err


def test_scoring_the_recording_again_gives_the_same_numbers(race: Race) -> None:
    """`score --json` prints all that the live run said again, bit for bit, but for the appliance's own health."""
    again = edge("score", race.recording, "--json")
    assert (again.code, again.err) == (0, "")
    live = [line for line in race.ran.out.splitlines() if json.loads(line)["event"] != "health"]
    assert again.out.splitlines() == live


def test_score_for_people_names_every_lap(race: Race) -> None:
    """Without --json: the recording, a line a lap with the time, and the count."""
    ran = edge("score", race.directory)
    assert (ran.code, ran.err) == (0, "")
    first, *laps, last = ran.out.splitlines()
    assert str(race.recording) in first
    times = [f"{lap['time_s']:.3f} s" for lap in race.ran.of("lap")]
    assert [time in line for time, line in zip(times, laps, strict=True)] == [True] * LAPS
    assert f"{LAPS} laps" in last


def test_observations_are_added_and_nothing_else_changes(watched: Ran, pristine: Path, clip: Path) -> None:
    """Two runs over one clip print the same bytes, but for the observations, one a frame, and the running laps that
    --observations adds."""
    assert (watched.code, watched.err) == (0, "")
    plain = edge("run", "--config", pristine / "demo.yaml", "--source", f"file:{clip}", "--json")
    assert (plain.code, plain.err) == (0, "")
    lines = watched.out.splitlines()
    added = ("observation", "running")
    assert [line for line in lines if json.loads(line)["event"] not in added] == plain.out.splitlines()
    observations = watched.of("observation")
    assert [one["t_ns"] for one in observations] == sorted({one["t_ns"] for one in observations})
    assert len(observations) >= 0.98 * CLIP_FRAMES
    assert {"t_s", "camera_px", "track_m", "confidence"} <= observations[0].keys()


def test_two_runs_over_one_clip_are_identical(watched: Ran, pristine: Path, clip: Path) -> None:
    """Byte for byte, observations and health included."""
    words = ("run", "--config", pristine / "demo.yaml", "--source", f"file:{clip}", "--json", "--observations")
    assert edge(*words).out == watched.out


def test_a_run_prints_json_only_and_its_summary_last(watched: Ran) -> None:
    """Every line of stdout is an object with `event`; `run` comes once, at the end, with the counts."""
    kinds = {"observation", "crossing", "running", "race", "standings", "health", "run"}
    assert {event["event"] for event in watched.events} == kinds
    assert [event["event"] for event in watched.events].count("run") == 1
    end = watched.events[-1]
    assert end == {
        "event": "run",
        "frames": CLIP_FRAMES,
        "detected_frames": CLIP_FRAMES,
        "laps": 0,
        "recording": None,
        "bad_pictures": [],
    }
    (health,) = [health for health in watched.of("health") if health["t_s"] == pytest.approx(1.0)]
    assert (health["fps"], health["display"], health["recording"]) == (pytest.approx(30.0), "none", "none")


def test_a_recording_is_a_source_too(race: Race, tmp_path: Path) -> None:
    """`mcap:` races the recorded pictures, which are fewer than the frames, and keeps their stamps."""
    words = ("run", "--config", race.directory / "demo.yaml", "--source", f"mcap:{race.recording}", "--json")
    ran = edge(*words, "--set", "race.max_gap_s=5")
    assert ran.code == 0
    live = race.ran.events[-1]["frames"]
    assert live / 7 < ran.events[-1]["frames"] < live / 5
    assert ran.of("health")[-1]["t_s"] == pytest.approx(race.ran.of("health")[-1]["t_s"], abs=0.2)


def test_laps_ends_the_run(race: Race) -> None:
    """`--laps 1` ends after one complete lap, exactly as the long run had it."""
    words = ("run", "--config", race.directory / "demo.yaml", "--source", f"sim:?laps={LAPS}", "--laps", 1, "--json")
    ran = edge(*words)
    assert ran.code == 0
    assert ran.of("lap") == race.ran.of("lap")[:1]
    assert ran.events[-1]["frames"] < race.ran.events[-1]["frames"]


def test_the_table_comes_as_text_csv_and_json(race: Race) -> None:
    """One entry: name, path similarity and completion time, the same in all three forms."""
    text, as_csv, as_json = (edge("table", race.recording, "--format", form) for form in ("text", "csv", "json"))
    assert [ran.code for ran in (text, as_csv, as_json)] == [0, 0, 0]
    (entry,) = [json.loads(line) for line in as_json.out.splitlines()]
    (row,) = csv.DictReader(io.StringIO(as_csv.out))
    assert "simulated car" in text.out
    assert "simulated car" in row.values()
    assert "simulated car" in entry.values()
    laps = race.ran.of("lap")
    mean_s = sum(lap["time_s"] for lap in laps) / LAPS
    assert f"{mean_s:.2f}"[:-1] in text.out
    assert edge("table", race.recording, "--json").out == as_json.out


def test_the_report_is_one_page_that_needs_nothing_else(race: Race, tmp_path: Path) -> None:
    """`report --out` writes one HTML file with pictures and without a reference outside itself; the recording stays."""
    before = race.recording.read_bytes()
    ran = edge("report", race.recording, "--out", tmp_path / "new")
    assert (ran.code, ran.err) == (0, "")
    (page,) = (tmp_path / "new").iterdir()
    assert str(page) in ran.out
    html = page.read_text(encoding="utf-8")
    (by_demo,) = race.directory.glob("*.html")
    assert (page.name, html) == (by_demo.name, by_demo.read_text(encoding="utf-8"))
    references = re.findall(r"""(?:src|href|action|data)\s*=\s*["']([^"']*)|url\(\s*["']?([^"')]*)|@import""", html)
    assert references
    assert all((a or b).startswith(("data:", "#")) for a, b in references)
    assert all(f"{lap['time_s']:.3f}" in html for lap in race.ran.of("lap"))
    assert race.recording.read_bytes() == before


@pytest.mark.parametrize("verb", ["score", "table", "report", "run"])
def test_a_truncated_recording_is_refused(race: Race, tmp_path: Path, verb: str) -> None:
    """A recording that lost its end gives no numbers: one line that says so and what to do, code 2, and no output."""
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(race.recording.read_bytes()[:-100_000])
    words = {
        "run": (
            "run",
            "--config",
            race.directory / "demo.yaml",
            "--source",
            f"mcap:{cut}",
            "--record",
            tmp_path / "new",
        ),
        "report": ("report", cut, "--out", tmp_path / "new"),
    }
    ran = edge(*words.get(verb, (verb, cut)))
    assert (ran.code, ran.out) == (2, "")
    line = ran.complaint()
    assert "cut.mcap" in line
    assert "truncated" in line
    assert "dnb-edge runs recover" in line
    assert list(tmp_path.iterdir()) == [cut]


def test_a_poor_view_is_timed_but_not_scored(race: Race) -> None:
    """Above the limit of the calibration error laps are timed and get no similarity; stderr, once, and Health say why."""
    words = ("run", "--config", race.directory / "demo.yaml", "--source", "sim:?laps=1", "--json")
    ran = edge(*words, "--set", "view.max_mean_error_m=0.000000000001")
    assert ran.code == 0
    (lap,) = ran.of("lap")
    assert lap["similarity_percent"] is None
    assert lap["valid"]
    assert ran.of("score") == []
    assert "not scored: the homography's mean keypoint error is " in ran.complaint()
    assert all("not scored" in " ".join(health["warnings"]) for health in ran.of("health"))


def test_config_show_is_a_configuration(pristine: Path, tmp_path: Path) -> None:
    """`config show` prints all keys in force, overrides included, as YAML that `config check` calls right and shows again."""
    shown = edge("config", "show", pristine / "demo.yaml", "--set", "race.laps=7")
    assert (shown.code, shown.err) == (0, "")
    data = yaml.safe_load(shown.out)
    assert data["race"]["laps"] == 7
    assert data["track"]["image"] == str(pristine / "twin.png")
    (tmp_path / "all.yaml").write_text(shown.out)
    checked = edge("config", "check", tmp_path / "all.yaml")
    assert (checked.code, checked.err) == (0, "")
    assert edge("config", "show", tmp_path / "all.yaml").out == shown.out


def test_the_schema_knows_every_key() -> None:
    """`config schema` prints JSON Schema with all sections and a description for every key; others are not allowed."""
    ran = edge("config", "schema")
    assert (ran.code, ran.err) == (0, "")
    schema = json.loads(ran.out)
    assert {"track", "view", "race", "score", "record", "display"} <= schema["properties"].keys()
    objects = [schema, *(part for part in schema["$defs"].values() if "properties" in part)]
    assert len(objects) > 10
    assert all(part["additionalProperties"] is False for part in objects)
    keys = {name: key for part in objects for name, key in part["properties"].items()}
    assert [name for name, key in keys.items() if "description" not in key and "$ref" not in key] == []
