"""A panel on the box's own SPI: luma's devices, told by our display, against models of the chips."""

import errno
import os
from pathlib import Path

import pytest
from board_checks import as_letters, as_rows, noisy, turned_about
from chip_models import ChipWire, matrix_rows, max7219_digits
from display_events import race
from lit_pictures import pictures_of
from pty_line import wait_until

from dnb_edge.display import luma_device
from dnb_edge.display.base import DisplayStatus
from dnb_edge.display.luma_device import LumaPanel, SpiPanel, SpiWire, parse_spi
from dnb_edge.display.luma_display import LumaDisplay
from dnb_edge.display.panel.segments import Digits
from dnb_edge.display.uri import check_uri, open_display
from dnb_edge.errors import InputError

pytest.importorskip("luma.led_matrix", reason="luma is not installed: pip install 'dnb-edge[luma]'")
# luma 1.9 asks Pillow for what Pillow 14 will no longer have; the extra `luma` keeps Pillow below that.
pytestmark = pytest.mark.filterwarnings("ignore:Image.Image.getdata is deprecated")


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("upside_down", [False, True])
def test_matrix_of_every_make(turn, reverse, upside_down):
    """The same settings as on a microcontroller give the same picture, by luma's bytes."""
    wire, canvas = ChipWire(4), noisy(32, 8, turn, colours=2)
    panel = LumaPanel(SpiPanel(path="/dev/spidev0.0", turn=turn, reverse=reverse, upside_down=upside_down), wire)
    panel.show(canvas)
    seen = matrix_rows(wire.chain, turn, reverse)
    assert (turned_about(seen) if upside_down else seen) == as_rows(canvas)
    assert [chip["intensity"] for chip in wire.chain.chips] == [3] * 4


@pytest.mark.parametrize("reverse", [False, True])
def test_digits(reverse):
    """Every pattern of segments is seen at every place."""
    wire = ChipWire(1)
    panel = LumaPanel(SpiPanel(path="/dev/spidev0.0", panel="max7219-8-digits", reverse=reverse, brightness=15), wire)
    for start in range(0, 256, 8):
        digits = Digits(8, "digits-8")
        digits.buffer[:] = bytes(range(start, start + 8))
        panel.show(digits)
        assert max7219_digits(wire.chain, reverse) == [as_letters(byte) for byte in digits.buffer]
    assert wire.chain.chips[0]["intensity"] == 15


def test_chips_that_were_upset_are_mended():
    """Whatever state a spike put the chips into, the next picture is right."""
    wire, canvas = ChipWire(4), noisy(32, 8, 1, colours=2)
    panel = LumaPanel(SpiPanel(path="/dev/spidev0.0"), wire)
    for chip in wire.chain.chips:
        chip.update(decode=0xFF, scan=2, on=0, test=1, intensity=15)
    panel.show(canvas)
    assert matrix_rows(wire.chain) == as_rows(canvas)


def test_the_board_is_drawn():
    """What stands on the panel is what the firmware would draw of the same race."""
    wire = ChipWire(4)
    opener = lambda wanted: LumaPanel(wanted, wire)  # noqa: E731
    with LumaDisplay(SpiPanel(path="/dev/spidev0.0"), opener) as display:
        display.post(race(3, laps_wanted=3))
        wait_until(lambda: display.status is DisplayStatus.ONLINE)
        pictures = pictures_of(race(3, laps_wanted=3))
        wait_until(lambda: "\n".join(matrix_rows(wire.chain)) in pictures)
    assert wire.closed == 1
    assert display.status is DisplayStatus.OFFLINE


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (errno.ENOENT, "/dev/spidev0.0: No such file or directory: switch SPI on"),
        (errno.EACCES, "/dev/spidev0.0: Permission denied: the service may not use it: see docs/wiring.md"),
        (errno.EIO, "/dev/spidev0.0: Input/output error"),
    ],
)
def test_spi_that_is_away_comes_back(number, said):
    """A fault is told with what to do, and the panel is lit once the SPI is there."""
    wire = ChipWire(4)
    wire.away = OSError(number, os.strerror(number))
    with LumaDisplay(SpiPanel(path="/dev/spidev0.0"), lambda wanted: LumaPanel(wanted, wire)) as display:
        display.post(race(1))
        wait_until(lambda: display.fault is not None)
        assert display.fault.startswith(said)
        assert display.status is DisplayStatus.OFFLINE
        wire.away = None
        wait_until(lambda: display.status is DisplayStatus.ONLINE)
        assert display.fault is None
        wire.away = OSError(number, os.strerror(number))
        wait_until(lambda: display.status is DisplayStatus.OFFLINE)


def test_a_real_device_file(tmp_path):
    """What is no SPI is refused by the kernel and closed again; a missing one is the system's own error."""
    with pytest.raises(FileNotFoundError):
        SpiWire(str(tmp_path / "spidev0.0"))
    before = len(list(Path("/proc/self/fd").iterdir()))
    with pytest.raises(OSError, match="Inappropriate ioctl"):
        SpiWire("/dev/null")
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_the_requests_are_those_of_the_kernel():
    """_IOW('k', number, size) of linux/spi/spidev.h: direction 1, size, type 'k', number."""

    def request(number, size):
        return 1 << 30 | size << 16 | ord("k") << 8 | number

    assert request(1, 1) == luma_device._SET_MODE
    assert request(3, 1) == luma_device._SET_BITS
    assert request(4, 4) == luma_device._SET_CLOCK


def test_uri():
    """A URI's options are those of the firmware's settings."""
    assert parse_spi("/dev/spidev0.0") == SpiPanel(path="/dev/spidev0.0")
    assert parse_spi("/dev/spidev1.0?panel=max7219-8-digits&brightness=9&reverse=true") == SpiPanel(
        path="/dev/spidev1.0", panel="max7219-8-digits", brightness=9, reverse=True
    )
    assert parse_spi("/dev/spidev0.0?turn=270&upside_down=true").turn == 270


@pytest.mark.parametrize(
    ("uri", "said"),
    [
        ("spi:", "use spi:/dev/spidev0.0"),
        ("spi:spidev0.0", "use spi:/dev/spidev0.0"),
        ("spi:/dev/spidev0.0?colour=red", "there is no option colour; there are panel, brightness"),
        ("spi:/dev/spidev0.0?path=/dev/null", "there is no option path"),
        ("spi:/dev/spidev0.0?brightness=99", "brightness: 0 to 15"),
        ("spi:/dev/spidev0.0?brightness=", "brightness: 0 to 15"),
        ("spi:/dev/spidev0.0?turn=45", "turn: 0, 90, 180 or 270"),
        ("spi:/dev/spidev0.0?panel=hub75-64x32", "panel: one of max7219-32x8 max7219-8-digits"),
        ("spi:/dev/spidev0.0?reverse=1", "reverse: true or false"),
    ],
)
def test_wrong_uris(uri, said):
    """What a panel on SPI cannot be is said in one line, before anything is opened."""
    with pytest.raises(InputError, match=said):
        check_uri(uri)


def test_without_luma(monkeypatch):
    """Where luma is missing the user reads how to install it, before the race."""

    def missing(name):
        raise ImportError(f"No module named {name!r}")

    monkeypatch.setattr(luma_device, "import_module", missing)
    with pytest.raises(InputError, match=r"needs luma.led_matrix .*install.sh --extra luma"):
        open_display("spi:/dev/spidev0.0")
