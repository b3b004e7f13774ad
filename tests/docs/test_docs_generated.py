"""Pages that are made from code say what the code says now: nothing left out, nothing twice."""

import re
import types
import typing
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer
from pydantic import BaseModel
from write_pages import PAGES

from dnb_edge.cli.main import app
from dnb_edge.cli.verbs import VERBS
from dnb_edge.config.schema import Config

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.mark.parametrize("page", PAGES)
def test_a_made_page_is_as_its_script_writes_it_now(page: str) -> None:
    """Who changes an option, a key or a fault runs `make docs-pages` with it."""
    assert (DOCS.parent / page).read_text(encoding="utf-8") == PAGES[page](), f"{page} is stale: make docs-pages"


def keys(model: type[BaseModel], path: str = "") -> Iterator[tuple[str, bool]]:
    """Each key with its sections, and whether it is a number; kinds of penalties as KIND, as the page has them."""
    for name, field in model.model_fields.items():
        own = f"{path}.{name}" if path else name
        below = next((part for part in parts(field.annotation) if issubclass(part, BaseModel)), None)
        if below is None:
            yield own, bool({int, float} & set(parts(field.annotation)))
        else:
            yield from keys(below, re.sub(r"^penalties\.\w+$", "penalties.KIND", own))


def parts(kind: typing.Any) -> list[type]:
    """The plain types that an annotation is made of."""
    if isinstance(kind, type) and not isinstance(kind, types.GenericAlias):
        return [kind]
    return [part for inner in typing.get_args(kind) for part in parts(inner)]


KEYS = sorted(set(keys(Config)))


@pytest.mark.parametrize(("key", "is_number"), KEYS)
def test_every_key_is_told_with_type_unit_default_and_meaning(key: str, is_number: bool) -> None:
    """A key that is added to the schema without a text, or a number whose unit nobody can tell, is found here."""
    rows = re.findall(
        rf"^\| `{re.escape(key)}` \|(.*)\|$", (DOCS / "config.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert len(rows) == 1
    kind, unit, default, meaning = (cell.strip() for cell in re.split(r"(?<!\\)\|", rows[0]))
    assert kind
    assert default
    assert len(meaning) > 10
    assert unit or not is_number, "no unit: name it in the key, or in docs/tools/config_page.py"


def test_the_configuration_has_keys() -> None:
    """The walk above finds them: sections, sections within sections, and lists of sections."""
    names = {key for key, _ in KEYS}
    assert {"name", "track.measured.length_m", "penalties.KIND.seconds", "cars.colour", "web.foxglove.port"} <= names
    assert len(names) > 120


def lines_of(command: typing.Any, words: str) -> Iterator[tuple[str, typing.Any]]:
    """Each verb as it is typed, and its command."""
    yield words, command
    for name, child in getattr(command, "commands", {}).items():
        yield from lines_of(child, f"{words} {name}")


COMMANDS = {
    line: command
    for verb in VERBS
    for line, command in lines_of(typer.main.get_command(app).get_command(None, verb), f"dnb-edge {verb}")
}


@pytest.mark.parametrize("line", COMMANDS)
def test_every_verb_is_shown_once_with_all_its_options(line: str) -> None:
    """A verb, a sub-verb or an option that was added or removed is on the page, or not, with its meaning."""
    text = (DOCS / "commands.md").read_text(encoding="utf-8")
    sections = re.findall(rf"^##+ {re.escape(line)}$(.*?)(?=^##|\Z)", text, re.MULTILINE | re.DOTALL)
    assert len(sections) == 1
    for option in (name for param in COMMANDS[line].params for name in param.opts if name.startswith("--")):
        rows = re.findall(rf"^\|[^|]*`{re.escape(option)}[ `].*\| ([^|]+) \|$", sections[0], re.MULTILINE)
        assert option == "--help" or len(rows) == 1
    assert not re.search(r"\|\s*\|$", sections[0], re.MULTILINE), "an option or an argument has no help"


def test_no_verb_is_shown_that_is_not_there() -> None:
    """As many headings as there are verbs and sub-verbs."""
    headings = re.findall(r"^##+ (dnb-edge .*)$", (DOCS / "commands.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(headings) == sorted(COMMANDS)
