"""Checks of the panels' drivers and of the firmware's loop against models of the chips, for MicroPython and CPython alike.

`test_board_drivers.py` runs each under CPython; `micropython board_checks.py FOLDER` runs all of them with the firmware as it
is written to a board, unpacked in FOLDER, and ends with `all N checks passed`.
"""

import sys

if sys.implementation.name == "micropython":
    sys.path.insert(0, sys.argv[1])
    from panel import face
    from panel.board import firmware, hub75, max7219, settings, ssd1306, tm1637, wires
    from panel.pixels import COLOURS, Canvas
else:
    from dnb_edge.display.panel import face
    from dnb_edge.display.panel.board import firmware, hub75, max7219, settings, ssd1306, tm1637, wires
    from dnb_edge.display.panel.pixels import COLOURS, Canvas

from chip_models import (
    SEGMENTS,
    Hub75Panel,
    Max7219Chain,
    OledChip,
    Tm1637Chip,
    matrix_rows,
    max7219_digits,
)
from pico_model import Pico

LAMPS = (0, 7, 1, 2, 3, 4, 5, 6)
"""Red 1, green 2, blue 4 of each of the canvas's colours on a panel that can only be on or off."""


USUAL_SIX = (2, 1, 0, 5, 4, 3)
"""Which of a TM1637's digits is where, left to right, on the usual board of six."""


class Noise:
    """Numbers that look like chance and are the same everywhere."""

    def __init__(self, seed):
        self._state = seed

    def below(self, limit):
        self._state = (self._state * 1103515245 + 12345) & 0x7FFFFFFF
        return (self._state >> 12) % limit


class DigitSurface:
    def __init__(self, data):
        self.buffer = bytearray(data)


def noisy(width, height, seed, colours=8):
    canvas, noise = Canvas(width, height), Noise(seed)
    for at in range(width * height):
        canvas.buffer[at] = noise.below(colours)
    return canvas


def as_rows(canvas):
    lit = ["#" if pixel else "." for pixel in canvas.buffer]
    return ["".join(lit[y * canvas.width : (y + 1) * canvas.width]) for y in range(canvas.height)]


def as_letters(byte):
    return "".join([name for place, name in enumerate(SEGMENTS) if byte >> place & 1])


def turned_about(rows):
    return ["".join(reversed(list(row))) for row in reversed(rows)]


def check_matrix_shows_every_pixel():
    """Any picture is seen as it is on MAX7219 matrices of every make: turned, mirrored, wires left or right."""
    for seed, (turn, reverse, mirror) in enumerate(
        [(turn, reverse, mirror) for turn in (0, 90, 180, 270) for reverse in (False, True) for mirror in (False, True)]
    ):
        chain, canvas = Max7219Chain(4), noisy(32, 8, seed, colours=2)
        max7219.Matrix(chain, chain.load, 32, turn=turn, reverse=reverse, mirror=mirror).show(canvas)
        assert matrix_rows(chain, turn, reverse, mirror) == as_rows(canvas), (turn, reverse, mirror)


def check_matrix_hung_upside_down():
    """`upside_down` shows a picture upright on a panel that hangs upside down, whatever its make."""
    for turn, reverse in ((0, False), (90, True), (270, False)):
        chain, canvas = Max7219Chain(4), noisy(32, 8, 7, colours=2)
        max7219.Matrix(chain, chain.load, 32, turn=turn, reverse=reverse, upside_down=True).show(canvas)
        assert turned_about(matrix_rows(chain, turn, reverse)) == as_rows(canvas)


def check_matrix_mends_itself():
    """A chip that a spike put into any state shows the next picture right, as bright as asked for, within 0..15."""
    noise = Noise(3)
    for brightness, told in ((0, 0), (3, 3), (15, 15), (99, 15), (-1, 0)):
        chain, canvas = Max7219Chain(4), noisy(32, 8, 5, colours=2)
        for chip in chain.chips:
            chip.update(decode=noise.below(256), intensity=noise.below(16), scan=noise.below(8))
            chip.update(on=noise.below(2), test=noise.below(2))
        max7219.Matrix(chain, chain.load, 32, brightness).show(canvas)
        assert matrix_rows(chain) == as_rows(canvas)
        assert [chip["intensity"] for chip in chain.chips] == [told] * 4


def check_max7219_digits():
    """Each of the 256 patterns of segments is seen at each of the eight places, wired either way about."""
    for reverse in (False, True):
        for start in range(0, 256, 8):
            chain, surface = Max7219Chain(1), DigitSurface(range(start, start + 8))
            max7219.DigitRow(chain, chain.load, reverse=reverse).show(surface)
            assert max7219_digits(chain, reverse) == [as_letters(byte) for byte in surface.buffer]


