"""Which of the race's cars a target is: by its marker, by its colour, or by the order in which cars turn up.

A target keeps its car for life. Knows targets' numbers and looks; knows nothing of what the cars do.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from dnb_edge.motion.appearance import Appearance
from dnb_edge.race.paint import paint_cost
from dnb_edge.race.rules import CarSetup


class Seats:
    """One seat a car, numbered from 0 in the order of `cars`, or as they are taken where no car is described."""

    def __init__(self, count: int, cars: Sequence[CarSetup] = ()) -> None:
        """`count` seats; `cars` describes the first of them, and may be empty."""
        self._count = count
        self._cars = tuple(cars)
        self._by_target: dict[int, int] = {}

    def held_by(self, target_id: int) -> int | None:
        """The seat that the target has already; None where it has none."""
        return self._by_target.get(target_id)

    def of(self, target_id: int, looks: Appearance, followed: Collection[int]) -> int | None:
        """The seat of a target, given one where it has none yet; None for a car that does not take part.

        `followed` are the numbers of all targets that are followed now: a seat whose target is not among them is free for
        whoever comes next. With one car in the race, every target is that car, unless it bears another's marker.
        """
        if target_id not in self._by_target:
            seat = self._choose(looks, followed)
            if seat is None:
                return None
            self._by_target[target_id] = seat
        return self._by_target[target_id]

    def _choose(self, looks: Appearance, followed: Collection[int]) -> int | None:
        numbers = [car.marker_id for car in self._cars]
        if looks.marker is not None and looks.marker in numbers:
            return numbers.index(looks.marker)
        open_to_all = [seat for seat in range(self._count) if seat >= len(numbers) or numbers[seat] is None]
        if self._count == 1:
            return open_to_all[0] if open_to_all else None
        taken = {seat for target, seat in self._by_target.items() if target in followed}
        ever = set(self._by_target.values())
        free = [seat for seat in open_to_all if seat not in taken]
        if not free:
            return None
        # A seat that nobody ever had comes before one whose car is away; among these the one that the colour fits best.
        return min(free, key=lambda seat: (self._colour_cost(seat, looks), seat in ever, seat))

    def _colour_cost(self, seat: int, looks: Appearance) -> float:
        colour = self._cars[seat].colour_bgr if seat < len(self._cars) else None
        seen = looks.colour
        return 0.0 if colour is None or seen is None else paint_cost(seen, colour, looks.variance)
