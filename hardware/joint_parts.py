"""The joint's printable parts with their dimensions and print settings."""

from build123d import Location, Rot

from hardware import colours
from hardware.drawing.dimensions import Hole, Length
from hardware.drawing.picture import View
from hardware.fasteners import CAMERA, M4, M5
from hardware.mount import joint
from hardware.printed import Printed, Slicing

_RING_VIEW = View(towards_eye=(0.8, -0.8, 0.8), up=(0, 0, 1))
_J = joint.SIZE
_R = _J.disc_radius_mm


def joint_parts() -> tuple[Printed, ...]:
    """The ring, the arm and the knob."""
    return _ring(), _arm(), _knob()


def _ring() -> Printed:
    high = _J.high.longer(0.6)
    bottom, top = _J.low_pitch_z_mm - _J.low.longer(0.6).crest_mm, _J.high_pitch_z_mm + high.crest_mm
    return Printed(
        name="joint-ring",
        hidden_lines=False,
        picture=_RING_VIEW,
        title="Joint: ring",
        group="joint",
        make=joint.ring,
        bed=Location(),
        colour=colours.RING,
        slicing=Slicing(infill_percent=100, bed_face="either: the side with fewer teeth (36)"),
        dimensions=(
            Length(view="front", start=(-_R, 0, 0), end=(_R, 0, 0)),
            Length(view="side", start=(0, 0, bottom), end=(0, 0, top)),
            Hole(view="front", centre=(0, 0, 0), diameter_mm=M5.hole_mm, note="M5", towards_deg=20, leader_mm=44),
            Hole(
                view="front", centre=(0, 0, 0), diameter_mm=2 * high.inner_mm, note="hub", towards_deg=35, leader_mm=42
            ),
        ),
        notes=(
            "36 teeth below (10° a step), 40 above (9° a step); flanks of 45°.",
            f"Figures 0 to 8 on the rim, {joint.ENGRAVED_MM:g} mm deep: digit sum of the tilt, 9 reads 0.",
        ),
    )


def _arm() -> Printed:
    inner, outer = _J.arm_z_mm
    x, _, plate_z = _J.plate_centre_mm
    half, side = _J.plate_screws_mm / 2, _J.plate_side_mm / 2
    return Printed(
        name="joint-arm",
        hidden_lines=False,
        title="Joint: arm",
        group="joint",
        make=joint.arm,
        bed=Rot(180, 0, 0),
        colour=colours.ARM,
        slicing=Slicing(walls=5, infill_percent=50, bed_face="the outer face (teeth up)"),
        dimensions=(
            Length(view="front", start=(0, -_R, 0), end=(x, -side, 0)),
            Length(view="front", start=(-_R, 0, 0), end=(x, -side, 0), at=2),
            Length(view="front", start=(x, -side, 0), end=(x, side, 0), upright=True, at=-1),
            Length(view="top", start=(x, 0, plate_z - side), end=(x, 0, outer), upright=True, at=-1),
            Length(view="top", start=(-_R, 0, inner), end=(-_R, 0, outer), upright=True),
            Length(view="side", start=(x, -half, plate_z - half), end=(x, -half, plate_z + half)),
            Length(view="side", start=(x, -half, plate_z - half), end=(x, half, plate_z - half), upright=True, at=-1),
            Hole(view="front", centre=(0, 0, outer), diameter_mm=M5.hole_mm, note="M5", towards_deg=160, leader_mm=24),
            Hole(
                view="front",
                centre=(_J.reach_mm - 11, 0, outer),
                diameter_mm=_J.tether_mm,
                note="safety cord",
                towards_deg=240,
            ),
            Hole(
                view="side",
                centre=(x, half, plate_z - half),
                diameter_mm=M4.hole_mm,
                count=4,
                note="M4",
                towards_deg=40,
                leader_mm=8,
            ),
            Hole(
                view="side",
                centre=(x, 0, plate_z),
                diameter_mm=CAMERA.hole_mm,
                note='1/4"-20',
                towards_deg=20,
                leader_mm=18,
            ),
        ),
        notes=("40 teeth towards the ring. The pointer stands at a right angle to the beam.",),
    )


def _knob() -> Printed:
    return Printed(
        name="knob",
        title="Knob for M5",
        group="joint and clamps",
        make=joint.knob,
        bed=Location(),
        colour=colours.KNOB,
        slicing=Slicing(infill_percent=60, bed_face="the face without the pocket"),
        dimensions=(
            Length(view="front", start=(-16, 0, 0), end=(16, 0, 0)),
            Length(view="side", start=(0, 0, 0), end=(0, 0, 13)),
            Hole(
                view="front",
                centre=(0, 0, 0),
                diameter_mm=M5.hole_mm,
                note="M5; pocket 8.3 across flats, 6 deep",
                towards_deg=30,
                leader_mm=34,
            ),
        ),
        notes=("Takes an M5 nut, or the head of an M5 hexagon bolt (shelf clamp: print three).",),
    )
