"""The face of a single row of letters, 32 x 8 pixels of one colour: one thing at a time, messages run through.

Runs on MicroPython.
"""

from .glyphs import SMALL, TALL, Font
from .pixels import WHITE, Canvas
from .scene import COUNT, END, GO, GRID, LAP, OUT, RUN, SILENT, START, WAIT, Scene, first_that_fits

STEP_MS = 40
"""A message moves one pixel in this time."""


def draw(scene: Scene, canvas: Canvas) -> None:
    """Draws `scene` on a dark `canvas`."""
    text = "   ".join(scene.texts)
    at = scene.passing(canvas.width, TALL.width(text), STEP_MS) if text else None
    if at is not None:
        canvas.text(at, 0, text, WHITE)
    elif scene.told.camera_lost and scene.what == RUN and not scene.blink(1200, 1200):
        _middle(canvas, "NO CAM")
    else:
        _FACES[scene.what](scene, canvas)
    if scene.crossing and scene.blink(120, 80):
        canvas.invert(WHITE)


def _middle(canvas: Canvas, text: str, font: Font = TALL) -> None:
    canvas.text((canvas.width - font.width(text)) // 2, (7 - font.height) // 2, text, WHITE, font)


def _right(canvas: Canvas, text: str) -> None:
    canvas.text(canvas.width - TALL.width(text), 0, text, WHITE)


def _fits(canvas: Canvas, room: int = 0):
    return lambda text: TALL.width(text) <= canvas.width - room


def _start(scene: Scene, canvas: Canvas) -> None:
    _middle(canvas, "DNB-EDGE", SMALL)
    canvas.fill(scene.t_ms // 80 % canvas.width - 1, canvas.height - 1, 3, 1, WHITE)


def _silent(scene: Scene, canvas: Canvas) -> None:
    if scene.blink(800, 400):
        _middle(canvas, "NO LINK", SMALL)


def _count(scene: Scene, canvas: Canvas) -> None:
    _middle(canvas, scene.count or "SET")


def _go(scene: Scene, canvas: Canvas) -> None:
    _middle(canvas, "GO!")
    if scene.blink(200, 200):
        canvas.invert(WHITE)


def _lap(scene: Scene, canvas: Canvas) -> None:
    lap = scene.lap
    if scene.better and not scene.blink(600, 400):
        _middle(canvas, "BEST")
    elif not lap.valid and not scene.blink(600, 400):
        _middle(canvas, "BAD")
    else:
        _right(canvas, first_that_fits(lap.official_ms, 3, _fits(canvas)))


def _run(scene: Scene, canvas: Canvas) -> None:
    number = str(scene.told.run_lap)
    room = SMALL.width(number) + 2
    time = first_that_fits(scene.running_ms, 2, _fits(canvas, room))
    _right(canvas, time)
    if _fits(canvas, room)(time):
        canvas.text(0, 2, number, WHITE, SMALL)


def _end(scene: Scene, canvas: Canvas) -> None:
    best = scene.told.best
    if best is None or scene.blink(1520, 2520):
        _middle(canvas, "END")
    else:
        _right(canvas, first_that_fits(best[1], 3, _fits(canvas)))


def _word(word: str):
    def face(scene: Scene, canvas: Canvas) -> None:  # noqa: ARG001 as every face
        _middle(canvas, word)

    return face


_FACES = {
    START: _start, SILENT: _silent, COUNT: _count, GO: _go, LAP: _lap, RUN: _run, END: _end,
    GRID: _word("GRID"), OUT: _word("OUT"), WAIT: _word("WAIT"),
}  # fmt: skip
