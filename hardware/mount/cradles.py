"""What holds the camera: jaws for webcams, posts for bare boards, a shelf for anything with a tripod thread.

Knows one cradle for each camera of `hardware.cameras`. Frame, in mm: the origin is the middle of the arm's plate, x to the
right and y up as the camera sees them, z forward, along the optical axis. All are printed lying on z = 0.
"""

from dataclasses import dataclass
from functools import cache

from build123d import Align, Box, Cylinder, Face, Part, Pos, Rot, Wire, extrude

from hardware.cameras import Board, Webcam
from hardware.fasteners import CAMERA, LOW, M4, bore, nut_pocket, trap_depth_mm
from hardware.mount.joint import SIZE, JointSize

_CORNER = (Align.MIN, Align.MIN, Align.MIN)


@dataclass(frozen=True, slots=True, kw_only=True)
class CradleSize:
    """What all cradles have in common, in mm."""

    back_mm: float = 7.0
    jaw_mm: float = 6.0
    foam_mm: float = 2.0
    ear_mm: float = 15.0
    """How far the jaws stick out beside the camera, for the two M4 screws that draw them together."""
    lip_mm: float = 2.5
    tether_mm: float = 6.5


CRADLE = CradleSize()


def board_rise_mm(camera: Board) -> float:
    """How far the board's middle lies above the plate's: large boards must clear the four M4 nuts."""
    return 18.0 if camera.holes_across_mm > 24 else 0.0


@cache
def webcam_cradle(camera: Webcam, size: CradleSize = CRADLE, joint: JointSize = SIZE) -> Part:
    """Back plate and lower jaw in two halves, with room for the camera's foot between them."""
    width, below, above = _webcam_extent(camera, size, joint)
    body = Pos(-width / 2, -below, 0) * Box(width, below + above, size.back_mm, align=_CORNER)
    reach = webcam_reach_mm(camera, size)
    body += Pos(-width / 2, -below, 0) * Box(width, size.jaw_mm, reach, align=_CORNER)
    body += _lip(width, -below + size.jaw_mm, reach, size.lip_mm)
    foot = jaw_gap_mm(camera, joint)
    body -= Pos(-foot / 2, -below - 1, size.back_mm) * Box(foot, size.jaw_mm + size.lip_mm + 2, 100, align=_CORNER)
    for x in webcam_screws_x_mm(camera, size):
        place = Pos(x, -below - 1, webcam_screw_z_mm(camera, size)) * Rot(-90, 0, 0)
        body -= place * (bore(M4.hole_mm, 20) + nut_pocket(M4, trap_depth_mm(M4) + 1))
    tether = Pos(width / 2 - 6, above - 6, -1) * bore(size.tether_mm, 30)
    return body - _plate_screws(size.back_mm, joint) - tether


@cache
def webcam_bar(camera: Webcam, size: CradleSize = CRADLE) -> Part:
    """The upper jaw, lying on its outer face: x as in the cradle, y forward, z towards the camera."""
    width = _webcam_width(camera, size)
    depth = camera.depth_mm * 0.8
    bar = Box(width, depth, size.jaw_mm, align=LOW)
    for x in webcam_screws_x_mm(camera, size):
        bar -= Pos(x, 0, -1) * bore(M4.hole_mm, 20)
    return bar


@cache
def board_cradle(camera: Board, size: CradleSize = CRADLE, joint: JointSize = SIZE) -> Part:
    """Back plate with four posts; each takes a screw from the front and its nut at the back."""
    rise = board_rise_mm(camera)
    half = max(joint.plate_side_mm, camera.width_mm + 8) / 2
    top = max(joint.plate_side_mm / 2, rise + camera.height_mm / 2 + 4)
    bottom = -joint.plate_side_mm / 2
    # Room beside the board for the tether's hole.
    body = Pos(-half, bottom, 0) * Box(2 * half + 11, top - bottom, size.back_mm, align=_CORNER)
    posts, holes = Part(), []
    for x in (-camera.holes_across_mm / 2, camera.holes_across_mm / 2):
        for y in (rise - camera.holes_up_mm / 2, rise + camera.holes_up_mm / 2):
            posts += Pos(x, y, 0) * Cylinder(
                camera.screw.hole_mm / 2 + 1.8, size.back_mm + camera.standoff_mm, align=LOW
            )
            holes.append(Pos(x, y, -1) * bore(camera.screw.hole_mm, 40))
            holes.append(Pos(x, y, -1) * nut_pocket(camera.screw, trap_depth_mm(camera.screw) + 1))
    body = body + posts - holes - _plate_screws(size.back_mm, joint)
    return body - Pos(half + 5, bottom + 6, -1) * bore(size.tether_mm, 30)


