"""What is said at the start of a race of a camera that does not do quite as it was asked."""

import logging
from dataclasses import replace
from pathlib import Path

import pytest
from played import Clip, Watcher, frame

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.daemon import appliance, rooms
from dnb_edge.daemon.appliance import RunOptions, run_appliance
from dnb_edge.sim.rig import Rig
from dnb_edge.values import CameraControl, Event, Frame, FrameDetections, Health


class Healths:
    """A listener."""

    warnings: tuple[str, ...] = ()

    def __init__(self) -> None:
        self.told: list[tuple[str, ...]] = []

    def frame(self, frame: Frame, found: FrameDetections) -> None:
        """Not of interest here."""

    def event(self, event: Event) -> None:
        """Keeps the warnings of each Health."""
        if isinstance(event, Health):
            self.told.append(event.warnings)


def test_what_the_camera_took_otherwise_is_a_warning_all_the_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Controls and rate that are not as asked stand in every Health, and in the log once; one that is as asked does not."""
    controls = (
        CameraControl(name="gain", asked=3, taken=3),
        CameraControl(name="exposure_time_absolute", asked=41, taken=40),
        CameraControl(name="frame rate", asked=30.0, taken=15.0),
    )
    clip = Clip([frame(number) for number in range(250)])
    clip.info = replace(clip.info, controls=controls)
    monkeypatch.setattr(appliance, "make_source", lambda uri, config: clip)
    monkeypatch.setattr(rooms, "make_detector", lambda *_: Watcher())
    listener = Healths()
    with caplog.at_level(logging.WARNING):
        run_appliance(
            load_config(write_demo_config(tmp_path, Rig(laps=1))),
            RunOptions(source_uri="played:"),
            listeners=[listener],
        )
    expected = {
        "camera: exposure_time_absolute is 40, not 41 as asked",
        "camera: frame rate is 15, not 30 as asked",
    }
    assert len(listener.told) >= 3
    assert all(expected <= set(warnings) for warnings in listener.told)
    said = [record.getMessage() for record in caplog.records if record.getMessage().startswith("camera: ")]
    assert sorted(said) == sorted(expected)
