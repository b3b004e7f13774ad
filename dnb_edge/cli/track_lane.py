"""The options of `track build` that say what the lane looks like: a colour in any notation, a place on it, or a shade."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, TypeAlias

import typer

from dnb_edge.archive import coordinates
from dnb_edge.errors import InputError
from dnb_edge.track.lane_shade import LaneShade
from dnb_edge.track.twin import Lane, LaneColour, colour_of
from dnb_edge.values import PointPx

Shade: TypeAlias = Annotated[
    LaneShade | None,
    typer.Option(
        "--lane", help="Darker or lighter than the floor, either of them (auto), or what lies between two lines."
    ),
]
Hsv: TypeAlias = Annotated[
    str | None, typer.Option(help="Lane colour: hue 0-360, saturation 0-100, value 0-100, such as 330,23,84.")
]
Hex: TypeAlias = Annotated[str | None, typer.Option(help="Lane colour as web pages write it, such as '#d8a0c0'.")]
Pixel: TypeAlias = Annotated[
    str | None, typer.Option(help="Lane colour: that of the picture at this px u,v of it, somewhere on the lane.")
]
Tolerance: TypeAlias = Annotated[
    str, typer.Option(help="How far hue, saturation and value may differ from the colour.")
]

USUAL_TOLERANCE = "20,14,20"


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneOptions:
    """What the user says of the lane; all None for `--lane auto`."""

    shade: LaneShade | None
    hsv: str | None
    hex_colour: str | None
    pixel: str | None
    tolerance: str

    def lane(self, colour_at: Callable[[PointPx], LaneColour]) -> Lane:
        """What tells the lane from the floor; `colour_at` looks a px of the picture up.

        Raises `InputError` where an option is malformed, or two of them say it.
        """
        given = {
            "--lane": self.shade,
            "--lane-hsv": self.hsv,
            "--lane-hex": self.hex_colour,
            "--lane-pixel": self.pixel,
        }
        named = [name for name, value in given.items() if value is not None]
        if len(named) > 1:
            raise InputError(
                f"{named[0]} and {named[1]}: one of them says what the lane looks like: leave the other out"
            )
        if self.hsv is not None:
            hue, saturation, value = coordinates.numbers("--lane-hsv", self.hsv, 3)
            return self._tolerant(LaneColour(hue_deg=hue, saturation_percent=saturation, value_percent=value))
        if self.hex_colour is not None:
            return self._tolerant(colour_of(*_bgr(self.hex_colour)))
        if self.pixel is not None:
            return self._tolerant(colour_at(coordinates.point("--lane-pixel", self.pixel)))
        if self.tolerance != USUAL_TOLERANCE:
            raise InputError("--lane-tolerance: a lane told by its shade has none: give its colour, or leave this out")
        return LaneShade.AUTO if self.shade is None else self.shade

    def _tolerant(self, colour: LaneColour) -> LaneColour:
        hue, saturation, value = coordinates.numbers("--lane-tolerance", self.tolerance, 3)
        return replace(
            colour,
            hue_tolerance_deg=hue,
            saturation_tolerance_percent=saturation,
            value_tolerance_percent=value,
        )


def _bgr(text: str) -> tuple[float, float, float]:
    """Blue, green and red, 0..255 each, of `#rrggbb` or `#rgb`."""
    digits = text.strip().removeprefix("#")
    if re.fullmatch(r"[0-9a-fA-F]{3}", digits):
        digits = "".join(2 * digit for digit in digits)
    if not re.fullmatch(r"[0-9a-fA-F]{6}", digits):
        raise InputError(f"--lane-hex {text}: must be red, green and blue in hexadecimal digits, such as '#d8a0c0'")
    red, green, blue = (int(digits[k : k + 2], 16) for k in (0, 2, 4))
    return float(blue), float(green), float(red)
