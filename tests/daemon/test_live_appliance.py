"""The whole appliance over its live socket, through the command line: set up, race after race, aim, and the end.

Its camera, `drive:`, gives 30 frames a second for ever.
"""

import json
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from service_manager import Manager, environment
from test_live_process import Process, config, python, start, wait_patiently

sys.path.insert(0, str(Path(__file__).parents[1] / "live"))

from caller import Caller

from dnb_edge.live.messages import (
    AimCamera,
    Answer,
    FromDaemon,
    NewRun,
    Phase,
    Picture,
    ShowText,
    State,
    Told,
    WatchPictures,
)
from dnb_edge.record.reader import read_run
from dnb_edge.values import Lap

__all__ = ["config", "start"]  # fixtures

Start = Callable[..., Process]


@pytest.fixture
def call(tmp_path: Path) -> Iterator[Callable[[], Caller]]:
    """Connects to the socket once somebody answers there."""
    made: list[Caller] = []

    def connect() -> Caller:
        wait_patiently(lambda: _answers(tmp_path / "s"))
        made.append(Caller(tmp_path / "s"))
        return made[-1]

    yield connect
    for one in made:
        one.close()


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[Manager]:
    """The service manager."""
    pytest.importorskip("systemd.daemon", reason="the systemd binding is not installed")
    one = Manager(tmp_path / "notify")
    yield one
    one.close()


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            return False
    return True


def _more(told: list[str], manager: Manager) -> list[str]:
    told += manager.heard()
    return told


def in_phase(phase: Phase) -> Callable[[FromDaemon], bool]:
    return lambda one: isinstance(one, State) and one.phase is phase


def is_event(kind: str) -> Callable[[FromDaemon], bool]:
    return lambda one: isinstance(one, Told) and one.event["event"] == kind


def states(heard: list[FromDaemon]) -> list[State]:
    return [one for one in heard if isinstance(one, State)]


def laps_in(recording: Path) -> list[float]:
    return [event.time_s for event in read_run(recording).events() if isinstance(event, Lap)]


def test_new_runs_are_whole_recordings(config: Path, tmp_path: Path, start: Start, call: Callable[[], Caller]) -> None:
    """Asked for after a lap: the first recording is finished, the configuration is read anew, and the second one is another
    entry's; each holds the laps that were told while it ran, and every event has a number of its own."""
    process = start("--config", config, "--source", "drive:", "--record", tmp_path / "runs", "--live", tmp_path / "s")
    client = call()
    client.follow()
    heard = client.hear_until(is_event("lap"))
    refused, asked = client.say(NewRun, entry=" "), client.say(NewRun, entry="Net 2")
    heard += client.hear_until(lambda one: isinstance(one, Answer) and one.ask == asked)
    answers = {one.ask: one for one in heard if isinstance(one, Answer)}
    assert not answers[refused].done
    if not answers[asked].done:
        # The other one was still looked at.
        asked = client.say(NewRun, entry="Net 2")
        heard += client.hear_until(lambda one: isinstance(one, Answer) and one.ask == asked and one.done)
    text = config.read_text(encoding="utf-8")
    heard += client.hear_until(is_event("lap"))
    config.write_text("nonsense: true\n", encoding="utf-8")
    damaged = client.answer(client.say(NewRun))
    assert damaged.reason is not None
    assert damaged.reason.startswith(str(config))
    config.write_text(text, encoding="utf-8")
    assert process.stopped() == 0
    while (message := client.hear_or_end()) is not None:
        heard.append(message)
    runs = [one for one in states(heard) if one.phase is Phase.RACING]
    assert [one.run for one in runs] == [path.stem for path in sorted((tmp_path / "runs").glob("*.mcap"))]
    assert len(runs) == 2
    told = [one for one in heard if isinstance(one, Told)]
    numbers = [one.sequence for one in told]
    assert numbers == sorted(set(numbers))
    second = runs[1].first_sequence
    for path, of in zip(sorted((tmp_path / "runs").glob("*.mcap")), (range(second), range(second, 10**9)), strict=True):
        laps = [one.event["time_s"] for one in told if one.event["event"] == "lap" and one.sequence in of]
        # The damaged answer's passing over may have swallowed one.
        assert set(laps) <= set(laps_in(path))
        assert laps
    names = [read_run(path).header.name for path in sorted((tmp_path / "runs").glob("*.mcap"))]
    assert names == ["simulated car", "Net 2"]
    assert not list((tmp_path / "runs").glob("*.part"))
    summaries = [event for event in process.events if event["event"] == "run"]
    assert [Path(str(one["recording"])).stem for one in summaries] == [one.run for one in runs]


