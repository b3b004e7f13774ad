"""The face of eight digits of seven segments: lap and time side by side, messages run through. Runs on MicroPython."""

from .scene import COUNT, END, GO, GRID, LAP, OUT, RUN, SILENT, START, WAIT, Scene, first_that_fits
from .segments import DOT, Digits, shapes

STEP_MS = 320
"""A message moves one digit in this time."""


def draw(scene: Scene, digits: Digits) -> None:
    """Draws `scene` on dark `digits`."""
    text = "   ".join(scene.texts)
    at = scene.passing(digits.count, len(shapes(text)), STEP_MS) if text else None
    if at is not None:
        digits.text(at, text)
    elif scene.told.camera_lost and scene.what == RUN and not scene.blink(1200, 1200):
        digits.text(0, "CA LOSt")
    else:
        _FACES[scene.what](scene, digits)
    if scene.crossing and scene.blink(120, 80):
        for place in range(digits.count):
            digits.buffer[place] ^= DOT


def _beside(digits: Digits, left: str, ms: int, places: int) -> None:
    """`left` and a time with at least one dark digit between them."""
    room = digits.count - len(shapes(left)) - 1
    digits.right(first_that_fits(ms, places, lambda text: len(shapes(text)) <= room))
    digits.text(0, left)


def _start(scene: Scene, digits: Digits) -> None:
    digits.text(0, "dnb-EdGE")
    digits.buffer[scene.t_ms // 240 % digits.count] |= DOT


def _silent(scene: Scene, digits: Digits) -> None:
    if scene.blink(800, 400):
        digits.text(0, "no LInE")


def _count(scene: Scene, digits: Digits) -> None:
    digits.right(scene.count or "SEt")


def _go(scene: Scene, digits: Digits) -> None:
    if scene.blink(200, 200):
        digits.text(3, "GO")


def _lap(scene: Scene, digits: Digits) -> None:
    lap = scene.lap
    if scene.better and not scene.blink(600, 400):
        digits.text(2, "bESt")
    elif not lap.valid and not scene.blink(600, 400):
        digits.text(2, "bAd")
    else:
        _beside(digits, "L%d" % lap.number, lap.official_ms, 3)


def _run(scene: Scene, digits: Digits) -> None:
    _beside(digits, str(scene.told.run_lap), scene.running_ms, 2)


def _end(scene: Scene, digits: Digits) -> None:
    best = scene.told.best
    if best is None or scene.blink(1520, 2520):
        digits.text(2, "End")
    else:
        _beside(digits, "b%d" % best[0], best[1], 3)


def _word(word: str):
    def face(scene: Scene, digits: Digits) -> None:  # noqa: ARG001 as every face
        digits.text(0, word)

    return face


_FACES = {
    START: _start, SILENT: _silent, COUNT: _count, GO: _go, LAP: _lap, RUN: _run, END: _end,
    GRID: _word("GrId"), OUT: _word("oUt LAP"), WAIT: _word("no CAr"),
}  # fmt: skip
