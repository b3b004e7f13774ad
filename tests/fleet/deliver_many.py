"""The figure of docs/fleet.md: thousands of laps from three boxes, the broker killed again and again, each delivered once.

    nice python tests/fleet/deliver_many.py [--laps 10000] [--kills 20] [--others 3] [--per-s 150]

Real processes: mosquitto without persistence, `dnb-edge fleet hub`, and for each box `dnb-edge fleet publish` on a real live
socket. `--others`: so many times a publisher and the hub are killed (SIGKILL), too. Exit code 1 where a lap is missing or
there twice.
"""

import argparse
import json
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

from fleet_rig import lap, racing
from mqtt_broker import Mosquitto, free_port

from dnb_edge import wire
from dnb_edge.live.server import LiveServer

BOXES = ("north", "south", "east")
LAST_S = 180.0


class Process:
    """A `dnb-edge fleet ...` that may be killed and started again."""

    def __init__(self, log: Path, *words: str) -> None:
        self._log, self._words = log, words
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "dnb_edge", "fleet", *self._words], stdout=log, stderr=log
            )

    def end(self, how: signal.Signals = signal.SIGKILL) -> int:
        assert self._process is not None
        self._process.send_signal(how)
        return self._process.wait(30.0)


def main() -> int:
    parser = argparse.ArgumentParser()
    for name, default in (("laps", 10_000), ("kills", 20), ("others", 3), ("per-s", 150), ("seed", 1)):
        parser.add_argument(f"--{name}", type=int, default=default)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        return campaign(Path(folder), asked)


def campaign(folder: Path, asked: argparse.Namespace) -> int:
    chance = random.Random(asked.seed)
    counts = {box: asked.laps // len(BOXES) + (place < asked.laps % len(BOXES)) for place, box in enumerate(BOXES)}
    broker, port = Mosquitto(folder), free_port()
    url, store = broker.url, folder / "hub.sqlite"
    hub = Process(folder / "hub.log", "hub", "--broker", url, "--store", str(store), "--port", str(port))
    daemons = {box: LiveServer(folder / f"{box}.sock", version="1") for box in BOXES}
    boxes = {
        box: Process(
            folder / f"{box}.log", "publish", "--broker", url, "--box", box,
            "--queue", str(folder / f"{box}.sqlite"), "--live", str(folder / f"{box}.sock"),
        )
        for box in BOXES
    }  # fmt: skip
    kills = set(chance.sample(range(asked.laps // 50, asked.laps), asked.kills))
    others = set(chance.sample(range(asked.laps // 10, asked.laps), 2 * asked.others))
    began_s, killed, killed_others = time.monotonic(), 0, 0
    broker.start()
    try:
        for process in (hub, *boxes.values()):
            process.start()
        for place, box in enumerate(BOXES):
            daemons[box].show(racing(f"run-{place:08x}-0001"))
        order = [box for box, count in counts.items() for _ in range(count)]
        chance.shuffle(order)
        told = dict.fromkeys(BOXES, 0)
        for number, box in enumerate(order):
            told[box] += 1
            daemons[box].tell(lap(told[box]))
            if number in kills:
                broker.kill()
                killed += 1
                time.sleep(chance.uniform(0.0, 0.5))
                broker.start()
            if number in others:
                process = hub if killed_others % 2 else boxes[chance.choice(BOXES)]
                process.end()
                process.start()
                killed_others += 1
            ahead_s = began_s + number / asked.per_s - time.monotonic()
            time.sleep(max(0.0, ahead_s))
        driven_s = time.monotonic() - began_s
        wait_for_all(store, asked.laps)
        all_s = time.monotonic() - began_s
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/v1/boxes", timeout=10.0) as answer:
            glance = json.load(answer)
        codes = [process.end(signal.SIGTERM) for process in (*boxes.values(), hub)]
    finally:
        broker.stop()
        for daemon in daemons.values():
            daemon.close()
    missing, twice, changed = judge(store, counts)
    queued = [
        sqlite3.connect(folder / f"{box}.sqlite").execute("SELECT count(*) FROM parcel").fetchone()[0] for box in BOXES
    ]
    print(
        f"{asked.laps} laps over {len(BOXES)} boxes in {driven_s:.0f} s, all stored after {all_s:.0f} s;"
        f" broker killed {killed} times, publishers and hub {killed_others} times (exit codes at the end {codes})\n"
        f"missing {missing}, twice {twice}, changed or out of order {changed}; left in the queues {queued};"
        f" came again and were passed over by the last hub process: {glance['passed_over']}; nonsense {glance['nonsense']}"
    )
    return int(bool(missing or twice or changed or any(queued)))


def wait_for_all(store: Path, laps: int) -> None:
    end_s = time.monotonic() + LAST_S
    base = sqlite3.connect(f"file:{store}?mode=ro", uri=True)
    while time.monotonic() < end_s and base.execute("SELECT count(*) FROM parcel").fetchone()[0] < laps:
        time.sleep(0.2)
    base.close()


def judge(store: Path, counts: dict[str, int]) -> tuple[int, int, int]:
    """Laps that are missing, there more than once, and other than they were told or in another order."""
    base = sqlite3.connect(store)
    missing = twice = changed = 0
    for box, count in counts.items():
        rows = base.execute("SELECT event FROM parcel WHERE box = ? AND kind = 'lap' ORDER BY id", (box,)).fetchall()
        events = [json.loads(event) for (event,) in rows]
        numbers = [event["number"] for event in events]
        missing += len(set(range(1, count + 1)) - set(numbers))
        twice += len(numbers) - len(set(numbers))
        changed += numbers != sorted(numbers)
        changed += sum(event != {"event": "lap", **wire.to_dict(lap(event["number"]))} for event in events)
    base.close()
    return missing, twice, changed


if __name__ == "__main__":
    sys.exit(main())
