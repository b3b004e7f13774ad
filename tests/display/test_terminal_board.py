"""The terminal board: its picture, its printed lines, and what it does on broken terminals."""

import io
import os
import sys

import pytest
from display_events import board, crossing, health, lap, race, run_summary, target
from pty_line import wait_until
from rich.console import Console

from dnb_edge.display.base import DisplayStatus
from dnb_edge.display.picture import LargeDigits, headline_text, lap_line, picture, printed_lines
from dnb_edge.display.state import LAPS_KEPT, BoardState
from dnb_edge.display.terminal import BoardConsole, TerminalDisplay


def render(state, *, width=80, height=24):
    console = Console(file=io.StringIO(), force_terminal=True, color_system=None, width=width, height=height)
    console.print(picture(state))
    return console.file.getvalue().splitlines()


def fullest_board():
    state = board(crossing(2.0), health(warnings=tuple(f"warning {number} " + "w" * 99 for number in range(9))))
    for number in range(1, LAPS_KEPT + 9):
        state = state.after(lap(number, time_s=99.999, valid=False, similarity=100.0, reasons=("r" * 99,)))
    return state


@pytest.mark.parametrize("state", [BoardState(), race(1), fullest_board()], ids=["empty", "lap 2", "fullest"])
def test_picture_fits_80_by_24(state):
    """Any board leaves at least one row of 24 free, and no line is wider than 80."""
    lines = render(state)
    assert len(lines) <= 23
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("height", range(16, 30))
def test_picture_leaves_a_row_for_printed_lines(height):
    """A picture as high as the terminal would be drawn again and again below itself."""
    assert len(render(fullest_board(), height=height)) < height


@pytest.mark.parametrize(("width", "height"), [(60, 16), (40, 10), (200, 60)])
def test_picture_survives_other_sizes(width, height):
    """A small or a large terminal gets a picture that is no wider than itself."""
    assert max(map(len, render(fullest_board(), width=width, height=height))) <= width


def test_picture_tells_all():
    """State, last, best, score and health are on the board, brackets in a reason as they are."""
    bad = lap(2, 12.0, 9.5, valid=False, similarity=None, reasons=("off the lane [2]",))
    state = race(1, laps_wanted=3).after(bad).after(health(22.0, display="offline", warnings=("dark [x]",)))
    text = "\n".join(render(state))
    for words in ("lap 3 of 3", "9.500 s", "10.000 s", "95.8 %", "off the lane [2]", "dark [x]", "display offline"):
        assert words in text


@pytest.mark.parametrize(
    ("saved", "words"), [(None, " dnb-edge "), (0, "dnb-edge, 0 laps saved"), (1, "dnb-edge, 1 lap saved")]
)
def test_picture_tells_what_is_saved(saved, words):
    """The board's lower edge says how many laps are on a disk, and nothing of it where none is recorded."""
    assert words in render(race(1).after(health(22.0, saved_laps=saved)))[-1]


@pytest.mark.parametrize(
    ("state", "text"),
    [
        (board(target(1.0)), "--.-"),
        (board(crossing(2.0)).at(6.27), "4.3"),
        (race(1).at(12.5), "10.000"),
        (race(1).at(15.0), "3.0"),
        (race(1).after(run_summary()).at(99.0), "10.000"),
    ],
)
def test_headline(state, text):
    """Large: the running lap in tenths, the last lap to the millisecond while it flashes and when the run is over."""
    assert headline_text(state) == text


def test_large_digits_in_ascii():
    """A console without block characters gets digits of number signs."""
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="ascii")
    Console(file=stream, width=80).print(LargeDigits("0.", "bold"))
    stream.flush()
    lines = [line.rstrip() for line in raw.getvalue().decode("ascii").splitlines()]
    assert lines == ["######", "##  ##", "##  ##", "##  ##", "######  ##"]


@pytest.mark.parametrize("time_s", [9.876, 123.456, 888.888, 1234.567])
def test_headline_is_whole_on_80_columns(time_s):
    """The large digits of any lap are not cut off by what stands beside them."""
    state = race(1, time_s=time_s)
    stream = io.StringIO()
    Console(file=stream, width=200).print(LargeDigits(headline_text(state), "bold"))
    board_lines = render(state)
    for row, digits in enumerate(stream.getvalue().splitlines(), start=1):
        assert digits.rstrip() in board_lines[row]


def test_stdout_is_left_alone(capsys):
    """While a live board stands, what the process prints to stdout goes to stdout and nowhere else."""
    text = io.StringIO()
    with TerminalDisplay(BoardConsole(file=text, force_terminal=True, width=80, height=24)) as display:
        display.post(race(1))
        wait_until(lambda: "lap 1  10.000 s" in text.getvalue())
        sys.stdout.write("json\n")
    assert capsys.readouterr().out == "json\n"
    assert "json" not in text.getvalue()


