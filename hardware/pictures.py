"""The pictures of the assembly page: mounts and cases put together and taken apart.

Knows which bodies are drawn from where, with what name beside them. Knows no dimensions.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

from build123d import Box, Pos, Rot

from hardware import cases, colours
from hardware.boards import MATRIX_32X8, PI
from hardware.cameras import C920, ELP_38, PI_HQ_GS
from hardware.drawing.picture import Body, Shaded, View, shaded
from hardware.fasteners import LOW
from hardware.mount.assembly import Camera, Placed, fasteners, mount

_COLOURS = {
    "base": colours.BASE,
    "ring": colours.RING,
    "arm": colours.ARM,
    "knob": colours.KNOB,
    "cradle": colours.CRADLE,
    "bar": colours.BAR,
    "camera": (110, 115, 125),
    "tray": colours.BASE,
    "lid": colours.ARM,
    "front": colours.BASE,
}
_CLAMP, _BOUGHT = colours.CLAMP, (185, 190, 195)
_COLUMNS, _ROW_MM, _LEADER_MM = 3, 9.0, 11.0
_BELOW = View(towards_eye=(0.75, -0.35, 1.0), up=(0, 1, 0))
_ABOVE = View(towards_eye=(0.75, 0.4, 1.0), up=(0, 1, 0))
_CASE = View(towards_eye=(-0.55, -1.0, 0.9), up=(0, 0, 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One picture: its file's name, what it shows in words, its bodies and from where they are seen."""

    name: str
    title: str
    bodies: Callable[[], Sequence[Placed]]
    view: View
    apart: bool

    def draw(self) -> str:
        """The picture as an SVG document."""
        return _svg(self.title, self.bodies(), self.view, apart=self.apart)


def pictures() -> tuple[Picture, ...]:
    """All pictures, in the order of the assembly page."""
    return (
        Picture(name="joint-apart", title="The tilt joint, taken apart", bodies=_joint, view=_ABOVE, apart=True),
        *_mounts("ceiling", C920, 41, _BELOW),
        *_mounts("boom", ELP_38, 60, _ABOVE),
        *_mounts("shelf", PI_HQ_GS, 20, _ABOVE),
        Picture(name="pi-case-apart", title="Raspberry Pi case, taken apart", bodies=_computer, view=_CASE, apart=True),
        Picture(name="display-case-apart", title="Display case, taken apart", bodies=_display, view=_CASE, apart=True),
    )


def _mounts(base: str, camera: Camera, tilt: int, view: View) -> tuple[Picture, Picture]:
    """One mount put together at a tilt, and taken apart at 0."""
    title = f"{base.capitalize()} mount with {camera.title}"
    return (
        Picture(
            name=f"mount-{base}",
            title=f"{title} at {tilt} degrees",
            bodies=lambda: mount(base, camera, tilt),
            view=view,
            apart=False,
        ),
        Picture(
            name=f"mount-{base}-apart",
            title=f"{title}, taken apart",
            bodies=lambda: [*mount(base, camera, 0), *fasteners()],
            view=view,
            apart=True,
        ),
    )


def _joint() -> list[Placed]:
    return [body for body in (*mount("shelf", None, 0), *fasteners()) if body.name not in {"pad", "M4 x 12"}]


def _computer() -> list[Placed]:
    floor = cases.CASE.floor_mm
    length, width = PI.board_mm
    board = Pos(0, 0, floor + PI.below_mm) * Box(length, width, PI.thickness_mm, align=LOW)
    sockets = floor + PI.below_mm + PI.thickness_mm
    for y in (-19, 1, 19):
        board += Pos(length / 2 - 8, y, sockets) * Box(20, 14, 15, align=LOW)
    board += Pos(-10, 0, sockets) * Box(16, 16, 2, align=LOW)
    top = cases.tray_outer_mm(PI, cases.CASE)[2]
    lid = Pos(0, 0, top + floor) * Rot(180, 0, 0) * cases.computer_lid()
    return [
        Placed(name="tray", shape=cases.computer_tray(), apart=(0, 0, 0)),
        Placed(name="Raspberry Pi", shape=board, apart=(0, 0, 45), bought=True),
        Placed(name="lid", shape=lid, apart=(0, 0, 85)),
    ]


