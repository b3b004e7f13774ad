"""The mount's printable parts with their dimensions and print settings."""

from functools import partial

from build123d import Location, Rot

from hardware.cameras import BOARDS, WEBCAMS, Board, Webcam
from hardware.drawing.dimensions import Hole, Length
from hardware.drawing.picture import View
from hardware.fasteners import CAMERA, M4, M5
from hardware.mount import bases, cradles, joint
from hardware.printed import Printed, Slicing

BASE_COLOUR, RING_COLOUR, ARM_COLOUR = (120, 160, 190), (240, 170, 60), (150, 190, 120)
KNOB_COLOUR, CRADLE_COLOUR, BAR_COLOUR, CLAMP_COLOUR = (220, 110, 90), (190, 160, 210), (170, 130, 200), (205, 190, 160)

_RING_VIEW = View(towards_eye=(0.8, -0.8, 0.8), up=(0, 0, 1))
_LYING = Slicing(walls=5, infill_percent=50, bed_face="the back of the cheek (teeth up)")
_J = joint.SIZE
_R = _J.disc_radius_mm
_S = _J.scale_radius_mm
_AXIS = Hole(view="front", centre=(0, 0, 0), diameter_mm=M5.hole_mm, note="M5", towards_deg=250, leader_mm=22)
_TEETH = Hole(
    view="front", centre=(0, 0, 0), diameter_mm=2 * _J.low.outer_mm, note="36 teeth", towards_deg=205, leader_mm=30
)


def mount_parts() -> tuple[Printed, ...]:
    """All parts of the joint, the three bases and the cradles."""
    webcams = [part for camera in WEBCAMS for part in _webcam(camera)]
    return (*_joint(), *_ceiling(), *_boom(), *_shelf(), *webcams, *(_board(camera) for camera in BOARDS), _thread())