def test_it_is_set_up_and_raced_without_a_shell(
    config: Path, tmp_path: Path, start: Start, call: Callable[[], Caller], manager: Manager
) -> None:
    """As a service: pictures while there is no configuration, with the reason; a race by itself once one is there; the run
    comes to its end and the process does not; another run when it is asked for; SIGTERM ends it well."""
    config.write_text(config.read_text(encoding="utf-8") + "race:\n  laps: 1\n", encoding="utf-8")
    words = ("--setup", tmp_path / "setup", "--source", "drive:", "--record", tmp_path / "runs")
    service = environment(manager.path, watchdog_s=10.0) | {"RUNTIME_DIRECTORY": str(tmp_path)}
    process = start(*words, service=service)
    (tmp_path / "s").symlink_to(tmp_path / "live.sock")
    client = call()
    client.follow()
    (setup,) = states(client.hear_until(in_phase(Phase.SETUP)))[-1:]
    assert setup.reason is not None
    assert setup.reason.startswith("no track is set up yet")
    assert setup.source == "drive:"
    client.say(WatchPictures, every_s=0.1)
    client.hear_until(lambda one: isinstance(one, Picture))
    early = client.answer(client.say(NewRun))
    assert early.reason == setup.reason
    assert client.answer(client.say(ShowText, text="code 4711", for_s=60.0)).done
    shutil.copytree(config.parent, tmp_path / "new")
    (tmp_path / "new" / config.name).rename(tmp_path / "new" / "dnb-edge.yaml")
    (tmp_path / "new").rename(tmp_path / "setup")
    (racing,) = states(client.hear_until(in_phase(Phase.RACING)))[-1:]
    assert racing.scenery is not None
    assert racing.laps_wanted == 1
    heard = client.hear_until(in_phase(Phase.FINISHED))
    assert [one.event["event"] for one in heard if isinstance(one, Told)][-1] == "run"
    (over,) = states(heard)[-1:]
    assert (over.run, over.scenery) == (racing.run, racing.scenery)
    client.hear_until(lambda one: isinstance(one, Picture))
    assert client.answer(client.say(NewRun)).done
    assert client.answer(client.say(AimCamera, aim=True)).done
    client.hear_until(lambda one: isinstance(one, Picture))
    assert client.answer(client.say(AimCamera, aim=False)).done
    client.hear_until(is_event("lap"))
    told = manager.heard()
    # What the manager's queue had no room for comes once that is read.
    wait_patiently(lambda: "READY=1" in _more(told, manager))
    assert "STOPPING=1" not in told
    process.process.terminate()
    wait_patiently(lambda: "STOPPING=1" in manager.heard())
    assert process.process.wait(60.0) == 0
    assert not (tmp_path / "live.sock").exists()
    whole = sorted((tmp_path / "runs").glob("run-*.mcap*"))
    assert [path.suffix for path in whole] == [".mcap"] * 3
    assert [len(laps_in(path)) for path in whole][::2] == [1, 1]


def test_a_second_daemon_on_the_socket_is_refused(
    config: Path, tmp_path: Path, start: Start, call: Callable[[], Caller]
) -> None:
    """With one line and code 2, though it records elsewhere; the first goes on."""
    first = start("--config", config, "--source", "drive:", "--live", tmp_path / "s")
    client = call()
    second = start("--config", config, "--source", "drive:", "--record", tmp_path / "b", "--live", tmp_path / "s")
    assert second.process.wait(60.0) == 2
    assert second.said() == (
        f"dnb-edge: --live {tmp_path / 's'}: another dnb-edge answers there: stop it (`systemctl stop dnb-edge`), or give "
        "--live another path\n"
    )
    assert not (tmp_path / "b").exists()
    client.follow()
    client.hear_until(is_event("health"))
    assert first.stopped() == 0


def test_a_killed_daemon_leaves_nothing_in_the_way(
    config: Path, tmp_path: Path, start: Start, call: Callable[[], Caller]
) -> None:
    """The next one takes over its socket, and its race: whoever comes is told the laps of before."""
    words = ("--config", config, "--source", "drive:", "--record", tmp_path / "runs", "--live", tmp_path / "s")
    first = start(*words)
    client = call()
    client.follow()
    client.hear_until(is_event("lap"))
    before = client.hello
    time.sleep(1.2)  # on the disk by then
    first.process.kill()
    first.process.wait()
    start(*words)
    again = call()
    assert again.hello.epoch != before.epoch
    again.follow()
    again.hear_until(is_event("lap"))


def test_a_fault_is_told_while_it_lasts(config: Path, tmp_path: Path, start: Start, call: Callable[[], Caller]) -> None:
    """No camera: a process that stays says so to whoever asks, and races by itself once that is mended."""
    text = config.read_text(encoding="utf-8")
    config.write_text(f"{text}capture:\n  source: v4l2:/dev/video977\n", encoding="utf-8")
    process = start("--config", config, "--setup", tmp_path / "setup", "--live", tmp_path / "s")
    client = call()
    (fault,) = states(client.hear_until(in_phase(Phase.FAULT)))[-1:]
    assert fault.reason is not None
    assert fault.reason.startswith("/dev/video977: there is no such camera")
    config.write_text(f"{text}capture:\n  source: 'drive:'\n", encoding="utf-8")
    client.hear_until(in_phase(Phase.RACING))
    assert process.said().count("/dev/video977") == 1
    assert process.stopped() == 0


def test_without_a_socket_nothing_is_served(config: Path, tmp_path: Path) -> None:
    """A race at a terminal, as ever: no socket, no lock, and it ends with its laps."""
    done = subprocess.run(
        python("live_drive.py", "run", "--config", config, "--source", "sim:?laps=1", "--json", "--setup", "none"),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1])["laps"] == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["etc"]
