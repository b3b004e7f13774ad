"""Three ways to fix the joint: under a ceiling, on a tripod or boom, on a shelf or table edge.

Knows the fixed halves of the mount, each with the joint's cheek in the joint's frame (z the axis, x forward, y up; mm).
All are printed lying on z = 0, teeth up: the weight then pulls along the layers and not between them.
"""

from dataclasses import dataclass
from functools import cache

from build123d import Align, Box, Cone, Cylinder, Face, Part, Pos, Rot, Wire, extrude

from hardware.fasteners import CAMERA, LOW, M5, bore, nut_pocket, trap_depth_mm, trap_flats_mm
from hardware.mount.joint import SIZE, JointSize, cheek, finished

_CORNER = (Align.MIN, Align.MIN, Align.MIN)


@dataclass(frozen=True, slots=True, kw_only=True)
class CeilingSize:
    """A plate above the joint, in mm; screwed to the ceiling, or clamped to a T rail by four jaws."""

    width_mm: float = 96.0
    depth_mm: float = 72.0
    plate_mm: float = 8.0
    below_mm: float = 45.0
    """From the plate's lower face to the joint's axis."""
    screw_across_mm: float = 72.0
    screw_z_mm: tuple[float, float] = (24.0, 60.0)
    rail_mm: float = 24.0
    """Width of the flange of a suspended ceiling's T rail."""
    rail_flange_mm: float = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BoomSize:
    """A block behind the joint, in mm: 1/4"-20 stud from below, tube of 18 to 32 mm in a V groove above."""

    near_mm: float = 40.0
    length_mm: float = 56.0
    height_mm: float = 32.0
    width_mm: float = 54.0
    groove_mm: float = 12.0
    """Depth of the V, whose walls stand at 45 degrees."""
    bolt_across_mm: float = 41.0
    tube_min_mm: float = 18.0
    tube_max_mm: float = 32.0
    jaw_mm: float = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ShelfSize:
    """A C clamp for boards, in mm."""

    near_mm: float = 30.0
    spine_mm: float = 18.0
    opening_mm: float = 44.0
    throat_mm: float = 58.0
    jaw_mm: float = 16.0
    width_mm: float = 30.0
    screws_in_mm: tuple[float, float] = (20.0, 44.0)
    """How far in front of the spine the two screws stand."""


CEILING, BOOM, SHELF = CeilingSize(), BoomSize(), ShelfSize()


@cache
def ceiling_base(size: CeilingSize = CEILING, joint: JointSize = SIZE) -> Part:
    """Cheek, neck and ceiling plate with four countersunk 5 mm holes and a hole for a safety cord."""
    half = size.width_mm / 2
    body = cheek(joint)
    neck = Box(34, size.below_mm + 1, joint.cheek_mm, align=_CORNER)
    body += Pos(-joint.disc_radius_mm, 0, 0) * neck
    body += Pos(-half, size.below_mm, 0) * Box(size.width_mm, size.plate_mm, size.depth_mm, align=_CORNER)
    body += _gusset(joint, size)
    for x in (-size.screw_across_mm / 2, size.screw_across_mm / 2):
        for z in size.screw_z_mm:
            sunk = bore(M5.hole_mm, 30) + Cone(5.2, 2.7, 2.5, align=LOW) + Pos(0, 0, -9.9) * bore(10.4, 9.9)
            body -= Pos(x, size.below_mm, z) * Rot(-90, 0, 0) * sunk
    return finished(body - Pos(-8, size.below_mm - 12, -1) * bore(joint.tether_mm, 30), joint)


def _gusset(joint: JointSize, size: CeilingSize) -> Part:
    """The rib between neck and plate, behind the joint, out of the arm's way."""
    x, y, z = -joint.disc_radius_mm, size.below_mm + 1, joint.cheek_mm - 1
    triangle = Face(Wire.make_polygon([(x, y - 19, z), (x, y, z), (x, y, z + 36)]))
    return extrude(triangle, amount=7, dir=(1, 0, 0))


@cache
def rail_jaw(size: CeilingSize = CEILING) -> Part:
    """One of four bars that clamp the ceiling plate to a T rail; z = 0 lies on the print bed, the hook grips at +x.

    The nut of its M5 screw lies in a pocket in the upper face.
    """
    reach = size.screw_across_mm / 2 - 3.5
    thickness = 9.0
    bar = Pos(-9, -9, 0) * Box(reach + 9, 18, thickness, align=_CORNER)
    # The flange goes under the hook, between bar and plate: the heel at the other end is as much higher.
    bar -= Pos(reach - (size.rail_mm / 2 - 3.5) - 1, -10, thickness - size.rail_flange_mm) * Box(
        50, 20, 20, align=_CORNER
    )
    return bar - Pos(0, 0, -1) * bore(M5.hole_mm, 30) - Pos(0, 0, -1) * nut_pocket(M5, trap_depth_mm(M5) - 0.4)


