"""The printable parts of the mount's three bases with their dimensions and print settings."""

from build123d import Location

from hardware import colours
from hardware.drawing.dimensions import Hole, Length
from hardware.fasteners import M5
from hardware.mount import bases, joint
from hardware.printed import Printed, Slicing

_LYING = Slicing(walls=5, infill_percent=50, bed_face="the back of the cheek (teeth up)")
_J = joint.SIZE
_R = _J.disc_radius_mm
_S = _J.scale_radius_mm
_AXIS = Hole(view="front", centre=(0, 0, 0), diameter_mm=M5.hole_mm, note="M5", towards_deg=250, leader_mm=22)
_TEETH = Hole(
    view="front", centre=(0, 0, 0), diameter_mm=2 * _J.low.outer_mm, note="36 teeth", towards_deg=205, leader_mm=30
)


def base_parts() -> tuple[Printed, ...]:
    """Ceiling, tripod and boom, shelf: each base with what clamps it."""
    return _ceiling(), _rail_jaw(), _boom(), _tube_jaw(), _shelf(), _shelf_pad()


def _ceiling() -> Printed:
    c = bases.CEILING
    half, across = c.width_mm / 2, c.screw_across_mm / 2
    top = c.below_mm + c.plate_mm
    near, far = c.screw_z_mm
    return Printed(
        name="base-ceiling",
        title="Base: ceiling",
        group="ceiling mount",
        make=bases.ceiling_base,
        bed=Location(),
        colour=colours.BASE,
        slicing=_LYING,
        dimensions=(
            Length(view="front", start=(-half, top, 0), end=(half, top, 0), at=-1),
            Length(view="front", start=(0, 0, 0), end=(_S, 0, 0)),
            Length(view="front", start=(half, 0, 0), end=(half, c.below_mm, 0), upright=True, at=-1),
            Length(view="front", start=(-_R, 0, 0), end=(-half, top, 0), upright=True),
            Length(view="top", start=(-across, top, far), end=(across, top, far), at=-1),
            Length(view="top", start=(-half, top, 0), end=(-across, top, near), upright=True),
            Length(view="top", start=(-across, top, near), end=(-across, top, far), upright=True, at=2),
            Length(view="top", start=(half, top, 0), end=(half, top, c.depth_mm), upright=True, at=-1),
            Length(view="side", start=(0, 0, 0), end=(0, -_R, _J.cheek_mm)),
            Hole(
                view="top",
                centre=(across, top, near),
                diameter_mm=M5.hole_mm,
                count=4,
                note="sunk from below",
                towards_deg=30,
                leader_mm=22,
            ),
            _AXIS,
            _TEETH,
            Hole(
                view="front",
                centre=(-8, c.below_mm - 12, 0),
                diameter_mm=_J.tether_mm,
                note="cable tie",
                towards_deg=150,
                leader_mm=34,
            ),
        ),
        notes=(
            "To a ceiling: four 5 mm wood screws. To a T rail of a suspended ceiling: four rail jaws, M5 x 20 countersunk.",
            "The safety cord goes to another fixing than this part.",
        ),
    )


def _rail_jaw() -> Printed:
    c = bases.CEILING
    jaw_reach = c.screw_across_mm / 2 - 3.5
    return Printed(
        name="rail-jaw",
        title="Jaw for a T rail",
        group="ceiling mount on a T rail",
        make=bases.rail_jaw,
        bed=Location(),
        quantity=4,
        colour=colours.CLAMP,
        slicing=Slicing(walls=5, infill_percent=60, bed_face="the face with the pocket"),
        dimensions=(
            Length(view="front", start=(-9, -9, 0), end=(jaw_reach, -9, 0)),
            Length(view="front", start=(0, 0, 0), end=(jaw_reach, -9, 0), at=2),
            Length(view="front", start=(-9, -9, 0), end=(-9, 9, 0), upright=True),
            Length(view="side", start=(0, -9, 0), end=(0, -9, 9)),
            Length(view="side", start=(0, 9, 9 - c.rail_flange_mm), end=(0, 9, 9), at=-1),
            Hole(
                view="front",
                centre=(0, 0, 9),
                diameter_mm=M5.hole_mm,
                note="M5, nut at the back",
                towards_deg=40,
                leader_mm=16,
            ),
        ),
        notes=("The step takes a flange 24 mm wide and up to 2 mm thick.",),
    )


