"""A part to print: how it is made, turned for the bed, dimensioned and sliced.

Knows what every part of the kit has; the parts themselves are listed in `mount_parts` and `case_parts`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from build123d import Location, Part

from hardware.drawing.dimensions import Hole, Length
from hardware.drawing.picture import View

PETG_G_PER_MM3 = 1.27e-3
_FROM_THE_FRONT = View(towards_eye=(0.7, 0.5, 1.0), up=(0, 1, 0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Slicing:
    """Print settings that differ from part to part; layers are 0.2 mm everywhere, and nothing needs support."""

    walls: int = 4
    infill_percent: int = 40
    brim: bool = False
    bed_face: str = "as it comes"
    """Which face lies on the bed, in words; the STL is turned that way already."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """One printable part."""

    name: str
    """The name of its files."""
    title: str
    group: str
    """What it is printed for, as in the table of docs/printing.md."""
    make: Callable[[], Part]
    bed: Location
    """From the part's own frame to the bed's: z up, the lowest point anywhere."""
    dimensions: tuple[Length | Hole, ...]
    notes: tuple[str, ...] = ()
    slicing: Slicing = Slicing()
    quantity: int = 1
    hidden_lines: bool = True
    """Whether the drawing shows them; between two crowns of teeth they tell nothing."""
    colour: tuple[int, int, int] = (150, 190, 120)
    picture: View = _FROM_THE_FRONT

    def on_bed(self) -> Any:
        """The part as it is printed."""
        return self.bed * self.make()


def mass_g(volume_mm3: float, slicing: Slicing) -> float:
    """A guess at the filament: walls take about half of such small parts, the infill the rest."""
    solid = 0.5 + 0.5 * slicing.infill_percent / 100
    return volume_mm3 * PETG_G_PER_MM3 * solid
