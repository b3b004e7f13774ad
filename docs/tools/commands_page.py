"""docs/commands.md: every verb and sub-verb of `dnb-edge` once, with its arguments, options and defaults.

Knows Typer's commands as the command line registers them, and Markdown. Knows nothing of what a verb does.
"""

from __future__ import annotations

import enum
import inspect
import re
import types
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer
from page_text import cell, made_by, paragraphs

from dnb_edge.cli.main import app

PAGE = "docs/commands.md"

_ABOUT = """
Every verb of the command line, with what it takes. `dnb-edge VERB --help` shows the same in a terminal.

`--json` prints JSON on stdout, and everything else goes to stderr. Exit codes: 0 done, 1 the work failed, 2 the input or the
configuration is wrong.
"""

_WORDS = {int: "N", float: "X", Path: "PATH", str: "TEXT"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Verb:
    """One command of the tree: a verb, or a verb of several."""

    words: tuple[str, ...]
    """From `dnb-edge` on."""
    command: Any
    """Typer's command."""
    children: tuple[str, ...]
    """Names of its sub-verbs, in the order of the help; none for a command that does something itself."""

    @property
    def line(self) -> str:
        """As it is typed."""
        return " ".join(self.words)


def verbs() -> list[Verb]:
    """Every verb and sub-verb, in the order of the help; the first is `dnb-edge` itself."""
    return list(_walk(typer.main.get_command(app), ("dnb-edge",)))


def _walk(command: Any, words: tuple[str, ...]) -> Iterator[Verb]:
    children = tuple(command.list_commands(None)) if hasattr(command, "list_commands") else ()
    yield Verb(words=words, command=command, children=children)
    for name in children:
        yield from _walk(command.get_command(None, name), (*words, name))


def page() -> str:
    """The whole page, Markdown."""
    top, *rest = verbs()
    lines = [
        "# Commands",
        "",
        made_by(__file__),
        "",
        paragraphs(_ABOUT),
        "",
        "| verb | what |",
        "|---|---|",
        *(
            f"| [`{verb.line}`](#{_anchor(verb)}) | {cell(_first_sentence(verb))} |"
            for verb in rest
            if len(verb.words) == 2
        ),
        "",
        f"`{top.line} --version` prints the version.",
    ]
    for verb in rest:
        lines += ["", f"{'#' * len(verb.words)} {verb.line}", "", *_section(verb)]
    return "\n".join(lines) + "\n"


def _anchor(verb: Verb) -> str:
    return verb.line.replace(" ", "-")


def _first_sentence(verb: Verb) -> str:
    text = " ".join(inspect.cleandoc(verb.command.help or "").split("\n\n")[0].split())
    return re.split(r"(?<=[.;:]) ", text, maxsplit=1)[0].rstrip(".;:")


def _section(verb: Verb) -> list[str]:
    lines = [paragraphs(inspect.cleandoc(verb.command.help or ""))]
    if verb.children:
        names = ", ".join(f"[`{name}`](#{_anchor(verb)}-{name})" for name in verb.children)
        lines += ["", f"Its verbs: {names}."]
    shown = [
        param for param in verb.command.params if not getattr(param, "hidden", False) and "--help" not in param.opts
    ]
    if verb.children and not shown:
        return lines
    kinds = _annotations(verb.command.callback)
    arguments = [param for param in shown if not param.opts[0].startswith("-")]
    options = [param for param in shown if param.opts[0].startswith("-")]
    usage = [verb.line, *(_argument(param, kinds) for param in arguments), *(["[OPTIONS]"] if options else [])]
    lines += ["", "```", " ".join(usage), "```"]
    if arguments:
        lines += ["", "| argument | what |", "|---|---|"]
        lines += [f"| `{_argument(param, kinds)}` | {cell(param.help or '')} |" for param in arguments]
    if options:
        lines += ["", "| option | default | what |", "|---|---|---|"]
        lines += [f"| {_option(param, kinds)} | {_default(param)} | {cell(param.help or '')} |" for param in options]
    return lines


def _argument(param: Any, kinds: dict[str, Any]) -> str:
    name = (param.metavar or param.name.upper()).removesuffix("...")
    several = "..." if param.nargs == -1 or typing.get_origin(kinds.get(param.name)) is list else ""
    return f"{name}{several}" if param.required else f"[{name}{several}]"


def _option(param: Any, kinds: dict[str, Any]) -> str:
    kind = kinds.get(param.name)
    names = ", ".join(f"`{name}`" for name in param.opts)
    if kind is bool:
        return ", ".join([names, *(f"`{name}`" for name in param.secondary_opts)])
    if typing.get_origin(kind) in {list, tuple}:
        kind = typing.get_args(kind)[0]
    if param.metavar:
        word = param.metavar
    elif isinstance(kind, type) and issubclass(kind, enum.Enum):
        word = "|".join(str(member.value) for member in kind)
    else:
        word = next((word for of, word in _WORDS.items() if of is kind), "TEXT")
    return cell(f"{names[:-1]} {word}`")


def _default(param: Any) -> str:
    if param.required:
        return "required"
    value = param.default() if callable(param.default) else param.default
    if value is None or value is False or value in ((), [], ""):
        return ""
    if isinstance(value, (list, tuple)):
        value = " ".join(map(str, value))
    if value is True:
        return f"`{param.opts[0]}`"
    return f"`{cell(str(value.value if isinstance(value, enum.Enum) else value))}`"


def _annotations(callback: Any) -> dict[str, Any]:
    """The plain type of each parameter, without None and what Typer is told."""
    found = typing.get_type_hints(inspect.unwrap(callback))
    return {name: _plain(kind) for name, kind in found.items()}


def _plain(kind: Any) -> Any:
    if typing.get_origin(kind) in {typing.Union, types.UnionType}:
        parts = [part for part in typing.get_args(kind) if part is not type(None)]
        return _plain(parts[0])
    return kind
