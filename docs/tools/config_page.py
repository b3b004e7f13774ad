"""docs/config.md: every key of the configuration with its type, unit, default and meaning, from the schema itself.

Knows the JSON Schema of the configuration, and Markdown. What a key means is written where it is declared, in
dnb_edge/config and in the core's settings; nothing of that is repeated here.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import Any

from page_text import cell, listed, made_by, paragraphs

from dnb_edge.config.schema import Config

PAGE = "docs/config.md"

UNITS = {
    "m": "metres", "px": "px", "s": "seconds", "us": "microseconds", "k": "kelvin", "hz": "hertz", "mb": "megabytes",
    "gb": "gigabytes", "h": "hours", "mps": "metres per second", "mps2": "metres per second squared",
    "fps": "frames per second", "seconds": "seconds",
}  # fmt: skip
"""Units by the last word of a key."""

RATES = {"metres_per_px": "metres per px", "download_mb_per_s": "megabytes per second", "pictures_per_s": "per second"}
"""Units of keys that end in `per_` something."""

COUNTS = {
    "track.lane_hsv": "degrees, percent, percent",
    "detector.min_confidence": "share", "detector.iou": "share", "detector.shift_ratio": "share",
    "detector.sigma_ratio": "share", "detector.markers.least_confidence": "share", "crossing.lasting_share": "share",
    "race.min_progress": "share", "penalties.KIND.factor": "factor", "motion.gate": "sigmas squared",
    "detector.threads": "count", "motion.confirm_observations": "count", "motion.cars": "count", "race.laps": "laps",
    "format.best_of": "laps", "format.warm_up_laps": "laps", "penalties.KIND.free": "count", "score.points": "count",
    "web.most_downloads": "count", "detector.markers.full_look_every": "frames",
    "detector.markers.missing_look_every": "frames", "cars.colour": "0 to 255",
    "detector.classes": "number", "detector.markers.ids": "number", "cars.marker": "number",
    "start.seed": "number", "web.port": "number", "web.foxglove.port": "number",
    "capture.gain": "the camera's own", "capture.focus": "the camera's own", "capture.controls": "the camera's own",
}  # fmt: skip
"""What is counted by keys of numbers that have no unit in their name. A new one is added here, or given a unit."""

_ABOUT = """
A configuration is one YAML file. Only `track` and `view` are needed; every other key has a default that suits most tracks.
A key that is not known is refused, with its name, the file and the line.
"""

_TRY = """\
```sh
dnb-edge config check my-track.yaml      # is it right?
dnb-edge config show my-track.yaml       # every key that is in force, defaults and rule set included
dnb-edge run --config my-track.yaml --set race.laps=5    # one key for one run
dnb-edge config schema > schema.json     # for editors that complete and check YAML
```""".splitlines()

_BEGIN = """
Copy [configs/example.yaml](../configs/example.yaml) to begin with, or set the track up [on the pages](setup.md), which write
the file. Paths are relative to the file in which they stand. A [rule set](rules.md) gives `race`, `start`, `format`,
`penalties` and `score` other defaults than those below.
"""

ALIKE = 3
"""So many keys of one section that are the same kind of section are described once, as KIND."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """One key of the configuration, as the page tells it."""

    path: str
    """With its sections, dotted; KIND stands for each of several sections that are alike."""
    kind: str
    """Its type, in words."""
    unit: str
    """Blank for what is no number."""
    default: str
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A section: what it is about, and its keys."""

    path: str
    """Blank for the configuration itself."""
    about: str
    keys: tuple[Key, ...]


def sections() -> list[Section]:
    """All sections, in the order of the schema; each key stands in one of them."""
    schema = Config.model_json_schema()
    return _sections("", schema, schema["$defs"])


def page() -> str:
    """The whole page, Markdown."""
    lines = [
        "# Every key of the configuration",
        "",
        made_by(__file__),
        "",
        paragraphs(_ABOUT),
        "",
        *_TRY,
        "",
        paragraphs(_BEGIN),
    ]
    for section in sections():
        if section.path:
            lines += ["", f"{'#' * (2 + section.path.count('.'))} {section.path}", "", paragraphs(section.about)]
        lines += ["", "| key | type | unit | default | meaning |", "|---|---|---|---|---|"]
        lines += [
            f"| `{key.path}` | {cell(key.kind)} | {key.unit} | {cell(key.default)} | {cell(key.meaning)} |"
            for key in section.keys
        ]
    return "\n".join(lines) + "\n"