def check_tm1637_digits():
    """Each of the 256 patterns of segments is seen on a TM1637, as bright as asked for."""
    for start in range(0, 256, 2):
        chip, surface = Tm1637Chip(), DigitSurface([(start + place) % 256 for place in range(6)])
        tm1637.Tm1637(chip.clock, chip.data, lambda wait: None, 15).show(surface)
        assert chip.seen(USUAL_SIX) == [as_letters(byte) for byte in surface.buffer]
        assert chip.light == 7


def check_tm1637_away():
    """A TM1637 that does not answer is an OSError, and the one that comes back shows the next picture."""
    chip, surface = Tm1637Chip(present=False), DigitSurface(range(6))
    driver = tm1637.Tm1637(chip.clock, chip.data, lambda wait: None)
    assert raises(OSError, driver.show, surface)
    chip.present = True
    driver.show(surface)
    assert chip.seen(USUAL_SIX) == [as_letters(byte) for byte in range(6)]


def check_oled_shows_every_pixel():
    """Any picture is seen as it is on an SSD1306 and an SH1106, hung either way."""
    for columns, first in ((128, 0), (132, 2)):
        for upside_down in (False, True):
            chip, canvas = OledChip(columns), noisy(128, 64, columns, colours=2)
            driver = ssd1306.Oled(chip, first_column=first, upside_down=upside_down)
            driver.begin()
            driver.show(canvas)
            seen = chip.seen()
            assert (turned_about(seen) if upside_down else seen) == as_rows(canvas)


def check_oled_sends_what_changed():
    """A still picture costs one page of eight each time; one changed pixel one page more, and is seen."""
    chip, canvas = OledChip(), noisy(128, 64, 1, colours=2)
    driver = ssd1306.Oled(chip)
    driver.begin()
    driver.show(canvas)
    before = chip.sent
    driver.show(canvas)
    still = chip.sent - before
    canvas.buffer[60 * 128 + 5] ^= 1
    driver.show(canvas)
    assert 129 <= still < 140
    assert chip.sent - before - still == 2 * still
    assert chip.seen() == as_rows(canvas)


def check_oled_mends_itself():
    """A chip that lost its power for a moment without anybody noticing is right again within 40 pictures."""
    chip, canvas = OledChip(), noisy(128, 64, 2, colours=2)
    driver = ssd1306.Oled(chip)
    driver.begin()
    driver.show(canvas)
    chip.lose_power()
    assert chip.seen() != as_rows(canvas)
    chip.paging = True
    for _ in range(40):
        driver.show(canvas)
    assert chip.seen() == as_rows(canvas)


def check_hub75_shows_every_colour():
    """Any picture is lit on a HUB75 panel in the right lamps, none while rows change, brighter with the setting, for ever."""
    shares = []
    for brightness, upside_down in ((0, False), (3, True), (15, False)):
        board, canvas = Hub75Panel(), noisy(64, 32, brightness)
        pico = with_modules(Pico(tell_panel=board.pins))
        driver = hub75.Hub75(COLOURS, 0, brightness, upside_down=upside_down)
        driver.begin()
        driver.show(noisy(64, 32, 99))
        driver.show(canvas)
        picture = hub75.ROWS * hub75.STEPS // 2
        pico.run(2 * picture)
        board.light, board.moments = {}, 0
        driver.begin()
        pico.run(2 * picture)
        seen = board.seen()
        if upside_down:
            seen = [list(reversed(row)) for row in reversed(seen)]
        for y in range(32):
            assert seen[y] == [LAMPS[pixel] for pixel in canvas.buffer[y * 64 : y * 64 + 64]], (brightness, y)
        assert board.moved_while_lit == 0
        assert sorted({row for row, _ in board.light}) == list(range(16))
        shares.append(sum(board.light.values()) / board.moments)
    assert 0.03 < shares[0] < shares[1] < shares[2] < 0.9, shares


def check_wires_of_every_panel():
    """Each panel of the settings has its driver at pins that the chip allows, and shows what it is given."""
    for panel in sorted(settings.PANELS):
        seen_of = _soldered(panel)
        pico, seen = seen_of
        with_modules(pico)
        told = dict(settings.DEFAULTS)
        told["panel"] = panel
        driver = wires.make(told, pico.machine, lambda wait: None)
        surface = firmware.Firmware(settings.PANELS[panel], driver, None, lambda: 0).surface
        face.test_picture(surface, 1)
        driver.begin()
        driver.show(surface)
        assert seen(surface), panel


