"""Pydantic models made from the core's frozen settings, so that a setting is declared once, where it is used.

The core must not know pydantic; its settings are plain dataclasses. `section` gives each a strict model with the same
names, types and defaults, which refuses unknown keys.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import sys
import textwrap
import types
import typing
from functools import cache
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict, create_model, model_validator

Number = Annotated[float, Strict()]
"""A number; text and booleans are none."""

Whole = Annotated[int, Strict()]
"""A whole number; text and booleans are none."""

STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True)
"""What every part of the configuration obeys: no unknown keys, no infinities, no change after loading."""


def _text(value: Any) -> Any:
    if value is not None and not isinstance(value, str):
        raise ValueError("must be text: write it in quotes")
    return value


Text = Annotated[str, BeforeValidator(_text)]
"""Text; what YAML takes for a number (a version 1.10, say) is refused, since its zeros are lost."""


def _name(value: Any) -> Any:
    if value is None or not _text(value).strip():
        raise ValueError("is blank: say who, what or which")
    if not value.isprintable():
        raise ValueError(f"{value!r} has characters that no board can show: write it in one line without them")
    return value


Name = Annotated[str, BeforeValidator(_name)]
"""Text in one line that is not blank."""

Settings = TypeVar("Settings")


def section(settings: type, **changed_defaults: Any) -> type[BaseModel]:
    """A strict model with the fields of the dataclass `settings`, whose own checks it applies; keywords replace defaults.

    Fields that are dataclasses themselves become such models too.
    """
    kinds = typing.get_type_hints(settings)
    texts = _attribute_docs(settings)
    fields: dict[str, Any] = {}
    for field in dataclasses.fields(settings):
        kind = _strict(kinds[field.name])
        default = changed_defaults.get(field.name, ... if field.default is dataclasses.MISSING else field.default)
        if dataclasses.is_dataclass(default):
            default = kind(**{part.name: getattr(default, part.name) for part in dataclasses.fields(default)})
        fields[field.name] = (kind, Field(default, description=texts.get(field.name)))
    checks: dict[str, Any] = {"checked": model_validator(mode="after")(_checked_by(settings))}
    model: type[BaseModel] = create_model(
        settings.__name__, __config__=STRICT, __doc__=settings.__doc__, __validators__=checks, **fields
    )
    return model


def to_settings(settings: type[Settings], model: BaseModel) -> Settings:
    """The dataclass `settings` from the model that `section` made of it. Raises its `ValueError`s."""
    kinds = typing.get_type_hints(settings)
    values = {name: getattr(model, name) for name in type(model).model_fields}
    return settings(**{name: _plain(kinds[name], value) for name, value in values.items()})


def _plain(kind: Any, value: Any) -> Any:
    """A setting of the type `kind`, whose dataclasses are models in `value`."""
    if isinstance(value, BaseModel):
        return to_settings(kind, value)
    if isinstance(value, tuple) and typing.get_args(kind)[1:] == (...,):
        return tuple(_plain(typing.get_args(kind)[0], item) for item in value)
    return value


_nested = cache(section)
"""One model for each kind of nested settings, however often it is used."""


def _checked_by(settings: type) -> Any:
    """A validator that makes `settings` from the model's values, to hear its ValueErrors while file and line are known."""

    def checked(model: BaseModel) -> BaseModel:
        to_settings(settings, model)
        return model

    return checked


def _strict(kind: Any) -> Any:
    """`kind` without pydantic's leniency for numbers: text is no number and `true` is not one."""
    if isinstance(kind, types.UnionType):
        return typing.Union[tuple(_strict(part) for part in kind.__args__)]  # noqa: UP007
    if typing.get_origin(kind) is tuple:
        return types.GenericAlias(
            tuple, tuple(part if part is ... else _strict(part) for part in typing.get_args(kind))
        )
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        return _nested(kind)
    return Annotated[kind, Strict()] if kind in (int, float, bool) else kind


def _attribute_docs(cls: type) -> dict[str, str]:
    """The string under each attribute of a class, by name."""
    if sys.flags.optimize > 1:
        return {}
    (node,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    assert isinstance(node, ast.ClassDef)
    docs = {}
    for field, text in zip(node.body, node.body[1:], strict=False):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(text, ast.Expr)
            and isinstance(text.value, ast.Constant)
        ):
            docs[field.target.id] = inspect.cleandoc(str(text.value.value))
    return docs
