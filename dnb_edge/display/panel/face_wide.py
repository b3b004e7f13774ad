"""The face of panels with room for several rows, 64 x 32 in colour and 128 x 64 in one: a head, big digits, last and best lap.

Runs on MicroPython.
"""

from .glyphs import SMALL, TALL, Font
from .pixels import AMBER, BLUE, CYAN, GREEN, RED, VIOLET, WHITE, Canvas
from .scene import COUNT, END, GO, GRID, LAP, OUT, RUN, SILENT, START, WAIT, Scene, first_that_fits, seconds, signed

STEP_MS = 40
"""A message moves one pixel in this time."""
NEVER = "--.---"


class Plan:
    """Where things are on a panel: `rows` are the tops of last lap, best lap and messages, two of which may be the same."""

    def __init__(self, font: Font, big_y: int, scale: int, rows: tuple[int, int, int]) -> None:
        self.font = font
        self.big_y = big_y
        self.scale = scale
        self.last_y, self.best_y, self.texts_y = rows


_PLANS = {
    32: Plan(SMALL, 6, 2, (21, 27, 27)),
    64: Plan(TALL, 9, 4, (39, 48, 57)),
}


def draw(scene: Scene, canvas: Canvas) -> None:
    """Draws `scene` on a dark `canvas`."""
    plan = _PLANS[canvas.height]
    if scene.note and scene.what in (WAIT, END, GRID) and scene.blink(8000, 2000):
        _note(scene.note, canvas)
        return
    _FACES[scene.what](scene, canvas, plan)
    if scene.crossing and scene.blink(120, 80):
        canvas.invert(WHITE)


