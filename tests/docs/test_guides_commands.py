"""What the documentation tells people to type can be typed: verbs and options are there, and the first lap is as promised."""

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from dnb_edge.cli.main import app

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    ROOT / "hardware" / "README.md",
    ROOT / "systemd" / "README.md",
]
FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
VERB = typer.main.get_command(app)


def typed(page: Path) -> list[str]:
    """Every line of a page's shell blocks that begins with the product's name, as far as a pipe."""
    text = "\n".join(
        body for kind, body in FENCED.findall(page.read_text(encoding="utf-8")) if kind in {"sh", "console"}
    )
    parts = (part for line in text.replace("\\\n", " ").splitlines() for part in re.split(r"(?:;|&&|\|) ", line))
    lines = (part.strip().removeprefix("$ ").removeprefix("sudo ") for part in parts)
    return [line for line in lines if re.match(r"dnb-edge (?!VERB)", line)]


def command(words: list[str]) -> tuple[Any, list[str]]:
    """The verb that the words name, and what is left of them."""
    found: Any = VERB
    while hasattr(found, "get_command") and words and not words[0].startswith("-"):
        name, *words = words
        below = found.get_command(typer.Context(found), name.split("|")[0])
        assert below is not None, f"there is no verb {name}"
        found = below
    return found, words


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_command_has_its_verb_and_options(page):
    """Each command of a page's shell blocks names a verb that is there, with options that it has."""
    for line in typed(page):
        words = shlex.split(line, comments=True)[1:]
        found, rest = command(words)
        known = {name for option in found.params for name in (*option.opts, *option.secondary_opts)} | {"--help"}
        named = [word.strip("[]").split("=")[0] for word in rest if re.match(r"\[?-{1,2}[a-z]", word)]
        assert set(named) <= known, f"{line}: {sorted(set(named) - known)}"


def test_the_quick_starts_blocks_are_shell():
    """Every block that a machine is to run is sound shell, and none of them asks for a camera."""
    page = (ROOT / "docs" / "quick-start.md").read_text(encoding="utf-8")
    blocks = [body for kind, body in FENCED.findall(page) if kind == "sh"]
    assert len(blocks) == 6
    for block in blocks:
        assert "/dev/" not in block
        subprocess.run(["bash", "-n"], input=block, text=True, check=True)
    assert "sudo ./install.sh\n" in blocks


def test_the_first_lap_is_as_the_quick_start_promises(tmp_path):
    """The command of the first timed lap prints the lap that the page shows."""
    page = (ROOT / "docs" / "quick-start.md").read_text(encoding="utf-8")
    (words,) = re.findall(r"^dnb-edge (demo .*) --out ~/first-lap$", page, re.MULTILINE)
    (promised,) = re.findall(r"^lap 1  ([\d.]+) s \+- 1 ms  similarity ([\d.]+) %$", page, re.MULTILINE)
    done = subprocess.run(
        [sys.executable, "-m", "dnb_edge", *words.split(), "--fast", "--out", str(tmp_path)],
        capture_output=True,
        text=True,
        check=True,
    )
    (told,) = re.findall(
        r"^lap 1  ([\d.]+) s \+- \d ms  similarity ([\d.]+) %$", done.stdout + done.stderr, re.MULTILINE
    )
    assert float(told[0]) == pytest.approx(float(promised[0]), abs=0.0015)
    assert float(told[1]) == pytest.approx(float(promised[1]), abs=0.2)
