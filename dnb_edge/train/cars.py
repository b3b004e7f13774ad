"""The kinds of miniature cars to draw, how often each is, and how one is stood on the floor.

Knows the list of kinds; what they look like is in `cars_chassis`, `cars_shells` and `cars_robots`. Every car stands on z = 0
with the centre of its footprint (the middle of where its wheels touch) at the origin and its nose along +x.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dnb_edge.errors import InputError
from dnb_edge.train import cars_chassis, cars_robots, cars_shells
from dnb_edge.train.solids import Solid

Rng = np.random.Generator
Maker = Callable[[Rng], list[Solid]]

CONTACT_SHARE = 0.012
"""What lies lower than this share of the length touches the floor."""

_KINDS: dict[str, tuple[Maker, float]] = {
    "bare_chassis": (cars_chassis.bare_chassis, 0.25),
    "donkey": (cars_chassis.donkey, 0.06),
    "f1tenth": (cars_chassis.f1tenth, 0.07),
    "deepracer": (cars_chassis.deepracer, 0.03),
    "touring": (cars_shells.touring, 0.09),
    "truck": (cars_shells.truck, 0.04),
    "buggy": (cars_shells.buggy, 0.04),
    "slot_car": (cars_shells.slot_car, 0.08),
    "formula": (cars_shells.formula, 0.05),
    "kart": (cars_shells.kart, 0.07),
    "duckiebot": (cars_robots.duckiebot, 0.04),
    "jetbot": (cars_robots.jetbot, 0.04),
    "thymio": (cars_robots.thymio, 0.02),
    "motor_kit": (cars_robots.motor_kit, 0.04),
    "acrylic_car": (cars_robots.acrylic_car, 0.04),
    "tracked": (cars_robots.tracked, 0.02),
    "round_robot": (cars_robots.round_robot, 0.02),
    "box_robot": (cars_robots.box_robot, 0.02),
}


def stood(solids: Sequence[Solid], length_m: float) -> list[Solid]:
    """The car scaled to `length_m` from end to end and put down on z = 0, the middle of its contacts at the origin."""
    corners = np.concatenate([solid.vertices_m for solid in solids])
    scale = length_m / float(np.ptp(corners[:, 0]))
    bottom = float(corners[:, 2].min())
    contacts = corners[corners[:, 2] - bottom < CONTACT_SHARE / scale * length_m]
    middle = (contacts[:, :2].min(axis=0) + contacts[:, :2].max(axis=0)) / 2.0
    origin = np.array([middle[0], middle[1], bottom])
    ends = np.cumsum([len(solid.vertices_m) for solid in solids])
    placed = np.split((corners - origin) * scale, ends[:-1])
    return [
        Solid(vertices_m=vertices, faces=solid.faces, colour=solid.colour, face_colours=solid.face_colours)
        for solid, vertices in zip(solids, placed, strict=True)
    ]


def _made(maker: Maker) -> Callable[[Rng, float], list[Solid]]:
    def make(rng: Rng, length_m: float) -> list[Solid]:
        return stood(maker(rng), length_m)

    return make


car_kinds: dict[str, Callable[[Rng, float], list[Solid]]] = {name: _made(maker) for name, (maker, _) in _KINDS.items()}
"""Each kind's maker by name, of one car (rng, length in metres): to name or leave out kinds, for a held-out set."""


def any_car(rng: Rng, length_m: float, kinds: Sequence[str] | None = None) -> list[Solid]:
    """One car of a random kind (of `kinds`, by name; None: of all) and look, `length_m` long.

    Raises InputError for a kind that is not in `car_kinds`.
    """
    names = tuple(_KINDS) if kinds is None else tuple(kinds)
    unknown = [name for name in names if name not in _KINDS]
    if unknown or not names:
        raise InputError(f"no such kind of car: {', '.join(unknown) or 'none named'}; name some of {', '.join(_KINDS)}")
    weights = np.array([_KINDS[name][1] for name in names])
    return car_kinds[names[int(rng.choice(len(names), p=weights / weights.sum()))]](rng, length_m)
