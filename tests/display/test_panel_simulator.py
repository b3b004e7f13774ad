"""`dnb-edge display --simulate`, as a shell sees it, and its lines: own, port, standard input."""

import os
import pty
import subprocess
import sys

import cv2
import numpy as np
import panel_cases
import pytest
from display_events import race
from pty_line import wait_until

from dnb_edge.cli.main import main
from dnb_edge.display.panel import face, state
from dnb_edge.display.serial_port import SerialDisplay
from dnb_edge.display.simulator import image
from dnb_edge.display.simulator_line import own_line, port_line
from dnb_edge.errors import InputError

TYPED = "".join(body + "\n" for body in panel_cases.REPAINT)


@pytest.fixture
def shell(monkeypatch, capsys):
    """Runs `dnb-edge display` with arguments; gives exit code, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["dnb-edge", "display", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit) as caught:
            main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return run


@pytest.mark.parametrize("layout", face.LAYOUTS)
def test_a_file_of_lines_becomes_a_picture(shell, tmp_path, layout):
    """The picture is that of a panel half a second after the last line, and stdout says how many lines there were."""
    lines, out = tmp_path / "lines.txt", tmp_path / "panel.png"
    lines.write_bytes(b"".join(map(panel_cases.line, panel_cases.BEFORE)) + b"rubbish\n")
    code, said, err = shell("--simulate", "--port", lines, "--layout", layout, "--png", out)
    assert (code, said, err) == (0, "4 lines obeyed, 1 thrown away\n", "")
    panel = panel_cases.told(state.Panel(), ((0, panel_cases.BEFORE),))
    surface = face.surface(layout)
    face.draw(panel, surface, 500)
    assert (cv2.imread(str(out)) == image(surface)).all()


def test_typed_lines_need_no_checksum(shell, tmp_path):
    """With --by-hand; without it they are thrown away."""
    lines = tmp_path / "lines.txt"
    lines.write_text(TYPED)
    assert shell("--simulate", "--port", lines, "--by-hand")[1] == "9 lines obeyed, 0 thrown away\n"
    assert shell("--simulate", "--port", lines)[1] == "0 lines obeyed, 9 thrown away\n"


def test_standard_input_ends_it():
    """A pipe into it, as `cat lines.txt | dnb-edge display --simulate --port -`."""
    words = [sys.executable, "-m", "dnb_edge", "display", "--simulate", "--port", "-", "--by-hand"]
    done = subprocess.run(words, input=TYPED, capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "9 lines obeyed, 0 thrown away\n"


def test_a_terminal_shows_the_picture():
    """In a terminal of 100 columns the panel's pixels appear as half blocks, with the port to give to the appliance."""
    master, slave = pty.openpty()
    words = [sys.executable, "-m", "dnb_edge", "display", "--simulate", "--layout", "matrix-32x8"]
    environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "100", "LINES": "40"}
    with subprocess.Popen(words, stdin=slave, stdout=slave, stderr=slave, env=environment) as process:
        seen = b""

        def shows():
            nonlocal seen
            seen += os.read(master, 4096)
            return "▀".encode() in seen and b"--display serial:/dev/pts/" in seen

        wait_until(shows, patience_s=60.0)
        process.terminate()
    os.close(slave)
    os.close(master)


def test_the_appliances_display_speaks_to_its_own_line(tmp_path):
    """Under the link's name; the panel knows the lap at once, and the link goes with the simulator."""
    link = tmp_path / "panel"
    link.symlink_to("/dev/null")
    panel = state.Panel()
    with own_line(link) as line, SerialDisplay(str(link)) as display:
        assert line.name == str(link)
        display.post(race(2))

        def heard():
            panel.feed(line.read(0.02), 0)
            return panel.shown.last is not None and panel.shown.last.number == 2

        wait_until(heard)
    assert panel.dropped == 0
    assert not link.is_symlink()


def test_a_line_whose_other_end_goes_has_ended(tmp_path):
    """Not an error: the cable was pulled."""
    master, slave = pty.openpty()
    with port_line(tmp_path / os.ttyname(slave)) as line:
        os.write(master, b"x")
        assert line.read(10.0) == b"x"
        assert line.read(0.0) == b""
        os.close(slave)
        os.close(master)
        assert line.read(10.0) is None


def test_a_link_never_replaces_a_file(tmp_path):
    """What is there and is no link stays."""
    (tmp_path / "notes").write_text("mine")
    with (
        pytest.raises(InputError, match="notes: cannot be a link to the display: File exists"),
        own_line(tmp_path / "notes"),
    ):
        pass
    assert (tmp_path / "notes").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--layout", "crt"), "--layout crt: must be one of matrix-32x8, matrix-64x32, oled-128x64, digits-8"),
        (("--png", "a.jpg"), "--png a.jpg: the name must end in .png"),
        (("--port", "/nowhere"), "/nowhere: cannot be read: No such file or directory"),
        (("--port", "-", "--link", "x"), "--link: names a line of its own: leave --port out"),
    ],
)
def test_bad_input_is_told_in_one_line(shell, words, complaint):
    """Exit code 2 and the option's name."""
    code, out, err = shell("--simulate", *words)
    assert (code, out, err) == (2, "", f"dnb-edge: {complaint}\n")


def test_without_anything_it_helps(shell):
    """The help, and no simulation."""
    code, out, _ = shell()
    assert code == 0
    assert "--simulate" in out
    assert np.any([layout in out for layout in face.LAYOUTS])
