"""How long after a crossing the last byte of its line has reached the display. A script, not a test.

python tests/display/line_latency.py [--seconds 120] [--cars 2]

The appliance runs a simulated race in real time and speaks to a pseudo-terminal; this script is the display. Two moments are
taken of each CROSS, LAP and CARLAP line: when its last byte came, as over USB, and when it would have left a wire of 115200
baud, behind whatever was sent before it. They are compared with the moment at which the appliance printed the event as JSON,
that is when it knew. A crossing is known only when frames behind the line have confirmed it: how many milliseconds behind it
their stamps are is told beside. Prints JSON, milliseconds.
"""

import argparse
import contextlib
import json
import os
import select
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import tty
from pathlib import Path

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.display import protocol, protocol_race
from dnb_edge.display.panel.line import checked
from dnb_edge.sim.rig import Rig

BYTE_S = 10 / protocol.BAUD
TIMED = (protocol.Cross, protocol.Lap, protocol_race.CarLap)


class Display(threading.Thread):
    """Reads the line; `heard` has, for each line, the message and both moments, seconds of `time.monotonic`."""

    def __init__(self):
        super().__init__(daemon=True)
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        self.heard = []
        self.bytes = 0
        self.done = False

    def run(self):
        torn, wire_free_s = b"", 0.0
        while not self.done:
            if not select.select([self.master], [], [], 0.2)[0]:
                continue
            data = os.read(self.master, 4096)
            came_s = time.monotonic()
            for byte in data:
                wire_free_s = max(wire_free_s, came_s) + BYTE_S
                if byte != 0x0A:
                    torn += bytes([byte])
                    continue
                body = checked(torn.removesuffix(b"\r"))
                torn = b""
                if body is not None:
                    self.heard.append((protocol.parse_line(body.encode()), came_s, wire_free_s))
            self.bytes += len(data)


def race(seconds, cars, folder):
    """The JSON lines of a race with the moment at which each came, and what the display heard."""
    config = write_demo_config(folder, Rig(laps=50, cars=cars))
    display = Display()
    display.start()
    source = f"sim:?pace=1&laps=50&cars={cars}"
    words = ["run", "--source", source, "--config", config, "--record", folder, "--json", "--observations"]
    words += ["--display", f"serial:{os.ttyname(display.slave)}"]
    with (folder / "log").open("w") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "dnb_edge", *map(str, words)],
            stdout=subprocess.PIPE,
            stderr=log,
            env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        )
        ends = threading.Timer(seconds, process.terminate)
        ends.start()
        told = [(time.monotonic(), json.loads(line)) for line in process.stdout]
        process.wait()
        ends.cancel()
    display.done = True
    display.join()
    return told, display


def matched(told, display):
    """For each timed line: kind, when its event was known, how far the race was by then since it, and the line's moments."""
    events, race_s = {}, 0.0
    for at_s, event in told:
        if event["event"] == "observation":
            race_s = max(race_s, event["t_s"])
        elif event["event"] == "crossing" and event["direction"] == "forward":
            events.setdefault(f"{event['t_s']:.3f}", (at_s, race_s - event["t_s"]))
        elif event["event"] == "lap":
            ended_s = event["start_s"] + event["time_s"]
            events.setdefault((event["number"], f"{event['time_s']:.3f}"), (at_s, race_s - ended_s))
    seen = set()
    for message, came_s, wire_s in display.heard:
        if not isinstance(message, TIMED) or message in seen:
            continue
        seen.add(message)
        is_crossing = isinstance(message, protocol.Cross)
        event = events.get(f"{message.t_s:.3f}" if is_crossing else (message.lap, f"{message.time_s:.3f}"))
        if event is not None:
            yield type(message).__name__.upper(), *event, came_s, wire_s


def spread(values):
    """Median, 95th percentile and greatest, in milliseconds."""
    cuts = statistics.quantiles(values, n=20)
    found = {"p50": statistics.median(values), "p95": cuts[18], "max": max(values)}
    return {name: round(1000 * value, 1) for name, value in found.items()}


def main():
    """Measures and prints."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--cars", type=int, default=1)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, contextlib.suppress(KeyboardInterrupt):
        told, display = race(asked.seconds, asked.cars, Path(folder))
    lines = list(matched(told, display))
    kinds = {kind for kind, *_ in lines}
    print(
        json.dumps(
            {
                "lines": {kind: sum(one[0] == kind for one in lines) for kind in sorted(kinds)},
                "known_to_last_byte_ms": spread([came_s - known_s for _, known_s, _, came_s, _ in lines]),
                "known_to_end_of_wire_ms": spread([wire_s - known_s for _, known_s, _, _, wire_s in lines]),
                "crossed_to_known_frames_ms": spread([behind_s for _, _, behind_s, *_ in lines]),
                "bytes_a_second": round(display.bytes / asked.seconds),
            }
        )
    )


if __name__ == "__main__":
    main()
