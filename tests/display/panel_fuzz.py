"""Bytes that a broken line might bring, against the panel's parser and faces. Runs on MicroPython, too: builtins only.

    python tests/display/panel_fuzz.py BYTES SEED        micropython tests/display/panel_fuzz.py BYTES SEED

Random bytes, valid lines, mutated ones with their checksum made right again. Every thousand bytes or so comes a repaint: the
panel must then know what a new panel knows that was told the same, and draw the same once nothing flashes any more; without any
help it must draw the same four seconds on. Anything else raises. Prints what it did.
"""

import sys

if __name__ == "__main__":
    sys.path.insert(
        0, __file__[: __file__.rindex("/tests/")] + "/dnb_edge/display" if "/tests/" in __file__ else "dnb_edge/display"
    )

CORPUS = (
    "HELLO DNB-EDGE 1", "STATE WAITING", "STATE OUT-LAP", "STATE LAP 3 OF 5", "STATE LAP 12", "STATE FINISHED",
    "RUN - -", "RUN 3 4.200", "RUN 3 4.301", "RUN 4 0.033", "CROSS 31.250", "LAP 1 12.483 +-0.002 OK 95.8",
    "LAP 2 14.000 +-0.010 BAD -", "LAP 3 999999.999 +-0.000 OK 100.0", "WHY 2 off the lane for 0.8 s",
    "SUSPECT 3 the camera had moved by 12 mm since it was calibrated", "BEST 1 12.483", "BEST 3 12.180",
    "PENALTY 3 2.000 the car left the lane for 0.8 s", "LIVE -0.214 95.8", "LIVE - -", "GRID waiting for 2 cars",
    "COUNT 3.0", "COUNT -", "GO 300.0", "GO -", "SAVED 2", "HEALTH FPS 29.9 REC RECORDING WARNINGS 1",
    "HEALTH FPS - REC FAILED WARNINGS 1", "WARN 1 camera gap of 2.1 s", "NOTE set-up code 4711 0815", "CAR 2 Anna",
    "CARLAP 1 4 12.904 OK", "PLACE 1= 2 5 12.483 - IN Anna", "PLACE 1= 1 4 12.491 0.008 IN Ben", "PLACE 3 9 0 - - OUT Z",
    "TOMORROW 17 a kind of a later version",
)  # fmt: skip


class Chance:
    """The same numbers everywhere: 32-bit xorshift (Marsaglia, 2003)."""

    def __init__(self, seed):
        self.state = (seed * 2654435761 + 1) & 0xFFFFFFFF

    def below(self, limit):
        """0 to `limit` - 1."""
        one = self.state
        one ^= (one << 13) & 0xFFFFFFFF
        one ^= one >> 17
        one ^= (one << 5) & 0xFFFFFFFF
        self.state = one
        return (one >> 8) % limit

    def of(self, choices):
        return choices[self.below(len(choices))]


def damaged(chance, line):
    """A line of the corpus as something may have changed it on its way."""
    body = bytearray(chance.of(CORPUS).encode())
    for _ in range(chance.below(4)):
        at = chance.below(len(body))
        kind = chance.below(4)
        if kind == 0:
            body[at] = chance.below(256)
        elif kind == 1:
            body[at] = chance.of(b" -+.0123456789=*OKBAD\r\n")
        elif kind == 2:
            body = body[:at] + body[at + 1 + chance.below(6) :] or bytearray(b"R")
        else:
            body = body[:at] + bytes([chance.of(b" 0919.-*x")]) * (1 + chance.below(9)) + body[at:]
    found = 0
    for byte in body:
        found ^= byte
    text = bytes(body) + (b" *%02X" % found if chance.below(3) else b" *00")
    if chance.below(8) == 0:
        text = text[: chance.below(len(text))]
    return text + chance.of((b"\r\n", b"\r\n", b"\r\n", b"\n", b"", b"\r", b"\r\n\r\n"))


def rubbish(chance, line):
    """A piece of whatever."""
    kind = chance.below(10)
    if kind < 1:
        return bytes([chance.below(256) for _ in range(chance.below(200))])
    if kind < 5:
        return line(chance.of(CORPUS))
    if kind < 6:
        # A repaint that breaks off.
        return b"".join([line(chance.of(CORPUS)) for _ in range(chance.below(9))])[: chance.below(300)]
    return damaged(chance, line)


