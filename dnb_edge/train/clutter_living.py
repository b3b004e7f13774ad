"""What lives and moves in a room: walking legs, shoes, hands that reach in, a cat, a dragged cable.

Knows shapes in metres; nothing of cameras or pictures. Each thing stands on z = 0 about the origin.
"""

from __future__ import annotations

import math

import numpy as np

from dnb_edge.train.clutter_devices import wandering
from dnb_edge.train.clutter_shapes import (
    WHITE,
    Rng,
    ball,
    cloth,
    limb,
    near,
    paint,
    placed,
    plate,
    resting,
    rubber,
    scaled,
    skin,
    slab,
    tipped,
    tube,
)
from dnb_edge.train.solids import Colour, FloatArray, Solid


def one_shoe(upper: Colour, sole: Colour, lace: Colour, side: int) -> list[Solid]:
    """A shoe 29 cm long, its toe along +x, a foot's outline for its sole; the ankle is at (-0.08, 0, 0.09)."""
    half = [(0.15, 0.0), (0.13, 0.035), (0.08, 0.048), (0.0, 0.042), (-0.08, 0.035), (-0.125, 0.03), (-0.14, 0.0)]
    outline = half + [(x, -y * 0.8) for x, y in reversed(half[1:-1])]
    outline = [(x, y * side) for x, y in outline]
    outline = outline if side > 0 else outline[::-1]
    toe = [(x, y) for x, y in outline if x > -0.01]
    out = [
        plate(outline, 0.0, 0.028, sole),
        plate(outline, 0.028, 0.05, upper, top=0.93),
        plate(toe, 0.05, 0.075, upper, top=0.6),
    ]
    out.append(limb((0.03, 0, 0.06), (-0.07, 0, 0.1), (0.03, 0.042), upper))
    out.append(limb((-0.08, 0, 0.03), (-0.08, 0, 0.1), (0.045, 0.043), upper))
    out += [slab((0.008, 0.05, 0.006), lace, at=(0.06 - 0.022 * i, 0, 0.08 + 0.008 * i)) for i in range(3)]
    return out


def _shoe_colours(rng: Rng) -> tuple[Colour, Colour, Colour]:
    upper = paint(rng) if rng.random() < 0.55 else rubber(rng)
    sole = near(rng, WHITE, 0.06) if rng.random() < 0.55 else (rubber(rng) if rng.random() < 0.8 else paint(rng))
    return upper, sole, near(rng, WHITE, 0.1) if rng.random() < 0.5 else rubber(rng)


def person(rng: Rng) -> list[Solid]:
    """Legs with shoes, in mid-step or standing, in trousers, shorts or a skirt, or in socks or bare feet."""
    trousers, (upper, sole, lace), bare = cloth(rng), _shoe_colours(rng), skin(rng)
    kind = rng.random()
    if kind < 0.1:
        upper = sole = lace = bare if rng.random() < 0.5 else paint(rng)
    hem = float(rng.uniform(0.35, 0.55)) if kind > 0.85 else float(rng.uniform(0.06, 0.16))
    stride, wide = (
        (float(rng.uniform(0.1, 0.35)), 0.09) if rng.random() < 0.6 else (0.03, float(rng.uniform(0.09, 0.18)))
    )
    thick = float(rng.uniform(0.85, 1.15))
    out: list[Solid] = []
    for side in (-1, 1):
        x, y = side * stride, side * wide
        lift = float(rng.uniform(0.0, 0.08)) if stride > 0.05 and side < 0 else 0.0
        foot = one_shoe(upper, sole, lace, side)
        if lift > 0.02:
            foot = tipped(foot, float(rng.uniform(0.2, 0.6)))
        out += placed(foot, side * float(rng.uniform(0, 0.3)), (x, y, lift))
        ankle, knee, hip = (
            np.array([x - 0.08, y, lift + 0.09]),
            np.array([x * 0.4 + 0.05, y, 0.5]),
            np.array([0, y * 0.9, 0.9]),
        )
        edge = ankle + (knee - ankle) * min(0.9, hem / 0.42)
        out.append(_bar(ankle, edge, 0.04 * thick, 0.05 * thick, bare))
        out.append(_bar(edge, knee, 0.065 * thick, 0.07 * thick, trousers))
        out.append(_bar(knee, hip, 0.07 * thick, 0.09 * thick, trousers))
    return out + _upper_body(trousers, thick, rng) if rng.random() < 0.7 else out


def _upper_body(trousers: Colour, thick: float, rng: Rng) -> list[Solid]:
    """Hips, trunk, shoulders, arms and head, as a camera above sees them over the legs."""
    shirt, tone, lean = cloth(rng) if rng.random() < 0.5 else paint(rng), skin(rng), float(rng.uniform(-0.05, 0.3))
    hair = near(rng, (35, 50, 75), 0.7)
    shoulder = (lean, 0.0, 1.32)
    out = [ball((0, 0, 0.93), (0.13 * thick, 0.18 * thick, 0.12), trousers, sides=10)]
    out.append(limb((0, 0, 0.95), shoulder, (0.14 * thick, 0.16 * thick), shirt, sides=10))
    out.append(ball(shoulder, (0.13 * thick, 0.24 * thick, 0.11), shirt, sides=10))
    for side in (-1, 1):
        elbow = (lean + float(rng.uniform(-0.15, 0.2)), side * 0.27, 1.05)
        wrist = (
            elbow[0] + float(rng.uniform(0.0, 0.25)),
            side * float(rng.uniform(0.1, 0.27)),
            float(rng.uniform(0.8, 1.05)),
        )
        out.append(limb((lean, side * 0.22 * thick, 1.33), elbow, (0.055, 0.045), shirt))
        out += [limb(elbow, wrist, (0.042, 0.03), tone), ball(wrist, (0.05, 0.04, 0.04), tone)]
    head = (lean * 1.3, 0.0, 1.57)
    return [*out, ball(head, (0.1, 0.08, 0.12), tone), ball((head[0] - 0.02, 0, 1.6), (0.105, 0.09, 0.11), hair)]