@cache
def boom_base(size: BoomSize = BOOM, joint: JointSize = SIZE) -> Part:
    """Cheek and block: a nut for a tripod's stud from below, a groove and two bolts for a tube above."""
    far = size.near_mm + size.length_mm
    half = size.height_mm / 2
    middle = -size.near_mm - size.length_mm / 2
    body = cheek(joint)
    neck = Pos(-size.near_mm - 1, -half, 0) * Box(size.near_mm, size.height_mm, joint.cheek_mm, align=_CORNER)
    body += neck
    body += Pos(-far, -half, 0) * Box(size.length_mm, size.height_mm, size.width_mm, align=_CORNER)
    # A rib up the block's front, beside the ring.
    rib = Face(Wire.make_polygon([(-size.near_mm - 1, -half, 11), (-26, -half, 11), (-size.near_mm - 1, -half, 40)]))
    body += extrude(rib, amount=8, dir=(0, 1, 0))
    body -= Pos(middle, half, size.width_mm / 2) * _groove(size, size.length_mm + 2)
    # The stud's nut slides in from the upper face while the part lies as printed.
    flats = trap_flats_mm(CAMERA)
    slot = Pos(middle, -half + 7, size.width_mm / 2) * Rot(-90, 0, 0) * nut_pocket(CAMERA)
    slot += Pos(middle - flats / 2, -half + 7, size.width_mm / 2) * Box(
        flats, trap_depth_mm(CAMERA), size.width_mm, align=_CORNER
    )
    body -= slot + Pos(middle, -half - 1, size.width_mm / 2) * Rot(-90, 0, 0) * bore(CAMERA.hole_mm, 20)
    for z in _bolts_z(size):
        body -= Pos(middle, -half - 1, z) * Rot(-90, 0, 0) * (bore(M5.hole_mm, 60) + nut_pocket(M5, 6))
    return finished(body - Pos(-30, 6, -1) * bore(joint.tether_mm, 30), joint)


@cache
def tube_jaw(size: BoomSize = BOOM) -> Part:
    """The other half of the tube clamp, groove up, from z = 0; x along the tube."""
    jaw = Box(size.length_mm - 16, size.width_mm, size.jaw_mm, align=LOW)
    jaw -= Pos(0, 0, size.jaw_mm) * Rot(90, 0, 0) * _groove(size, size.length_mm)
    for y in (-size.bolt_across_mm / 2, size.bolt_across_mm / 2):
        jaw -= Pos(0, y, -1) * bore(M5.hole_mm, 40)
    return jaw


@cache
def shelf_base(size: ShelfSize = SHELF, joint: JointSize = SIZE) -> Part:
    """Cheek and C clamp, open towards -x, with two M5 screws from below."""
    far = size.near_mm + size.spine_mm + size.throat_mm
    half = size.opening_mm / 2
    body = cheek(joint)
    neck = Pos(-size.near_mm - 1, -half, 0) * Box(size.near_mm, size.opening_mm, joint.cheek_mm, align=_CORNER)
    body += neck
    block = Pos(-far, -half - size.jaw_mm, 0) * Box(
        far - size.near_mm, size.opening_mm + 2 * size.jaw_mm, size.width_mm, align=_CORNER
    )
    opening = Pos(-far - 1, -half, -1) * Box(size.throat_mm + 1, size.opening_mm, size.width_mm + 2, align=_CORNER)
    body += block - opening
    for x in shelf_screws_x_mm(size):
        place = Pos(x, -half, size.width_mm / 2) * Rot(90, 0, 0)
        body -= place * (Pos(0, 0, -1) * bore(M5.hole_mm, 40) + Pos(0, 0, -1) * nut_pocket(M5, trap_depth_mm(M5) + 1))
    spine = -size.near_mm - size.spine_mm / 2
    return finished(body - Pos(spine, -half - size.jaw_mm / 2, -1) * bore(joint.tether_mm, 60), joint)


@cache
def shelf_pad() -> Part:
    """What presses against the board, on the tip of a clamp screw."""
    return Cylinder(10, 7, align=LOW) - Pos(0, 0, 3) * bore(5.4, 10)


def shelf_screws_x_mm(size: ShelfSize = SHELF) -> tuple[float, float]:
    """Where the clamp screws stand in the joint's frame."""
    first, second = size.screws_in_mm
    return -size.near_mm - size.spine_mm - first, -size.near_mm - size.spine_mm - second


def _bolts_z(size: BoomSize) -> tuple[float, float]:
    return (size.width_mm - size.bolt_across_mm) / 2, (size.width_mm + size.bolt_across_mm) / 2


def _groove(size: BoomSize, length: float) -> Part:
    """A V along x, open at y = 0 towards +y."""
    g = size.groove_mm
    v = Face(Wire.make_polygon([(0, -g, 0), (0, 1, g + 1), (0, 1, -g - 1)]))
    return extrude(v, amount=length / 2, dir=(1, 0, 0), both=True)
