"""A USB stick is plugged in during a race: finished runs come onto it, checked, and the display says when it is done.

The real thing: udev rule, unit, kernel, a stick that QEMU emulates; what lies on it afterwards is read from its image here.
"""

import socket
import subprocess
import time

import numpy as np
import pytest
from harness import reel, stick
from harness.appliance import DISPLAY_URI, PATIENCE_S, RUNS, laps, note
from harness.recipe import REPOSITORY
from harness.stick import Stick

from dnb_edge.display import protocol
from dnb_edge.record.channels import TrackScene
from dnb_edge.record.header import RunHeader, software_versions
from dnb_edge.record.reader import read_run
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.values import Clock, Lap, SourceInfo

INSTALL = {
    "dnb-edge-take-home@.service": "/etc/systemd/system",
    "99-dnb-edge-take-home.rules": "/etc/udev/rules.d",
}
"""As systemd/README.md says."""
UNIT = "'dnb-edge-take-home@*'"
UNMOUNTED = "! grep vfat /proc/mounts"


@pytest.fixture
def finished(tmp_path):
    """A finished recording with a lap, made here."""
    source = SourceInfo(uri="sim:", width_px=64, height_px=36, nominal_fps=30.0, clock=Clock.SIMULATED, live=False)
    header = RunHeader(name="one", setup={}, config={}, source=source, versions=software_versions())
    scene = TrackScene(route_m=np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), lines_m={})
    writer = Recorder(RecordingSettings(directory=tmp_path, image_fps=None), header, scene)
    lap = Lap(number=1, start_t_ns=0, end_t_ns=10**9, start_s=0.0, time_s=1.0, sigma_s=0.002, valid=True, reasons=(),
              similarity_percent=95.0, observed_fraction=1.0)  # fmt: skip
    writer.add_event(lap)
    return writer.close()


@pytest.fixture
def racing(guest, appliance, webcam, logs, finished):
    """The appliance in a race that is being recorded; beside that there is a finished recording. It takes recordings home."""
    if (reason := stick.obstacle()) is not None:
        pytest.skip(f"a stick {reason}")
    for name, place in INSTALL.items():
        guest.put((REPOSITORY / "systemd" / name).read_text(), f"{place}/{name}")
    guest.run("udevadm control --reload")
    guest.put(finished.read_bytes(), f"{RUNS}/{finished.name}")
    guest.run(f"chown dnb-edge:dnb-edge /var/lib/dnb-edge {RUNS} {RUNS}/*")
    webcam.plug(guest)
    config = reel.configuration(logs / "config", source=f"v4l2:{webcam.node}", display={"uri": DISPLAY_URI})
    # What a busy host does to an emulated race is not what is tested here.
    appliance.install(config, unit_lines="WatchdogSec=0\nTimeoutStartSec=infinity\n")
    appliance.start()
    return appliance


def test_a_stick_takes_finished_runs_home(racing, guest, logs, finished):
    """The finished run is on the stick, the one being recorded is not, and not a byte of a stranger's stick changes."""
    strange = Stick(logs / "strange.img")
    before = strange.digest
    strange.plug(guest)
    guest.wait_for(f"journalctl -b -u {UNIT} | grep -q 'Skipped due to .exec-condition'", timeout_s=PATIENCE_S)
    # Until then the next one would be taken for the same.
    guest.wait_for(f"! systemctl list-units --no-legend {UNIT} | grep -q activ", timeout_s=PATIENCE_S)
    guest.run(UNMOUNTED)
    strange.pull(guest)

    mine = Stick(logs / "mine.img")
    mine.make_folder("dnb-edge")
    plugged_s = time.monotonic()
    mine.plug(guest)
    said_s, said = racing.display.wait(
        protocol.Note, lambda told: "copied and checked" in told.text, since_s=plugged_s, timeout_s=PATIENCE_S
    )
    guest.wait_for(UNMOUNTED, timeout_s=PATIENCE_S)
    assert racing.shown("ActiveState", "NRestarts") == {"ActiveState": "active", "NRestarts": "0"}
    assert guest.run(f"systemctl list-units --failed --no-legend {UNIT}") == ""
    mine.pull(guest)
    guest.wait_for("! ls /dev/sd*", timeout_s=PATIENCE_S)
    (host,) = mine.read("dnb-edge", logs / "stick").iterdir()
    on_box = {path.name: path for path in racing.recordings(logs / "runs")}
    assert on_box[finished.name].read_bytes() == finished.read_bytes()
    (recorded,) = (path for name, path in on_box.items() if name.endswith(".part"))
    note(logs, said=said.text, said_s=round(said_s - plugged_s, 1), size_mb=round(finished.stat().st_size / 1e6, 1))
    assert host.name == guest.run("hostname").strip() != socket.gethostname()
    assert {path.name for path in host.iterdir()} == {finished.name, "manifest.jsonl", "SHA256SUMS"}
    assert (host / finished.name).read_bytes() == finished.read_bytes()
    subprocess.run(["sha256sum", "--strict", "--quiet", "-c", "SHA256SUMS"], cwd=host, check=True)
    assert laps(read_run(host / finished.name))
    assert recorded.stat().st_size > 0
    assert said.text == "stick: 1 run copied and checked, take it out"
    assert strange.digest == before


def test_a_stick_that_is_pulled_too_early_is_told_and_goes_on_later(racing, guest, logs):
    """Pulled while it is written to: the display says so; plugged in again, the run comes onto it whole."""
    guest.run(f"f=$(ls {RUNS}/*.mcap) && dd if=/dev/urandom bs=1M count=24 status=none >> $f")
    mine = Stick(logs / "mine.img")
    mine.make_folder("dnb-edge")
    mine.plug(guest)
    at_s = time.monotonic()
    racing.display.wait(protocol.Note, lambda told: "copying" in told.text, since_s=at_s, timeout_s=PATIENCE_S)
    pulled_s = time.monotonic()
    mine.pull(guest)
    said_s, said = racing.display.wait(
        protocol.Note, lambda told: "copying" not in told.text, since_s=pulled_s, timeout_s=PATIENCE_S
    )
    guest.wait_for(f"! systemctl list-units --no-legend {UNIT} | grep -q activ", timeout_s=PATIENCE_S)
    guest.wait_for(UNMOUNTED, timeout_s=PATIENCE_S)
    mine.plug(guest)
    racing.display.wait(
        protocol.Note, lambda told: "copied and checked" in told.text, since_s=said_s, timeout_s=PATIENCE_S
    )
    guest.wait_for(UNMOUNTED, timeout_s=PATIENCE_S)
    note(logs, said=said.text, said_s=round(said_s - pulled_s, 1))
    (host,) = mine.read("dnb-edge", logs / "stick").iterdir()
    (finished,) = (path for path in racing.recordings(logs / "runs") if path.suffix == ".mcap")
    assert {path.name for path in host.iterdir()} == {finished.name, "manifest.jsonl", "SHA256SUMS"}
    assert (host / finished.name).read_bytes() == finished.read_bytes()
    assert "pulled out or bad" in said.text
