"""What a run is made of, as the conductor asks for it."""

from __future__ import annotations

from pathlib import Path

import pytest

from dnb_edge.capture.source import FrameSource
from dnb_edge.cli import run_means
from dnb_edge.cli.run_means import RunMeans
from dnb_edge.config.devices import CaptureConfig
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.errors import InputError


def means(config_file: Path) -> RunMeans:
    return RunMeans(
        config_file=config_file, setup=None, source=None, record=None, display=None, laps=None, entry=None, model=None,
        overrides=(), last_good=None, resume_within_s=0.0, as_json=True, observations=False, notifier=ServiceNotifier(),
    )  # fmt: skip


def test_settings_that_are_tried_lie_over_the_configurations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While the camera is aimed: what is asked wins, what is not stays as configured, what cannot be is one line."""
    config = tmp_path / "dnb-edge.yaml"
    config.write_text("capture: {exposure_us: 8000, gain: 3}\n")
    asked: list[CaptureConfig] = []

    def opened(uri: str, capture: CaptureConfig) -> FrameSource:
        asked.append(capture)
        raise InputError(uri)

    monkeypatch.setattr(run_means, "source_of", opened)
    for settings in (None, {"exposure_us": 4000.0}):
        with pytest.raises(InputError, match="sim:"):
            means(config).open_camera("sim:", settings)
    assert [(one.exposure_us, one.gain) for one in asked] == [(8000.0, 3.0), (4000.0, 3.0)]
    with pytest.raises(InputError, match=r"the camera's settings: .*fps"):
        means(config).open_camera("sim:", {"fps": -1})