def _sections(path: str, schema: dict[str, Any], models: dict[str, Any]) -> list[Section]:
    fields: dict[str, dict[str, Any]] = schema["properties"]
    inner = {
        name: model for name, field in fields.items() if (model := _model(field)) and "properties" in models[model]
    }
    alike = next((model for model in inner.values() if list(inner.values()).count(model) >= ALIKE), None)
    keys, below = [], []
    for name, field in fields.items():
        own = f"{path}.{name}" if path else name
        if path or name not in inner or field.get("type") == "array":
            keys.append(_key(own, field, models, required=name in schema.get("required", ())))
        if name in inner and inner[name] != alike:
            below += _sections(own, models[inner[name]], models)
    if alike:
        below += _sections(f"{path}.KIND", models[alike], models)
    return [Section(path=path, about=schema.get("description", "") if path else "", keys=tuple(keys)), *below]


def _model(field: dict[str, Any]) -> str | None:
    """The name of the model that a field is of, or is a list of."""
    for part in (field, field.get("items", {}), *field.get("anyOf", ())):
        if "$ref" in part:
            return str(part["$ref"]).rpartition("/")[2]
    return None


def _key(path: str, field: dict[str, Any], models: dict[str, Any], *, required: bool) -> Key:
    # A further camera's keys are those of the first one.
    own, kind = path.removeprefix("further_cameras."), _kind(field, path, models)
    return Key(
        path=path,
        kind=kind,
        unit=_unit(own) if "number" in kind or own in COUNTS else "",
        default="required" if required else _default(field.get("default"), models.get(_model(field) or "", {})),
        meaning=field.get("description", ""),
    )


def _unit(path: str) -> str:
    name = path.rpartition(".")[2]
    if path in COUNTS:
        return COUNTS[path]
    if "_per_" in name:
        return RATES.get(name, "")
    return UNITS.get(name.rpartition("_")[2], "")


def _default(value: Any, model: dict[str, Any]) -> str:
    if isinstance(value, dict) and "properties" in model:
        usual = {name: part.get("default") for name, part in model["properties"].items()}
        other = {name: part for name, part in value.items() if part != usual[name]}
        return (
            f"`{{{', '.join(f'{name}: {json.dumps(part)}' for name, part in other.items())}}}`" if other else "as below"
        )
    if value is None or value in ([], {}, ""):
        return "none"
    return f"`{value if isinstance(value, str) else json.dumps(value)}`"


def _kind(schema: dict[str, Any], path: str, models: dict[str, Any]) -> str:
    if "anyOf" in schema:
        parts = [_kind(part, path, models) for part in schema["anyOf"] if part.get("type") != "null"]
        return listed(parts)
    if "$ref" in schema:
        model = models[_model(schema) or ""]
        if "properties" not in model:
            return _kind(model, path, models)
        return "a section"
    if "const" in schema:
        return f"`{schema['const']}`"
    if "enum" in schema:
        return listed([f"`{word}`" for word in schema["enum"]])
    return _plain(schema, path, models)


def _plain(schema: dict[str, Any], path: str, models: dict[str, Any]) -> str:
    kind = schema["type"]
    if kind == "array" and "prefixItems" in schema:
        return f"[{', '.join(_bare(_kind(part, path, models)) for part in schema['prefixItems'])}]"
    if kind == "array":
        return f"list of {_kind(schema['items'], path, models)}".replace("list of a section", "list of sections")
    if kind == "object":
        return f"names, each with a {_kind(schema['additionalProperties'], path, models)}"
    if kind == "string":
        return "path" if schema.get("format") == "path" else "`'#rrggbb'`" if "pattern" in schema else "text"
    if kind == "boolean":
        return "`true` or `false`"
    return ("whole number" if kind == "integer" else "number") + _bounds(schema)


def _bare(kind: str) -> str:
    """A number within a list: its bounds would fill the table."""
    return re.sub(r"(number)[^\[\]]*$", r"\1", kind) if kind.startswith(("number", "whole")) else kind


def _bounds(schema: dict[str, Any]) -> str:
    low, high = schema.get("minimum"), schema.get("maximum")
    above, below = schema.get("exclusiveMinimum"), schema.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f", {low} to {high}"
    told = [f"above {above}" if above is not None else "", f"below {below}" if below is not None else "",
            f"at least {low}" if low is not None else "", f"at most {high}" if high is not None else ""]  # fmt: skip
    given = [part for part in told if part]
    return f", {' and '.join(given)}" if given else ""
