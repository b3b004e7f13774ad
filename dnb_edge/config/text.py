"""YAML text to plain data and the line of every key.

Knows YAML as we write it, its mistakes and its traps: text that is small to read and without end to unfold. Knows nothing of
what the keys mean.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from dnb_edge.errors import InputError


class ConfigLoader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """PyYAML's safe loader as in YAML 1.2 and as anybody expects: 1e-3 is a number, and a date is text.

    Libyaml's where there is one, which is 15 times faster: a track has thousands of numbers.
    """


# Replaced, not changed: the list is PyYAML's own and shared with its other loaders.
ConfigLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:timestamp"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
ConfigLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?[0-9]+[eE][-+]?[0-9]+$"), list("-+0123456789")
)


def _whole(loader: Any, node: yaml.ScalarNode) -> int:
    """A whole number of 64 bits: Python cannot even tell one of thousands of digits."""
    value: int = loader.construct_yaml_int(node)
    if not abs(value) < 2**63:
        raise _fault("a whole number of more than 64 bits", node.start_mark)
    return value


ConfigLoader.add_constructor("tag:yaml.org,2002:int", _whole)

KeyPath: TypeAlias = tuple[str | int, ...]
"""A key and those above it; whole numbers are places in a list, from 0."""

DEEPEST = 20
"""Levels of nesting that a file may have."""

MOST_VALUES = 100_000
"""Values and keys that a file may have, each counted as often as an alias stands for it: a track of 20 000 points."""

MOST_CHARACTERS = 4_000_000


def configuration_text(path: Path) -> str:
    """The text of the configuration file at `path`. Raises `InputError` for a missing or unreadable one."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InputError(f"{path}: cannot read the configuration: {reason}") from error


def plain(text: str, look: Callable[[yaml.Node], None] | None = None) -> Any:
    """The one document in `text` as plain data; None where there is none. `look` is shown its tree first.

    Raises `yaml.YAMLError` where it is not valid YAML, a value is not what its tag says it is, or it is deeper or larger than
    any file of ours, as it stands or with its aliases unfolded.
    """
    if len(text) > MOST_CHARACTERS:
        raise _fault(f"longer than {MOST_CHARACTERS} characters")
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise _fault("it holds what is no character") from error
    _check_nesting(text)
    reader = ConfigLoader(text)
    try:
        node = reader.get_single_node()
        if node is None:
            return None
        _count(node, 0, 0)
        if look is not None:
            look(node)
        return reader.construct_document(node)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        # What PyYAML's constructors say of `!!int x`, `!!bool x`, `!!timestamp x` or a number of 5000 digits.
        raise _fault("a value is not what its tag or its form says it is") from error
    finally:
        reader.dispose()


def _fault(problem: str, mark: Any = None) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=mark)


def _check_nesting(text: str) -> None:
    """Before the composer sees it, which calls itself for each level: libyaml's until the stack ends, and the process."""
    depth = 0
    for event in yaml.parse(text, Loader=ConfigLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise _fault("nested too deeply", event.start_mark)


def _count(node: yaml.Node, depth: int, count: int) -> int:
    """`count` and all of `node`, with aliases unfolded, as whoever goes through the data meets them."""
    count += 1
    if depth > DEEPEST:
        raise _fault("nested too deeply, or within itself", node.start_mark)
    if count > MOST_VALUES:
        raise _fault(f"more than {MOST_VALUES} values", node.start_mark)
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            count = _count(value, depth + 1, _count(key, depth + 1, count))
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            count = _count(value, depth + 1, count)
    return count


def parse_lines(path: Path, text: str, *, what: str) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """The mapping in `text`, and the line of every key in it, from 1. `what` says what it should be, as in "the rule set".

    Raises `InputError` naming `path` and the line where it is no YAML, no mapping, or names a key twice.
    """
    lines: dict[KeyPath, int] = {}
    try:
        data = plain(text, lambda node: _note_lines(path, node, (), lines))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        raise InputError(f"{path}{where}: not valid YAML: {getattr(error, 'problem', None) or error}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path}: {what} must be a mapping of keys, as in configs/drivenetbench.yaml")
    return data, lines


def _note_lines(path: Path, node: yaml.Node, at: KeyPath, lines: dict[KeyPath, int]) -> None:
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
