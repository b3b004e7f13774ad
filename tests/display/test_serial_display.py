"""The serial display over real pseudo-terminals: pulled cables, stuck displays, late displays."""

import os

import pytest
import serial
from display_events import crossing, health, lap, race
from pty_line import Firmware, PtyLine, wait_until

from dnb_edge.display import serial_port
from dnb_edge.display.base import DisplayStatus
from dnb_edge.display.protocol import BAUD
from dnb_edge.display.serial_port import WRITE_TIMEOUT_S, SerialDisplay, write_lines
from dnb_edge.display.uri import check_uri, open_display
from dnb_edge.errors import InputError


def is_online(display):
    return lambda: display.status is DisplayStatus.ONLINE


def is_offline(display):
    return lambda: display.status is DisplayStatus.OFFLINE


def test_lap_appears(line):
    """A posted lap is on the display, with its crossing, without any repaint in between."""
    firmware = Firmware()
    with SerialDisplay(str(line.path)) as display:
        display.post(race(1, laps_wanted=3))
        line.listen(firmware, lambda heard: 1 in heard.shown["laps"])
        display.post(race(2, laps_wanted=3))
        line.listen(firmware, lambda heard: 2 in heard.shown["laps"])
        assert firmware.crossings.count(22.0) == 1
        assert firmware.shown["state"].body() == "STATE LAP 3 OF 3"
        assert firmware.dropped == []
        assert display.fault is None


def test_laps_between_two_tellings_are_all_told(line):
    """The latest state wins, and the laps of the states that it replaced are told all the same."""
    firmware = Firmware()
    with SerialDisplay(str(line.path)) as display:
        for laps in range(7):
            display.post(race(laps))
        line.listen(firmware, lambda heard: set(heard.shown["laps"]) == set(range(1, 7)))


def test_reading_byte_by_byte(line):
    """A display that takes single bytes hears whole lines."""
    firmware = Firmware()
    with SerialDisplay(str(line.path)) as display:
        display.post(race(3).after(health(warnings=("dark",))))
        line.listen(firmware, lambda heard: heard.shown["warnings"] == ["dark"], size=1)
        assert firmware.dropped == []


def test_silence_is_broken_by_signs_of_life_and_repaints(line):
    """With no post at all, a display that is switched on later is painted in full."""
    firmware = Firmware()
    with SerialDisplay(str(line.path)) as display:
        display.post(race(2))
        line.listen(firmware, lambda heard: heard.repaints >= 1 and heard.shown["laps"])
        late = Firmware()
        line.listen(late, lambda heard: heard.repaints >= 1 and set(heard.shown["laps"]) == {1, 2})


def test_a_crossing_is_told_though_a_repaint_is_due(line, monkeypatch):
    """With a repaint due at every moment, crossings and laps are still told as news, and repaints come in between."""
    monkeypatch.setattr(serial_port, "REPAINT_S", 0.0)
    firmware = Firmware()
    with SerialDisplay(str(line.path)) as display:
        display.post(race(1))
        line.listen(firmware, lambda heard: 1 in heard.shown["laps"])
        for laps in (2, 3, 4):
            display.post(race(laps))
            line.listen(firmware, lambda heard, laps=laps: laps in heard.shown["laps"])
        line.listen(firmware, lambda heard, before=firmware.repaints: heard.repaints > before)
    # The first lap's crossing is told, too, where the display was painted before it was posted.
    assert firmware.crossings[-3:] == [race(laps).crossed_s for laps in (2, 3, 4)]


def test_a_port_that_is_not_there_is_offline_and_found_when_it_comes(tmp_path):
    """The race runs on without its display; the fault names the port; plugging it in later is enough."""
    line = PtyLine(tmp_path / "ttyTEST")
    with SerialDisplay(str(line.path)) as display:
        display.post(race(1))
        wait_until(lambda: display.fault is not None)
        assert display.status is DisplayStatus.OFFLINE
        assert display.fault == f"{line.path}: No such file or directory"
        line.plug()
        line.listen(Firmware(), lambda heard: 1 in heard.shown["laps"])
        wait_until(is_online(display))
        assert display.fault is None
    line.unplug()


def test_unplug_and_replug(line):
    """A pulled cable is offline within 3 s; the race goes on; the same path again is online and repainted in full."""
    with SerialDisplay(str(line.path)) as display:
        display.post(race(1))
        line.listen(Firmware(), lambda heard: 1 in heard.shown["laps"])
        line.unplug()
        wait_until(is_offline(display), patience_s=3.0)
        display.post(race(2))
        display.post(race(3))
        line.plug()
        again = Firmware()
        line.listen(again, lambda heard: set(heard.shown["laps"]) == {1, 2, 3})
        assert again.crossings == []
        wait_until(is_online(display))


