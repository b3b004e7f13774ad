"""What panels are told in the tests, and when their pictures are taken. Runs on MicroPython, too: builtins only."""

REPAINT = (
    "HELLO DNB-EDGE 1",
    "STATE LAP 3 OF 5",
    "LAP 1 12.483 +-0.002 OK 95.8",
    "LAP 2 13.207 +-0.003 OK 91.2",
    "BEST 1 12.483",
    "LIVE -0.214 95.8",
    "SAVED 2",
    "HEALTH FPS 29.9 REC RECORDING WARNINGS 0",
    "RUN 3 4.200",
)
"""A lap is running and all is well."""

CARS = (
    "HELLO DNB-EDGE 1",
    "CAR 2 Anna",
    "STATE LAP 6",
    "GO 212.4",
    "LAP 5 12.483 +-0.002 OK 95.8",
    "BEST 5 12.483",
    "PLACE 1= 2 5 12.483 - IN Anna",
    "PLACE 1= 1 4 12.491 0.008 IN Ben",
    "HEALTH FPS 29.9 REC NONE WARNINGS 0",
    "RUN 6 7.300",
)


def but(told, *changes, last=None):
    """`told` with lines of the same kind replaced, others put in before the `RUN` line, which may be another one."""
    kinds = [change.split(" ")[0] for change in changes]
    kept = [body for body in told[:-1] if body.split(" ")[0] not in kinds]
    return tuple(kept) + tuple(changes) + (last or told[-1],)


def without(told, *kinds):
    """`told` without the lines of some kinds."""
    return tuple([body for body in told if body.split(" ")[0] not in kinds])


BEFORE = ("HELLO DNB-EDGE 1", "STATE WAITING", "HEALTH FPS 29.9 REC RECORDING WARNINGS 0", "RUN - -")
HEALTH_OF = "HEALTH FPS %s REC %s WARNINGS %d"
GAP = "WARN 1 camera gap of 2.1 s"
GONE = "WARN 1 /dev/video0: the camera is gone (No such device)"
CODE = "NOTE set-up code 4711 0815"
ADDRESS = "NOTE http://192.168.4.1:8080 code 4711 0815"

CASES = (
    # name, ((when told, what), ...), when the picture is taken
    ("start-up", (), 400),
    ("waiting", ((0, BEFORE),), 1000),
    ("out-lap", ((0, but(BEFORE, "STATE OUT-LAP")),), 1000),
    ("grid", ((0, but(BEFORE, "GRID waiting for 2 cars to stand on the grid")),), 1000),
    ("grid-text", ((0, but(BEFORE, "GRID waiting for 2 cars to stand on the grid")), (4000, BEFORE[-1:])), 5600),
    ("countdown", ((0, but(BEFORE, "COUNT 3.0")),), 320),
    ("countdown-secret", ((0, but(BEFORE, "COUNT -")),), 320),
    ("go", ((0, but(BEFORE, "COUNT 0.1")), (200, ("GO 300.0", "RUN - -"))), 760),
    ("race-clock", ((0, but(REPAINT, "GO 281.0", "LIVE - -")),), 40),
    ("running", ((0, REPAINT),), 760),
    ("running-long", ((0, but(REPAINT, "STATE LAP 12", last="RUN 12 123.456")),), 40),
    ("crossing", ((0, REPAINT), (8000, ("CROSS 39.890", "RUN 3 12.200"))), 8040),
    ("lap", ((0, REPAINT), (9000, ("CROSS 38.900", "LAP 3 13.180 +-0.002 OK 93.0", "STATE LAP 4 OF 5", "RUN 4 0.033"))), 10000),
    ("lap-long", ((0, REPAINT), (9000, ("LAP 12 123.456 +-0.002 OK -", "RUN 13 0.033"))), 10000),
    ("best-lap", ((0, REPAINT), (9000, ("LAP 3 12.180 +-0.002 OK 97.0", "BEST 3 12.180", "RUN 4 0.033"))), 10000),
    ("bad-lap", ((0, REPAINT), (9000, ("LAP 3 14.000 +-0.010 BAD -", "WHY 3 off the lane for 0.8 s", "RUN 4 0.033"))), 10000),
    ("penalty", ((0, REPAINT), (9000, ("LAP 3 12.900 +-0.002 OK 90.0", "PENALTY 3 2.000 cut", "RUN 4 0.033"))), 10000),
    ("why", ((0, but(REPAINT, "LAP 2 14.000 +-0.010 BAD -", "WHY 2 off the lane for 0.8 s")), (5000, ("RUN 3 9.200",))), 6000),
    ("finished", ((0, but(REPAINT, "STATE FINISHED", "LIVE - -", last="RUN - -")),), 2000),
    ("warning", ((0, but(REPAINT, HEALTH_OF % ("29.9", "RECORDING", 1), GAP)), (5000, ("RUN 3 9.200",))), 6000),
    ("camera-lost", ((0, but(REPAINT, HEALTH_OF % ("-", "RECORDING", 1), GONE)),), 1400),
    ("not-recording", ((0, but(REPAINT, HEALTH_OF % ("29.9", "FAILED", 0))), (5000, ("RUN 3 9.200",))), 6000),
    ("set-up-code", ((0, but(BEFORE, CODE)),), 1000),
    ("set-up-code-runs-through", ((0, but(BEFORE, CODE)), (4000, BEFORE[-1:])), 6000),
    ("address", ((0, but(BEFORE, ADDRESS)),), 1000),
    ("address-while-racing", ((0, but(REPAINT, ADDRESS)), (5000, ("RUN 3 9.200",))), 6000),
    ("several-cars", ((0, CARS),), 1000),
    ("no-signal", ((0, REPAINT),), 3640),
)  # fmt: skip


def line(body):
    """`body` as the appliance sends it."""
    found = 0
    for byte in body.encode():
        found ^= byte
    return ("%s *%02X\r\n" % (body, found)).encode()


def told(panel, steps):
    """Feeds `panel` the lines of `steps`, each line at its moment."""
    for t_ms, bodies in steps:
        for body in bodies:
            panel.feed(line(body), t_ms)
    return panel
