"""A model's complaints as one line that names the key and what to do.

Knows pydantic's complaints and the models' keys; where a key stands is asked of the caller.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from typing import Any

from pydantic import BaseModel, ValidationError

from dnb_edge.config.text import KeyPath, dotted


def explain(error: ValidationError, model: type[BaseModel], where: Callable[[KeyPath, bool], str], *, root: str) -> str:
    """One line for the first of `error`'s mistakes in a document like `model`, and the number of others.

    `where` says where a key stands; it is told too whether the key is unknown. `root` names the document itself.
    """
    first, *others = error.errors()
    path: KeyPath = tuple(part for part in first["loc"] if not (isinstance(part, str) and part.startswith("function-")))
    what = _what(first, path, model)
    key, colon, rest = what.partition(": ")
    if colon and (named := _named(key, path, model)):
        path, what = named, rest
    more = f" (and {len(others)} more)" if others else ""
    return f"{where(path, first['type'] == 'extra_forbidden')}: {dotted(path, root=root)}: {what}{more}"


def known_keys(path: KeyPath, model: Any) -> list[str]:
    """The keys that may stand under the key `path` of a document like `model`."""
    for part in path:
        if isinstance(part, int):
            continue
        field = getattr(model, "model_fields", {}).get(part)
        if field is None:
            return []
        options = [field.annotation, *getattr(field.annotation, "__args__", ())]
        model = next((option for option in options if hasattr(option, "model_fields")), None)
    return list(getattr(model, "model_fields", {}))


def _named(key: str, path: KeyPath, model: type[BaseModel]) -> KeyPath | None:
    """The key with which a section's own check began its text, whole or from the section on; None where that is no key."""
    parts: KeyPath = tuple(int(part) if part.isdecimal() else part for part in key.split("."))
    whole = parts if parts[: len(path)] == path else (*path, *parts)
    return whole if whole and (whole == path or str(whole[-1]) in known_keys(whole[:-1], model)) else None


def _what(mistake: Any, path: KeyPath, model: type[BaseModel]) -> str:
    if mistake["type"] == "extra_forbidden":
        close = difflib.get_close_matches(str(path[-1]), known_keys(path[:-1], model), n=1)
        return "unknown key" + (f", did you mean {close[0]}?" if close else "; see configs/ for the keys there are")
    if mistake["type"] == "missing":
        return "is missing: add it"
    if mistake["type"] == "model_type":
        return "must be a mapping of keys, {} for none"
    if mistake["type"] == "too_long":
        return f"{mistake['ctx']['actual_length']} are too many: {mistake['ctx']['max_length']} at most"
    text = str(mistake["msg"]).removeprefix("Value error, ")
    return text[0].lower() + text[1:]
