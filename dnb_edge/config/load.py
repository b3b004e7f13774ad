"""YAML files to a checked `Config`: every mistake is one line that names the file, the line in it and the key.

Knows YAML and the command line's `--set`; knows nothing of what the values are used for.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from dnb_edge.config.faults import explain
from dnb_edge.config.paths import CommandLineText
from dnb_edge.config.rules import NoSuchRules, RuleSet, load_rule_set, with_rules
from dnb_edge.config.schema import DEFAULT_RULES, Config
from dnb_edge.config.text import KeyPath, configuration_text, parse_lines, plain
from dnb_edge.errors import InputError

_RULES: KeyPath = ("rules",)
START_MODE: KeyPath = ("start", "mode")
"""The key that decides whether a rule set's start is of use."""


def load_config(path: Path, overrides: Sequence[str] = ()) -> Config:
    """The configuration in the YAML file `path`, changed by `overrides` of the form `key.path=value`.

    Raises `InputError` for a missing or unreadable file, bad YAML, an unknown or ill-typed key and a bad override.
    """
    data, lines = parse_lines(path, configuration_text(path), what="the configuration")
    return check_config(data, base=path.resolve().parent, overrides=overrides, origin=str(path), lines=lines)


def check_config(
    data: dict[str, Any],
    *,
    base: Path,
    overrides: Sequence[str] = (),
    origin: str = "configuration",
    lines: dict[KeyPath, int] | None = None,
) -> Config:
    """`data`, plain YAML types, as a `Config`; relative paths are relative to `base`. Errors as for `load_config`.

    What wins over what: an override over `data`, `data` over the rule set that it names.
    """
    lines = lines or {}
    changes = [parse_override(override) for override in overrides]
    given = {path: override for (path, _), override in zip(changes, overrides, strict=True)}
    if _RULES in given:
        data = data | {"rules": dict(changes)[_RULES]}
    rules = _rule_set(data, base, _where(_RULES, origin, lines, None, given, unknown=False))
    if rules is not None:
        data = with_rules(data, rules, start_mode=dict(changes).get(START_MODE))
    for (path, value), override in zip(changes, overrides, strict=True):
        set_key(data, path, value, override)
    context: dict[str, Any] = {"base": base}
    if isinstance(data.get("data_dir"), str):
        root = Path.cwd() if isinstance(data["data_dir"], CommandLineText) else base
        context["data_dir"] = root / Path(data["data_dir"]).expanduser()

    def where(path: KeyPath, unknown: bool) -> str:
        return _where(path, origin, lines, rules, given, unknown=unknown)

    try:
        return Config.model_validate(data, context=context)
    except ValidationError as error:
        raise InputError(explain(error, Config, where, root="the configuration")) from error


def _rule_set(data: dict[str, Any], base: Path, where: str) -> RuleSet | None:
    """The rule set that `data` names at `where`; None where what it names is no text, for the schema to refuse."""
    name = data.get("rules", DEFAULT_RULES)
    if not isinstance(name, str):
        return None
    try:
        return load_rule_set(name, Path.cwd() if isinstance(name, CommandLineText) else base)
    except NoSuchRules as error:
        raise InputError(f"{where}: rules: {error}") from error


def parse_override(override: str) -> tuple[KeyPath, Any]:
    """The key's path and the value of one `key.path=value`. Raises `InputError` where it has another form."""
    key, equals, text = override.partition("=")
    path = tuple(key.strip().split("."))
    if not equals or not all(path):
        raise InputError(f"--set {override}: must have the form key.path=value, such as race.laps=3")
    try:
        value = plain(text)
    except yaml.YAMLError as error:
        raise InputError(f"--set {override}: the value is not valid YAML") from error
    if isinstance(value, dict) and not text.lstrip().startswith("{"):
        # `sim:` and `a: b` are mappings to YAML and text to whoever writes them on a command line.
        value = text.strip()
    return path, CommandLineText(value) if isinstance(value, str) else value


def set_key(data: dict[str, Any], path: KeyPath, value: Any, override: str) -> None:
    """Puts `value` at `path` into `data`. Raises `InputError` naming `override` where something above it is no section."""
    here = data
    for part in path[:-1]:
        here = here.setdefault(str(part), {})
        if not isinstance(here, dict):
            raise InputError(f"--set {override}: {part} is a value and has no keys of its own")
    here[str(path[-1])] = value


def _where(
    path: KeyPath,
    origin: str,
    lines: dict[KeyPath, int],
    rules: RuleSet | None,
    given: dict[KeyPath, str],
    *,
    unknown: bool,
) -> str:
    """Where the key at `path` was given: on the command line, in the configuration, or in its rule set."""
    prefixes = [path[:n] for n in range(len(path), 0, -1)]
    override = next((given[at] for at in prefixes if at in given), None)
    if override is None and unknown and path not in lines:
        # An unknown section that only an override has made.
        override = next((text for at, text in given.items() if at[: len(path)] == path), None)
    if override is not None:
        return f"--set {override}"
    for at in prefixes:
        if at in lines:
            return f"{origin}, line {lines[at]}"
        if rules is not None and len(at) > 1 and at in rules.lines:
            return f"{rules.origin}, line {rules.lines[at]}"
    return origin
