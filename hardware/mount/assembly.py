"""The mount put together: which parts, where, at any tilt; and how far apart they are drawn in an exploded picture.

Knows places and directions in the joint's frame (z the axis, x forward, y up; mm). The screws and the camera bodies here are
for pictures and for checking that everything finds room.
"""

from dataclasses import dataclass
from functools import cache

from build123d import Align, Box, Cylinder, Location, Part, Plane, Pos, RegularPolygon, Rot, extrude

from hardware.cameras import Board, Webcam
from hardware.fasteners import LOW, M4, M5, Screw
from hardware.mount import bases, cradles, joint

Vector = tuple[float, float, float]
Camera = Webcam | Board


@dataclass(frozen=True, slots=True, kw_only=True)
class Placed:
    """One body at its place."""

    name: str
    shape: Part
    apart: Vector
    """Where it goes in an exploded picture, from its place, mm."""
    bought: bool = False
    """A screw, a nut or the camera: not printed."""


BASES = {"ceiling": bases.ceiling_base, "boom": bases.boom_base, "shelf": bases.shelf_base}


def mount(base: str, camera: Camera | None, tilt_deg: int, *, lift_mm: float = 0.0) -> list[Placed]:
    """All printed parts of a mount and its camera at a whole degree of tilt from 0 to 90.

    `lift_mm` draws ring and arm apart along the axis by as much each, for checking: teeth that touch have no volume in
    common, but no computer knows. Raises KeyError for an unknown base.
    """
    turn = Rot(0, 0, -tilt_deg)
    ring = Pos(0, 0, lift_mm) * Rot(0, 0, joint.ring_turn_deg(tilt_deg)) * joint.ring()
    arm_place = Pos(0, 0, 2 * lift_mm) * turn
    knob_z = joint.SIZE.arm_z_mm[1] + 2 * lift_mm + 1.0
    bodies = [
        Placed(name="base", shape=BASES[base](), apart=(0, 0, 0)),
        Placed(name="ring", shape=ring, apart=(0, 0, 28)),
        Placed(name="arm", shape=arm_place * joint.arm(), apart=(0, 0, 62)),
        Placed(name="knob", shape=Pos(0, 0, knob_z) * joint.knob(), apart=(0, 0, 96)),
    ]
    bodies += _clamps(base)
    if camera is not None:
        bodies += [
            Placed(
                name=part.name,
                shape=arm_place * cradle_place() * part.shape,
                apart=_turned(part.apart, tilt_deg),
                bought=part.bought,
            )
            for part in carried(camera)
        ]
    return bodies


def cradle_place() -> Location:
    """From a cradle's frame to the joint's, at tilt 0."""
    return Plane(origin=joint.SIZE.plate_centre_mm, x_dir=(0, 0, -1), z_dir=(1, 0, 0)).location


@cache
def carried(camera: Camera) -> tuple[Placed, ...]:
    """Cradle and camera in the cradle's frame; the way apart is in the cradle's frame, too."""
    if isinstance(camera, Webcam):
        upper = cradles.webcam_jaw_y_mm(camera)
        back = cradles.CRADLE.back_mm + cradles.CRADLE.foam_mm
        body = Pos(0, 0, back) * Box(camera.width_mm, camera.height_mm, camera.depth_mm, align=LOW)
        body += Pos(0, 0, back + camera.depth_mm) * Cylinder(9, 4, align=LOW)
        bar = Pos(0, upper, cradles.webcam_screw_z_mm(camera)) * Rot(-90, 0, 0) * cradles.webcam_bar(camera)
        return (
            Placed(name="cradle", shape=cradles.webcam_cradle(camera), apart=(0, 0, 25)),
            Placed(name="camera", shape=body, apart=(0, 0, 62), bought=True),
            Placed(name="bar", shape=bar, apart=(0, 32, 62)),
        )
    rise = cradles.board_rise_mm(camera)
    z = cradles.CRADLE.back_mm + camera.standoff_mm
    body = Pos(0, rise, z) * Box(camera.width_mm, camera.height_mm, 1.6, align=LOW)
    body += Pos(0, rise, z) * Cylinder(min(camera.width_mm, camera.height_mm) * 0.3, camera.thickness_mm, align=LOW)
    return (
        Placed(name="cradle", shape=cradles.board_cradle(camera), apart=(0, 0, 25)),
        Placed(name="camera", shape=body, apart=(0, 0, 55), bought=True),
    )