def test_lap_line():
    """The line printed the moment the car crosses."""
    assert lap_line(lap(2)) == "lap 2  12.483 s +- 2 ms  similarity 95.8 %"
    bad = lap(3, valid=False, similarity=None, reasons=("off the lane", "car lost"))
    assert lap_line(bad) == "lap 3  12.483 s +- 2 ms  NOT VALID: off the lane; car lost"


def test_a_moved_camera_is_on_the_board():
    """Title, warning and lap say that laps are suspect, the first two in red; a lap's own line carries it too."""
    moved = lap(2, 12.0, 9.5, suspect=("the camera had moved by 12 mm",))
    warned = health(22.0, warnings=("camera moved 12 mm: laps are suspect",), view_moved_m=0.012)
    state = race(1, laps_wanted=3).after(moved).after(warned)
    text = "\n".join(render(state))
    for words in ("CAMERA MOVED", "suspect: the camera had moved", "! camera moved 12 mm"):
        assert words in text
    console = Console(width=80, height=24, force_terminal=True, color_system="standard", file=io.StringIO())
    console.print(picture(state))
    assert "\x1b[1;31mCAMERA MOVED" in console.file.getvalue()
    assert "\x1b[1;31m! camera moved 12 mm" in console.file.getvalue()
    assert lap_line(moved).endswith("SUSPECT: the camera had moved by 12 mm")
    assert "CAMERA MOVED" not in "\n".join(render(race(1).after(health(22.0))))


def test_printed_lines():
    """Phases, laps and new warnings are printed once each; the passing of time prints nothing."""
    waiting, dark = BoardState(laps_wanted=1), health(5.0, warnings=("dark",))
    begun = waiting.after(target(1.0)).after(crossing(2.0))
    assert printed_lines(None, waiting) == ["waiting for the car"]
    assert printed_lines(waiting, begun) == ["the car crosses the start line, lap 1 begins"]
    assert printed_lines(begun, begun.at(9.0)) == []
    assert printed_lines(begun, begun.after(dark)) == ["warning: dark"]
    assert printed_lines(begun.after(dark), begun.after(dark)) == []
    done = begun.after(lap(1))
    assert printed_lines(begun, done) == [lap_line(lap(1)), "finished"]


def test_a_note_is_shown_where_warnings_leave_room_and_printed_once():
    """What wants somebody's hand stands below the warnings, never in their place; a pipe gets it as a line of its own."""
    note = "something like a car stands at (3.00, 2.00) m"
    asking = BoardState().after(health(5.0, notes=(note,)))
    assert printed_lines(BoardState(), asking) == [f"note: {note}"]
    assert printed_lines(asking, asking.after(health(6.0, notes=(note,)))) == []
    assert f"? {note}" in "\n".join(render(asking))
    full = BoardState().after(health(5.0, warnings=("dark", "cold"), notes=(note,)))
    assert note not in "\n".join(render(full))


def test_a_pipe_gets_plain_lines():
    """Where stderr is no terminal there is no escape sequence and no picture, only the lines."""
    text = io.StringIO()
    with TerminalDisplay(BoardConsole(file=text)) as display:
        display.post(race(1).after(health(12.5, warnings=("dark [x]",))))
    assert text.getvalue().splitlines() == ["lap 1  10.000 s +- 2 ms  similarity 95.8 %", "lap 2", "warning: dark [x]"]


def test_a_terminal_gets_its_cursor_back():
    """The live picture hides the cursor and shows it again at the end."""
    text = io.StringIO()
    with TerminalDisplay(BoardConsole(file=text, force_terminal=True, width=80, height=24)) as display:
        display.post(race(1))
    assert "\x1b[?25l" in text.getvalue()
    assert text.getvalue().rindex("\x1b[?25h") > text.getvalue().rindex("\x1b[?25l")


@pytest.mark.parametrize("terminal", [True, False])
def test_a_broken_pipe_is_offline_not_the_end(terminal):
    """Where the reader of stderr has gone, posts go on and `fault` says why nothing is shown."""
    reader, writer = os.pipe()
    os.close(reader)
    stream = os.fdopen(writer, "w", encoding="utf-8")
    display = TerminalDisplay(BoardConsole(file=stream, force_terminal=terminal, width=80, height=24))
    display.post(race(1))
    wait_until(lambda: display.status is DisplayStatus.OFFLINE)
    display.post(race(2))
    assert "Broken pipe" in display.fault
    display.close()
    with pytest.raises(BrokenPipeError):
        stream.close()


def test_a_stopped_terminal_does_not_stop_the_race():
    """Nobody reads the pipe (Ctrl-S): posts return all the same, and so does `close`."""
    reader, writer = os.pipe()
    stream = os.fdopen(writer, "w", encoding="utf-8")
    display = TerminalDisplay(BoardConsole(file=stream, force_terminal=True, width=80, height=24))
    for number in range(200):
        display.post(race(1).after(crossing(20.0 + number)))
    os.close(reader)
    display.close()
    with pytest.raises(BrokenPipeError):
        stream.close()