def _boom() -> Printed:
    b = bases.BOOM
    far, half, middle = b.near_mm + b.length_mm, b.height_mm / 2, -b.near_mm - b.length_mm / 2
    low, high = (b.width_mm - b.bolt_across_mm) / 2, (b.width_mm + b.bolt_across_mm) / 2
    return Printed(
        name="base-boom",
        title="Base: tripod and boom",
        group="tripod or boom mount",
        make=bases.boom_base,
        bed=Location(),
        colour=colours.BASE,
        slicing=_LYING,
        dimensions=(
            Length(view="front", start=(-far, -half, 0), end=(0, -_R, 0)),
            Length(view="front", start=(-far, -half, 0), end=(_S, 0, 0), at=2),
            Length(view="front", start=(-far, -half, 0), end=(-far, half, 0), upright=True),
            Length(view="top", start=(-far, half, 0), end=(-b.near_mm, half, 0), at=-1),
            Length(view="top", start=(-far, half, 0), end=(-far, half, b.width_mm), upright=True),
            Length(view="top", start=(middle, half, low), end=(middle, half, high), upright=True, at=-1),
            Length(
                view="side",
                start=(0, half, b.width_mm / 2 - b.groove_mm),
                end=(0, half, b.width_mm / 2 + b.groove_mm),
                at=-1,
            ),
            Length(view="side", start=(0, -_R, 0), end=(0, -_R, _J.cheek_mm)),
            Hole(
                view="top",
                centre=(middle, half, high),
                diameter_mm=M5.hole_mm,
                count=2,
                note="M5",
                towards_deg=-35,
                leader_mm=32,
            ),
            _AXIS,
        ),
        notes=(
            'Tripod: slide a 1/4"-20 nut into the slot; the stud enters from below, in the middle of the block.',
            f"Tube: {b.tube_min_mm:g} to {b.tube_max_mm:g} mm, in the groove under the tube jaw, two M5 x 80.",
        ),
    )


def _tube_jaw() -> Printed:
    b = bases.BOOM
    length = b.length_mm - 16
    return Printed(
        name="tube-jaw",
        title="Jaw for a tube",
        group="boom mount on a tube",
        make=bases.tube_jaw,
        bed=Location(),
        colour=colours.CLAMP,
        slicing=Slicing(walls=5, infill_percent=50, bed_face="the face without the groove"),
        dimensions=(
            Length(view="front", start=(-length / 2, 0, 0), end=(length / 2, 0, 0)),
            Length(
                view="front",
                start=(-length / 2, -b.width_mm / 2, 0),
                end=(-length / 2, b.width_mm / 2, 0),
                upright=True,
                at=2,
            ),
            Length(view="front", start=(0, -b.bolt_across_mm / 2, 0), end=(0, b.bolt_across_mm / 2, 0), upright=True),
            Length(view="side", start=(0, -b.width_mm / 2, 0), end=(0, -b.width_mm / 2, b.jaw_mm)),
            Length(view="side", start=(0, -b.groove_mm, b.jaw_mm), end=(0, b.groove_mm, b.jaw_mm), upright=True, at=1),
            Hole(
                view="front",
                centre=(0, b.bolt_across_mm / 2, b.jaw_mm),
                diameter_mm=M5.hole_mm,
                count=2,
                note="M5",
                towards_deg=30,
                leader_mm=30,
            ),
        ),
    )


def _shelf() -> Printed:
    s = bases.SHELF
    far, half = s.near_mm + s.spine_mm + s.throat_mm, s.opening_mm / 2
    outer = half + s.jaw_mm
    spine = -s.near_mm - s.spine_mm
    first, second = bases.shelf_screws_x_mm()
    return Printed(
        name="base-shelf",
        title="Base: shelf clamp",
        group="shelf mount",
        make=bases.shelf_base,
        bed=Location(),
        colour=colours.BASE,
        slicing=_LYING,
        dimensions=(
            Length(view="front", start=(-far, -outer, 0), end=(spine, -half, 0)),
            Length(view="front", start=(-far, -outer, 0), end=(0, -_R, 0), at=2),
            Length(view="front", start=(-far, -outer, 0), end=(-far, outer, 0), upright=True, at=2),
            Length(view="front", start=(-far, -half, 0), end=(-far, half, 0), upright=True),
            Length(view="top", start=(second, outer, s.width_mm / 2), end=(first, outer, s.width_mm / 2), at=-1),
            Length(view="top", start=(-far, outer, 0), end=(-far, outer, s.width_mm), upright=True),
            Length(view="side", start=(0, -_R, 0), end=(0, -_R, _J.cheek_mm)),
            _AXIS,
            Hole(
                view="front",
                centre=(spine + s.spine_mm / 2, -half - s.jaw_mm / 2, 0),
                diameter_mm=_J.tether_mm,
                note="cable tie",
                towards_deg=-30,
                leader_mm=14,
            ),
        ),
        notes=(
            "Holds boards of 15 to 38 mm. Two M5 x 60 hexagon bolts from below, each with a knob and a pad,",
            "their nuts in the pockets of the lower jaw (print one knob more for the joint).",
        ),
    )


def _shelf_pad() -> Printed:
    return Printed(
        name="shelf-pad",
        title="Pad for a clamp screw",
        group="shelf mount",
        make=bases.shelf_pad,
        bed=Location(),
        quantity=2,
        colour=colours.CLAMP,
        slicing=Slicing(infill_percent=100, bed_face="the closed face"),
        dimensions=(
            Length(view="front", start=(-10, 0, 0), end=(10, 0, 0)),
            Length(view="side", start=(0, 0, 0), end=(0, 0, 7)),
            Length(view="side", start=(0, 0, 0), end=(0, 0, 3), at=2),
            Hole(view="front", centre=(0, 0, 7), diameter_mm=5.4, note="M5's tip", towards_deg=35, leader_mm=34),
        ),
    )
