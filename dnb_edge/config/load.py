"""YAML files to a checked `Config`: every mistake is one line that names the file, the line in it and the key.

Knows YAML and the command line's `--set`; knows nothing of what the values are used for.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import yaml
from pydantic import ValidationError

from dnb_edge.config.schema import CommandLineText, Config
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

DEEPEST = 20
"""Levels of nesting that a configuration may have."""


def load_config(path: Path, overrides: Sequence[str] = ()) -> Config:
    """The configuration in the YAML file `path`, changed by `overrides` of the form `key.path=value`.

    Raises `InputError` for a missing or unreadable file, bad YAML, an unknown or ill-typed key and a bad override.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InputError(f"{path}: cannot read the configuration: {reason}") from error
    data, lines = _parse(path, text)
    return check_config(data, base=path.resolve().parent, overrides=overrides, origin=str(path), lines=lines)


def check_config(
    data: dict[str, Any],
    *,
    base: Path,
    overrides: Sequence[str] = (),
    origin: str = "configuration",
    lines: dict[KeyPath, int] | None = None,
) -> Config:
    """`data`, plain YAML types, as a `Config`; relative paths are relative to `base`. Errors as for `load_config`."""
    given: dict[KeyPath, str] = {}
    for override in overrides:
        given[_override(data, override)] = override
    context: dict[str, Any] = {"base": base}
    if isinstance(data.get("data_dir"), str):
        root = Path.cwd() if isinstance(data["data_dir"], CommandLineText) else base
        context["data_dir"] = root / Path(data["data_dir"]).expanduser()
    try:
        return Config.model_validate(data, context=context)
    except ValidationError as error:
        raise InputError(_explain(error, origin, lines or {}, given)) from error


def _parse(path: Path, text: str) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """The file's data and the line of every key."""
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
        raise InputError(f"{path}: the configuration must be a mapping of keys, as in configs/drivenetbench.yaml")
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
                raise InputError(f"{path}, line {key.start_mark.line + 1}: {_dotted(here)} is given twice")
            lines[here] = key.start_mark.line + 1
            _note_lines(path, value, here, lines)
    elif isinstance(node, yaml.SequenceNode):
        for i, value in enumerate(node.value):
            lines[(*at, i)] = value.start_mark.line + 1
            _note_lines(path, value, (*at, i), lines)


def _override(data: dict[str, Any], override: str) -> KeyPath:
    """Applies one `key.path=value` to `data`; returns the key's path."""
    key, equals, text = override.partition("=")
    path = tuple(key.strip().split("."))
    if not equals or not all(path):
        raise InputError(f"--set {override}: must have the form key.path=value, such as race.laps=3")
    try:
        value = yaml.load(text, Loader=ConfigLoader)  # noqa: S506 a safe loader
    except yaml.YAMLError as error:
        raise InputError(f"--set {override}: the value is not valid YAML") from error
    here = data
    for part in path[:-1]:
        here = here.setdefault(part, {})
        if not isinstance(here, dict):
            raise InputError(f"--set {override}: {part} is a value and has no keys of its own")
    here[path[-1]] = CommandLineText(value) if isinstance(value, str) else value
    return path


def _explain(error: ValidationError, origin: str, lines: dict[KeyPath, int], given: dict[KeyPath, str]) -> str:
    """One line for the first mistake, and the number of others."""
    first, *others = error.errors()
    path: KeyPath = tuple(part for part in first["loc"] if not (isinstance(part, str) and part.startswith("function-")))
    what = _what(first, path)
    key, colon, rest = what.partition(": ")
    if colon and path and key.split(".")[: len(path)] == list(path):
        # A section's own check names the key itself.
        path, what = tuple(key.split(".")), rest
    where = next((f"--set {given[path[:n]]}" for n in range(len(path), 0, -1) if path[:n] in given), None)
    if where is None and first["type"] == "extra_forbidden" and path not in lines:
        # An unknown section that only an override has made.
        where = next((f"--set {text}" for at, text in given.items() if at[: len(path)] == path), None)
    if where is None:
        line = next((lines[path[:n]] for n in range(len(path), 0, -1) if path[:n] in lines), None)
        where = origin if line is None else f"{origin}, line {line}"
    more = f" (and {len(others)} more)" if others else ""
    return f"{where}: {_dotted(path)}: {what}{more}"


def _what(mistake: Any, path: KeyPath) -> str:
    if mistake["type"] == "extra_forbidden":
        close = difflib.get_close_matches(str(path[-1]), known_keys(path[:-1]), n=1)
        return "unknown key" + (f", did you mean {close[0]}?" if close else "; see configs/ for the keys there are")
    if mistake["type"] == "missing":
        return "is missing: add it"
    text = str(mistake["msg"]).removeprefix("Value error, ")
    return text[0].lower() + text[1:]


def known_keys(path: KeyPath) -> list[str]:
    """The keys that may stand under the key `path` of the configuration."""
    model: Any = Config
    for part in path:
        field = getattr(model, "model_fields", {}).get(part)
        if field is None:
            return []
        options = [field.annotation, *getattr(field.annotation, "__args__", ())]
        model = next((option for option in options if hasattr(option, "model_fields")), None)
    return list(getattr(model, "model_fields", {}))


def _dotted(path: KeyPath) -> str:
    return ".".join(str(part) for part in path) or "the configuration"
