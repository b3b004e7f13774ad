"""Cases: a tray and lid for the computer, a front and back for each display with a Pico behind it.

Knows printable boxes, in mm. Frames: x to the right, y up the plan, z up from the print bed; every case part lies on z = 0
as it is printed. Openings are wider than the plugs, since plugs differ.
"""

from dataclasses import dataclass
from functools import cache

from build123d import Align, Box, Cylinder, Part, Pos

from hardware.boards import PI, PICO_HOLES_MM, PICO_MM, Computer, Display
from hardware.fasteners import LOW, M2_5, M3, M4, bore

_CORNER = (Align.MIN, Align.MIN, Align.MIN)
_FLAT = (Align.CENTER, Align.CENTER, Align.MIN)


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseSize:
    """What all cases have in common, in mm."""

    wall_mm: float = 2.4
    floor_mm: float = 2.4
    play_mm: float = 0.8
    """Round a board, on each side."""
    post_mm: float = 7.0
    """Side of the corner posts that take the lid's M3 screws."""
    beside_mm: float = 2.5
    """Between the computer's long sides and the walls: the posts must clear the sockets at its end."""
    pilot_mm: float = 2.6
    """A hole in which an M3 screw cuts its own thread."""


CASE = CaseSize()


@cache
def computer_tray(board: Computer = PI, size: CaseSize = CASE) -> Part:
    """Floor with four posts for the board, walls with openings for all sockets, two lugs with M4 holes."""
    outer_x, outer_y, height = tray_outer_mm(board, size)
    body = Box(outer_x, outer_y, height, align=_FLAT)
    inner_x, inner_y = outer_x - 2 * size.wall_mm, outer_y - 2 * size.wall_mm
    body -= Pos(0, 0, size.floor_mm) * Box(inner_x, inner_y, height, align=_FLAT)
    for x, y in _corners(outer_x - size.post_mm, outer_y - size.post_mm):
        body += Pos(x, y, 0) * Box(size.post_mm, size.post_mm, height, align=_FLAT)
        body -= Pos(x, y, height - 14) * bore(size.pilot_mm, 20)
    origin = Pos(-board.board_mm[0] / 2, -board.board_mm[1] / 2, 0)
    board_z = size.floor_mm + board.below_mm
    for x, y in board.holes_mm:
        body += origin * Pos(x, y, 0) * Cylinder(3.2, board_z, align=LOW)
        body -= origin * Pos(x, y, -1) * bore(M2_5.hole_mm, 40)
        # The screws come from below, their heads sunk into the floor.
        body -= origin * Pos(x, y, -1) * bore(M2_5.head_mm, 1 + 2.0)
    body -= _sockets(board, (outer_x, outer_y, height), board_z, size)
    body -= _slots(46, 30, 7, thickness=size.floor_mm)
    for side in (-1, 1):
        lug = Pos(0, side * (outer_y / 2 + 5), 0) * Box(16, 12, 5, align=_FLAT)
        body += lug - Pos(0, side * (outer_y / 2 + 6), -1) * bore(M4.hole_mm, 10)
    return body


@cache
def computer_lid(board: Computer = PI, size: CaseSize = CASE) -> Part:
    """A plate with air slots, held by four M3 screws; a rim keeps it in place."""
    outer_x, outer_y, _ = tray_outer_mm(board, size)
    body = Box(outer_x, outer_y, size.floor_mm, align=_FLAT)
    rim_x, rim_y = outer_x - 2 * size.wall_mm - 0.6, outer_y - 2 * size.wall_mm - 0.6
    rim = Box(rim_x, rim_y, size.floor_mm + 2, align=_FLAT) - Pos(0, 0, -1) * Box(
        rim_x - 3.2, rim_y - 3.2, 20, align=_FLAT
    )
    for x, y in _corners(outer_x - size.post_mm, outer_y - size.post_mm):
        rim -= Pos(x, y, -1) * Box(size.post_mm + 0.8, size.post_mm + 0.8, 20, align=_FLAT)
        body -= Pos(x, y, -1) * bore(M3.hole_mm, 20)
    return body + rim - _slots(62, 40, 10, thickness=size.floor_mm)


