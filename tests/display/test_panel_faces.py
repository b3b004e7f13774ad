"""The panels' pictures: golden files, the letterings, what moves and what stands. Look at them: `tests/display/panels/`."""

from pathlib import Path

import numpy as np
import panel_cases
import panel_pictures
import pytest

from dnb_edge.display.panel import face, state
from dnb_edge.display.panel.glyphs import SMALL, TALL
from dnb_edge.display.panel.pixels import COLOURS, DARK, WHITE, Canvas
from dnb_edge.display.panel.scene import FRAME_MS, first_that_fits, seconds, signed
from dnb_edge.display.panel.segments import DOT, Digits, shape, shapes
from dnb_edge.display.simulator import image, in_terminal, plain, png

PANELS = Path(__file__).parent / "panels"
ASCII = "".join(map(chr, range(0x20, 0x7F)))


def drawn(layout, steps, t_ms):
    surface = face.surface(layout)
    face.draw(panel_cases.told(state.Panel(), steps), surface, t_ms)
    return surface


@pytest.mark.parametrize("layout", face.LAYOUTS)
def test_every_face_is_as_it_was(layout):
    """Each picture is the golden one; `python tests/display/panel_pictures.py` makes them anew after a change on purpose."""
    now = panel_pictures.golden(plain, panel_pictures.drawn(state, face, layout))
    golden = (PANELS / f"{layout}.txt").read_text(encoding="utf-8")
    for one, other in zip(now.split("== "), golden.split("== "), strict=True):
        assert one == other


