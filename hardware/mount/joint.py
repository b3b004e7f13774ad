"""The tilt joint: a cheek with a degree scale, a loose ring, an arm; locked by teeth at every whole degree.

Knows the joint's own parts. Frame of all parts here, in mm: z is the joint's axis, x points forward (where the camera
looks at 0 degrees), y up. Tilt is how far the camera looks down: the arm turns by -tilt about z.

Ring and cheek mesh with 36 teeth (10 degrees a step), ring and arm with 40 (9 degrees a step). Turning the ring by
i steps and the arm by j against it tilts the arm by 10 i + 9 j degrees: with both signs that is any whole degree. The
arm's angle leaves no choice for i but `tilt mod 9`, so the ring carries the figures 0 to 8 and the right one is the tilt's
digit sum (9 counts as 0): 41 degrees needs ring 5. The scale need only be read to the nearest few degrees.
"""

from dataclasses import dataclass
from functools import cache

from build123d import Align, Box, CenterArc, Cylinder, Face, Line, Part, Polygon, Pos, Rot, Wire, extrude, make_face

from hardware.digits import figure, tick
from hardware.fasteners import CAMERA, LOW, M4, M5, bore, nut_pocket
from hardware.mount.teeth import Crown, crown, facing_down

LOW_CROWN = Crown(teeth=36, inner_mm=9.0, outer_mm=20.0)
HIGH_CROWN = Crown(teeth=40, inner_mm=9.0, outer_mm=20.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSize:
    """Everything about the joint that may be changed, in mm."""

    disc_radius_mm: float = 22.5
    cheek_mm: float = 12.0
    ring_mm: float = 6.5
    """Between the ring's two pitch planes."""
    arm_mm: float = 9.0
    reach_mm: float = 45.0
    """From the axis to the back of the arm's plate."""
    plate_mm: float = 6.0
    plate_side_mm: float = 44.0
    plate_screws_mm: float = 30.0
    """Side of the square of four M4 screws between arm and cradle."""
    beam_mm: float = 20.0
    scale_radius_mm: float = 40.0
    tether_mm: float = 6.5
    low: Crown = LOW_CROWN
    high: Crown = HIGH_CROWN

    @property
    def low_pitch_z_mm(self) -> float:
        """The pitch plane between cheek and ring."""
        return self.cheek_mm + self.low.root_mm

    @property
    def high_pitch_z_mm(self) -> float:
        """The pitch plane between ring and arm."""
        return self.low_pitch_z_mm + self.ring_mm

    @property
    def arm_z_mm(self) -> tuple[float, float]:
        """The arm's inner and outer face."""
        inner = self.high_pitch_z_mm + self.high.root_mm
        return inner, inner + self.arm_mm

    @property
    def plate_centre_mm(self) -> tuple[float, float, float]:
        """Middle of the arm's plate, on the face that the cradle touches, at tilt 0."""
        return self.reach_mm + self.plate_mm, 0.0, self.arm_z_mm[1] - self.plate_side_mm / 2


SIZE = JointSize()
MAX_TILT_DEG = 90
ENGRAVED_MM = 0.6


def ring_figure(tilt_deg: int) -> int:
    """The figure on the ring that stands at the cheek's mark at this tilt: its digit sum, 9 counting as 0."""
    return tilt_deg % 9


def ring_turn_deg(tilt_deg: int) -> float:
    """How far the ring is turned about +z from its own zero at this tilt."""
    return -10.0 * ring_figure(tilt_deg)


@cache
def cheek(size: JointSize = SIZE) -> Part:
    """The fixed half as a blank, from z = 0: disc, sector for the scale, teeth. `finished` cuts what must be cut last."""
    body = Cylinder(size.disc_radius_mm, size.cheek_mm, align=LOW)
    body += extrude(_sector(size.scale_radius_mm, -7, 97), amount=size.cheek_mm)
    return body + Pos(0, 0, size.low_pitch_z_mm) * crown(size.low, size.low.root_mm + 1)


def finished(base: Part, size: JointSize = SIZE) -> Part:
    """A base round the cheek with its scale from 0 (up) to 90 (forward), mark, bolt hole and the pocket of the bolt's head."""
    # The mark that the ring's figure is read against is at the bottom: it is seen from where one stands.
    mark = Pos(0, -size.disc_radius_mm - 0.5, size.cheek_mm) * tick(length_mm=3, stroke_mm=1.2, depth_mm=2)
    return base - [*_scale(size), mark, bore(M5.hole_mm, 60), nut_pocket(M5)]


@cache
def ring(size: JointSize = SIZE) -> Part:
    """The loose ring, turned to its zero, with teeth on both faces and the figures 0 to 8 on its rim."""
    # Hub and rim are as high as the crests: the ring lies flat on the print bed, and its teeth run into them.
    low, high = size.low.longer(0.6), size.high.longer(0.6)
    bottom, top = size.low_pitch_z_mm - low.crest_mm, size.high_pitch_z_mm + high.crest_mm
    low_root, high_root = size.low_pitch_z_mm + low.root_mm, size.high_pitch_z_mm - high.root_mm
    full = Pos(0, 0, bottom) * Cylinder(size.disc_radius_mm, top - bottom, align=LOW)
    groove = Cylinder(size.low.outer_mm + 0.4, 50, align=LOW) - Cylinder(size.low.inner_mm - 0.4, 50, align=LOW)
    body = full - Pos(0, 0, high_root) * groove - Pos(0, 0, low_root - 50) * groove
    body += Pos(0, 0, size.high_pitch_z_mm) * crown(high, high.root_mm + 0.5)
    body += Pos(0, 0, size.low_pitch_z_mm) * facing_down(low, low.root_mm + 0.5)
    middle = (bottom + top) / 2
    figures = []
    for number in range(9):
        outwards = Rot(0, 0, -90 + 10 * number) * Pos(size.disc_radius_mm, 0, middle) * Rot(90, 0, 90)
        figures += [outwards * bar for bar in figure(str(number), height_mm=3.6, stroke_mm=0.7, depth_mm=ENGRAVED_MM)]
    return body - figures - bore(M5.hole_mm, 60)


@cache
def arm(size: JointSize = SIZE) -> Part:
    """The turning half at tilt 0: disc, teeth, pointer, beam and the plate that carries a cradle."""
    inner, _ = size.arm_z_mm
    body = Pos(0, 0, inner) * Cylinder(size.disc_radius_mm, size.arm_mm, align=LOW)
    body += Pos(0, 0, size.high_pitch_z_mm) * facing_down(size.high, size.high.root_mm + 1)
    beam_length = size.reach_mm + size.plate_mm
    body += Pos(0, 0, inner) * Box(beam_length, size.beam_mm, size.arm_mm, align=(Align.MIN, Align.CENTER, Align.MIN))
    body += _plate(size)
    # A wedge stiffens the corner; it stays above the scale, which it passes over at 90 degrees.
    drop = inner - size.cheek_mm - 2
    wedge = Face(
        Wire.make_polygon([(size.reach_mm - 15, 0, inner), (size.reach_mm, 0, inner), (size.reach_mm, 0, inner - drop)])
    )
    body += extrude(wedge, amount=4, both=True)
    body += _pointer(size)
    body -= Pos(size.reach_mm - 11, 0, inner - 20) * bore(size.tether_mm, 60)
    return body - bore(M5.hole_mm, 60)


@cache
def knob() -> Part:
    """A hand knob round an M5 nut or the head of an M5 bolt; the pocket opens upwards from z = 7."""
    height, radius = 13.0, 16.0
    body = Cylinder(radius, height, align=LOW)
    for lobe in range(6):
        body -= Rot(0, 0, 60 * lobe + 30) * Pos(radius + 3, 0, -1) * bore(11, height + 2)
    return body - Pos(0, 0, -1) * bore(M5.hole_mm, 30) - Pos(0, 0, height - 6) * nut_pocket(M5, 10)


def _plate(size: JointSize) -> Part:
    x, y, z = size.plate_centre_mm
    side, half = size.plate_side_mm, size.plate_screws_mm / 2
    plate = Pos(x, y, z) * Box(size.plate_mm, side, side, align=(Align.MAX, Align.CENTER, Align.CENTER))
    across = Rot(0, 90, 0)
    plate -= Pos(size.reach_mm - 1, 0, z) * across * bore(CAMERA.hole_mm, 20)
    for dy in (-half, half):
        for dz in (-half, half):
            plate -= Pos(size.reach_mm - 1, dy, z + dz) * across * bore(M4.hole_mm, 20)
    return plate


def _pointer(size: JointSize) -> Part:
    """A fin that reaches down beside the ring to just above the scale, its tip at the ticks' inner ends."""
    inner, outer = size.arm_z_mm
    root, tip = size.disc_radius_mm + 0.8, size.disc_radius_mm + 4.5
    fin = Pos(0, 0, size.cheek_mm + 0.5) * extrude(
        Polygon((-3.5, root), (3.5, root), (0.4, tip), (-0.4, tip), align=None), amount=outer - size.cheek_mm - 0.5
    )
    bridge = Pos(0, 0, inner) * extrude(
        Polygon((-3.5, root - 5), (3.5, root - 5), (3.5, root), (-3.5, root), align=None), amount=size.arm_mm
    )
    return fin + bridge


def _scale(size: JointSize) -> list[Part]:
    cutters = []
    ticks_from = size.disc_radius_mm + 5.0
    for degrees in range(0, MAX_TILT_DEG + 1, 5):
        long = degrees % 15 == 0
        line = tick(length_mm=4.0 if long else 2.5, stroke_mm=0.8, depth_mm=ENGRAVED_MM)
        turned = Pos(0, 0, size.cheek_mm) * Rot(0, 0, -degrees)
        cutters.append(turned * Pos(0, ticks_from, 0) * line)
        if long:
            text = figure(str(degrees), height_mm=4.2, stroke_mm=0.8, depth_mm=ENGRAVED_MM)
            cutters += [turned * Pos(0, ticks_from + 8.2, 0) * bar for bar in text]
    return cutters


def _sector(radius_mm: float, from_deg: float, to_deg: float) -> Face:
    arc = CenterArc((0, 0), radius_mm, from_deg, to_deg - from_deg)
    return make_face([Line((0, 0), arc @ 0), arc, Line(arc @ 1, (0, 0))])
