"""Paths in a configuration: relative to its file, to `data_dir`, or, from the command line, to the working directory.

Knows where a value came from. Knows nothing of what lies at the path.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationInfo


class CommandLineText(str):
    """Text given with `--set`: a relative path in it is relative to the working directory, not to the config file."""

    __slots__ = ()


def _resolve(value: Any, info: ValidationInfo) -> Any:
    if not isinstance(value, str | Path):
        raise ValueError(f"must be a path, not {value!r}")  # noqa: TRY004 pydantic reports ValueErrors
    path = Path(value).expanduser()
    if path.is_absolute():
        return path
    base = Path.cwd() if isinstance(value, CommandLineText) else (info.context or {}).get("base", Path.cwd())
    return base / path


def _resolve_data(value: Any, info: ValidationInfo) -> Any:
    """As `_resolve`, within `data_dir` where one is given."""
    context = dict(info.context or {})
    data_dir = context.get("data_dir")
    if data_dir is not None and not isinstance(value, CommandLineText) and isinstance(value, str | Path):
        return value if Path(value).is_absolute() else data_dir / value
    return _resolve(value, info)


def names_a_file(rules: str) -> bool:
    """Whether a rule set is told by its file's path, not by its name."""
    return "/" in rules or rules.endswith((".yaml", ".yml"))


def resolve_rules(value: Any, info: ValidationInfo) -> Any:
    """As `_resolve`, where the value is the path of a rule set and not its name."""
    return str(_resolve(value, info)) if isinstance(value, str) and names_a_file(value) else value


ConfigPath = Annotated[Path, BeforeValidator(_resolve)]
"""A path; relative ones are relative to the config file."""

DataPath = Annotated[Path, BeforeValidator(_resolve_data)]
"""A path to input data; relative ones are relative to `data_dir` if that is given, else to the config file."""