@pytest.mark.parametrize("layout", face.LAYOUTS)
@pytest.mark.parametrize(("name", "steps", "at_ms"), panel_cases.CASES, ids=[case[0] for case in panel_cases.CASES])
def test_a_picture_stands_until_it_says(layout, name, steps, at_ms):
    """Until `next_change` nothing changes; it is never later than the silence that follows."""
    panel = panel_cases.told(state.Panel(), steps)
    surface, later = face.surface(layout), face.surface(layout)
    t_ms = at_ms
    while t_ms < at_ms + 1200:
        face.draw(panel, surface, t_ms)
        due_ms = face.next_change(panel, surface, t_ms)
        assert t_ms < due_ms <= t_ms + 3000 + FRAME_MS
        for between_ms in {t_ms, (t_ms + due_ms) // 2, due_ms - 1}:
            face.draw(panel, later, between_ms)
            assert later.buffer == surface.buffer
        t_ms = due_ms


@pytest.mark.parametrize("layout", face.LAYOUTS)
def test_a_race_without_news_is_still(layout):
    """A panel that waits for a car sleeps until the appliance falls silent, and then says so."""
    panel = panel_cases.told(state.Panel(), ((0, panel_cases.BEFORE),))
    surface = face.surface(layout)
    assert face.next_change(panel, surface, 0) == 3000
    face.draw(panel, surface, 2960)
    waiting = bytes(surface.buffer)
    face.draw(panel, surface, 3000)
    assert surface.buffer != waiting


@pytest.mark.parametrize("layout", face.LAYOUTS)
def test_the_running_time_moves_between_lines(layout):
    """Ten frames after a line there were ten pictures."""
    panel = panel_cases.told(state.Panel(), ((0, panel_cases.REPAINT),))
    seen = set()
    for frame in range(10):
        surface = face.surface(layout)
        face.draw(panel, surface, 40 * frame)
        seen.add(bytes(surface.buffer))
    assert len(seen) == 10


@pytest.mark.parametrize("layout", face.LAYOUTS)
def test_drawing_needs_no_dark_surface(layout):
    """What was there before leaves no trace."""
    used = face.surface(layout)
    for step in range(face.TEST_STEPS):
        face.test_picture(used, step)
        assert any(used.buffer)
        face.draw(panel_cases.told(state.Panel(), ((0, panel_cases.REPAINT),)), used, 0)
        assert used.buffer == drawn(layout, ((0, panel_cases.REPAINT),), 0).buffer


def test_the_self_test_lights_everything():
    """Every pixel and every segment is lit in some step, and some step has each of them dark."""
    for layout in face.LAYOUTS:
        steps = []
        for step in range(face.TEST_STEPS):
            surface = face.surface(layout)
            face.test_picture(surface, step)
            steps.append(bytes(surface.buffer))
        assert all(steps[0])
        if layout != "digits-8":
            assert all((one != 0) != (other != 0) for one, other in zip(steps[1], steps[2], strict=True))


@pytest.mark.parametrize(("font", "missing"), [(TALL, "O"), (SMALL, "abcdefghijklmnopqrstuvwxyz")])
def test_every_character_has_its_own_picture(font, missing):
    """All printable ASCII is drawn, none like another but O and nought; small letters that are missing look as capitals do."""
    own = [font.glyph(one) for one in ASCII if one not in missing]
    assert len(set(own)) == len(own)
    assert all(1 <= width <= 5 and len(rows) == font.height for width, rows in own)
    for one in missing:
        assert font.glyph(one) == font.glyph("0" if font is TALL else one.upper())
    assert font.glyph("é") == font.glyph("?")


def test_digits_are_equally_wide():
    """So that a running time does not shake."""
    assert len({TALL.glyph(one)[0] for one in "0123456789"}) == len({SMALL.glyph(one)[0] for one in "0123456789"}) == 1


def test_text_is_cut_at_the_edges_and_as_wide_as_said():
    """Nothing outside the picture is touched; the width is that of the lettering, at each scale."""
    for scale in (1, 2):
        canvas = Canvas(20, 9)
        assert canvas.text(-3, -2, "88888", WHITE, TALL, scale) == scale * TALL.width("88888")
        assert len(canvas.buffer) == 180
        assert any(canvas.buffer)
    canvas.clear()
    canvas.set(20, 0, WHITE)
    canvas.set(0, 9, WHITE)
    canvas.fill(-5, -5, 3, 30, WHITE)
    assert not any(canvas.buffer)
    assert canvas.text(0, 0, "", WHITE) == 0


@pytest.mark.parametrize(
    ("ms", "places", "text"),
    [(12_483, 3, "12.483"), (12_489, 2, "12.48"), (999, 1, "0.9"), (0, 3, "0.000"), (60_050, 3, "60.050"), (7, 0, "0")],
)
def test_times_are_cut_and_not_rounded(ms, places, text):
    """A running time shows no hundredth that is not over."""
    assert seconds(ms, places) == text


def test_as_many_decimals_as_there_is_room_for():
    """Long times lose decimals, never digits before the point."""
    fits = [first_that_fits(ms, 3, lambda text: len(text) <= 6) for ms in (12_483, 123_456, 99_999_999)]
    assert fits == ["12.483", "123.45", "99999"]
    assert [signed(-214), signed(214), signed(0)] == ["-0.21", "+0.21", "+0.00"]


def test_seven_segments():
    """The digits are those of every clock; a point belongs to the digit before it, and two in a row to none."""
    assert [shape(one) for one in "0123456789"] == [0x3F, 0x06, 0x5B, 0x4F, 0x66, 0x6D, 0x7D, 0x07, 0x7F, 0x6F]
    assert shapes("1.2") == [0x06 | DOT, 0x5B]
    assert shapes("..") == [DOT, DOT]
    digits = Digits(8)
    digits.right("123456789")
    digits.text(-1, "A1")
    assert digits.buffer[0] == shape("1")


def test_the_simulator_shows_every_lit_pixel():
    """The image has a light in its panel's colour where the panel has a pixel, and hardly any light elsewhere."""
    surface = drawn("matrix-64x32", ((0, panel_cases.REPAINT),), 760)
    cell = image(surface).shape[0] // surface.height
    centres = image(surface)[cell // 2 :: cell, cell // 2 :: cell, ::-1]
    for value, colour in enumerate(COLOURS):
        lit = np.frombuffer(bytes(surface.buffer), dtype=np.uint8).reshape(32, 64) == value
        assert (centres[lit] == (colour if value != DARK else (26, 26, 26))).all()
    assert png(surface).startswith(b"\x89PNG")


@pytest.mark.parametrize(("layout", "rows", "columns"), [
    ("matrix-32x8", 4, 32), ("matrix-64x32", 16, 64), ("oled-128x64", 16, 64), ("digits-8", 3, 32),
])  # fmt: skip
def test_the_terminal_picture_fits(layout, rows, columns):
    """Half blocks, Braille and paper digits, all within 64 columns."""
    lines = in_terminal(drawn(layout, ((0, panel_cases.REPAINT),), 760)).plain.split("\n")
    assert (len(lines), max(map(len, lines))) == (rows, columns)


def test_without_colours_lit_pixels_are_dots():
    """A terminal that shows no colours gets Braille, in which lit and dark differ."""
    surface = drawn("matrix-64x32", ((0, panel_cases.REPAINT),), 760)
    dots = sum((ord(one) - 0x2800).bit_count() for one in in_terminal(surface, colour=False).plain if one != "\n")
    assert dots == sum(value != DARK for value in surface.buffer)
