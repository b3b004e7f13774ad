"""`dnb-edge runs copy` and `runs export --to` as a person and a script see them."""

import json
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from record_samples import small_run
from typer.testing import CliRunner, Result

from dnb_edge.cli import runs as runs_verb
from dnb_edge.errors import InputError, WorkError
from dnb_edge.live.messages import ShowText
from dnb_edge.live.server import LiveServer, Order, Reply


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    place = tmp_path / "runs"
    place.mkdir()
    return place


@pytest.fixture
def stick(tmp_path: Path) -> Path:
    place = tmp_path / "stick"
    place.mkdir()
    return place


def call(*words: object) -> Result:
    return CliRunner().invoke(runs_verb.app, [str(word) for word in words])


def on_stick(stick: Path) -> set[str]:
    return {path.name for path in (stick / "dnb-edge" / socket.gethostname()).glob("*.mcap")}


def test_a_script_reads_what_came_of_it(runs: Path, stick: Path) -> None:
    """One JSON object with the runs copied, and nothing else on stdout."""
    name = small_run(runs).name
    result = call("copy", runs, "--to", stick, "--json")
    assert result.exit_code == 0
    told = json.loads(result.stdout)
    assert (told["copied"], told["files"], told["missing"], told["stopped"]) == ([name], 1, [], None)
    assert (Path(told["directory"]) / name).read_bytes() == (runs / name).read_bytes()


def test_export_to_is_the_same(runs: Path, stick: Path) -> None:
    """`runs export DIR --to STICK` copies; with what only CSV has it is refused, and without --to it is what it was."""
    run = small_run(runs)
    assert "1 run copied and checked" in call("export", runs, "--to", stick).stdout
    assert on_stick(stick) == {run.name}
    for words in (("--what", "laps"), ("-o", "x.csv"), ("--no-edits",)):
        refused = call("export", runs, "--to", stick, *words)
        assert isinstance(refused.exception, InputError)
        assert "--to" in str(refused.exception)
    assert len(call("export", run).stdout.splitlines()) == 4


def test_wrong_places_are_refused(runs: Path, stick: Path) -> None:
    """No runs there, no stick there: one line that says so."""
    for words in (("copy", runs / "none", "--to", stick), ("copy", runs, "--to", stick / "none")):
        result = call(*words)
        assert isinstance(result.exception, InputError)
        assert "there is no such directory" in str(result.exception)


def test_what_is_missing_is_exit_code_1(runs: Path, stick: Path) -> None:
    """A run that cannot be copied is told on stdout and in the error, and the others are there."""
    whole, unreadable = small_run(runs), small_run(runs)
    folder = stick / "dnb-edge" / socket.gethostname()
    folder.mkdir(parents=True)
    # A folder in the way of its pictures' folder: a file.
    (runs / f"{unreadable.stem}.pictures").mkdir()
    (runs / f"{unreadable.stem}.pictures" / "1.mcap").write_bytes(b"")
    (folder / f"{unreadable.stem}.pictures").write_bytes(b"in the way")
    result = call("copy", runs, "--to", stick)
    assert isinstance(result.exception, WorkError)
    assert "not copied" in str(result.exception)
    assert unreadable.name in result.stdout
    assert whole.name not in on_stick(stick) or on_stick(stick) >= {whole.name}


def test_the_displays_say_how_it_goes(runs: Path, stick: Path, tmp_path: Path) -> None:
    """At the beginning, and when it is done: that it may be taken out; each fits a display's line."""
    small_run(runs)
    small_run(runs)
    told: list[ShowText] = []

    def show(order: Order, reply: Reply) -> None:
        assert isinstance(order, ShowText)
        told.append(order)
        reply(None)

    with LiveServer(tmp_path / "live.sock", version="1", on_order=show):
        assert call("copy", runs, "--to", stick, "--live", tmp_path / "live.sock").exit_code == 0
        assert call("copy", runs, "--to", stick, "--live", tmp_path / "live.sock").exit_code == 0
    texts = [one.text for one in told]
    assert texts[0].startswith("stick: copying, ")
    assert texts[-2:] == [
        "stick: 2 runs copied and checked, take it out",
        "stick: nothing new, 2 runs on it, take it out",
    ]
    assert all(len(text) <= 60 for text in texts)


def test_without_the_appliance_it_copies_all_the_same(runs: Path, stick: Path, tmp_path: Path) -> None:
    """Where the daemon is down that is one line on stderr."""
    run = small_run(runs)
    result = call("copy", runs, "--to", stick, "--live", tmp_path / "live.sock")
    assert result.exit_code == 0
    assert result.stderr.count("not said on a display") == 1
    assert on_stick(stick) == {run.name}


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_ended_in_the_middle_it_leaves_whole_files(runs: Path, stick: Path, how: signal.Signals) -> None:
    """Ctrl-C, stopped or killed: only whole files have names, and the next time it goes on."""
    names = {small_run(runs).name for _ in range(2)}
    for name in names:
        with (runs / name).open("ab") as stream:
            stream.write(bytes(1 << 20))
    words = ["-m", "dnb_edge", "runs", "copy", str(runs), "--to", str(stick), "--mb-per-s", "1"]
    process = subprocess.Popen([sys.executable, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline_s = time.monotonic() + 60
    while len(on_stick(stick)) < 1:
        assert time.monotonic() < deadline_s
        time.sleep(0.05)
    process.send_signal(how)
    assert process.wait(30) != 0
    (first,) = on_stick(stick)
    assert (stick / "dnb-edge" / socket.gethostname() / first).read_bytes() == (runs / first).read_bytes()
    told = json.loads(call("copy", runs, "--to", stick, "--json").stdout)
    assert {*told["copied"], *told["already"]} == names
    assert told["already"] == [first]
    assert not list((stick / "dnb-edge" / socket.gethostname()).glob("*.partial"))
