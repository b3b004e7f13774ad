"""A camera that comes back: the same one wherever it is, and no other in its place."""

from dataclasses import replace
from pathlib import Path

import pytest
from played import Camera, info

from dnb_edge.capture.source import FrameSource
from dnb_edge.daemon.camera import SameCamera
from dnb_edge.errors import InputError, TemporaryFault
from dnb_edge.values import SourceInfo

FIRST = replace(info(live=True), uri="v4l2:/dev/video0", camera_id="usb-Maker_Cam_0001-video-index0")


class Bus:
    """Which camera each URI opens."""

    def __init__(self, cameras: dict[str, SourceInfo]) -> None:
        self.cameras = cameras
        self.opened: list[Camera] = []

    def open(self, uri: str) -> FrameSource:
        if uri not in self.cameras:
            raise InputError(f"{uri}: there is no such camera")
        camera = Camera()
        camera.info = self.cameras[uri]
        self.opened.append(camera)
        return camera


def nowhere(identity: str) -> Path | None:
    """No camera is plugged in but those of the bus."""
    return None


def test_the_same_camera_under_the_same_node() -> None:
    """Nothing changed but time."""
    bus = Bus({FIRST.uri: FIRST})
    assert SameCamera(FIRST, bus.open, find=nowhere)().info == FIRST


def test_a_renumbered_camera_is_found_by_its_name() -> None:
    """It was video0 and is video1 now: its identity leads to it, with nobody at video0 or another camera there."""
    uri = "v4l2:/dev/video1"
    find = {FIRST.camera_id: Path("/dev/video1")}.get
    found = replace(FIRST, uri=uri)
    assert SameCamera(FIRST, Bus({uri: found}).open, find=find)().info == found
    other = replace(FIRST, camera_id="usb-Other")
    bus = Bus({FIRST.uri: other, uri: found})
    assert SameCamera(FIRST, bus.open, find=find)().info == found
    assert [camera.closed for camera in bus.opened] == [True, False]


@pytest.mark.parametrize(
    ("there", "said"),
    [
        (None, "v4l2:/dev/video0: there is no such camera"),
        (
            replace(FIRST, camera_id="usb-Other"),
            "another camera, usb-Other, is plugged in: put usb-Maker_Cam_0001-video-index0 back, or end the run",
        ),
        (replace(FIRST, width_px=640, height_px=480), "the camera gives 640x480 now and gave 64x36 when the run began"),
    ],
    ids=["none", "another", "another size"],
)
def test_what_is_not_the_camera_gives_no_frame(there: SourceInfo | None, said: str) -> None:
    """One line says what to do, and whatever was opened is closed again."""
    bus = Bus({} if there is None else {FIRST.uri: there})
    with pytest.raises((InputError, TemporaryFault)) as raised:
        SameCamera(FIRST, bus.open, find=nowhere)()
    assert str(raised.value).startswith(said)
    assert all(camera.closed for camera in bus.opened)


def test_a_camera_without_a_name_is_taken_as_it_is() -> None:
    """Where no identity is known there is nothing to compare."""
    nameless = replace(FIRST, camera_id=None)
    assert SameCamera(nameless, Bus({FIRST.uri: FIRST}).open, find=nowhere)().info == FIRST
