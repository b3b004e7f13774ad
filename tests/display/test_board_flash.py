"""Writing the firmware onto a board, over a pseudo-terminal with MicroPython's raw REPL at its other end."""

import json
import os
import subprocess
import sys
import tty

import on_board
import pytest
import serial
from micropython import HERE

from dnb_edge.display import flash
from dnb_edge.errors import InputError, WorkError


class Board:
    """A board on a port, its files in `folder`: the raw REPL run by `python`."""

    def __init__(self, python, folder):
        self.folder = folder
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._python = python
        self._process = None

    def plug(self):
        """As after power on: its program runs."""
        self.unplug()
        command = [*self._python, str(HERE / "raw_repl.py")]
        self._process = subprocess.Popen(command, stdin=self._master, stdout=self._master, cwd=self.folder)
        return self.port

    def unplug(self):
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def restarted(self):
        """Whether it was started anew by itself."""
        return self._process.wait(timeout=10) == 0

    def close(self):
        self.unplug()
        os.close(self._slave)
        os.close(self._master)

    def files(self):
        paths = (path for path in self.folder.rglob("*") if path.is_file())
        return {str(path.relative_to(self.folder)): path.read_bytes() for path in paths}


def _cpython():
    return [sys.executable]


def _micropython():
    return list(on_board.here())


@pytest.fixture(params=[_cpython, _micropython], ids=["cpython", "micropython"])
def board(request, tmp_path):
    board = Board(request.param(), tmp_path)
    yield board
    board.close()


@pytest.fixture
def host_board(tmp_path):
    board = Board(_cpython(), tmp_path)
    yield board
    board.close()


def test_a_bare_board_gets_everything(board):
    """Every file of the firmware, `main.py` and the settings are on the board, byte for byte, and it is started anew."""
    told = []
    done = flash.flash(
        board.plug(),
        {"panel": "hub75-64x32", "brightness": 9},
        tell=lambda path, at, count: told.append((path, at, count)),
    )
    assert board.restarted()
    files = board.files()
    assert json.loads(files.pop("settings.json")) == {"panel": "hub75-64x32", "brightness": 9}
    assert files == flash.board_files()
    assert files["main.py"] == flash.MAIN
    assert set(done.written) == {"settings.json", *files}
    assert done.unchanged == done.removed == ()
    assert [at for _, at, _ in told] == list(range(len(files) + 2))
    assert {count for _, _, count in told} == {len(files) + 1}


def test_twice_writes_nothing(board):
    """A board that has it all is left as it is, settings of its own included, and is started anew."""
    flash.flash(board.plug(), {"brightness": 1})
    before = board.files()
    done = flash.flash(board.plug())
    assert board.restarted()
    assert done.written == done.removed == ()
    assert board.files() == before


def test_settings_go_over_those_that_are_there(board):
    """One setting changes and the others stay; a file that a board would not take is written anew."""
    flash.flash(board.plug(), {"panel": "hub75-64x32", "upside_down": True})
    done = flash.flash(board.plug(), {"brightness": 9})
    assert done.written[0] == "settings.json"
    there = json.loads(board.files()["settings.json"])
    assert there == {"panel": "hub75-64x32", "upside_down": True, "brightness": 9}
    for wrong in (b"{}}", b'{"panel": "vt100"}', b"\xff\xfe"):
        (board.folder / "settings.json").write_bytes(wrong)
        flash.flash(board.plug(), {"brightness": 2})
        assert json.loads(board.files()["settings.json"]) == {"brightness": 2}