def _display() -> list[Placed]:
    display = MATRIX_32X8
    floor = cases.CASE.floor_mm
    depth = cases.display_outer_mm(display, cases.CASE)[2]
    module = Pos(0, 0, floor) * Box(*display.module_mm, 2, align=LOW)
    for number in range(4):
        module += Pos((number - 1.5) * 32, 0, floor - 2) * Box(31.6, 31.6, 10, align=LOW)
    pico = Pos(0, 0, depth - floor - 6) * Box(51, 21, 2, align=LOW)
    back = Pos(0, 0, depth + floor) * Rot(180, 0, 0) * cases.display_back(display)
    return [
        Placed(name="front", shape=cases.display_front(display), apart=(0, 0, 0)),
        Placed(name="LED matrix", shape=module, apart=(0, 0, 40), bought=True),
        Placed(name="Pico", shape=pico, apart=(0, 0, 62), bought=True),
        Placed(name="back", shape=back, apart=(0, 0, 85)),
    ]


def _svg(title: str, placed: Sequence[Placed], view: View, *, apart: bool) -> str:
    bodies = [
        Body(shape=each.shape, colour=_colour(each), offset_mm=each.apart if apart else (0, 0, 0)) for each in placed
    ]
    drawn = shaded(bodies, view)
    x0, y0, x1, y1 = drawn.bounds
    x0, y0, width, height = x0 - 14, y0 - 14, x1 - x0 + 28, y1 - y0 + 28
    names = list(dict.fromkeys(body.name for body in placed))
    rows = -(-len(names) // _COLUMNS) if apart else 0
    balloons = _balloons(placed, names, drawn) + _legend(names, x0, y0 + height, width) if apart else ""
    height += rows * _ROW_MM
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{x0:.2f} {y0:.2f} {width:.2f} {height:.2f}" '
        f'width="{width * 3:.0f}" height="{height * 3:.0f}" font-family="Helvetica, Arial, sans-serif" font-size="5">'
        f"<title>{escape(title)}</title>"
        f'<rect x="{x0:.2f}" y="{y0:.2f}" width="{width:.2f}" height="{height:.2f}" fill="#fff"/>\n'
        f"{drawn.svg}\n{balloons}</svg>\n"
    )


def _balloons(placed: Sequence[Placed], names: Sequence[str], drawn: Shaded) -> str:
    """A number beside one body of each name, on a leader that points away from the picture's middle."""
    x0, y0, x1, y1 = drawn.bounds
    out = []
    for number, name in enumerate(names, start=1):
        spots = [spot for body, spot in zip(placed, drawn.spots, strict=True) if body.name == name and spot is not None]
        if not spots:
            continue
        x, y, _ = max(spots, key=lambda spot: spot[2])
        away_x, away_y = x - (x0 + x1) / 2, y - (y0 + y1) / 2
        length = math.hypot(away_x, away_y) or 1.0
        end_x, end_y = x + _LEADER_MM * away_x / length, y + _LEADER_MM * away_y / length
        out.append(
            f'<path d="M{x:.2f} {y:.2f}L{end_x:.2f} {end_y:.2f}" stroke="#111" stroke-width="0.4"/>'
            f'<circle cx="{x:.2f}" cy="{y:.2f}" r="0.8" fill="#111"/>{_balloon(number, end_x, end_y)}\n'
        )
    return "".join(out)


def _legend(names: Sequence[str], x0: float, y0: float, width: float) -> str:
    out = []
    for index, name in enumerate(names):
        x, y = x0 + 8 + index % _COLUMNS * (width - 8) / _COLUMNS, y0 + index // _COLUMNS * _ROW_MM
        words = f'<text x="{x + 5.5:.2f}" y="{y + 1.8:.2f}" fill="#111">{escape(name)}</text>'
        out.append(f"{_balloon(index + 1, x, y)}{words}\n")
    return "".join(out)


def _balloon(number: int, x: float, y: float) -> str:
    return (
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="3.6" fill="#fff" stroke="#111" stroke-width="0.4"/>'
        f'<text x="{x:.2f}" y="{y + 1.8:.2f}" text-anchor="middle" fill="#111">{number}</text>'
    )


def _colour(body: Placed) -> tuple[int, int, int]:
    return _BOUGHT if body.bought and body.name != "camera" else _COLOURS.get(body.name, _CLAMP)
