"""The libcamera source with Debian's own libcamera and its bindings, over a USB webcam: the contract, a race under the unit,
unplugging, and a machine that has slept.

libcamera's pipeline for USB cameras is the one that can be had without a board's own camera. The `virtual` one of libcamera
0.4.0, Debian 13's, leaves what it says about its frames uninitialised: number, status and size.
"""

import json

import pytest
from harness import reel
from harness.appliance import DISPLAY_URI, PATIENCE_S, RUNS, account, laps, note, the_run, timed
from harness.image import SOURCE, TEST_SITE
from test_unplug import until_frames

from dnb_edge.display import protocol

PYTHON = "/opt/dnb-edge/venv/bin/python"
NAMED_BY_FIRMWARE = """
set -e
mkdir /run/sys
mount -t tmpfs tmpfs /run/sys
for folder in /sys/*; do mkdir /run/sys/${folder##*/}; mount --rbind $folder /run/sys/${folder##*/}; done
mkdir /run/sys/firmware_node
echo '\\_SB_.VHCI' > /run/sys/firmware_node/path
mount --rbind /run/sys /sys
"""
"""libcamera calls a USB camera by what the firmware calls its host controller, and takes none without. Real controllers have a
name; the kernel's controller for USB over a network has none, so that it gets one here, in /sys."""
LIBCAMERA_IN_THE_UNIT = "DeviceAllow=char-media rw\nPrivateNetwork=no\nRestrictAddressFamilies=AF_NETLINK\n"
"""As systemd/README.md says."""
HEARS_NOTHING = "DeviceAllow=char-media rw\nPrivateNetwork=no\n"
"""Without netlink. (A network namespace has the same effect, but would bring its own /sys, without the name above.)"""
CYCLES = 8
BACK_S = 5.0
LAPS = 4
LEAST_TIMED = 2
LAP_LIMIT_S = 0.1

LOOK = """
import json, sys, time
from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.source import open_source

settings = CaptureSettings(width_px=640, height_px=360, pixel_format=sys.argv[1], exposure_us=4000, gain=2.0)
source = open_source("libcamera:0", settings)
told = []
for frame in source.frames():
    told.append((frame.sequence, (time.monotonic_ns() - frame.t_ns) * 1e-9, frame.stamp_source.value))
    if len(told) == 20:
        break
slept_s = time.clock_gettime(time.CLOCK_BOOTTIME) - time.monotonic()
kind = "jpeg" if frame.bgr is None else "bgr"
print(json.dumps({"frames": told, "slept_s": slept_s, "kind": kind, "lost": [lost.reason for lost in source.lost],
                  "camera": source.info.camera_id, "format": source.info.pixel_format,
                  "controls": [control.name for control in source.info.controls]}))
source.close()
"""


@pytest.fixture
def with_libcamera(guest, webcam):
    """The guest with a webcam that libcamera knows."""
    guest.run(NAMED_BY_FIRMWARE)
    webcam.plug(guest)
    # libcamera looks once, and wants the media device's node as well.
    guest.run("udevadm settle")
    return guest


def looked(guest, pixel_format: str, *, before: str = "") -> dict:
    said = guest.run(f"{before}{PYTHON} - {pixel_format} 2>/dev/null", stdin=LOOK.encode(), timeout_s=120.0)
    return json.loads(said.splitlines()[-1])


@pytest.mark.parametrize("size", ["640x360", "1280x720"])
def test_it_passes_the_contract_of_sources(with_libcamera, size):
    """The rows that all sources pass, with a real camera behind real bindings."""
    environment = f"PYTHONPATH={TEST_SITE} DNB_EDGE_TEST_LIBCAMERA=0 DNB_EDGE_TEST_CAMERA_SIZE={size}"
    words = "-q -p no:cacheprovider -k real_libcamera tests/capture/test_source_contract.py"
    said = with_libcamera.run(f"cd {SOURCE} && {environment} {PYTHON} -m pytest {words}", timeout_s=240.0)
    assert " passed" in said
    assert "skipped" not in said


@pytest.mark.parametrize(("asked", "four_cc", "kind"), [("MJPG", "MJPG", "jpeg"), ("YUYV", "YUYV", "bgr")])
def test_formats_stamps_and_controls_are_real(with_libcamera, webcam, logs, asked, four_cc, kind):
    """Both formats; stamps of the first row, not of arrival, young, on CLOCK_MONOTONIC; the exposure has reached the driver."""
    told = looked(with_libcamera, asked)
    note(logs, **told)
    assert (told["format"], told["kind"]) == (four_cc, kind)
    assert told["camera"].startswith("\\_SB_.VHCI")
    assert all(0.0 < age_s < 5.0 and source == "start_of_frame" for _, age_s, source in told["frames"])
    set_to = with_libcamera.run(f"v4l2-ctl -d {webcam.node} -C auto_exposure,exposure_time_absolute")
    assert "auto_exposure: 1" in set_to
    assert "exposure_time_absolute: 40\n" in set_to
    assert told["controls"] == ["AeEnable", "AnalogueGain", "ExposureTime"]