def repaint(chance):
    """A repaint as the appliance may send it, always whole."""
    lap = 1 + chance.below(40)
    bodies = ["HELLO DNB-EDGE 1"]
    if chance.below(3) == 0:
        bodies += ["CAR 2 Anna"]
    bodies += [chance.of(("STATE LAP %d OF 50" % lap, "STATE LAP %d" % lap, "STATE WAITING", "STATE FINISHED"))]
    bodies += chance.of(((), ("GRID waiting for the car",), ("COUNT 2.4",), ("GO 120.0",), ("GO -",)))
    for number in range(max(1, lap - chance.below(9)), lap):
        bodies += ["LAP %d %d.%03d +-0.002 OK 95.8" % (number, 1 + chance.below(99), chance.below(1000))]
        bodies += chance.of(((), (), ("WHY %d off the lane" % number,), ("PENALTY %d 2.000 off the lane" % number,)))
    bodies += chance.of(((), ("BEST 1 12.483",)))
    bodies += chance.of(((), ("PLACE 1 2 5 12.483 - IN Anna", "PLACE 2 1 4 12.491 0.008 IN Ben")))
    bodies += chance.of(((), ("LIVE +0.214 95.8",), ("SAVED %d" % lap,)))
    bodies += chance.of(
        ((), ("HEALTH FPS 29.9 REC RECORDING WARNINGS 0",), ("HEALTH FPS - REC NONE WARNINGS 1", "WARN 1 gone"))
    )
    bodies += chance.of(((), ("NOTE set-up code 4711 0815",)))
    running = chance.below(4)
    return bodies, (lap, 1000 * chance.below(60) + chance.below(1000)) if running else None


def run_line(running, since_ms):
    if running is None:
        return "RUN - -"
    elapsed_ms = running[1] + since_ms
    return "RUN %d %d.%03d" % (running[0], elapsed_ms // 1000, elapsed_ms % 1000)


class Fuzz:
    """`state`, `face` and `cases`: the modules of the panel and `panel_cases`, however they are imported here."""

    def __init__(self, state, face, cases, seed):
        self.state, self.face, self.line = state, face, cases.line
        self.chance = Chance(seed)
        self.surfaces = [face.surface(layout) for layout in face.LAYOUTS]
        self.others = [face.surface(layout) for layout in face.LAYOUTS]
        self.panel = state.Panel()
        self.t_ms = 0
        self.fed = self.repaints = self.pictures = self.least_lines = 0

    def run(self, size):
        """Feeds `size` bytes and more."""
        while self.fed < size:
            self.rubbish(800 + self.chance.below(400))
            self.check()

    def rubbish(self, size):
        end = self.fed + size
        while self.fed < end:
            piece = rubbish(self.chance, self.line)
            while piece:
                cut = 1 + self.chance.below(120)
                self.panel.feed(piece[:cut], self.t_ms)
                self.fed += min(cut, len(piece))
                piece = piece[cut:]
                self.t_ms += self.chance.below(30) if self.chance.below(200) else 5000
            if self.chance.below(20) == 0:
                self.draw_one()

    def draw_one(self):
        """One of the faces, whatever is known now, and when it says that it changes."""
        surface = self.chance.of(self.surfaces)
        self.face.draw(self.panel, surface, self.t_ms)
        due = self.face.next_change(self.panel, surface, self.t_ms)
        assert self.t_ms < due <= self.t_ms + 3040, (self.t_ms, due)
        self.pictures += 1

    def check(self):
        """A repaint, whatever went before it."""
        fresh = self.state.Panel()
        bodies, running = repaint(self.chance)
        self.both(fresh, b"\r\n")
        self.paint(fresh, bodies, run_line(running, 0))
        assert self.panel.shown.facts() == fresh.shown.facts(), "another state after a repaint"
        self.repaints += 1
        if self.chance.below(4) == 0:
            # Four seconds of an ordinary race, and nobody forgets anything.
            for step in range(1, 43):
                self.t_ms += 100
                paint = bodies if step % 20 == 0 else ()
                self.paint(fresh, paint, run_line(running, 100 * step))
            self.t_ms += 40
        else:
            for panel in (self.panel, fresh):
                panel.crossed_at = panel.lapped = panel.bettered = panel.went_at = None
            self.t_ms += 40
            if running is not None:
                # A new lap: the running time is not carried on from what went before.
                running = (running[0] + 1, 0)
                self.paint(fresh, (), run_line(running, 0))
        for surface, other in zip(self.surfaces, self.others):  # noqa: B905 not on MicroPython
            self.face.draw(self.panel, surface, self.t_ms)
            self.face.draw(fresh, other, self.t_ms)
            assert surface.buffer == other.buffer, "another picture after a repaint: " + surface.layout
        self.pictures += len(self.surfaces)

    def paint(self, fresh, bodies, last):
        for body in bodies:
            self.both(fresh, self.line(body))
        self.both(fresh, self.line(last))

    def both(self, fresh, data):
        self.panel.feed(data, self.t_ms)
        fresh.feed(data, self.t_ms)


def main():
    import gc

    import panel_cases
    from panel import face, state

    fuzz = Fuzz(state, face, panel_cases, int(sys.argv[2]))
    fuzz.run(20000)
    gc.collect()
    before = gc.mem_alloc() if hasattr(gc, "mem_alloc") else 0
    fuzz.run(int(sys.argv[1]))
    gc.collect()
    grown = gc.mem_alloc() - before if hasattr(gc, "mem_alloc") else 0
    assert grown < 16384, "%d bytes more are held at the end" % grown
    print("%d bytes, %d repaints, %d pictures, %d lines obeyed, %d thrown away, %d bytes more held" % (
        fuzz.fed, fuzz.repaints, fuzz.pictures, fuzz.panel.lines, fuzz.panel.dropped, grown))  # fmt: skip


if __name__ == "__main__":
    main()
