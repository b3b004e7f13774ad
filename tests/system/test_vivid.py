"""Faults that the kernel's own played camera can make: dropped buffers, a stream that fails, a device that goes away."""

import time

import pytest
from harness import reel
from harness.appliance import DISPLAY_URI, PATIENCE_S, account, note, the_run
from test_contract import VIVID

from dnb_edge.display import protocol

DRIVER = "/sys/bus/platform/drivers/vivid"

# A node keeps its number for as long as a program holds it open: bound too soon, the camera would be /dev/video1.
UNTIL_LET_GO = "while ls -l /proc/[0-9]*/fd 2>/dev/null | grep -q /dev/video0; do sleep 0.05; done"


def names_the_camera(warn: protocol.Warn) -> bool:
    """Whether it is about the device: what is lost for want of time, or repeats itself, is told in other words."""
    return "/dev/video0" in warn.text or "the camera fails" in warn.text


@pytest.fixture
def watching(guest, appliance, logs):
    """The appliance with a camera over nothing in particular: no car comes, frames do."""
    # A picture that stands still would be called frozen.
    guest.run(f"{VIVID} && v4l2-ctl -d /dev/video0 -c horizontal_movement=6")
    config = reel.configuration(logs / "config", source="v4l2:/dev/video0", display={"uri": DISPLAY_URI})
    appliance.install(config)
    appliance.start()
    appliance.display.wait(protocol.Health, lambda health: (health.fps or 0) > 0, since_s=0.0, timeout_s=PATIENCE_S)
    return appliance


def frames_come(appliance, since_s: float, *, timeout_s: float) -> float:
    """When the display next tells of a rate after `since_s`."""
    at_s, _ = appliance.display.wait(
        protocol.Health, lambda health: (health.fps or 0) > 0, since_s=since_s, timeout_s=timeout_s
    )
    return at_s


def test_dropped_buffers_are_counted(watching, guest, logs):
    """Where the driver drops 30 % of the frames, each of them is in the account, under its reason."""
    guest.run("v4l2-ctl -d /dev/video0 -c percentage_of_dropped_buffers=30")
    time.sleep(10.0)
    watching.stop()
    frames = account(the_run(watching.recordings(logs / "runs")))
    note(logs, raced=frames.raced, missing=frames.missing, lost=frames.lost)
    assert frames.unexplained == 0
    assert frames.lost["gap"] > 0


def test_a_stream_that_fails_is_opened_again(watching, guest, logs):
    """A fatal error of the stream is said and costs seconds, not the service."""
    begun_s = time.monotonic()
    guest.run("v4l2-ctl -d /dev/video0 -c inject_fatal_streaming_error=1")
    said_s, warning = watching.display.wait(protocol.Warn, names_the_camera, since_s=begun_s, timeout_s=PATIENCE_S)
    back_s = frames_come(watching, said_s, timeout_s=PATIENCE_S)
    note(logs, said_s=round(said_s - begun_s, 1), words=warning.text, back_s=round(back_s - said_s, 1))
    assert watching.shown("ActiveState", "NRestarts") == {"ActiveState": "active", "NRestarts": "0"}


def test_a_device_that_disconnects_comes_back(watching, guest, logs):
    """As a cable that is pulled while the driver stays: said, and raced again once the node is back."""
    begun_s = time.monotonic()
    guest.run(f"echo vivid.0 > {DRIVER}/unbind")
    said_s, warning = watching.display.wait(protocol.Warn, names_the_camera, since_s=begun_s, timeout_s=PATIENCE_S)
    guest.run(UNTIL_LET_GO)
    guest.run(f"echo vivid.0 > {DRIVER}/bind && udevadm settle && v4l2-ctl -d /dev/video0 -c timestamp_source=1")
    bound_s = time.monotonic()
    back_s = frames_come(watching, bound_s, timeout_s=PATIENCE_S)
    note(logs, said_s=round(said_s - begun_s, 1), words=warning.text, back_s=round(back_s - bound_s, 1))
    assert watching.shown("ActiveState", "NRestarts") == {"ActiveState": "active", "NRestarts": "0"}