def test_stamps_are_right_on_a_machine_that_has_slept(with_libcamera, logs):
    """libcamera says CLOCK_BOOTTIME and hands on the driver's stamps of CLOCK_MONOTONIC: an hour of sleep shifts none."""
    told = looked(with_libcamera, "MJPG", before="unshare --time --boottime 3600 ")
    note(logs, **told)
    assert told["slept_s"] == pytest.approx(3600.0, abs=5.0)
    assert all(0.0 < age_s < 5.0 for _, age_s, _ in told["frames"])


def start(appliance, logs, *, unit_lines=LIBCAMERA_IN_THE_UNIT, **config):
    """The unit, racing through libcamera."""
    appliance.install(
        reel.configuration(logs / "config", source="libcamera:0", display={"uri": DISPLAY_URI}, **config),
        unit_lines=unit_lines,
    )
    appliance.start()


def test_a_race_through_libcamera_is_counted_and_timed(with_libcamera, appliance, logs):
    """In the unit's sandbox: all laps, near the truth, every missing frame explained."""
    start(appliance, logs, race={"laps": LAPS, "max_gap_s": 4.0})
    appliance.display.wait(protocol.State, lambda state: state.word == "FINISHED", since_s=0.0, timeout_s=PATIENCE_S)
    with_libcamera.wait_for(f"! ls {RUNS} | grep -q part", timeout_s=PATIENCE_S)
    # The box stays up for the next race.
    assert appliance.shown("ActiveState", "NRestarts") == {"ActiveState": "active", "NRestarts": "0"}
    appliance.stop()
    run = the_run(appliance.recordings(logs / "runs"))
    frames = account(run)
    errors_s = [lap.time_s - reel.lap_s() for lap in timed(run)]
    note(logs, lap_error_ms=[round(1e3 * error) for error in errors_s], raced=frames.raced, lost=frames.lost)
    assert [lap.number for lap in laps(run)] == list(range(1, LAPS + 1))
    assert len(errors_s) >= LEAST_TIMED
    assert max(map(abs, errors_s)) < LAP_LIMIT_S
    assert frames.unexplained == 0


def test_it_takes_the_camera_again_each_time(with_libcamera, appliance, webcam, logs):
    """In the same sandbox: frames again within 5 s each time, and nothing that the bindings hold is left behind."""
    start(appliance, logs)
    appliance.display.wait(protocol.State, lambda state: state.word == "LAP", since_s=0.0, timeout_s=PATIENCE_S)
    pid, guest = appliance.main_pid(), with_libcamera

    def held() -> list[int]:
        said = guest.run(
            f"ls /proc/{pid}/fd | wc -l; ls /proc/{pid}/task | wc -l; grep -c dmabuf /proc/{pid}/maps || true"
        )
        return [int(word) for word in said.split()]

    before, waits_s = held(), []
    for _ in range(CYCLES):
        webcam.unplug()
        guest.run("sleep 1")
        webcam.plug(guest)
        waits_s.append(until_frames(webcam, timeout_s=PATIENCE_S))
    after = held()
    note(logs, cycles=CYCLES, frames_s=[round(wait, 2) for wait in waits_s], descriptors_threads_maps=[before, after])
    assert appliance.main_pid() == pid
    assert all(now <= then + 1 for then, now in zip(before, after, strict=True))
    assert max(waits_s) <= BACK_S


def test_where_libcamera_hears_of_no_plugs_the_service_starts_anew(with_libcamera, appliance, webcam, logs):
    """libcamera would end the process where it is told to stop the lost camera; we say what is wrong, end in order, and the
    unit's next process has the camera."""
    start(appliance, logs, unit_lines=HEARS_NOTHING)
    appliance.display.wait(protocol.State, lambda state: state.word == "LAP", since_s=0.0, timeout_s=PATIENCE_S)
    webcam.unplug()
    with_libcamera.wait_for("[ $(systemctl show dnb-edge -P NRestarts) -gt 0 ]", timeout_s=PATIENCE_S)
    webcam.plug(with_libcamera)
    until_frames(webcam, timeout_s=PATIENCE_S)
    journal = appliance.journal()
    note(logs, restarts=appliance.shown("NRestarts"))
    assert "libcamera has not heard that a camera was unplugged" in journal
    assert "assertion" not in journal
    assert "status=6/ABRT" not in journal
