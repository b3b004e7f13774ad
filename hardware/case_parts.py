"""The cases' printable parts with their dimensions and print settings."""

from functools import partial

from build123d import Location

from hardware import cases
from hardware.boards import DISPLAYS, PI, PICO_HOLES_MM, Display
from hardware.drawing.dimensions import Hole, Length
from hardware.drawing.picture import View
from hardware.fasteners import M2_5, M3, M4
from hardware.printed import Printed, Slicing

TRAY_COLOUR, LID_COLOUR, FRONT_COLOUR, BACK_COLOUR = (120, 160, 190), (150, 190, 120), (150, 150, 160), (205, 190, 160)
_THIN = Slicing(walls=3, infill_percent=20, bed_face="the large flat face")
_FROM_ABOVE = View(towards_eye=(-0.5, -0.9, 1.2), up=(0, 0, 1))


def case_parts() -> tuple[Printed, ...]:
    """The computer's tray and lid, and front and back for each display."""
    return (*_computer(), *(part for display in DISPLAYS for part in _display(display)))


def _computer() -> tuple[Printed, ...]:
    size = cases.CASE
    x, y, height = cases.tray_outer_mm(PI, size)
    x, y = x / 2, y / 2
    left, low = -PI.board_mm[0] / 2, -PI.board_mm[1] / 2
    (hole_x, hole_y), (far_x, far_y) = PI.holes_mm[0], PI.holes_mm[3]
    post_x, post_y = x - size.post_mm / 2, y - size.post_mm / 2
    tray = Printed(
        name="pi-tray",
        title="Pi case: tray",
        group="Pi case",
        make=cases.computer_tray,
        bed=Location(),
        colour=TRAY_COLOUR,
        slicing=_THIN,
        picture=_FROM_ABOVE,
        dimensions=(
            Length(view="front", start=(-x, -y, 0), end=(x, -y, 0), at=2),
            Length(view="front", start=(left + hole_x, low + hole_y, 0), end=(left + far_x, low + hole_y, 0)),
            Length(view="front", start=(-x, -y, 0), end=(-x, y, 0), upright=True, at=2),
            Length(
                view="front", start=(left + hole_x, low + hole_y, 0), end=(left + hole_x, low + far_y, 0), upright=True
            ),
            Length(view="front", start=(-post_x, post_y, 0), end=(post_x, post_y, 0), at=-1),
            Length(view="front", start=(post_x, -post_y, 0), end=(post_x, post_y, 0), upright=True, at=-1),
            Length(view="side", start=(x, -y, 0), end=(x, -y, height)),
            Hole(
                view="front",
                centre=(left + far_x, low + far_y, 8),
                diameter_mm=M2_5.hole_mm,
                count=4,
                note="M2.5",
                towards_deg=25,
                leader_mm=30,
            ),
            Hole(
                view="front",
                centre=(0, y + 6, 5),
                diameter_mm=M4.hole_mm,
                count=2,
                note="M4",
                towards_deg=30,
                leader_mm=14,
            ),
            Hole(
                view="front",
                centre=(-post_x, post_y, height),
                diameter_mm=size.pilot_mm,
                count=4,
                note="for M3 x 10",
                towards_deg=130,
                leader_mm=10,
            ),
        ),
        notes=("Raspberry Pi 4 and 5, with the active cooler. Board: four M2.5 x 12 from below with nuts.",),
    )
    lid = Printed(
        name="pi-lid",
        title="Pi case: lid",
        group="Pi case",
        make=cases.computer_lid,
        bed=Location(),
        colour=LID_COLOUR,
        slicing=_THIN,
        picture=_FROM_ABOVE,
        dimensions=(
            Length(view="front", start=(-x, -y, 0), end=(x, -y, 0), at=2),
            Length(view="front", start=(-post_x, -post_y, 0), end=(post_x, -post_y, 0)),
            Length(view="front", start=(-x, -y, 0), end=(-x, y, 0), upright=True, at=2),
            Length(view="front", start=(-post_x, -post_y, 0), end=(-post_x, post_y, 0), upright=True),
            Length(view="side", start=(x, -y, 0), end=(x, -y, size.floor_mm)),
            Hole(
                view="front",
                centre=(post_x, post_y, 0),
                diameter_mm=M3.hole_mm,
                count=4,
                note="M3",
                towards_deg=30,
                leader_mm=12,
            ),
        ),
    )
    return tray, lid


def _display(display: Display) -> tuple[Printed, ...]:
    size = cases.CASE
    x, y, height = cases.display_outer_mm(display, size)
    x, y = x / 2, y / 2
    window_x, window_y = display.window_mm[0] / 2, display.window_mm[1] / 2
    off_x, off_y = display.window_off_mm
    post_x, post_y = x - size.post_mm / 2, y - size.post_mm / 2
    pico_x, pico_y = PICO_HOLES_MM[0] / 2, PICO_HOLES_MM[1] / 2
    front = Printed(
        name=f"display-front-{display.name}",
        title=f"Display front: {display.name}",
        group=f"display case for {display.title}",
        make=partial(cases.display_front, display),
        bed=Location(),
        colour=FRONT_COLOUR,
        slicing=_THIN,
        picture=_FROM_ABOVE,
        dimensions=(
            Length(view="front", start=(-x, -y, 0), end=(x, -y, 0), at=2),
            Length(
                view="front", start=(off_x - window_x, off_y - window_y, 0), end=(off_x + window_x, off_y - window_y, 0)
            ),
            Length(view="front", start=(-x, -y, 0), end=(-x, y, 0), upright=True, at=2),
            Length(
                view="front",
                start=(off_x - window_x, off_y - window_y, 0),
                end=(off_x - window_x, off_y + window_y, 0),
                upright=True,
            ),
            Length(view="side", start=(x, -y, 0), end=(x, -y, height)),
            Hole(
                view="front",
                centre=(post_x, post_y, height),
                diameter_mm=size.pilot_mm,
                count=4,
                note="for M3 x 10",
                towards_deg=30,
                leader_mm=10,
            ),
        ),
        notes=(f"{display.title}: {display.source}. Measure yours. Fix the module with foam tape.",),
    )
    back = Printed(
        name=f"display-back-{display.name}",
        title=f"Display back: {display.name}",
        group=f"display case for {display.title}",
        make=partial(cases.display_back, display),
        bed=Location(),
        colour=BACK_COLOUR,
        slicing=_THIN,
        picture=_FROM_ABOVE,
        dimensions=(
            Length(view="front", start=(-x, -y, 0), end=(x, -y, 0), at=2),
            Length(view="front", start=(-pico_x, -pico_y, 0), end=(pico_x, -pico_y, 0)),
            Length(view="front", start=(-x, -y, 0), end=(-x, y, 0), upright=True, at=2),
            Length(view="front", start=(-pico_x, -pico_y, 0), end=(-pico_x, pico_y, 0), upright=True),
            Length(view="front", start=(-post_x, post_y, 0), end=(post_x, post_y, 0), at=-1),
            Length(view="side", start=(x, -y, 0), end=(x, -y, size.floor_mm)),
            Hole(
                view="front",
                centre=(post_x, post_y, 0),
                diameter_mm=M3.hole_mm,
                count=4,
                note="M3",
                towards_deg=30,
                leader_mm=12,
            ),
        ),
        notes=(
            "The posts take a Raspberry Pi Pico on four M2 x 6 that cut their own thread; keyholes for 4 mm screws.",
        ),
    )
    return front, back
