"""YAML text to plain data and the line of every key.

Knows YAML as we write it and its mistakes; knows nothing of what the keys mean.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from dnb_edge.errors import InputError


class ConfigLoader(yaml.SafeLoader):
    """PyYAML's safe loader as in YAML 1.2 and as anybody expects: 1e-3 is a number, and a date is text."""


# Replaced, not changed: the list is PyYAML's own and shared with its other loaders.
ConfigLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:timestamp"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
ConfigLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?[0-9]+[eE][-+]?[0-9]+$"), list("-+0123456789")
)

KeyPath: TypeAlias = tuple[str | int, ...]
"""A key and those above it; whole numbers are places in a list, from 0."""

DEEPEST = 20
"""Levels of nesting that a file may have."""


def parse_lines(path: Path, text: str, *, what: str) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """The mapping in `text`, and the line of every key in it, from 1. `what` says what it should be, as in "the rule set".

    Raises `InputError` naming `path` and the line where it is no YAML, no mapping, or names a key twice.
    """
    try:
        node = yaml.compose(text, Loader=ConfigLoader)
        lines: dict[KeyPath, int] = {}
        if node is not None:
            _note_lines(path, node, (), lines)
        data = yaml.load(text, Loader=ConfigLoader)  # noqa: S506 a safe loader
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        raise InputError(f"{path}{where}: not valid YAML: {getattr(error, 'problem', None) or error}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path}: {what} must be a mapping of keys, as in configs/drivenetbench.yaml")
    return data, lines


def _note_lines(path: Path, node: yaml.Node, at: KeyPath, lines: dict[KeyPath, int]) -> None:
    if len(at) > DEEPEST:
        raise InputError(f"{path}, line {node.start_mark.line + 1}: nested too deeply, or within itself")
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise InputError(f"{path}, line {key.start_mark.line + 1}: a key must be a word")
            here = (*at, key.value)
            if here in lines:
                raise InputError(f"{path}, line {key.start_mark.line + 1}: {dotted(here)} is given twice")
            lines[here] = key.start_mark.line + 1
            _note_lines(path, value, here, lines)
    elif isinstance(node, yaml.SequenceNode):
        for i, value in enumerate(node.value):
            lines[(*at, i)] = value.start_mark.line + 1
            _note_lines(path, value, (*at, i), lines)


def dotted(path: KeyPath, *, root: str = "the configuration") -> str:
    """The key as a user writes it; `root` for the document itself."""
    return ".".join(str(part) for part in path) or root
