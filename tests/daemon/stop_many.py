"""Starts live races and ends each with SIGTERM at a moment of chance: all must be done within 5 s, with a whole recording.

    python tests/daemon/stop_many.py COUNT

A script, since 200 take minutes; the tests run it with a few. Each race is a fork of this process, which has imported and drawn
everything already. Prints JSON and exits with 1 where one did not end as it must.
"""

import contextlib
import json
import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

import live_drive

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.cli.main import main as edge
from dnb_edge.record.reader import read_run
from dnb_edge.sim.rig import Rig

WITHIN_S = 5.0
LATEST_S = 2.5
"""The signal comes at any time up to here after the first frame, seconds."""


def race(words: list[str]) -> int:
    """A process that races; its id."""
    child = os.fork()
    if child:
        return child
    code = 70
    # The parent's flow must not go on in the child, whatever happens here.
    with contextlib.suppress(BaseException):
        sys.argv = ["dnb-edge", *words]
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        try:
            edge()
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
    os._exit(code)


def ended_within(child: int, seconds: float) -> tuple[float, int | None]:
    """How long the process took to end, and its code; None where it was killed for taking too long."""
    began_s = time.monotonic()
    while time.monotonic() - began_s < seconds:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return time.monotonic() - began_s, os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return seconds, None


def main(count: int) -> int:
    chance = random.Random(1)
    live_drive.play()
    live_drive.rig()
    took_s, bad = [], []
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(scratch)
        config = write_demo_config(root, Rig(laps=1))
        for number in range(count):
            first, runs = root / f"first-{number}", root / f"runs-{number}"
            os.environ["DRIVE_LOG"] = str(first)
            child = race(["run", "--config", str(config), "--source", "drive:", "--record", str(runs), "--json"])
            while not first.exists():
                time.sleep(0.005)
            time.sleep(chance.uniform(0.0, LATEST_S))
            os.kill(child, signal.SIGTERM)
            seconds, code = ended_within(child, WITHIN_S)
            took_s.append(seconds)
            names = sorted(path.name for path in runs.rglob("*"))
            recordings = list(runs.glob("*.mcap"))
            whole = len(recordings) == 1 and not any(name.endswith(".part") for name in names)
            whole = whole and read_run(recordings[0]).damage is None
            if code != 0 or not whole:
                bad.append({"number": number, "code": code, "files": names})
    told = {"stopped": count - len(bad), "of": count, "worst_s": round(max(took_s), 3), "bad": bad}
    sys.stdout.write(json.dumps(told) + "\n")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
