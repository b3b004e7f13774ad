"""The appliance, the gateway and cars, as processes of their own: what is recorded, and that no car can move a lap."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from gateways import PATIENCE_S, until

from dnb_edge import wire
from dnb_edge.archive.replayed import replay
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.record.reader import iter_told
from dnb_edge.sim.rig import Rig
from dnb_edge.values import VehicleReport
from dnb_edge.vehicle.client import Vehicle

SOURCE = "sim:?laps=1&pace={pace}"
ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1"}


def dnb_edge(*words: object, **how: object) -> "subprocess.Popen[str]":
    """The command, with a pipe from its stdout."""
    command = [sys.executable, "-m", "dnb_edge", *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT, **how)  # type: ignore[call-overload, no-any-return]


def events_of(lines: str) -> list[dict[str, object]]:
    return [json.loads(line) for line in lines.splitlines()]


def results(events: list[dict[str, object]]) -> list[dict[str, object]]:
    """What must not move."""
    return [event for event in events if event["event"] in {"crossing", "lap", "score"}]


@pytest.fixture
def gateway(tmp_path: Path) -> Iterator[tuple[Path, int]]:
    """`dnb-edge vehicle` on a free port, and the socket that it looks for a daemon at."""
    path = tmp_path / "live.sock"
    process = dnb_edge("vehicle", "--socket", path, "--udp", "127.0.0.1:0", stderr=subprocess.DEVNULL)
    assert process.stdout is not None
    name = process.stdout.readline()
    assert name.startswith("UDP 127.0.0.1:")
    yield path, int(name.rpartition(":")[2])
    process.send_signal(signal.SIGTERM)
    assert process.wait(PATIENCE_S) == 0
    process.stdout.close()


def flood(port: int, ended: threading.Event) -> None:
    """Lies, nonsense and truth, as fast as this process can."""
    lines = [
        b'{"car": 1, "throttle": 1}',
        b'{"car": 1, "steering": 9}',
        b"\xff" * 300,
        b"{" * 400,
        b'{"car": 98, "inference_ms": 5}',
    ]
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sender:
        # Another machine than the honest car's: what one sends too much is at its own cost.
        sender.bind(("127.0.0.2", 0))
        while not ended.wait(0.001):
            for line in lines * 4:
                sender.sendto(line, ("127.0.0.1", port))


def test_no_car_moves_a_lap(gateway: tuple[Path, int], tmp_path: Path) -> None:
    """The laps of a race flooded by vehicles are those of a race without any, to the last digit, live and when it is scored
    again; what came through is in the recording, with the cars' own figures; and the car drove on green and stopped on red."""
    path, port = gateway
    config = write_demo_config(tmp_path, Rig(laps=1))
    undisturbed = dnb_edge(
        "run", "--config", config, "--source", SOURCE.format(pace=0), "--json", stderr=subprocess.DEVNULL
    )
    ended = threading.Event()
    flooder = threading.Thread(target=flood, args=(port, ended))
    words = ["stop"]
    with closing(Vehicle("127.0.0.1", port, car=2)) as car:
        flooded = dnb_edge(
            "run", "--config", config, "--source", SOURCE.format(pace=3), "--record", tmp_path / "runs", "--live", path,
            "--json", stderr=subprocess.DEVNULL,
        )  # fmt: skip
        flooder.start()
        try:
            while flooded.poll() is None:
                car.tell(inference_ms=12.5, steering=-0.25, throttle=0.5)
                if car.word != words[-1]:
                    words.append(car.word)
                ended.wait(0.02)
            until(lambda: car.word == "stop", "red")
        finally:
            ended.set()
            flooder.join()
            flooded.kill()
            said, _ = flooded.communicate()
    assert flooded.returncode == 0
    assert [word for word in words if word != "ready"] in (["stop", "go"], ["stop", "go", "stop"])
    alone, _ = undisturbed.communicate()
    assert [event["event"] for event in results(events_of(said))] == ["crossing", "crossing", "lap", "score"]
    assert results(events_of(said)) == results(events_of(alone))
    recording = Path(str(events_of(said)[-1]["recording"]))
    again = [json.loads(wire.event_to_json(event)) for event in replay(recording).events]
    assert results(again) == results(events_of(said))
    told = list(iter_told(recording, VehicleReport))
    assert {report.car for report in told} <= {1, 2, 98}
    assert (12.5, -0.25, 0.5) in {(report.inference_ms, report.steering, report.throttle) for report in told}
    assert max(report.refused for report in told) > len(told)