@cache
def thread_cradle(size: CradleSize = CRADLE, joint: JointSize = SIZE) -> Part:
    """A shelf with a long hole for a 1/4 inch screw, for any camera with a tripod thread."""
    half, depth = joint.plate_side_mm / 2, 52.0
    body = Pos(-half, -half, 0) * Box(2 * half, 2 * half, size.back_mm, align=_CORNER)
    body += Pos(-half, -half - size.jaw_mm, 0) * Box(2 * half, size.jaw_mm, depth, align=_CORNER)
    for x in (-half, half - 5):
        triangle = Face(
            Wire.make_polygon([(x, -half, size.back_mm), (x, -half, depth - 8), (x, half - 10, size.back_mm)])
        )
        body += extrude(triangle, amount=5, dir=(1, 0, 0))
    for z in range(22, 41, 2):
        body -= Pos(0, -half - size.jaw_mm - 1, z) * Rot(-90, 0, 0) * bore(CAMERA.hole_mm, 20)
    body -= Pos(-CAMERA.hole_mm / 2, -half - size.jaw_mm - 1, 22) * Box(CAMERA.hole_mm, 20, 18, align=_CORNER)
    tether = Pos(half - 6, half - 6, -1) * bore(size.tether_mm, 30)
    return body - _plate_screws(size.back_mm, joint, skip_corner=True) - tether


def webcam_screws_x_mm(camera: Webcam, size: CradleSize = CRADLE) -> tuple[float, float]:
    """Where the two screws beside the camera stand."""
    x = camera.width_mm / 2 + size.foam_mm + size.ear_mm / 2
    return -x, x


def webcam_screw_z_mm(camera: Webcam, size: CradleSize = CRADLE) -> float:
    """How far in front of the arm's plate they stand: at the middle of the camera."""
    return size.back_mm + size.foam_mm + camera.depth_mm / 2


def webcam_reach_mm(camera: Webcam, size: CradleSize = CRADLE) -> float:
    """How far the lower jaw reaches in front of the arm's plate: foam behind the camera, the lip in front of it."""
    return size.back_mm + size.foam_mm + camera.depth_mm + size.lip_mm


def webcam_jaw_y_mm(camera: Webcam, size: CradleSize = CRADLE) -> float:
    """Inner face of the upper jaw, the camera's middle being at 0."""
    return camera.height_mm / 2 + size.foam_mm


def jaw_gap_mm(camera: Webcam, joint: JointSize = SIZE) -> float:
    """Between the lower jaw's halves: the camera's foot and the nuts of the plate's screws must get in."""
    return max(camera.foot_mm, joint.plate_screws_mm + M4.head_mm + 2)


def _webcam_width(camera: Webcam, size: CradleSize) -> float:
    return camera.width_mm + 2 * (size.foam_mm + size.ear_mm)


def _webcam_extent(camera: Webcam, size: CradleSize, joint: JointSize) -> tuple[float, float, float]:
    """Width of the back plate, and how far it reaches below and above the camera's middle."""
    below = camera.height_mm / 2 + size.foam_mm + size.jaw_mm
    return _webcam_width(camera, size), below, max(webcam_jaw_y_mm(camera, size), joint.plate_side_mm / 2)


def _lip(width: float, y: float, z: float, lip: float) -> Part:
    """A 45 degree lip at the jaw's front edge: printable, and the camera cannot slide off."""
    triangle = Face(Wire.make_polygon([(-width / 2, y, z), (-width / 2, y, z - lip), (-width / 2, y + lip, z)]))
    return extrude(triangle, amount=width, dir=(1, 0, 0))


def _plate_screws(thickness: float, joint: JointSize, *, skip_corner: bool = False) -> list[Part]:
    """Cutters for the four M4 screws from the arm, nuts in pockets in the front face."""
    half = joint.plate_screws_mm / 2
    corners = [(x, y) for x in (-half, half) for y in (-half, half) if not (skip_corner and x > 0 and y > 0)]
    pocket = Rot(0, 180, 0) * nut_pocket(M4, trap_depth_mm(M4) + 1)
    cutters = []
    for x, y in corners:
        cutters += [Pos(x, y, -1) * bore(M4.hole_mm, 20), Pos(x, y, thickness + 1) * pocket]
    return cutters
