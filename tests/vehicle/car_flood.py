"""What a flood of cars' lines costs a live race: frames lost, latency, the gateway's processor time. A script: seconds, rounds.

A live camera at 30 a second (`tests/daemon/live_drive.py`, nothing drawn), the gateway, and a flooder, each a process; rounds
without and with the flood in turn. Prints a JSON object for each.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.record.reader import read_run
from dnb_edge.sim.rig import Rig

DRIVE = Path(__file__).parents[1] / "daemon" / "live_drive.py"
ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1"}
AT_ONCE = 20


def started(*words: object) -> "subprocess.Popen[str]":
    """A Python process with a pipe from its stdout."""
    command = [sys.executable, *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=ENVIRONMENT)


def flood(port: int, lasts_s: float) -> int:
    """Says whatever it can; how many lines."""
    sent, end_s = 0, time.monotonic() + lasts_s
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while time.monotonic() < end_s:
            for _ in range(AT_ONCE):
                line = b'{"car": %d, "throttle": 0.5, "seq": %d}' % (1 + sent % 3, sent)
                sender.sendto(line, ("127.0.0.1", port))
                sent += 1
            time.sleep(0.001)
    return sent


def raced(folder: Path, lasts_s: float, *, flooded: bool) -> dict[str, object]:
    """One race."""
    config, path, runs = write_demo_config(folder, Rig(laps=1)), folder / "live.sock", folder / "runs"
    words = ("run", "--config", config, "--source", "drive:", "--record", runs, "--live", path, "--json", "--no-resume")
    with (
        started(DRIVE, *words) as race,
        started("-m", "dnb_edge", "vehicle", "--socket", path, "--udp", "127.0.0.1:0") as gateway,
    ):
        assert gateway.stdout is not None
        assert race.stdout is not None
        port = int(gateway.stdout.readline().rpartition(":")[2])
        while '"health"' not in race.stdout.readline():
            pass
        sent = flood(port, lasts_s) if flooded else time.sleep(lasts_s)
        race.send_signal(signal.SIGTERM)
        events = [json.loads(line) for line in race.stdout]
        used = Path(f"/proc/{gateway.pid}/stat").read_text(encoding="ascii").split()
        gateway.terminate()
    health = [event for event in events if event["event"] == "health"][-1]
    recording = read_run(Path(events[-1]["recording"]))
    return {
        "flooded": flooded,
        "lines_sent": sent or 0,
        "lines_recorded": recording.counts.get("/vehicle", 0),
        "frames": health["frames"],
        "frames_lost": health["dropped_frames"],
        "messages_lost": recording.lost_messages,
        "latency_p95_ms": round(health["latency_p95_ms"], 1),
        "latency_p99_ms": round(health["latency_p99_ms"], 1),
        "gateway_cpu_s": (int(used[13]) + int(used[14])) / os.sysconf("SC_CLK_TCK"),
        "load": os.getloadavg()[0],
    }


if __name__ == "__main__":
    for number in range(2 * int(sys.argv[2])):
        with tempfile.TemporaryDirectory() as name:
            told = raced(Path(name), float(sys.argv[1]), flooded=number % 2 == 1)
        sys.stdout.write(json.dumps(told) + "\n")
        sys.stdout.flush()
