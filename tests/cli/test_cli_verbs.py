"""Every verb explains itself."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from edge_command import edge, edge_cold
from typer.main import get_command
from typer.testing import CliRunner

from dnb_edge import __version__
from dnb_edge.cli.main import app


def verbs(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The words of every command and every group of commands."""
    yield path
    for name in command.list_commands(None) if hasattr(command, "list_commands") else ():
        yield from verbs(command.get_command(None, name), (*path, name))


VERBS = list(verbs(get_command(app)))


def test_the_verbs_are_those_of_the_contract() -> None:
    """None of the verbs that scripts know has gone."""
    contract = {
        ("demo",), ("run",), ("score",), ("table",), ("report",), ("bench",), ("track", "build"), ("track", "show"),
        ("calibrate", "keypoints"), ("calibrate", "markers"), ("calibrate", "lens"), ("calibrate", "check"),
        ("calibrate", "refine"), ("mount", "plan"), ("runs", "list"), ("runs", "recover"), ("runs", "export"),
        ("config", "show"), ("config", "check"), ("config", "schema"), ("doctor",),
    }  # fmt: skip
    assert contract <= set(VERBS)


@pytest.mark.parametrize("words", VERBS, ids=lambda words: " ".join(words) or "dnb-edge")
def test_help_explains_verb_and_options(words: tuple[str, ...]) -> None:
    """`--help` works for each, with a sentence on what it does and one for each of its options."""
    helped = CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, [*words, "--help"])
    assert helped.exit_code == 0
    assert re.search(r"^ *Usage: .*" + " ".join(words), helped.stdout, re.MULTILINE)
    assert re.search(r"^ +[A-Z].*\.\s*$", helped.stdout, re.MULTILINE)
    command = get_command(app)
    for word in words:
        command = command.get_command(None, word)
    assert [option.name for option in command.params if not getattr(option, "help", None)] == []


def test_the_command_says_its_version_and_without_words_its_help() -> None:
    """`--version` prints one line; the bare command prints its verbs and is a wrong command line."""
    assert edge_cold("--version").out == f"dnb-edge {__version__}\n"
    bare = edge_cold()
    assert bare.code == 2
    assert "demo" in bare.out + bare.err


@pytest.mark.parametrize("words", [words for words in VERBS if len(words) == 1], ids=lambda words: words[0])
def test_every_verb_starts_from_nothing(words: tuple[str, ...]) -> None:
    """With no other module imported before it, as from a shell."""
    assert edge_cold(*words, "--help").code == 0


@pytest.mark.parametrize(
    "words", [("--version",), ("run", "--source", "bogus:0"), ("score", "no-such.mcap"), ("nothing",)]
)
def test_a_warm_command_is_what_a_cold_one_is(words: tuple[str, ...]) -> None:
    """The tests' own short cut changes neither a stream nor an exit code."""
    assert edge(*words) == edge_cold(*words)