def test_the_interpreters_own_raw_repl(tmp_path):
    """The same on the raw REPL that MicroPython itself has, where its Unix port has one (Debian 13's has not)."""
    master, slave = os.openpty()
    tty.setraw(slave)
    process = subprocess.Popen(on_board.here(), stdin=master, stdout=master, stderr=subprocess.DEVNULL, cwd=tmp_path)
    try:
        with serial.Serial(os.ttyname(slave), timeout=2) as line:
            line.write(b"\r\x03\x01")
            if b"raw REPL" not in line.read(4096):
                pytest.skip("this MicroPython's Unix port has no raw REPL")
        done = flash.flash(os.ttyname(slave), {"brightness": 9})
        assert set(done.written) == {"settings.json", *flash.board_files()}
        files = {str(path.relative_to(tmp_path)): path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
        assert json.loads(files.pop("settings.json")) == {"brightness": 9}
        assert files == flash.board_files()
    finally:
        process.kill()
        process.wait()
        os.close(slave)
        os.close(master)


def test_an_older_firmware_is_replaced(board):
    """What changed is written, what is no more goes, and other people's files stay."""
    flash.flash(board.plug())
    (board.folder / "panel" / "face.py").write_text("def draw(): pass\n")
    (board.folder / "panel" / "old.py").write_text("")
    (board.folder / "diary.txt").write_text("mine")
    done = flash.flash(board.plug())
    assert done.written == ("panel/face.py", "main.py")
    assert done.removed == ("panel/old.py",)
    assert board.files() == {**flash.board_files(), "diary.txt": b"mine"}


def test_half_written_does_not_start(host_board, monkeypatch):
    """A board that is pulled out in the middle has no `main.py`, and the next try mends it."""
    flash.flash(host_board.plug())
    for path in host_board.folder.rglob("*.py"):
        if path.name != "main.py":
            path.write_text("old")

    def pull(path, done, count):
        if done == 3:
            host_board.unplug()

    monkeypatch.setattr(flash, "ANSWER_S", 0.5)
    with pytest.raises(WorkError, match="stopped answering"):
        flash.flash(host_board.plug(), tell=pull)
    assert "main.py" not in host_board.files()
    flash.flash(host_board.plug())
    left = {name: content for name, content in host_board.files().items() if not name.endswith(".new")}
    assert left == flash.board_files()


def test_a_full_board_says_so(host_board):
    """The board's own error is what the user reads."""
    (host_board.folder / "panel").write_text("a file where the folder is to be")
    with pytest.raises(WorkError, match="the board says"):
        flash.flash(host_board.plug())


def test_damaged_memory_is_noticed(host_board, monkeypatch):
    """A file that reads back otherwise than it was written is an error, and is not put in its place."""
    monkeypatch.setattr(
        flash, "_HELPERS", flash._HELPERS.replace("part = file.read(512)", "part = file.read(512)[:-1]")
    )
    with pytest.raises(WorkError, match=r"kept panel/__init__\.py wrongly"):
        flash.flash(host_board.plug())
    assert "panel/__init__.py" not in host_board.files()


def test_nobody_answers(tmp_path, monkeypatch):
    """A port with something else at its end says what may be wrong."""
    monkeypatch.setattr(flash, "ANSWER_S", 0.2)
    monkeypatch.setattr(flash, "INTERRUPT_S", 0.2)
    board = Board(_cpython(), tmp_path)
    try:
        with pytest.raises(WorkError, match="no MicroPython answers"):
            flash.flash(board.port)
    finally:
        board.close()


def test_another_python_is_refused(host_board, monkeypatch):
    """What calls itself otherwise, or is too old, is left alone."""
    port = host_board.plug()
    monkeypatch.setattr(flash, "OLDEST", (2, 0))
    with pytest.raises(WorkError, match=r"MicroPython 1\.26\.1 is too old: 2\.0 or newer"):
        flash.flash(port)
    assert host_board.files() == {}


def test_a_port_that_is_not_there():
    """A wrong port is the user's to mend."""
    with pytest.raises(InputError, match=r"/dev/nothing: cannot be opened .*sudo systemctl stop dnb-edge"):
        flash.flash("/dev/nothing")


def test_wrong_settings_touch_no_board():
    """Settings are judged before the port is opened."""
    with pytest.raises(InputError, match="the panel's settings: brightness: 0 to 15"):
        flash.flash("/dev/nothing", {"brightness": 99})


@pytest.mark.parametrize(
    ("there", "said"),
    [
        ([], "no board with MicroPython is plugged in: hold its BOOTSEL"),
        (["/dev/ttyACM0", "/dev/ttyACM1"], "several boards are plugged in: name one of /dev/ttyACM0 /dev/ttyACM1"),
    ],
)
def test_which_board(there, said, monkeypatch):
    """One board is found by itself; none, or several, is said."""

    class Port:
        def __init__(self, device, vid=flash.RASPBERRY_PI):
            self.device, self.vid = device, vid

    others = [Port("/dev/ttyUSB0", 0x1A86), Port("/dev/ttyS0", None)]
    monkeypatch.setattr(flash.list_ports, "comports", lambda: [*others, *map(Port, there)])
    with pytest.raises(InputError, match=said):
        flash.find_port()
    monkeypatch.setattr(flash.list_ports, "comports", lambda: [*others, Port("/dev/ttyACM7")])
    assert flash.find_port() == "/dev/ttyACM7"