def _joint() -> tuple[Printed, ...]:
    low_z, high_z = _J.low_pitch_z_mm, _J.high_pitch_z_mm
    inner, outer = _J.arm_z_mm
    x, _, plate_z = _J.plate_centre_mm
    half, side = _J.plate_screws_mm / 2, _J.plate_side_mm / 2
    low = _J.low.longer(0.6)
    high = _J.high.longer(0.6)
    bottom, top = low_z - low.crest_mm, high_z + high.crest_mm
    ring = Printed(
        name="joint-ring",
        hidden_lines=False,
        picture=_RING_VIEW,
        title="Joint: ring",
        group="joint",
        make=joint.ring,
        bed=Location(),
        colour=RING_COLOUR,
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
    arm = Printed(
        name="joint-arm",
        hidden_lines=False,
        title="Joint: arm",
        group="joint",
        make=joint.arm,
        bed=Rot(180, 0, 0),
        colour=ARM_COLOUR,
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
    knob = Printed(
        name="knob",
        title="Knob for M5",
        group="joint and clamps",
        make=joint.knob,
        bed=Location(),
        colour=KNOB_COLOUR,
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
    return ring, arm, knob


def _ceiling() -> tuple[Printed, ...]:
    c = bases.CEILING
    half, across = c.width_mm / 2, c.screw_across_mm / 2
    top = c.below_mm + c.plate_mm
    near, far = c.screw_z_mm
    base = Printed(
        name="base-ceiling",
        title="Base: ceiling",
        group="ceiling mount",
        make=bases.ceiling_base,
        bed=Location(),
        colour=BASE_COLOUR,
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
    jaw_reach = across - 3.5
    jaw = Printed(
        name="rail-jaw",
        title="Jaw for a T rail",
        group="ceiling mount on a T rail",
        make=bases.rail_jaw,
        bed=Location(),
        quantity=4,
        colour=CLAMP_COLOUR,
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
    return base, jaw


def _boom() -> tuple[Printed, ...]:
    b = bases.BOOM
    far, half, middle = b.near_mm + b.length_mm, b.height_mm / 2, -b.near_mm - b.length_mm / 2
    low, high = (b.width_mm - b.bolt_across_mm) / 2, (b.width_mm + b.bolt_across_mm) / 2
    base = Printed(
        name="base-boom",
        title="Base: tripod and boom",
        group="tripod or boom mount",
        make=bases.boom_base,
        bed=Location(),
        colour=BASE_COLOUR,
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
    length = b.length_mm - 16
    jaw = Printed(
        name="tube-jaw",
        title="Jaw for a tube",
        group="boom mount on a tube",
        make=bases.tube_jaw,
        bed=Location(),
        colour=CLAMP_COLOUR,
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
    return base, jaw


def _shelf() -> tuple[Printed, ...]:
    s = bases.SHELF
    far, half = s.near_mm + s.spine_mm + s.throat_mm, s.opening_mm / 2
    outer = half + s.jaw_mm
    spine = -s.near_mm - s.spine_mm
    first, second = bases.shelf_screws_x_mm()
    base = Printed(
        name="base-shelf",
        title="Base: shelf clamp",
        group="shelf mount",
        make=bases.shelf_base,
        bed=Location(),
        colour=BASE_COLOUR,
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
    pad = Printed(
        name="shelf-pad",
        title="Pad for a clamp screw",
        group="shelf mount",
        make=bases.shelf_pad,
        bed=Location(),
        quantity=2,
        colour=CLAMP_COLOUR,
        slicing=Slicing(infill_percent=100, bed_face="the closed face"),
        dimensions=(
            Length(view="front", start=(-10, 0, 0), end=(10, 0, 0)),
            Length(view="side", start=(0, 0, 0), end=(0, 0, 7)),
            Length(view="side", start=(0, 0, 0), end=(0, 0, 3), at=2),
            Hole(view="front", centre=(0, 0, 7), diameter_mm=5.4, note="M5's tip", towards_deg=35, leader_mm=34),
        ),
    )
    return base, pad


def _webcam(camera: Webcam) -> tuple[Printed, ...]:
    c = cradles.CRADLE
    half = camera.width_mm / 2 + c.foam_mm + c.ear_mm
    below = camera.height_mm / 2 + c.foam_mm + c.jaw_mm
    above = max(cradles.webcam_jaw_y_mm(camera), _J.plate_side_mm / 2)
    depth = cradles.webcam_reach_mm(camera)
    screw_x, screw_z = cradles.webcam_screws_x_mm(camera)[1], cradles.webcam_screw_z_mm(camera)
    plate, gap = _J.plate_screws_mm / 2, cradles.jaw_gap_mm(camera) / 2
    cradle = Printed(
        name=f"cradle-{camera.name}",
        title=f"Cradle: {camera.title}",
        group=f"cradle for {camera.title}",
        make=partial(cradles.webcam_cradle, camera),
        bed=Location(),
        colour=CRADLE_COLOUR,
        slicing=Slicing(bed_face="the back"),
        dimensions=(
            Length(view="front", start=(-half, -below, 0), end=(half, -below, 0), at=2),
            Length(view="front", start=(-gap, -below, depth), end=(gap, -below, depth)),
            Length(view="front", start=(-half, -below, 0), end=(-half, above, 0), upright=True),
            Length(view="front", start=(-plate, plate, 0), end=(plate, plate, 0), at=-1),
            Length(view="front", start=(plate, -plate, 0), end=(plate, plate, 0), upright=True, at=-1),
            Length(view="top", start=(-screw_x, 0, screw_z), end=(screw_x, 0, screw_z), at=-1),
            Length(view="top", start=(half, 0, 0), end=(screw_x, 0, screw_z), upright=True, at=-1),
            Length(view="side", start=(0, -below, 0), end=(0, -below, depth)),
            Length(view="side", start=(0, above, 0), end=(0, above, c.back_mm), at=-1),
            Hole(
                view="front",
                centre=(-plate, plate, c.back_mm),
                diameter_mm=M4.hole_mm,
                count=4,
                note="M4, nuts in front",
                towards_deg=195,
                leader_mm=10,
            ),
        ),
        notes=(
            f"Body: {camera.width_mm:g} x {camera.height_mm:g} x {camera.depth_mm:g} mm; foam: {c.foam_mm:g} mm a side.",
            "Two M4 x 50 beside the camera draw the bar down; their nuts lie in the lower jaw.",
        ),
    )
    bar_depth = camera.depth_mm * 0.8
    bar = Printed(
        name=f"bar-{camera.name}",
        title=f"Bar: {camera.title}",
        group=f"cradle for {camera.title}",
        make=partial(cradles.webcam_bar, camera),
        bed=Location(),
        colour=BAR_COLOUR,
        slicing=Slicing(bed_face="either flat face"),
        dimensions=(
            Length(view="front", start=(-half, -bar_depth / 2, 0), end=(half, -bar_depth / 2, 0), at=2),
            Length(view="front", start=(-screw_x, 0, 0), end=(screw_x, 0, 0)),
            Length(view="front", start=(-half, -bar_depth / 2, 0), end=(-half, bar_depth / 2, 0), upright=True),
            Length(view="side", start=(0, -bar_depth / 2, 0), end=(0, -bar_depth / 2, c.jaw_mm)),
            Hole(
                view="front",
                centre=(screw_x, 0, c.jaw_mm),
                diameter_mm=M4.hole_mm,
                count=2,
                note="M4",
                towards_deg=40,
                leader_mm=14,
            ),
        ),
    )
    return cradle, bar


def _board(camera: Board) -> Printed:
    c = cradles.CRADLE
    rise = cradles.board_rise_mm(camera)
    half = max(_J.plate_side_mm, camera.width_mm + 8) / 2
    top = max(_J.plate_side_mm / 2, rise + camera.height_mm / 2 + 4)
    bottom = -_J.plate_side_mm / 2
    x, up = camera.holes_across_mm / 2, camera.holes_up_mm / 2
    plate = _J.plate_screws_mm / 2
    tip = c.back_mm + camera.standoff_mm
    return Printed(
        name=f"cradle-{camera.name}",
        title=f"Cradle: {camera.title}",
        group=f"cradle for {camera.title}",
        make=partial(cradles.board_cradle, camera),
        bed=Location(),
        colour=CRADLE_COLOUR,
        slicing=Slicing(bed_face="the back"),
        dimensions=(
            Length(view="front", start=(-half, bottom, 0), end=(half + 11, bottom, 0), at=2),
            Length(view="front", start=(-plate, -plate, 0), end=(plate, -plate, 0)),
            Length(view="front", start=(-x, rise + up, 0), end=(x, rise + up, 0), at=-1),
            Length(view="front", start=(-half, bottom, 0), end=(-half, top, 0), upright=True, at=2),
            Length(view="front", start=(-x, rise - up, 0), end=(-x, rise + up, 0), upright=True),
            Length(view="front", start=(plate, -plate, 0), end=(plate, plate, 0), upright=True, at=-1),
            Length(view="side", start=(0, bottom, 0), end=(0, bottom, c.back_mm)),
            Length(view="side", start=(0, top, 0), end=(0, rise + up, tip), at=-1),
            Hole(
                view="front",
                centre=(x, rise + up, tip),
                diameter_mm=camera.screw.hole_mm,
                count=4,
                note=f"{camera.screw.name}, nuts behind",
                towards_deg=20,
                leader_mm=22,
            ),
            Hole(
                view="front",
                centre=(half + 5, bottom + 6, c.back_mm),
                diameter_mm=c.tether_mm,
                note="safety cord",
                towards_deg=-20,
                leader_mm=16,
            ),
        ),
        notes=(f"Four {camera.screw.name} x 16 from the front. Measure your board's holes before you print.",),
    )


def _thread() -> Printed:
    c = cradles.CRADLE
    half = _J.plate_side_mm / 2
    return Printed(
        name="cradle-thread",
        title='Cradle: any camera with a 1/4" thread',
        group="cradle for any camera with a tripod thread",
        make=cradles.thread_cradle,
        bed=Location(),
        colour=CRADLE_COLOUR,
        slicing=Slicing(bed_face="the back"),
        dimensions=(
            Length(view="front", start=(-half, -half, 0), end=(half, -half, 0)),
            Length(view="front", start=(-half, -half - c.jaw_mm, 0), end=(-half, half, 0), upright=True),
            Length(view="side", start=(0, -half, 0), end=(0, -half, 52)),
            Length(view="side", start=(0, half, 0), end=(0, half, c.back_mm), at=-1),
            Length(view="side", start=(0, -half - c.jaw_mm, 52), end=(0, -half, 52), upright=True, at=1),
        ),
        notes=('The long hole takes a 1/4"-20 screw from below: 6 mm of plastic and a washer, then the camera.',),
    )
