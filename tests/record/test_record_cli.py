"""`dnb-edge runs` as a script sees it."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from record_samples import HEADER, lap, recorder, small_run
from typer.testing import CliRunner, Result

from dnb_edge.cli import runs
from dnb_edge.errors import InputError, WorkError
from dnb_edge.record.writer import Recorder, RecordingSettings


def call(*words: object) -> Result:
    return CliRunner().invoke(runs.app, [str(word) for word in words])


def cut(path: Path) -> Path:
    part = path.rename(path.with_name(path.name + ".part"))
    part.write_bytes(part.read_bytes()[:-300])
    return part


def test_list_tells_how_each_recording_stands(tmp_path: Path) -> None:
    """Whole, cut and foreign files are listed with their state, laps and duration, the damaged ones with the reason."""
    whole = small_run(tmp_path)
    part = cut(small_run(tmp_path))
    (tmp_path / "notes.mcap").write_bytes(b"not mine")
    result = call("list", tmp_path, "--json")
    assert result.exit_code == 0
    notes, first, second = [json.loads(line) for line in result.stdout.splitlines()]
    assert (first["file"], first["state"], first["laps"], first["name"]) == (whole.name, "whole", 3, HEADER.name)
    assert first["duration_s"] == 59 * 33_000_000 / 1e9
    assert (second["file"], second["state"], second["laps"]) == (part.name, "part", 3)
    assert "truncated" in second["note"]
    assert (notes["state"], notes["laps"]) == ("damaged", None)
    assert "not an MCAP file" in notes["note"]
    text = call("list", tmp_path)
    assert text.exit_code == 0
    assert whole.name in text.stdout


def test_recover_makes_the_cut_one_whole(tmp_path: Path) -> None:
    """`runs recover DIR` leaves whole recordings only; with --json it tells what came back."""
    cut(small_run(tmp_path))
    result = call("recover", tmp_path, "--json")
    assert result.exit_code == 0
    (told,) = [json.loads(line) for line in result.stdout.splitlines()]
    assert (told["laps"], told["messages"] > 100, told["bad_parts"]) == (3, True, 0)
    assert Path(told["path"]).exists()
    assert [json.loads(line)["state"] for line in call("list", tmp_path, "--json").stdout.splitlines()] == ["whole"]
    again = call("recover", tmp_path)
    assert (again.exit_code, again.stdout) == (0, "nothing to recover\n")


def test_recover_goes_on_after_a_hopeless_file_and_fails_at_the_end(tmp_path: Path) -> None:
    """A file that cannot be recovered is told and the others are recovered all the same; the command fails."""
    (tmp_path / "a.mcap.part").write_bytes(b"")
    cut(small_run(tmp_path))
    result = call("recover", tmp_path)
    assert isinstance(result.exception, WorkError)
    assert "1 of 2 files could not be recovered" in str(result.exception)
    assert "3 laps recovered" in result.stdout
    assert "a.mcap.part: not an MCAP file" in result.stdout


def test_export_writes_the_laps_in_full(tmp_path: Path) -> None:
    """The CSV holds one row a lap with floats that read back exactly, to stdout or to a new file, never over one."""
    path = small_run(tmp_path)
    result = call("export", path)
    rows = list(csv.DictReader(io.StringIO(result.stdout)))
    assert [int(row["number"]) for row in rows] == [1, 2, 3]
    assert [float(row["time_s"]) for row in rows] == [n * 33_000_000 / 1e9 for n in (19, 39, 59)]
    assert (rows[0]["run"], rows[0]["valid"], rows[0]["reasons"]) == (HEADER.name, "true", "")
    target = tmp_path / "laps.csv"
    assert call("export", path, "-o", target).exit_code == 0
    assert target.read_bytes().decode() == result.stdout_bytes.decode()
    again = call("export", path, "-o", target)
    assert isinstance(again.exception, InputError)


@pytest.mark.parametrize("name", ["=1+1", "+1", "-1", "@x", "\tx", "\rx"])
def test_a_name_is_never_a_formula(tmp_path: Path, name: str) -> None:
    """A run called like a spreadsheet formula comes out as text."""
    writer = Recorder(RecordingSettings(directory=tmp_path), replace(HEADER, name=name))
    writer.add_event(lap(1, 1_000))
    (row,) = csv.DictReader(io.StringIO(call("export", writer.close()).stdout, newline=""))
    assert row["run"] == "'" + name


@pytest.mark.parametrize("command", ["list", "recover", "export"])
def test_what_is_not_there_is_an_input_error(tmp_path: Path, command: str) -> None:
    """A missing directory or file is told by name."""
    result = call(command, tmp_path / "nowhere")
    assert isinstance(result.exception, InputError)
    assert "nowhere" in str(result.exception)


def test_a_recording_under_way_is_listed(tmp_path: Path) -> None:
    """A run that is being recorded is listed as a part with its laps so far, and is not disturbed."""
    writer = recorder(tmp_path)
    writer.wait_saved(writer.add_event(lap(1, 1_000)))
    (told,) = [json.loads(line) for line in call("list", tmp_path, "--json").stdout.splitlines()]
    assert (told["state"], told["laps"]) == ("part", 1)
    writer.close()