def _middle(canvas: Canvas, y: int, text: str, colour: int, font: Font = TALL, scale: int = 1) -> None:
    """`text` in the middle; a smaller scale where it does not fit."""
    while scale > 1 and scale * (font.width(text) + 1) - scale > canvas.width:
        scale -= 1
    canvas.text((canvas.width - scale * font.width(text)) // 2, y, text, colour, font, scale)


def _ends(canvas: Canvas, y: int, left: str, right: str, colours: tuple[int, int], font: Font) -> None:
    canvas.text(0, y, left, colours[0], font)
    canvas.text(canvas.width - font.width(right), y, right, colours[1], font)


def _huge(canvas: Canvas, text: str, colour: int) -> None:
    """As large as the panel allows."""
    scale = min(canvas.height // 8, (canvas.width + 1) // TALL.width(text))
    _middle(canvas, (canvas.height - 7 * scale) // 2, text, colour, TALL, scale)


def _note(note: str, canvas: Canvas) -> None:
    """A page of its own, as large as its words allow."""
    for font, scale in ((TALL, 3), (TALL, 2), (TALL, 1), (SMALL, 1)):
        lines = _wrapped(note, font, canvas.width // scale, breaks=font is SMALL)
        step = (font.height + 1) * scale + (1 if scale == 1 else 0)
        widest = max([font.width(one) for one in lines])
        if len(lines) * step - scale <= canvas.height and widest * scale <= canvas.width:
            break
    y = max(0, (canvas.height - len(lines) * step + scale) // 2)
    for line in lines:
        canvas.text((canvas.width - scale * font.width(line)) // 2, y, line, AMBER, font, scale)
        y += step


def _wrapped(text: str, font: Font, width: int, *, breaks: bool) -> list[str]:
    """Lines of whole words; with `breaks` a word that is longer than a line goes on in the next."""
    lines = [""]
    for word in text.split(" "):
        longer = lines[-1] + " " + word if lines[-1] else word
        if font.width(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
        while breaks and font.width(lines[-1]) > width:
            fits = max([count for count in range(1, len(lines[-1])) if font.width(lines[-1][:count]) <= width])
            lines[-1:] = [lines[-1][:fits], lines[-1][fits:]]
    return lines if lines[0] else lines[1:]


def _head(scene: Scene, canvas: Canvas, plan: Plan, text: str, colour: int = WHITE) -> None:
    """The first row: where the run stands; place and difference to the best lap; a dot while it is recorded."""
    told = scene.told
    width = canvas.text(0, 0, text, colour, plan.font)
    right = canvas.width
    mark = plan.font.height - 2
    if told.recording == "RECORDING":
        right -= mark + 2
        canvas.fill(right + 2, 1, mark, mark, RED)
    if told.warnings and scene.blink(600, 400):
        canvas.text(right - 2, 0, "!", AMBER, plan.font)
    if told.warnings:
        right -= 4
    for words, hue in _asides(scene):
        left = right - plan.font.width(words)
        if left < width + plan.font.height - 2:
            break
        canvas.text(left, 0, words, hue, plan.font)
        right = left + 2 - plan.font.height


def _asides(scene: Scene) -> list[tuple[str, int]]:
    """What else stands in the head, as far as there is room, the most important first."""
    told = scene.told
    words = []
    if scene.what == RUN and told.delta_ms is not None:
        words.append((signed(told.delta_ms), GREEN if told.delta_ms < 0 else RED))
    elif told.race == "GO" and told.race_tenths is not None:
        words.append(("%ds" % (told.race_tenths // 10), CYAN))
    if told.places:
        words += [("P%d%s" % (place[0], "=" if place[1] else ""), BLUE) for place, car in
                  [one[:2] for one in told.places] if car == told.car]  # fmt: skip
        words.append((told.name, BLUE))
    return words


def _rows(scene: Scene, canvas: Canvas, plan: Plan) -> None:
    """Last lap, best lap, messages."""
    told, last, font = scene.told, scene.told.last, plan.font
    at, text = _running_text(scene, canvas, plan)
    if last is None:
        _ends(canvas, plan.last_y, "LAST", NEVER, (CYAN, CYAN), font)
    else:
        time = seconds(last.official_ms, 3)
        if canvas.width > 64 and last.similarity is not None:
            time = "%s %d.%d%%" % (time, last.similarity // 10, last.similarity % 10)
        verdict = "LAST" if last.valid else "BAD"
        _ends(canvas, plan.last_y, verdict, time, (CYAN, GREEN if last.valid else RED), font)
    if at is None or plan.texts_y != plan.best_y:
        best = NEVER if told.best is None else seconds(told.best[1], 3)
        _ends(canvas, plan.best_y, "BEST", best, (CYAN, CYAN if told.best is None else VIOLET), font)
    if at is not None:
        canvas.text(at, plan.texts_y, text, AMBER, font)


def _running_text(scene: Scene, canvas: Canvas, plan: Plan) -> tuple[int | None, str]:
    """The messages and where they begin; a short one stands still where there is a row for it."""
    text = "   ".join(scene.texts) or _standings(scene)
    width = plan.font.width(text)
    if not text:
        return None, ""
    if plan.texts_y != plan.best_y:
        if width <= canvas.width:
            return (canvas.width - width) // 2, text
        return canvas.width - scene.t_ms // STEP_MS % (canvas.width + width), text
    return scene.passing(canvas.width, width, STEP_MS), text


def _standings(scene: Scene) -> str:
    """`1 Anna 12.483  2 Ben 12.491`, where several cars race and nothing else is to be said."""
    return "   ".join([
        "%d%s %s%s" % (one[0][0], "=" if one[0][1] else "", one[-1], "" if one[3] is None else " " + seconds(one[3], 3))
        for one in scene.told.places
    ])  # fmt: skip


def _big(canvas: Canvas, plan: Plan, ms: int, places: int, colour: int) -> None:
    scale = plan.scale
    text = first_that_fits(ms, places, lambda text: TALL.width(text) * scale <= canvas.width)
    canvas.text(canvas.width - TALL.width(text) * scale, plan.big_y, text, colour, TALL, scale)


def _start(scene: Scene, canvas: Canvas, plan: Plan) -> None:
    quarter = canvas.height // 8
    _middle(canvas, quarter, "DNB-EDGE", WHITE, TALL, plan.scale // 2)
    _middle(canvas, canvas.height - 2 * quarter - plan.font.height, "WAITING FOR BOX", CYAN, plan.font)
    canvas.fill(scene.t_ms // 40 % (canvas.width + 8) - 8, canvas.height - 2, 8, 2, GREEN)


def _silent(scene: Scene, canvas: Canvas, plan: Plan) -> None:
    if scene.blink(800, 400):
        _middle(canvas, canvas.height // 4, "NO SIGNAL", RED, TALL, plan.scale // 2)
    _middle(canvas, canvas.height * 5 // 8, "CHECK THE CABLE", CYAN, plan.font)


def _count(scene: Scene, canvas: Canvas, plan: Plan) -> None:  # noqa: ARG001 as every face
    _huge(canvas, scene.count or "SET", AMBER)


def _go(scene: Scene, canvas: Canvas, plan: Plan) -> None:  # noqa: ARG001 as every face
    _huge(canvas, "GO", GREEN)
    if scene.blink(240, 240):
        canvas.invert(GREEN)


def _lap(scene: Scene, canvas: Canvas, plan: Plan) -> None:
    lap = scene.lap
    colour = VIOLET if scene.better else GREEN if lap.valid else RED
    words = "BEST LAP %d" if scene.better else "LAP %d" if lap.valid else "BAD LAP %d"
    _head(scene, canvas, plan, words % lap.number, colour)
    if not scene.better or scene.blink(600, 200):
        _big(canvas, plan, lap.official_ms, 3, colour)
    _rows(scene, canvas, plan)


def _run(scene: Scene, canvas: Canvas, plan: Plan) -> None:
    lost = scene.told.camera_lost and not scene.blink(1200, 1200)
    _head(scene, canvas, plan, "NO CAMERA" if lost else "LAP " + scene.lap_of, RED if lost else WHITE)
    _big(canvas, plan, scene.running_ms, 2, CYAN if scene.told.camera_lost else AMBER)
    _rows(scene, canvas, plan)


def _end(scene: Scene, canvas: Canvas, plan: Plan) -> None:
    _head(scene, canvas, plan, "FINISHED")
    if scene.told.best is not None:
        _big(canvas, plan, scene.told.best[1], 3, VIOLET)
    _rows(scene, canvas, plan)


def _word(head: str, word: str):
    def face(scene: Scene, canvas: Canvas, plan: Plan) -> None:
        _head(scene, canvas, plan, head)
        _middle(canvas, plan.big_y, word, WHITE, TALL, plan.scale)
        _rows(scene, canvas, plan)

    return face


_FACES = {
    START: _start, SILENT: _silent, COUNT: _count, GO: _go, LAP: _lap, RUN: _run, END: _end,
    GRID: _word("START", "GRID"), OUT: _word("OUT-LAP", "OUT"), WAIT: _word("WAITING", "CAR?"),
}  # fmt: skip
