"""Things that stand or lie about a race track and are no car, and how often each is met.

Knows which things there are; nothing of their shapes, of cameras or pictures. Each thing stands on z = 0 about the origin.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dnb_edge.train.clutter_devices import (
    battery,
    cable_on_floor,
    circuit_board,
    extension_socket,
    game_controller,
    headphones,
    keyboard_or_mouse,
    laptop,
    power_brick,
    spare_parts,
    tool,
    transmitter,
)
from dnb_edge.train.clutter_furniture import (
    bag,
    bucket,
    cabinet,
    carton,
    clamp_stand,
    door_stop,
    four_leg_chair,
    office_chair,
    plate_castor,
    robot_base,
    single_leg,
    table,
    tripod,
    twin_castor,
    wall_piece,
)
from dnb_edge.train.clutter_living import cat, dragged_cable, hand, person, shoes
from dnb_edge.train.clutter_shapes import Rng, grounded, scaled
from dnb_edge.train.clutter_small import (
    books,
    chessboard,
    cone,
    drink,
    figure,
    floor_marks,
    loose_ball,
    marker,
    papers,
    ruler,
    tape_roll,
    toy_blocks,
    toy_house,
)
from dnb_edge.train.solids import Solid

Make = Callable[[Rng], list[Solid]]

# Most weight on what fooled detectors in real rooms: chair bases, castors, controllers, headphones, bricks, markers, feet.
STATIC: tuple[tuple[Make, float], ...] = (
    (office_chair, 10), (twin_castor, 4), (plate_castor, 4), (four_leg_chair, 4), (table, 3), (single_leg, 3), (tripod, 3),
    (wall_piece, 4), (door_stop, 1), (cabinet, 3), (carton, 4), (bag, 4), (bucket, 1), (robot_base, 1), (clamp_stand, 2),
    (power_brick, 4), (extension_socket, 4), (game_controller, 5), (headphones, 4), (transmitter, 4), (laptop, 3),
    (keyboard_or_mouse, 4), (battery, 3), (cable_on_floor, 4), (tool, 3), (spare_parts, 4), (circuit_board, 2),
    (papers, 3), (floor_marks, 3), (marker, 5), (chessboard, 1), (drink, 3), (tape_roll, 3), (cone, 3), (toy_blocks, 3),
    (books, 2), (ruler, 1), (figure, 3), (toy_house, 2), (loose_ball, 1), (person, 6), (shoes, 5), (hand, 1),
)  # fmt: skip
"""What stays where it is, with its weight."""
MOVING: tuple[tuple[Make, float], ...] = (
    (person, 46), (office_chair, 16), (four_leg_chair, 3), (hand, 14), (loose_ball, 5), (cat, 6), (dragged_cable, 4),
    (bag, 1), (carton, 1), (shoes, 1), (cabinet, 1), (game_controller, 1), (tape_roll, 1),
)  # fmt: skip
"""What moves through the picture, with its weight."""


def _pick(rng: Rng, kinds: tuple[tuple[Make, float], ...]) -> list[Solid]:
    weights = np.array([weight for _, weight in kinds])
    return grounded(kinds[int(rng.choice(len(kinds), p=weights / weights.sum()))][0](rng))


def any_static(rng: Rng) -> list[Solid]:
    """Something that stays where it is; small things are at times larger than life, so that size alone tells nothing."""
    thing = _pick(rng, STATIC)
    extent_m = max(float(np.abs(solid.vertices_m).max()) for solid in thing)
    if extent_m < 0.3 and rng.random() < 0.4:
        return scaled(thing, float(np.exp(rng.uniform(0.0, 1.0))))
    return thing


def any_mover(rng: Rng) -> list[Solid]:
    """Something that moves through the picture and is no car."""
    return _pick(rng, MOVING)
