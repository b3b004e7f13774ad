"""The appliance as a process of its own with a live camera: signals, a second one, wrong input as a service, the last good
copy."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from played import wait_until
from service_manager import Manager, environment

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.sim.rig import Rig

HERE = Path(__file__).parent
STOPS = 6
PATIENCE_S = 120.0


def python(script: str, *words: object) -> list[str]:
    return [sys.executable, str(HERE / script), *map(str, words)]


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """The demo's configuration."""
    (tmp_path / "etc").mkdir()
    return write_demo_config(tmp_path / "etc", Rig(laps=1))


class Process:
    """A `dnb-edge run`, killed at the latest when its test is over."""

    def __init__(self, *words: object, err: Path, service: dict[str, str] | None = None) -> None:
        self._err = err
        kept = {name: value for name, value in os.environ.items() if name not in {"NOTIFY_SOCKET", "WATCHDOG_USEC"}}
        service = {} if service is None else service
        service.pop("WATCHDOG_PID", None)
        with err.open("wb") as stream:
            self.process = subprocess.Popen(
                python("live_drive.py", "run", *words, "--json"),
                env=kept | {"OMP_NUM_THREADS": "1"} | service,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=stream,
                text=True,
            )
        self.events: list[dict[str, object]] = []
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.events.append(json.loads(line))

    def said(self) -> str:
        return self._err.read_text(encoding="utf-8")

    def healths(self) -> list[dict[str, object]]:
        return [event for event in self.events if event["event"] == "health"]

    def stopped(self) -> int:
        """Its code after SIGTERM."""
        self.process.terminate()
        return self.process.wait(PATIENCE_S)

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join()
        assert self.process.stdout is not None
        self.process.stdout.close()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Process]]:
    """Starts processes."""
    started: list[Process] = []

    def begin(*words: object, service: dict[str, str] | None = None) -> Process:
        started.append(Process(*words, err=tmp_path / f"err-{len(started)}", service=service))
        return started[-1]

    yield begin
    for one in started:
        one.close()


def test_every_sigterm_ends_a_race_well_within_five_seconds() -> None:
    """At moments of chance: code 0, and one whole recording each time. `stop_many.py 200` is the same at length."""
    done = subprocess.run(
        python("stop_many.py", STOPS), capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.stdout, done.stderr
    told = json.loads(done.stdout)
    assert (told["stopped"], told["bad"]) == (STOPS, [])


def test_a_second_appliance_is_refused(config: Path, tmp_path: Path, start: Callable[..., Process]) -> None:
    """One line and code 2 for the second; the first races on, and tells of the machine as well."""
    words = ("--config", config, "--source", "drive:", "--record", tmp_path / "runs")
    first = start(*words)
    wait_patiently(lambda: bool(first.healths()))
    second = start(*words)
    assert second.process.wait(PATIENCE_S) == 2
    (line,) = second.said().splitlines()
    assert line.startswith(f"dnb-edge: {tmp_path / 'runs'}: another dnb-edge is racing with this directory: stop it")
    assert first.process.poll() is None
    assert first.stopped() == 0
    assert [path.suffix for path in (tmp_path / "runs").glob("*.mcap*")] == [".mcap"]
    told = first.healths()[-1]
    assert told["memory_bytes"] > 10e6
    assert told["disk_free_bytes"] > 0
    assert told["queued_frames"] in (0, 1, 2)
    assert told["saved_laps"] in range(100)
    assert 0.0 < told["latency_p95_ms"] <= told["latency_p99_ms"]
    assert sum(lost["frames"] for lost in told["lost"]) == told["dropped_frames"]


def wait_patiently(true: Callable[[], bool]) -> None:
    """Starts of processes take their time on a busy machine."""
    for _ in range(10):
        try:
            wait_until(true)
        except AssertionError:
            continue
        return
    wait_until(true)


def test_a_service_without_a_camera_says_so_and_starts_once_it_is_there(
    config: Path, tmp_path: Path, start: Callable[..., Process]
) -> None:
    """It stays up with the reason in its status line, told once in the log; the mended configuration is read by itself."""
    pytest.importorskip("systemd.daemon", reason="the systemd binding is not installed")
    text = config.read_text(encoding="utf-8")
    config.write_text(f"{text}capture:\n  source: v4l2:/dev/video977\n", encoding="utf-8")
    manager = Manager(tmp_path / "notify")
    heard: list[str] = []

    def told(what: str) -> bool:
        heard.extend(manager.heard())
        return any(line.startswith(what) for line in heard)

    service = start("--config", config, service=environment(manager.path, watchdog_s=10.0))
    wait_patiently(lambda: told("STATUS=cannot start yet: /dev/video977: there is no such camera"))
    assert service.process.poll() is None
    config.write_text(f"{text}capture:\n  source: 'drive:'\n", encoding="utf-8")
    wait_patiently(lambda: told("READY=1"))
    assert service.said().count("/dev/video977") == 1
    assert service.stopped() == 0
    assert told("STOPPING=1")
    manager.close()


def test_a_damaged_configuration_gives_way_to_the_last_good_one(
    config: Path, tmp_path: Path, start: Callable[..., Process]
) -> None:
    """After a race with it: damaged YAML, and then a damaged twin, race with the copy and say so on all displays."""
    words = ("--config", config, "--source", "drive:", "--last-good", tmp_path / "last-good")
    race = start(*words)
    wait_patiently((tmp_path / "last-good" / "current").exists)
    assert race.stopped() == 0
    good = config.read_bytes()
    for damaged in (config, next(config.parent.glob("*twin*.png"))):
        damaged.write_bytes(b"\x00damaged")
        race = start(*words)
        wait_patiently(lambda now=race: bool(now.healths()))
        (warning,) = [text for text in race.healths()[0]["warnings"] if "last good" in text]
        assert warning.startswith(f"last good configuration in use: {damaged}")
        assert race.stopped() == 0
        assert warning in race.said()
        config.write_bytes(good)