def _soldered(panel):
    """A Pico with this panel at the pins of docs/wiring.md, and what tells whether it shows a surface."""
    if panel.startswith("max7219"):
        chain = Max7219Chain(1 if panel.endswith("digits") else 4)
        pico = Pico(wired={17: chain.load}, spi=chain)
        if panel.endswith("digits"):
            return pico, lambda surface: max7219_digits(chain) == [as_letters(byte) for byte in surface.buffer]
        return pico, lambda surface: matrix_rows(chain) == as_rows(surface)
    if panel.startswith("tm1637"):
        chip = Tm1637Chip()
        pico = Pico(wired={18: chip.clock, 19: chip.data})
        return pico, lambda surface: chip.seen(USUAL_SIX) == [as_letters(byte) for byte in surface.buffer]
    if panel.startswith("hub75"):
        board = Hub75Panel()
        pico = Pico(tell_panel=board.pins)

        def lit(surface):
            pico.run(2 * hub75.ROWS * hub75.STEPS // 2)
            seen = board.seen()
            return all(seen[at // 64][at % 64] == LAMPS[pixel] for at, pixel in enumerate(surface.buffer))

        return pico, lit
    chip = OledChip(132 if panel.startswith("sh1106") else 128)
    return Pico(i2c=chip), lambda surface: chip.seen() == as_rows(surface)


class Line:
    """What the firmware reads, at a clock that stands until somebody waits."""

    def __init__(self, *parts):
        self.now = 0
        self._parts = list(parts)

    def read(self, wait_ms):
        if self._parts and self._parts[0][0] <= self.now:
            return self._parts.pop(0)[1]
        self.now += max(wait_ms, 1)
        return b""

    def clock(self):
        return self.now


class Driver:
    """Keeps what it was to show; away while `away`."""

    def __init__(self):
        self.shown = []
        self.begun = self.tried = 0
        self.away = False

    def begin(self):
        self.tried += 1
        if self.away:
            raise OSError(5)
        self.begun += 1

    def show(self, surface):
        if self.away:
            raise OSError(5)
        self.shown.append(bytes(surface.buffer))


def turned(line, driver, until_ms, **options):
    made = firmware.Firmware("matrix-32x8", driver, line.read, line.clock, **options)
    while line.now < until_ms:
        made.turn()
    return made


def drawn(panel, t_ms):
    surface = face.surface("matrix-32x8")
    face.draw(panel, surface, t_ms)
    return bytes(surface.buffer)


def check_loop_tests_itself():
    """At power on every test picture is shown once, a wrong settings file is complained about, then the board waits."""
    driver = Driver()
    made = turned(Line(), driver, 5000)
    wanted = []
    for step in range(face.TEST_STEPS):
        surface = face.surface("matrix-32x8")
        face.test_picture(surface, step)
        wanted.append(bytes(surface.buffer))
    assert driver.shown[: face.TEST_STEPS] == wanted
    assert driver.shown[-1] == drawn(made.panel, 4999)
    complaining = Driver()
    turned(Line(), complaining, 4000, complaint="unknown key colour")
    assert complaining.shown[face.TEST_STEPS] not in driver.shown


def check_loop_shows_lines():
    """Lines that came in pieces are on the panel 40 ms after the last byte at the latest; also those during the self-test."""
    lines = b"HELLO DNB-EDGE 1 *15\r\nSTATE LAP 1 OF 3 *01\r\nRUN 1 0.033 *56\r\n"
    for start_ms in (100, 5000):
        driver = Driver()
        line = Line(*[(start_ms + at, lines[at : at + 7]) for at in range(0, len(lines), 7)])
        made = turned(line, driver, start_ms)
        while made.panel.lines < 3:
            made.turn()
            last_ms = line.now
        assert made.panel.dropped == 0
        while line.now < max(last_ms + firmware.FRAME_MS, 1500):
            made.turn()
        frame_ms = line.now - line.now % firmware.FRAME_MS
        assert driver.shown[-1] in (drawn(made.panel, frame_ms), drawn(made.panel, frame_ms - firmware.FRAME_MS))
        assert driver.shown[-1] != drawn(firmware.state.Panel(), frame_ms)


def check_loop_draws_at_once():
    """A crossing is on the panel as soon as nothing more waits to be read, not only when the next picture is due."""
    repaint = b"HELLO DNB-EDGE 1 *15\r\nSTATE LAP 1 OF 3 *01\r\nRUN 1 0.033 *56\r\n"
    driver, line = Driver(), Line((5000, repaint), (5111, b"CROSS 8.250 *5F\r\n"))
    made = turned(line, driver, 5050)
    while made.panel.lines < 4:
        made.turn()
    heard_ms, count = line.now, len(driver.shown)
    while len(driver.shown) == count:
        made.turn()
    assert line.now - heard_ms <= 2


def check_loop_keeps_up():
    """With 60 ms for a picture and 30 us for a byte a board still hears all of a line that is never quiet."""
    body, count = b"RUN 1 0.033 *56\r\n" * 14, 80

    class Slow(Line):
        def read(self, wait_ms):
            data = Line.read(self, wait_ms)
            self.now += (len(data) * 30 + 999) // 1000
            return data

    class SlowDriver(Driver):
        def show(self, surface):
            Driver.show(self, surface)
            line.now += 60

    line = Slow(*[(3000, body)] * count)
    driver = SlowDriver()
    made = turned(line, driver, 3000)
    before, began_ms = len(driver.shown), line.now
    while made.panel.lines < 14 * count:
        made.turn()
    assert made.panel.dropped == 0
    # 115200 baud are 11.52 bytes a millisecond.
    assert line.now - began_ms < len(body) * count / 11.52
    assert len(driver.shown) - before > (line.now - began_ms) / 150


def check_loop_waits_for_the_panel():
    """A panel that does not answer stops nothing, is asked again after a second, and is set up anew when it is back."""
    driver, line = Driver(), Line()
    made = firmware.Firmware("matrix-32x8", driver, line.read, line.clock)
    while line.now < 3000:
        made.turn()
    driver.away = True
    while line.now < 9000:
        made.turn()
    count, driver.away = len(driver.shown), False
    while line.now < 11000:
        made.turn()
    assert driver.begun == 2
    assert 6 <= driver.tried <= 8
    assert len(driver.shown) > count


def check_clock_does_not_wrap():
    """The clock goes on where MicroPython's ticks begin again at 2 to the 30."""
    ticks = [2**30 - 100]

    def difference(later, earlier):
        return (later - earlier + 2**29) % 2**30 - 2**29

    clock = firmware.Clock(lambda: ticks[0], difference)
    heard = []
    for step in (0, 60, 60, 1000):
        ticks[0] = (ticks[0] + step) % 2**30
        heard.append(clock())
    assert heard == [0, 60, 120, 1120]


def check_settings():
    """A settings file is taken whole or not at all, and what is wrong with it is told in a line."""
    good = '{"panel": "hub75-64x32", "brightness": 15, "turn": 90, "checksums": false}'
    read, complaint = settings.read(good)
    assert complaint == ""
    assert (read["panel"], read["brightness"], read["reverse"]) == ("hub75-64x32", 15, False)
    for text, wrong in (
        ("{panel", "not JSON"),
        ("", "not JSON"),
        ("[]", "not an object"),
        ('{"colour": 1}', "unknown key colour"),
        ('{"brightness": 16}', "brightness: 0 to 15"),
        ('{"brightness": true}', "brightness: 0 to 15"),
        ('{"brightness": 3, "turn": 45}', "turn: 0, 90, 180 or 270"),
        ('{"reverse": 1}', "reverse: true or false"),
        ('{"panel": "vt100"}', "panel: one of " + " ".join(sorted(settings.PANELS))),
        ('{"panel": ["hub75-64x32"]}', "panel: one of " + " ".join(sorted(settings.PANELS))),
    ):
        assert settings.read(text) == (settings.DEFAULTS, wrong), text
    assert settings.load("/nowhere/settings.json") == (settings.DEFAULTS, "")


def raises(kind, function, *arguments):
    try:
        function(*arguments)
    except kind:
        return True
    return False


def with_modules(pico):
    """What `import machine` gives from now on is this board's; the caller's business to undo it."""
    for name, module in pico.modules().items():
        sys.modules[name] = module
    return pico


CHECKS = [
    check_matrix_shows_every_pixel,
    check_matrix_hung_upside_down,
    check_matrix_mends_itself,
    check_max7219_digits,
    check_tm1637_digits,
    check_tm1637_away,
    check_oled_shows_every_pixel,
    check_oled_sends_what_changed,
    check_oled_mends_itself,
    check_hub75_shows_every_colour,
    check_wires_of_every_panel,
    check_loop_tests_itself,
    check_loop_shows_lines,
    check_loop_draws_at_once,
    check_loop_keeps_up,
    check_loop_waits_for_the_panel,
    check_clock_does_not_wrap,
    check_settings,
]

if __name__ == "__main__":
    for check in CHECKS:
        check()
        sys.stdout.write(check.__name__ + "\n")
    sys.stdout.write(f"all {len(CHECKS)} checks passed\n")