@cache
def display_front(display: Display, size: CaseSize = CASE) -> Part:
    """The bezel, face down: window, a frame that holds the module, walls, posts for the back's screws, a slot for the cable."""
    outer_x, outer_y, height = display_outer_mm(display, size)
    body = Box(outer_x, outer_y, height, align=_FLAT)
    inner = Box(outer_x - 2 * size.wall_mm, outer_y - 2 * size.wall_mm, height, align=_FLAT)
    body -= Pos(0, 0, size.floor_mm) * inner
    off_x, off_y = display.window_off_mm
    body -= Pos(off_x, off_y, -1) * Box(*display.window_mm, 20, align=_FLAT)
    frame_x, frame_y = display.module_mm[0] + size.play_mm, display.module_mm[1] + size.play_mm
    frame = Box(frame_x + 4, frame_y + 4, size.floor_mm + 4, align=_FLAT)
    frame &= Box(outer_x, outer_y, height, align=_FLAT)
    frame -= Pos(0, 0, -1) * Box(frame_x, frame_y, 20, align=_FLAT)
    body += frame
    for x, y in _corners(outer_x - size.post_mm, outer_y - size.post_mm):
        body += Pos(x, y, 0) * Box(size.post_mm, size.post_mm, height, align=_FLAT)
        body -= Pos(x, y, height - 14) * bore(size.pilot_mm, 20)
    # The cable leaves at the bottom, against the back.
    body -= Pos(0, -outer_y / 2, height - 10) * Box(16, 20, 20, align=_FLAT)
    return body


@cache
def display_back(display: Display, size: CaseSize = CASE) -> Part:
    """The back: four posts for a Raspberry Pi Pico, two keyholes to hang it by, holes for the screws."""
    outer_x, outer_y, _ = display_outer_mm(display, size)
    body = Box(outer_x, outer_y, size.floor_mm, align=_FLAT)
    for x, y in _corners(outer_x - size.post_mm, outer_y - size.post_mm):
        body -= Pos(x, y, -1) * bore(M3.hole_mm, 20)
    for x, y in _corners(*PICO_HOLES_MM):
        body += Pos(x, y, 0) * Cylinder(2.2, size.floor_mm + 4, align=LOW)
        body -= Pos(x, y, 1.0) * bore(1.7, 20)
    for side in (-1, 1):
        x, y = side * (PICO_MM[0] / 2 + 7), outer_y / 2 - size.post_mm - 6
        body -= (
            Pos(x, y - 5, -1) * bore(8.0, 20)
            + Pos(x, y, -1) * bore(4.2, 20)
            + Pos(x, y - 2.5, -1) * Box(4.2, 5, 20, align=_FLAT)
        )
    return body


def tray_outer_mm(board: Computer, size: CaseSize) -> tuple[float, float, float]:
    """Length, width and height of the tray. The posts stand beyond the board's ends: the long sides stay free for sockets."""
    across = board.board_mm[0] + 2 * (size.wall_mm + size.play_mm + size.post_mm)
    up = board.board_mm[1] + 2 * (size.wall_mm + size.beside_mm)
    return across, up, size.floor_mm + board.below_mm + board.thickness_mm + board.above_mm


def _sockets(board: Computer, outer: tuple[float, float, float], board_z: float, size: CaseSize) -> list[Part]:
    """Cutters for plugs, card and wires; x and y of the sockets are those of a Pi 4 and 5."""
    outer_x, outer_y, height = outer
    long, short = board.board_mm
    end = size.post_mm + size.wall_mm + 1
    low = board_z - 1.5
    through_wall = size.wall_mm + 1
    origin = Pos(-long / 2, -outer_y / 2, 0)
    return [
        # USB and Ethernet: the whole end. The card: a notch through the floor, for a finger.
        Pos(outer_x / 2 - end, -short / 2 + 2, low) * Box(end + 1, short - 4, height, align=_CORNER),
        Pos(-outer_x / 2 - 1, -12, -1) * Box(end + 1, 24, board_z + 5, align=_CORNER),
        # USB-C, HDMI, audio along one side; the header's wires and the ribbons along the other.
        origin * Pos(3, -1, low) * Box(58, through_wall, 14, align=_CORNER),
        origin * Pos(6, outer_y - size.wall_mm, height - 10) * Box(58, through_wall, 6, align=_CORNER),
    ]


def display_outer_mm(display: Display, size: CaseSize) -> tuple[float, float, float]:
    """Width, height and depth of a display's case, with room for a Pico and its cable behind the module."""
    width = max(display.module_mm[0], PICO_MM[0] + 30) + 2 * (size.wall_mm + size.play_mm)
    tall = max(display.module_mm[1], PICO_MM[1] + 6) + 2 * (size.post_mm + size.play_mm)
    return width, tall, size.floor_mm + display.depth_mm + 16


def _corners(across: float, up: float) -> list[tuple[float, float]]:
    return [(x, y) for x in (-across / 2, across / 2) for y in (-up / 2, up / 2)]


def _slots(width: float, length: float, count: int, *, thickness: float) -> list[Part]:
    pitch = width / count
    return [
        Pos((number - (count - 1) / 2) * pitch, 0, -1) * Box(2.5, length, thickness + 2, align=_FLAT)
        for number in range(count)
    ]
