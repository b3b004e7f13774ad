"""From what a panel was told to its picture: the one place that knows which face belongs on which panel.

Runs on MicroPython.
"""

from . import face_digits, face_row, face_wide
from .pixels import DARK, WHITE, Canvas
from .scene import FRAME_MS, Scene
from .segments import DOT, Digits
from .state import SILENT_MS, Panel

LAYOUTS = ("matrix-32x8", "matrix-64x32", "oled-128x64", "digits-8")
"""Four 8 x 8 matrices in a row, a HUB75 matrix, an OLED, eight digits of seven segments."""

_DRAW: dict = {
    "matrix-32x8": face_row.draw,
    "matrix-64x32": face_wide.draw,
    "oled-128x64": face_wide.draw,
    "digits-8": face_digits.draw,
}
TEST_STEPS = 4


def surface(layout: str) -> Canvas | Digits:
    """Something dark to draw on. `layout` is one of `LAYOUTS`."""
    if layout == "digits-8":
        return Digits(8, layout)
    width, height = layout.split("-")[1].split("x")
    return Canvas(int(width), int(height), layout)


def draw(panel: Panel, surface: Canvas | Digits, t_ms: int) -> None:
    """Draws `panel` as it is at `t_ms` on `surface`, which need not be dark."""
    surface.clear()
    _DRAW[surface.layout](Scene(panel, t_ms), surface)


def next_change(panel: Panel, surface: Canvas | Digits, t_ms: int) -> int:  # noqa: ARG001 faces may differ one day
    """The next moment at which the picture may be another one if nothing is fed meanwhile: after `t_ms`, within 3 s."""
    frame = t_ms - t_ms % FRAME_MS
    heard = panel.heard_at
    if heard is None or Scene(panel, t_ms).moves:
        return frame + FRAME_MS
    # Silence is seen at the first frame that is three seconds after the last line.
    due = heard + SILENT_MS
    return max(frame + FRAME_MS, due - due % -FRAME_MS)


def test_picture(surface: Canvas | Digits, step: int) -> None:
    """The self-test at power on, `step` from 0 to `TEST_STEPS` - 1: all lit, two chequers, then the start-up picture."""
    if step == TEST_STEPS - 1:
        draw(Panel(), surface, 0)
    elif isinstance(surface, Canvas):
        _chequer(surface, step)
    else:
        for at in range(surface.count):
            surface.buffer[at] = (0xFF, 0x7F, DOT)[step]


def _chequer(canvas: Canvas, step: int) -> None:
    for y in range(canvas.height):
        for x in range(canvas.width):
            canvas.set(x, y, WHITE if step == 0 or (x + y) % 2 == step - 1 else DARK)