def fasteners() -> list[Placed]:
    """The joint's bolt with its washer and nut, and the arm's four M4 screws, at tilt 0; for pictures alone."""
    outer = joint.SIZE.arm_z_mm[1]
    bolt = hex_bolt(M5, 40)
    parts = [Placed(name="M5 x 40", shape=Pos(0, 0, 4) * bolt, apart=(0, 0, -45), bought=True)]
    washer = Cylinder(7.5, 1, align=LOW) - Cylinder(2.7, 1, align=LOW)
    parts.append(Placed(name="M5 washer", shape=Pos(0, 0, outer) * washer, apart=(0, 0, 80), bought=True))
    nut = extrude(RegularPolygon(M5.nut_flats_mm / 3**0.5, 6), amount=5) - Cylinder(2.4, 20)
    parts.append(Placed(name="M5 nut", shape=Pos(0, 0, outer + 8) * nut, apart=(0, 0, 118), bought=True))
    x, y, z = joint.SIZE.plate_centre_mm
    half = joint.SIZE.plate_screws_mm / 2
    for dy in (-half, half):
        for dz in (-half, half):
            screw = Pos(x - joint.SIZE.plate_mm, y + dy, z + dz) * Rot(0, 90, 0) * cap_screw(M4, 12)
            parts.append(Placed(name="M4 x 12", shape=screw, apart=(-22, 0, 62), bought=True))
    return parts


def hex_bolt(screw: Screw, length_mm: float) -> Part:
    """A bolt whose shaft rises from z = 0, its head below."""
    head = Pos(0, 0, -3.5) * extrude(RegularPolygon(screw.nut_flats_mm / 3**0.5, 6), amount=3.5)
    return head + Cylinder(float(screw.name[1:]) / 2, length_mm, align=LOW)


def cap_screw(screw: Screw, length_mm: float) -> Part:
    """A cylinder-head screw whose shaft rises from z = 0, its head below."""
    diameter = float(screw.name[1:])
    head = Cylinder(diameter * 0.85, diameter, align=(Align.CENTER, Align.CENTER, Align.MAX))
    return head + Cylinder(diameter / 2, length_mm, align=LOW)


def _clamps(base: str) -> list[Placed]:
    return {"ceiling": _rail_jaws, "boom": _tube_jaw, "shelf": _pads}[base]()


def _rail_jaws() -> list[Placed]:
    size = bases.CEILING
    top = size.below_mm + size.plate_mm
    jaws = []
    for side in (-1, 1):
        inwards = Rot(90, 0, 0) * Rot(0, 0, 180 if side > 0 else 0)
        for z in size.screw_z_mm:
            place = Pos(side * size.screw_across_mm / 2, top + 9, z) * inwards
            jaws.append(Placed(name="rail jaw", shape=place * bases.rail_jaw(), apart=(0, 30, 0)))
    return jaws


def _tube_jaw() -> list[Placed]:
    """As it sits on a tube of 25 mm."""
    size = bases.BOOM
    apex_to_apex = 25.0 * 2**0.5
    gap = apex_to_apex - 2 * size.groove_mm
    middle = -size.near_mm - size.length_mm / 2
    place = Pos(middle, size.height_mm / 2 + gap + size.jaw_mm, size.width_mm / 2) * Rot(90, 0, 0)
    return [Placed(name="tube jaw", shape=place * bases.tube_jaw(), apart=(0, 40, 0))]


def _pads() -> list[Placed]:
    size = bases.SHELF
    y, z = -size.opening_mm / 2 + 14, size.width_mm / 2
    turned = Rot(90, 0, 0)
    return [
        Placed(name="pad", shape=Pos(x, y, z) * turned * bases.shelf_pad(), apart=(0, 0, 0))
        for x in bases.shelf_screws_x_mm()
    ]


def _turned(direction: Vector, tilt_deg: float) -> Vector:
    """A way apart in the cradle's frame, carried by the arm, in the joint's; the arm's own way apart comes on top."""
    place = Rot(0, 0, -tilt_deg) * Plane(origin=(0, 0, 0), x_dir=(0, 0, -1), z_dir=(1, 0, 0)).location
    moved = (place * Pos(*direction)).position
    return moved.X, moved.Y, moved.Z + 62