def test_a_stuck_display_never_blocks_and_comes_back(line):
    """Nobody reads: posts go on, the display is offline and stays so; once read again it is repainted from a blank line."""
    with SerialDisplay(str(line.path)) as display:
        wait_until(is_online(display))
        state, posts = race(1), 0

        def post_until_stuck():
            nonlocal state, posts
            posts += 1
            state = state.after(crossing(20.0 + posts)).after(
                health(20.0 + posts, warnings=(f"{posts} " + "w" * 50,) * 4)
            )
            display.post(state)
            return display.status is DisplayStatus.OFFLINE

        wait_until(post_until_stuck)
        assert "takes no bytes" in display.fault
        display.post(state.after(lap(2, 12.0, 9.0)))
        firmware = Firmware()
        line.listen(firmware, lambda heard: 2 in heard.shown["laps"])
        assert b"\r\n\r\nHELLO" in line.raw, "no blank line to end a torn one before the repaint"
        wait_until(is_online(display))


def test_close_of_a_stuck_display_returns(line):
    """Closing does not wait for bytes that nobody takes, and the thread is gone."""
    display = SerialDisplay(str(line.path))
    posts = 0

    def post_until_stuck():
        nonlocal posts
        posts += 1
        display.post(race(1).after(crossing(20.0 + posts)))
        return display.fault is not None

    wait_until(post_until_stuck)
    display.close()
    assert not display._thread.is_alive()


def test_last_state_is_told_before_close(line):
    """A board posted right before `close` reaches the display."""
    display = SerialDisplay(str(line.path))
    wait_until(is_online(display))
    display.post(race(3, laps_wanted=3))
    display.close()
    firmware = Firmware()
    line.listen(firmware, lambda heard: heard.shown["state"] and heard.shown["state"].word == "FINISHED")
    assert set(firmware.shown["laps"]) == {1, 2, 3}


def test_two_appliances_do_not_share_a_port(line):
    """The second one is offline instead of writing into the first one's lines."""
    with SerialDisplay(str(line.path)) as first:
        wait_until(is_online(first))
        with SerialDisplay(str(line.path)) as second:
            wait_until(lambda: second.fault is not None)
            assert second.status is DisplayStatus.OFFLINE


@pytest.mark.parametrize("kind", ["file", "folder", "null"])
def test_a_path_that_is_no_serial_port_is_offline(tmp_path, kind):
    """A path that opens but is no terminal is a fault like any other, not the end of the thread."""
    path = {"file": tmp_path / "file", "folder": tmp_path, "null": "/dev/null"}[kind]
    if kind == "file":
        path.touch()
    with SerialDisplay(str(path)) as display:
        wait_until(lambda: display.fault is not None)
        assert display._thread.is_alive()


def test_open_display(line):
    """The URI of a config makes the display."""
    with open_display(f"serial:{line.path}") as display:
        assert isinstance(display, SerialDisplay)
        wait_until(is_online(display))


@pytest.mark.parametrize("uri", ["", "serial:", "serial:ttyUSB0", "oled:0", "terminal", "terminal:/dev/tty1", "/dev/x"])
def test_open_display_refuses(uri):
    """Anything but the known schemes is one clear line that names what was given and what to write."""
    for look in (open_display, check_uri):
        with pytest.raises(InputError, match="serial:/dev/ttyUSB0"):
            look(uri)


class FullPort:
    """A port whose buffer is full and drains at 115200 baud: a pseudo-terminal takes everything at once. Times are its own."""

    def __init__(self):
        self.taken = b""
        self._read_end, self._write_end = os.pipe()

    def fileno(self):
        """Something that can always be written to."""
        return self._write_end

    def write(self, data):
        """As pyserial's: all of it within the time-out, or none of it is known to have gone."""
        if len(data) * 10 / BAUD > WRITE_TIMEOUT_S:
            raise serial.SerialTimeoutException
        self.taken += data

    def close(self):
        """Both ends."""
        os.close(self._read_end)
        os.close(self._write_end)


def test_a_long_repaint_goes_out_though_it_takes_longer_than_a_port_may_be_stuck():
    """Eight cars and eight laps with all their reasons are 0.3 s of line: a port that takes bytes meanwhile is not stuck."""
    port = FullPort()
    lines = bytes(range(256)) * 15
    write_lines(port, lines, fresh=True)
    assert port.taken == b"\r\n" + lines
    port.close()
