"""Cars with bodies: touring and rally shells, pick-ups and off-road buggies, slot cars, formula cars, karts with a driver.

Knows what these cars look like; nothing of cameras or pictures. Makers build a car about one unit long, nose along +x, on
z = 0; `dnb_edge.train.cars` scales and places it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dnb_edge.train.car_boards import antenna, camera, electronics, tag_plate
from dnb_edge.train.car_parts import (
    between,
    bumper,
    chance,
    dark,
    driver,
    light,
    paint,
    pick,
    point,
    shaded,
    suspension,
    vivid,
    wheels,
    wing,
)
from dnb_edge.train.solids import Colour, Solid, box, loft, prism, rod, rounded_section

Rng = np.random.Generator
Station = tuple[float, float, float, float]
"""x, half width, low and high of a cross-section."""


def _hull(
    stations: Sequence[Station], colours: Sequence[Colour], tops: Sequence[Colour], roof_share: float, belt_share: float
) -> list[Solid]:
    sections = [
        (x, rounded_section(half, low, high, roof_share=roof_share, belt_share=belt_share))
        for x, half, low, high in stations
    ]
    return loft(sections, colours, top_colours=tops)


def _stripe(stations: Sequence[Station], y: float, half: float, colour: Colour) -> list[Solid]:
    sections = []
    for x, _, low, high in stations:
        section = rounded_section(half, high - 0.3 * (high - low), high + 0.004, roof_share=1.0)
        section[:, 0] += y
        sections.append((x, section))
    return loft(sections, (colour,) * 6)


def _livery(rng: Rng, stations: Sequence[Station], cabin: Sequence[Station], lively: float) -> list[Solid]:
    """Stripes along the car, number roundels, sponsor patches."""
    out: list[Solid] = []
    colour = pick(rng, (vivid(rng), light(rng), dark(rng)))
    if chance(rng, 0.5 * lively):
        y, half = (0.0, between(rng, 0.03, 0.09)) if chance(rng, 0.5) else (0.05, between(rng, 0.015, 0.035))
        for side in (-1, 1) if y else (1,):
            out += _stripe(stations[1:-1], side * y, half, colour)
            out += _stripe(cabin, side * y, half, colour)
    if chance(rng, 0.5 * lively):
        bonnet, roof = stations[-3], cabin[1]
        x, z = pick(rng, ((bonnet[0], bonnet[3] + 0.008), ((roof[0] + cabin[2][0]) / 2, roof[3] + 0.008)))
        radius = between(rng, 0.055, 0.085)
        out.append(prism((x, 0, z), radius, 0.008, (245, 245, 245), sides=12))
        out.append(box((x, 0, z + 0.003), (radius * 0.9, radius * between(rng, 0.3, 1.0), 0.008), dark(rng)))
    if chance(rng, 0.55 * lively):
        roof_from, roof_to, roof_z = cabin[1][0], cabin[2][0], cabin[1][3]
        for _ in range(int(rng.integers(2, 6))):
            size = (between(rng, 0.03, 0.1), between(rng, 0.04, 0.16), 0.008)
            x, z = pick(rng, ((between(rng, roof_from, roof_to), roof_z), (stations[-3][0], stations[-3][3])))
            out.append(box((x, between(rng, -0.11, 0.11), z + 0.002), size, paint(rng)))
    if chance(rng, 0.6 * lively):
        patch = vivid(rng)
        for side in (-1, 1):
            out.append(box((between(rng, -0.1, 0.1), side * stations[2][1], 0.12), (0.3, 0.012, 0.05), patch))
    return out


def _lamps(rng: Rng, front: Station, rear: Station) -> list[Solid]:
    out: list[Solid] = []
    lamp = pick(rng, ((230.0, 240.0, 245.0), (120.0, 230.0, 250.0), (245.0, 235.0, 215.0)))
    for side in (-1, 1):
        z = front[2] + (front[3] - front[2]) * 0.75
        out.append(box((front[0] - 0.02, side * front[1] * 0.72, z), (0.07, front[1] * 0.38, 0.04), lamp))
        z = rear[2] + (rear[3] - rear[2]) * 0.75
        out.append(box((rear[0] + 0.005, side * rear[1] * 0.75, z), (0.03, rear[1] * 0.35, 0.04), (30, 20, 190)))
    out.append(box((front[0] - 0.005, 0, front[2] + 0.03), (0.04, front[1] * 1.1, 0.04), dark(rng)))
    return out


def _bodied(
    rng: Rng, *, half: float, height: float, cabin: tuple[float, float], lively: float, wheel: float
) -> list[Solid]:
    """A closed car: lofted body and cabin, lamps, mirrors, wheels in arches; `cabin` is its rear and front end on the body."""
    low = wheel * between(rng, 0.35, 0.6)
    belt = height * between(rng, 0.58, 0.68)
    nose = belt * between(rng, 0.5, 0.75)
    stations: list[Station] = [
        (-0.5, half * between(rng, 0.75, 0.9), low * 1.6, belt * between(rng, 0.75, 0.95)),
        (-0.44, half * 0.96, low, belt),
        (-0.28, half, low, belt * 1.02),
        (0.12, half * between(rng, 0.93, 1.0), low, belt * 0.98),
        (0.3, half * 0.99, low, belt * 0.88),
        (0.44, half * 0.9, low, nose),
        (0.5, half * between(rng, 0.55, 0.85), low * 1.2, nose * 0.75),
    ]
    body = paint(rng)
    second = body if chance(rng, 0.9 - 0.3 * lively) else paint(rng)
    tail = second if chance(rng, 0.35) else body
    tops = [tail, tail, body, body, second, second]
    sill = body if chance(rng, 0.7) else dark(rng)
    out = _hull(stations, (sill, sill, body, body, body, sill), tops, between(rng, 0.8, 0.93), between(rng, 0.5, 0.75))
    rear, front = cabin
    rake = between(rng, 0.1, 0.2)
    back_rake = between(rng, 0.04, 0.16)
    glass = dark(rng) if chance(rng, 0.85) else (150.0, 120.0, 90.0)
    roof = body if chance(rng, 0.7) else paint(rng)
    top_half = half * between(rng, 0.8, 0.88)
    house: list[Station] = [
        (rear, top_half, belt * 0.8, belt),
        (rear + back_rake, top_half, belt * 0.8, height),
        (front - rake, top_half, belt * 0.8, height * 0.99),
        (front, top_half * 0.96, belt * 0.8, belt * 0.97),
    ]
    flank = glass
    out += _hull(house, (body, body, flank, roof, flank, body), (glass, roof, glass), between(rng, 0.7, 0.82), 0.3)
    out += _lamps(rng, stations[-2], stations[0])
    out += _livery(rng, stations, house, lively)
    width = half * between(rng, 0.3, 0.42)
    gauge = 2 * half - width + 0.012
    wheelbase = between(rng, 0.57, 0.66)
    out += wheels(rng, wheelbase=wheelbase, gauge=gauge, radius=wheel, width=width)
    for x in (-wheelbase / 2, wheelbase / 2):
        for side in (-1, 1):
            arch = prism((x, side * half * 0.97, wheel), wheel * 1.2, half * 0.08, (18, 18, 18), sides=12, axis="y")
            out.append(arch)
    if chance(rng, 0.4):
        for side in (-1, 1):
            out.append(box((front - rake * 0.8, side * half * 1.02, belt * 1.05), (0.03, half * 0.2, 0.03), body))
    if chance(rng, 0.35 + 0.35 * lively):
        span = half * between(rng, 1.5, 1.95)
        shade = body if chance(rng, 0.5) else dark(rng)
        high = belt + between(rng, 0.03, 0.11)
        out += wing(rng, x=-0.45, low=belt * 0.9, high=high, span=span, chord=between(rng, 0.06, 0.12), colour=shade)
    return out


def touring(rng: Rng) -> list[Solid]:
    """A touring or rally shell of a radio-controlled car, at times with robot parts on its roof."""
    height = between(rng, 0.27, 0.36)
    cabin = (between(rng, -0.42, -0.3), between(rng, 0.16, 0.27))
    if chance(rng, 0.15):  # a van, an off-roader, a small old car
        height, cabin = between(rng, 0.38, 0.5), (-0.49, between(rng, 0.2, 0.36))
    out = _bodied(
        rng, half=between(rng, 0.21, 0.25), height=height, cabin=cabin, lively=0.7, wheel=between(rng, 0.07, 0.095)
    )
    if chance(rng, 0.2):
        out += electronics(rng, length=0.35, width=0.3, deck=height, wire_count=3)[0]
    if chance(rng, 0.15):
        out += camera(rng, x=0.1, low=height * 0.8, high=height + between(rng, 0.03, 0.15))
    if chance(rng, 0.12):
        out += tag_plate(rng, x=-0.06, z=height + 0.01, size=between(rng, 0.18, 0.28))
    if chance(rng, 0.15):
        out += antenna(rng, x=-0.3, y=0.1, z=height * 0.6, height=between(rng, 0.2, 0.5))
    return out


def slot_car(rng: Rng) -> list[Solid]:
    """A slot car: low, wide, loud liveries, roundels, wings, and a guide under the nose."""
    height = between(rng, 0.2, 0.29)
    cabin = (between(rng, -0.38, -0.18), between(rng, 0.1, 0.24))
    return _bodied(
        rng, half=between(rng, 0.2, 0.245), height=height, cabin=cabin, lively=1.25, wheel=between(rng, 0.065, 0.088)
    )


def truck(rng: Rng) -> list[Solid]:
    """A monster truck or pick-up: a shell with a load bed, high above big knobbly wheels."""
    radius, tyre = between(rng, 0.13, 0.19), between(rng, 0.11, 0.17)
    gauge = between(rng, 0.46, 0.6)
    out = wheels(rng, wheelbase=between(rng, 0.56, 0.66), gauge=gauge, radius=radius, width=tyre, knobbly=True)
    for x in (-0.3, 0.3):
        out += suspension(rng, x=x, gauge=gauge - tyre * 0.4, hub=radius, tower=radius * 1.6)
    body, low = paint(rng), radius * between(rng, 1.05, 1.35)
    half, tall = between(rng, 0.18, 0.23), between(rng, 0.1, 0.14)
    glass = dark(rng)
    stations: list[Station] = [
        (-0.46, half * 0.95, low, low + tall),
        (-0.1, half, low, low + tall),
        (0.25, half, low, low + tall * 0.98),
        (0.43, half * 0.9, low, low + tall * 0.85),
        (0.47, half * 0.8, low, low + tall * 0.5),
    ]
    out += _hull(stations, (body,) * 6, (body,) * 4, 0.88, 0.6)
    start = between(rng, -0.16, -0.08) if chance(rng, 0.65) else -0.42
    high = low + tall + between(rng, 0.09, 0.14)
    roof = body if chance(rng, 0.8) else paint(rng)
    house: list[Station] = [
        (start, half * 0.9, low + tall * 0.7, low + tall),
        (start + 0.04, half * 0.9, low + tall * 0.7, high),
        (0.06, half * 0.9, low + tall * 0.7, high),
        (0.19, half * 0.9, low + tall * 0.7, low + tall),
    ]
    out += _hull(house, (body, body, glass, roof, glass, body), (glass, roof, glass), 0.78, 0.3)
    if start > -0.3:
        out.append(box((-0.3, 0, low + tall), (0.24, half * 1.5, 0.01), dark(rng)))
    out += _lamps(rng, stations[-1], stations[0]) + bumper(rng, x=0.51, width=half * 2, z=low)
    out += _livery(rng, stations, house, 0.7)
    if chance(rng, 0.3):
        out.append(box((0.0, 0, high + 0.02), (0.03, half * 1.2, 0.035), light(rng)))
    return out


def buggy(rng: Rng) -> list[Solid]:
    """An off-road buggy in its shell: a slim body, open wheels, a high rear wing."""
    radius, tyre = between(rng, 0.1, 0.13), between(rng, 0.09, 0.12)
    gauge = between(rng, 0.46, 0.54)
    out = wheels(
        rng,
        wheelbase=0.64,
        gauge=gauge,
        radius=radius,
        width=tyre,
        front_width=tyre * between(rng, 0.6, 1),
        knobbly=True,
    )
    for x in (-0.32, 0.32):
        out += suspension(rng, x=x, gauge=gauge - 0.04, hub=radius, tower=radius * between(rng, 1.7, 2.2))
    body, half = paint(rng), between(rng, 0.12, 0.17)
    second, glass = paint(rng), dark(rng)
    out.append(box((0, 0, radius * 0.6), (0.85, half * 1.7, 0.025), dark(rng)))
    stations: list[Station] = [
        (-0.38, half * 0.7, 0.07, 0.17),
        (-0.2, half * 1.15, 0.07, 0.23),
        (-0.05, half * 1.2, 0.07, between(rng, 0.27, 0.32)),
        (0.08, half * 1.05, 0.07, 0.2),
        (0.3, half * 0.6, 0.08, 0.17),
        (0.45, half * 0.4, 0.08, 0.12),
    ]
    out += _hull(stations, (body, second, body, body, body, second), (second, body, glass, body, second), 0.6, 0.45)
    out += wing(
        rng,
        x=-0.43,
        low=0.12,
        high=between(rng, 0.26, 0.34),
        span=between(rng, 0.36, 0.5),
        chord=between(rng, 0.12, 0.18),
    )
    return out + bumper(rng, x=0.5, width=between(rng, 0.2, 0.34), z=radius * 0.7)


def formula(rng: Rng) -> list[Solid]:
    """A formula car: needle nose, side pods, open slicks, a front and a rear wing, a helmet, perhaps a halo."""
    radius, tyre = between(rng, 0.062, 0.085), between(rng, 0.075, 0.11)
    half = between(rng, 0.19, 0.24)
    gauge = 2 * half - tyre
    out = wheels(rng, wheelbase=0.64, gauge=gauge, radius=radius, width=tyre, front_width=tyre * 0.8)
    body, second = paint(rng), paint(rng)
    slim = between(rng, 0.045, 0.06)
    spine: list[Station] = [
        (-0.44, slim * 0.7, 0.05, 0.1),
        (-0.25, slim, 0.05, 0.17),
        (-0.1, slim * 1.1, 0.05, between(rng, 0.2, 0.24)),
        (-0.05, slim * 1.3, 0.05, 0.14),
        (0.12, slim * 1.2, 0.05, 0.14),
        (0.3, slim * 0.9, 0.05, 0.115),
        (0.48, slim * 0.5, 0.04, 0.065),
    ]
    out += _hull(spine, (body,) * 6, (second, body, body, (20, 20, 20), body, second), 0.65, 0.6)
    for side in (-1, 1):
        pod = box(
            (-0.1, side * half * 0.5, 0.075), (0.36, half * 0.55, 0.08), second, taper=(0.8, 0.85), shift_top_m=-0.03
        )
        out.append(pod)
        for x in (-0.32, 0.32):
            for shift in (-0.05, 0.05):
                out.append(rod(point(x + shift, 0, 0.09), point(x, side * gauge / 2, radius), 0.007, dark(rng)))
    out.append(box((-0.06, 0, 0.03), (0.5, half * 1.4, 0.012), dark(rng)))
    front = body if chance(rng, 0.6) else second
    out.append(box((0.46, 0, 0.035), (0.075, half * between(rng, 1.6, 2.0), 0.014), front))
    for side in (-1, 1):
        out.append(box((0.45, side * half * 0.92, 0.05), (0.11, 0.012, 0.05), second))
    out.append(prism((0.02, 0, 0.16), 0.038, 0.05, vivid(rng), sides=8, top_scale=0.7))
    if chance(rng, 0.4):
        for side in (-1, 1):
            out.append(rod(point(-0.05, side * 0.055, 0.17), point(0.1, 0, 0.18), 0.008, dark(rng)))
    return out + wing(
        rng,
        x=-0.45,
        low=0.08,
        high=between(rng, 0.16, 0.23),
        span=half * 1.5,
        chord=between(rng, 0.07, 0.1),
        colour=second,
    )


def kart(rng: Rng) -> list[Solid]:
    """A toy kart with a big seated driver: thick wheels, bold colours, pipes behind, a bumper or a snout in front."""
    radius, tyre = between(rng, 0.11, 0.17), between(rng, 0.12, 0.18)
    half = between(rng, 0.28, 0.36)
    gauge = 2 * half - tyre
    base, second = vivid(rng), paint(rng)
    rim = vivid(rng) if chance(rng, 0.6) else light(rng)
    tyres = dark(rng) if chance(rng, 0.9) else vivid(rng)
    out = wheels(rng, wheelbase=between(rng, 0.56, 0.66), gauge=gauge, radius=radius, width=tyre, colours=(tyres, rim))
    low, deck = 0.05, between(rng, 0.14, 0.2)
    slim = half * between(rng, 0.5, 0.65)
    stations: list[Station] = [
        (-0.46, slim * 0.8, low + 0.03, deck * 1.3),
        (-0.3, slim, low, deck * 1.5),
        (-0.12, slim * 1.05, low, deck),
        (0.16, slim * 0.95, low, deck),
        (0.3, slim * 0.85, low, deck * 1.35),
        (0.5, slim * 0.6, low + 0.02, deck * 0.8),
    ]
    out += _hull(stations, (base, second, base, base, base, second), (second, base, dark(rng), base, second), 0.75, 0.5)
    for side in (-1, 1):
        pod = box((-0.02, side * slim * 1.2, deck * 0.6), (0.3, half * 0.35, deck * 0.7), second, taper=(0.8, 0.8))
        out.append(pod)
        if chance(rng, 0.7):
            out.append(prism((-0.46, side * slim * 0.5, deck * 1.2), 0.045, 0.14, light(rng), sides=8, axis="x"))
    out.append(box((-0.27, 0, deck + 0.12), (0.06, slim * 1.3, 0.26), shaded(second, 0.7)))
    if chance(rng, 0.6):
        out.append(prism((0.38, 0, deck * 1.15), slim * 0.4, 0.012, (245, 245, 245), sides=10))
        out.append(box((0.38, 0, deck * 1.15 + 0.008), (slim * 0.4, slim * 0.2, 0.008), vivid(rng)))
    out.append(prism((0.14, 0, deck + 0.14), 0.07, 0.02, dark(rng), sides=8, axis="x"))
    out += driver(rng, x=between(rng, -0.16, -0.06), seat=deck, size=between(rng, 0.36, 0.5), arms_to=0.12)
    if chance(rng, 0.5):
        out += bumper(rng, x=0.53, width=half * between(rng, 0.9, 1.5), z=0.08)
    return out
