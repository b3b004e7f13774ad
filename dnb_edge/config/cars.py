"""The cars of a configuration: their names, and what tells them apart.

Knows colours as people write them; knows nothing of how markers and colours are seen.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, Field, WithJsonSchema

from dnb_edge.config.sections import STRICT, Name, Number, Whole


def _from_hex(value: Any) -> Any:
    """(blue, green, red) of text like #ff8000; anything else as it is."""
    if not isinstance(value, str):
        return value
    digits = value.removeprefix("#")
    if len(digits) != 6 or not all(digit in "0123456789abcdefABCDEF" for digit in digits):
        raise ValueError(f"{value!r} is no colour: give '#rrggbb' in quotes, or [blue, green, red], 0..255 each")
    red, green, blue = bytes.fromhex(digits)
    return (blue, green, red)


Byte = Annotated[Number, Field(ge=0, le=255)]
Colour = Annotated[
    tuple[Byte, Byte, Byte],
    BeforeValidator(_from_hex),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string", "pattern": "^#?[0-9a-fA-F]{6}$"},
                {
                    "type": "array",
                    "items": {"type": "number", "minimum": 0, "maximum": 255},
                    "minItems": 3,
                    "maxItems": 3,
                },
            ]
        }
    ),
]
"""A colour: '#rrggbb', or [blue, green, red], 0..255 each."""


class CarConfig(BaseModel):
    """One car that takes part, and how it is told from the others."""

    model_config = STRICT

    name: Name
    """What standings and boards call it."""
    marker: Annotated[Whole, Field(ge=0)] | None = None
    """Number of the marker on its roof, for the detector `markers`."""
    colour: Colour | None = None
    """Its colour: '#rrggbb' in quotes, or [blue, green, red], 0..255 each."""


def told_apart(cars: tuple[CarConfig, ...]) -> tuple[CarConfig, ...]:
    """The cars. Raises `ValueError`, a line that opens with the key, where two have a name, a marker or a colour in common."""
    for key in ("name", "marker", "colour"):
        seen: dict[object, int] = {}
        for k, car in enumerate(cars):
            value = getattr(car, key)
            if value is not None and value in seen:
                raise ValueError(f"cars.{k}.{key}: the same as of car {seen[value] + 1}: give each car its own")
            seen[value] = k
    return cars