def _bar(a: FloatArray, b: FloatArray, low: float, high: float, colour: Colour) -> Solid:
    return limb((float(a[0]), float(a[1]), float(a[2])), (float(b[0]), float(b[1]), float(b[2])), (low, high), colour)


def shoes(rng: Rng) -> list[Solid]:
    """A shoe or a pair that stands about; some lie on their side."""
    upper, sole, lace = _shoe_colours(rng)
    size, out = float(rng.uniform(0.75, 1.1)), list[Solid]()
    for side in (-1, 1) if rng.random() < 0.6 else (1,):
        foot = scaled(one_shoe(upper, sole, lace, side), size)
        if rng.random() < 0.15:
            foot = tipped(placed(foot, math.pi / 2), math.pi / 2)
        out += placed(foot, float(rng.normal(0, 0.35)), (float(rng.normal(0, 0.05)), side * 0.08, 0.0))
    return out


def hand(rng: Rng) -> list[Solid]:
    """A hand that reaches in, on the floor or above it, with forearm and sleeve, sometimes holding a small thing."""
    tone, sleeve, lift = skin(rng), cloth(rng) if rng.random() < 0.8 else paint(rng), float(rng.uniform(0.0, 0.12))
    palm_z, mirror = 0.045 + lift, 1 if rng.random() < 0.5 else -1
    out = [
        plate([(-0.045, -0.03), (0.045, -0.042), (0.045, 0.042), (-0.045, 0.032)], palm_z - 0.014, palm_z + 0.014, tone)
    ]
    curl = float(rng.uniform(0.0, 0.9))
    for number, length in enumerate((0.07, 0.08, 0.075, 0.06)):
        y = (-0.03 + 0.021 * number) * mirror
        middle = (0.045 + length * 0.55, y * 1.2, palm_z - length * 0.3 * curl)
        tip = (0.045 + length * (1 - 0.35 * curl), y * 1.3, max(0.008, palm_z - length * 0.75 * curl - 0.01))
        out += [
            limb((0.042, y, palm_z), middle, (0.01, 0.009), tone, sides=6),
            limb(middle, tip, (0.009, 0.007), tone, sides=6),
        ]
    out.append(
        limb(
            (-0.02, -0.035 * mirror, palm_z),
            (0.05, -0.075 * mirror, max(0.01, palm_z - 0.02)),
            (0.013, 0.009),
            tone,
            sides=6,
        )
    )
    rise = float(rng.uniform(0.3, 0.9))
    wrist, cuff = (-0.05, 0.0, palm_z + 0.003), float(rng.uniform(0.02, 0.25))
    edge = (-0.05 - cuff, 0.0, palm_z + cuff * rise)
    elbow = (-0.36, 0.0, palm_z + 0.31 * rise)
    out += [limb(wrist, edge, (0.028, 0.036), tone), limb(edge, elbow, (0.043, 0.055), sleeve)]
    out.append(limb(elbow, (-0.65, 0.05, elbow[2] + 0.25), (0.055, 0.065), sleeve))
    if rng.random() < 0.2:
        out.append(slab((0.05, 0.03, 0.02), paint(rng), at=(0.07, 0, max(0.0, palm_z - 0.04))))
    return resting(out) if min(part.vertices_m[:, 2].min() for part in out) < 0 else out


def cat(rng: Rng) -> list[Solid]:
    """A cat or small dog: a body on four thin legs, a head with ears, a tail."""
    fur, other = (
        near(rng, ((30, 30, 32), (60, 110, 170), (150, 150, 150), (215, 225, 230))[int(rng.integers(4))], 0.2),
        WHITE,
    )
    size, legs = float(rng.uniform(0.8, 1.4)), 0.14
    crouched = rng.random() < 0.3
    legs = 0.04 if crouched else legs
    out = [
        ball((0, 0, legs + 0.06), (0.2, 0.075, 0.08), fur, sides=10),
        ball((0.2, 0, legs + 0.13), (0.06, 0.05, 0.05), fur),
    ]
    out += [
        limb((0.2, s * 0.03, legs + 0.16), (0.2, s * 0.04, legs + 0.2), (0.02, 0.003), fur, sides=5) for s in (-1, 1)
    ]
    for x in (-0.14, 0.12):
        for y in (-0.04, 0.04):
            paw = x + float(rng.uniform(-0.06, 0.06))
            out.append(
                limb((paw, y, 0.0), (x, y, legs + 0.04), (0.017, 0.025), other if rng.random() < 0.2 else fur, sides=6)
            )
    tail = np.array(
        [
            [-0.18, 0, legs + 0.08],
            [-0.27, 0.03, legs + 0.12],
            [-0.34, float(rng.normal(0, 0.06)), legs + float(rng.uniform(0, 0.25))],
        ]
    )
    return resting(scaled([*out, *tube(tail, 0.012, fur)], size))


def dragged_cable(rng: Rng) -> list[Solid]:
    """A cable that is pulled over the floor and rises at its end."""
    colour = rubber(rng) if rng.random() < 0.5 else paint(rng)
    points = wandering(rng, (-0.4, 0.0), 0.0, float(rng.uniform(0.5, 1.2)))
    share = np.linspace(0, 1, len(points))
    points[:, 2] += np.maximum(0, share - 0.7) ** 2 * float(rng.uniform(0.0, 6.0))
    return tube(points, 0.004, colour)
