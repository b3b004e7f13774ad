"""The cameras' printable cradles with their dimensions and print settings."""

from functools import partial

from build123d import Location

from hardware import colours
from hardware.cameras import BOARDS, WEBCAMS, Board, Webcam
from hardware.drawing.dimensions import Hole, Length
from hardware.fasteners import M4
from hardware.mount import cradles, joint
from hardware.printed import Printed, Slicing

_J = joint.SIZE


def cradle_parts() -> tuple[Printed, ...]:
    """A cradle and a bar for each webcam, a cradle for each board, one for any camera with a thread."""
    webcams = [part for camera in WEBCAMS for part in (_webcam(camera), _bar(camera))]
    return (*webcams, *(_board(camera) for camera in BOARDS), _thread())


def _half_width_mm(camera: Webcam) -> float:
    return camera.width_mm / 2 + cradles.CRADLE.foam_mm + cradles.CRADLE.ear_mm


def _webcam(camera: Webcam) -> Printed:
    c = cradles.CRADLE
    half = _half_width_mm(camera)
    below = camera.height_mm / 2 + c.foam_mm + c.jaw_mm
    above = max(cradles.webcam_jaw_y_mm(camera), _J.plate_side_mm / 2)
    depth = cradles.webcam_reach_mm(camera)
    screw_x, screw_z = cradles.webcam_screws_x_mm(camera)[1], cradles.webcam_screw_z_mm(camera)
    plate, gap = _J.plate_screws_mm / 2, cradles.jaw_gap_mm(camera) / 2
    return Printed(
        name=f"cradle-{camera.name}",
        title=f"Cradle: {camera.title}",
        group=f"cradle for {camera.title}",
        make=partial(cradles.webcam_cradle, camera),
        bed=Location(),
        colour=colours.CRADLE,
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


def _bar(camera: Webcam) -> Printed:
    c, half = cradles.CRADLE, _half_width_mm(camera)
    screw_x = cradles.webcam_screws_x_mm(camera)[1]
    bar_depth = camera.depth_mm * 0.8
    return Printed(
        name=f"bar-{camera.name}",
        title=f"Bar: {camera.title}",
        group=f"cradle for {camera.title}",
        make=partial(cradles.webcam_bar, camera),
        bed=Location(),
        colour=colours.BAR,
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
        colour=colours.CRADLE,
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
        colour=colours.CRADLE,
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
