"""`dnb-edge report`: whose page it is, and what other lines, rules and a judge change on it."""

from __future__ import annotations

from html import unescape
from pathlib import Path

import pytest
from table_runs import Car, record
from typer.testing import CliRunner

from dnb_edge.cli.main import app
from dnb_edge.errors import InputError

CAR = Car((3.0, 3.1, 2.9, 3.2))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A recording of one car with four laps on a circle of 1 m about (200, 200) twin px, the start line at its right."""
    return record(tmp_path, "run.mcap", CAR)


def page(run: Path, *words: object) -> str:
    """The report that is written under these options, as text."""
    out = run.parent / "report"
    ran = CliRunner().invoke(app, ["report", str(run), "--out", str(out), *map(str, words)])
    assert ran.exit_code == 0, ran.exception
    assert ran.stdout == f"Report: {out / 'run.html'}\n"
    return unescape((out / "run.html").read_text(encoding="utf-8"))


def test_the_rules_are_told_with_their_digest(run: Path) -> None:
    """The rule set of the run; nothing was changed since."""
    told = page(run)
    assert "<dt>Rules</dt><dd>practice, version 1, digest " in told
    assert "Changed since the run" not in told
    digests = told[told.index("Digests of the conditions") :]
    assert all(f"<dt>{name}</dt><dd>" in digests for name in ("track", "calibration", "rules"))
    assert "4 valid of 4" in told
    assert "Along the route" in told


def test_another_line_and_another_rule_are_on_the_page(run: Path) -> None:
    """The same options as `score`: what was changed is said, sectors appear, a lap is not valid any more."""
    told = page(run, "--line", "half=AT:100,200", "--set", "race.max_lap_s=3.15")
    assert "<dt>Changed since the run</dt>" in told
    assert "line half added" in told
    assert "race.max_lap_s 3.15" in told
    assert "3 valid of 4" in told
    assert "Sector 2 (s)" in told
    before = page(run)
    assert "Sector 2 (s)" not in before


def test_another_rule_set_is_named(run: Path) -> None:
    """`--rules` by name."""
    assert "<dd>time-limit, version " in page(run, "--rules", "time-limit")


def test_no_edits_is_what_the_race_said(run: Path) -> None:
    """A judge's decisions are on the page unless they are not wanted."""
    words = ["judge", "remove", str(run), "--lap", "2", "--because", "carried <home>", "--by", "Ada"]
    assert CliRunner().invoke(app, words).exit_code == 0
    edited = page(run)
    assert "3 valid of 3" in edited
    assert "carried <home>" in edited
    raw = page(run, "--no-edits")
    assert "4 valid of 4" in raw
    assert "carried" not in raw


def test_a_wrong_option_is_refused_and_writes_nothing(run: Path) -> None:
    """One line that names the option; no page."""
    ran = CliRunner().invoke(app, ["report", str(run), "--out", str(run.parent / "new"), "--set", "camera.fps=3"])
    assert isinstance(ran.exception, InputError)
    assert "--set camera.fps=3" in str(ran.exception)
    assert not (run.parent / "new").exists()
