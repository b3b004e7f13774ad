"""The contract that every display keeps, the recording one of the tests as well as the real ones."""

import io
import threading

import pytest
from chip_models import ChipWire
from display_events import race
from pty_line import Firmware, wait_until

from dnb_edge.display.base import Display, DisplayStatus
from dnb_edge.display.luma_device import LumaPanel, SpiPanel
from dnb_edge.display.luma_display import LumaDisplay
from dnb_edge.display.recording import RecordingDisplay
from dnb_edge.display.serial_port import SerialDisplay
from dnb_edge.display.terminal import BoardConsole, TerminalDisplay


class Recorded:
    """A display that keeps what it was told."""

    def open(self, line) -> Display:
        self.display = RecordingDisplay()
        return self.display

    def laps_shown(self):
        return {lap.number for state in self.display.states for lap in state.laps}


class Serial:
    """The serial display with a display's firmware at the other end."""

    def open(self, line) -> Display:
        self.line, self.firmware = line, Firmware()
        return SerialDisplay(str(line.path))

    def laps_shown(self):
        self.firmware.hear(self.line.read())
        return set(self.firmware.shown["laps"])


class Spi:
    """The panel on the box's own SPI, with a model of its chips at the wires."""

    def open(self, line) -> Display:
        pytest.importorskip("luma.led_matrix", reason="luma is not installed: pip install 'dnb-edge[luma]'")
        wire = ChipWire(4)
        self.display = LumaDisplay(SpiPanel(path="/dev/spidev0.0"), lambda wanted: LumaPanel(wanted, wire))
        return self.display

    def laps_shown(self):
        # Which laps the drawn picture was made of; that pixels are right is test_luma_display.py's business.
        return {lap.number for lap in self.display._panel.shown.laps}


class Terminal:
    """The terminal board."""

    terminal = True

    def open(self, line) -> Display:
        self.text = io.StringIO()
        return TerminalDisplay(BoardConsole(file=self.text, force_terminal=self.terminal, width=80, height=24))

    def laps_shown(self):
        return {number for number in range(1, 9) if f"lap {number}  10.000 s" in self.text.getvalue()}


class Pipe(Terminal):
    """The terminal board where there is no terminal."""

    terminal = False


# luma 1.9 asks Pillow for what Pillow 14 will no longer have; the extra `luma` keeps Pillow below that.
pytestmark = pytest.mark.filterwarnings("ignore:Image.Image.getdata is deprecated")


@pytest.fixture(params=[Recorded, Serial, Spi, Terminal, Pipe])
def peer(request):
    return request.param()


def test_every_lap_is_shown(peer, line):
    """Every lap of every posted state is shown, also where states follow one another faster than the display paints."""
    with peer.open(line) as display:
        for laps in range(6):
            display.post(race(laps))
        wait_until(lambda: peer.laps_shown() == {1, 2, 3, 4, 5})


def test_status_says_online_then_offline(peer, line):
    """A display that works is online without fault, and offline once closed."""
    display = peer.open(line)
    display.post(race(1))
    wait_until(lambda: display.status is DisplayStatus.ONLINE)
    assert display.fault is None
    display.close()
    assert display.status is DisplayStatus.OFFLINE


def test_the_last_state_is_shown_by_close(peer, line):
    """What was posted right before `close` is shown."""
    with peer.open(line) as display:
        wait_until(lambda: display.status is DisplayStatus.ONLINE)
        display.post(race(3, laps_wanted=3))
    wait_until(lambda: peer.laps_shown() == {1, 2, 3})


def test_after_close_nothing_happens(peer, line):
    """Closing twice and posting to a closed display do nothing, and no thread is left."""
    threads = set(threading.enumerate())
    display = peer.open(line)
    display.close()
    display.close()
    display.post(race(1))
    assert set(threading.enumerate()) <= threads
    assert peer.laps_shown() == set()


def test_posts_from_several_threads(peer, line):
    """States may come from any thread."""
    with peer.open(line) as display:
        posters = [threading.Thread(target=display.post, args=(race(2),)) for _ in range(8)]
        for poster in posters:
            poster.start()
        for poster in posters:
            poster.join()
        wait_until(lambda: peer.laps_shown() == {1, 2})
