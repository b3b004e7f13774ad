"""`dnb-edge config rules`: what rule sets there are, and one of them to copy."""

from __future__ import annotations

from pathlib import Path

from edge_command import edge

from dnb_edge.config.rules import PRESETS


def test_every_rule_set_is_listed_on_a_line_of_its_own() -> None:
    """Its name, and what it is for."""
    ran = edge("config", "rules")
    assert (ran.code, ran.err) == (0, "")
    assert [line.split()[0] for line in ran.out.splitlines()] == list(PRESETS)
    assert all(line.endswith(".") for line in ran.out.splitlines())


def test_a_rule_set_is_printed_as_a_file_that_can_be_used(tmp_path: Path) -> None:
    """`config rules laps > mine.yaml`, and `config rules mine.yaml` reads it again."""
    ran = edge("config", "rules", "laps")
    (tmp_path / "mine.yaml").write_text(ran.out)
    assert edge("config", "rules", "mine.yaml", cwd=tmp_path).out == ran.out


def test_what_is_no_rule_set_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    """A name that is none, and a file with a mistake in it."""
    ran = edge("config", "rules", "papr")
    assert ran.code == 2
    assert "did you mean paper?" in ran.complaint()
    (tmp_path / "mine.yaml").write_text("name: mine\npenalties:\n  lost: {seconds: -1}\n")
    ran = edge("config", "rules", "mine.yaml", cwd=tmp_path)
    assert ran.code == 2
    assert "mine.yaml, line 3: penalties.lost.seconds: -1.0 must not be negative" in ran.complaint()
