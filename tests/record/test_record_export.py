"""`dnb-edge runs export` and `list`: laps with all that was made of them, passes and incidents, entry and session."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from record_samples import HEADER, lap, small_run
from typer.testing import CliRunner, Result

from dnb_edge.cli import runs
from dnb_edge.errors import InputError
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.values import (
    Crossing,
    Direction,
    EntryInfo,
    Incident,
    IncidentKind,
    PassStatus,
    Penalty,
    SectorTime,
)

PASS = Crossing(
    t_ns=1_000,
    t_s=1e-6,
    line="start",
    direction=Direction.FORWARD,
    sigma_s=0.002,
    track_m=(1.5, 0.25),
    target_id=3,
    estimated=False,
    speed_mps=1.25,
    status=PassStatus.IGNORED,
    reason="sooner than 2 s after the one before",
    car=2,
)
OFF = Incident(
    number=1,
    kind=IncidentKind.OFF_TRACK,
    car=2,
    target_id=3,
    lap=1,
    start_t_ns=500,
    end_t_ns=900,
    start_s=5e-7,
    lasted_s=0.4,
    greatest_m=0.123,
    worst_t_ns=700,
    track_m=(1.0, 2.0),
    camera_px=(320.0, 240.5),
    s_m=3.5,
    text="=2 cm beyond the lane",
)
JUDGED = replace(
    lap(1, 2_000),
    car=2,
    valid=False,
    reasons=("left the lane",),
    sectors=(
        SectorTime(number=1, line="sector 1", time_s=1 / 3, sigma_s=0.003),
        SectorTime(number=2, line="start", time_s=None, sigma_s=None),
    ),
    penalties=(
        Penalty(offence="off_track", seconds=3.0, invalid=True, reason="0.12 m beyond the lane", incident=1),
        Penalty(offence="judge", factor=0.5, reason="pushed"),
    ),
    penalty_s=3.0,
    penalty_factor=0.5,
    official_time_s=3.000002,
    estimated=True,
)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A recording with a pass, an incident and a lap."""
    header = replace(
        HEADER, entry=EntryInfo(name=HEADER.name, version="v2", checkpoint_sha256="ab" * 32), session="monday"
    )
    writer = Recorder(RecordingSettings(directory=tmp_path), header)
    for event in (PASS, OFF, JUDGED):
        writer.add_event(event)
    return writer.close()


def call(*words: object) -> Result:
    return CliRunner().invoke(runs.app, [str(word) for word in words])


def rows(*words: object) -> list[dict[str, str]]:
    ran = call("export", *words)
    assert ran.exit_code == 0, ran.exception
    return list(csv.DictReader(io.StringIO(ran.stdout)))


def test_laps_have_sectors_penalties_and_official_times(run: Path) -> None:
    """All that was made of a lap, after the columns that were always there."""
    (row,) = rows(run)
    assert list(row)[:10] == [
        "run", "number", "start_s", "time_s", "sigma_s", "valid", "reasons", "similarity_percent", "observed_fraction",
        "suspect",
    ]  # fmt: skip
    assert (row["car"], row["valid"], row["estimated"]) == ("2", "false", "true")
    assert (row["official_time_s"], row["penalty_s"], row["penalty_factor"]) == ("3.000002", "3.0", "0.5")
    assert row["penalties"] == "off_track: +3 s, not valid (0.12 m beyond the lane); judge: x 0.5 (pushed)"
    assert (float(row["sector_1_s"]), row["sector_1_sigma_s"]) == (1 / 3, "0.003")
    assert (row["sector_2_s"], row["sector_2_sigma_s"]) == ("", "")


def test_passes_and_incidents_are_tables_of_their_own(run: Path) -> None:
    """Each pass with its status and reason, each incident with place, extent and words; no cell is a formula."""
    (one,) = rows(run, "--what", "passes")
    assert (one["line"], one["status"], one["reason"]) == ("start", "ignored", PASS.reason)
    assert (one["car"], one["lap"], one["speed_mps"], one["x_m"], one["y_m"]) == ("2", "", "1.25", "1.5", "0.25")
    (other,) = rows(run, "--what", "incidents")
    assert (other["kind"], other["greatest_m"], other["u_px"], other["v_px"]) == (
        "off_track",
        "0.123",
        "320.0",
        "240.5",
    )
    assert other["text"] == "'=2 cm beyond the lane"


def test_everything_goes_into_three_files(run: Path, tmp_path: Path) -> None:
    """`--what all` writes what each export writes by itself, and nothing where one of them is there already."""
    assert call("export", run, "--what", "all", "-o", tmp_path / "x.csv").exit_code == 0
    for what in ("laps", "passes", "incidents"):
        written = (tmp_path / f"x-{what}.csv").read_bytes()
        assert written == call("export", run, "--what", what).stdout_bytes
    (tmp_path / "y-incidents.csv").touch()
    ran = call("export", run, "--what", "all", "-o", tmp_path / "y.csv")
    assert isinstance(ran.exception, InputError)
    assert not (tmp_path / "y-laps.csv").exists()
    assert isinstance(call("export", run, "--what", "all").exception, InputError)


def test_list_tells_entry_and_session(run: Path) -> None:
    """Version, checkpoint and session are listed; an old recording has none, and no digests where its setup is not ours."""
    small_run(run.parent)
    told, old = [json.loads(line) for line in call("list", run.parent, "--json").stdout.splitlines()]
    assert (told["name"], told["version"], told["session"]) == (HEADER.name, "v2", "monday")
    assert told["checkpoint_sha256"] == "ab" * 32
    assert (old["version"], old["session"], old["track"], old["rules"]) == (None, None, None, None)
    text = CliRunner().invoke(runs.app, ["list", str(run.parent)], env={"COLUMNS": "160"}).stdout
    assert "session" in text
    assert "monday" in text
