"""From a checked configuration to the rooms of a run: two ways to say the same thing build the same."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from dnb_edge.assembly import assemble, make_track
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.cli.main import app
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.errors import InputError
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Clock, SourceInfo


@pytest.fixture(scope="module")
def demo_config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo's own configuration with its files."""
    return write_demo_config(tmp_path_factory.mktemp("demo"), Rig(seed=1, laps=1))


def info(width_px: int, height_px: int) -> SourceInfo:
    return SourceInfo(uri="x:", width_px=width_px, height_px=height_px, nominal_fps=30.0, clock=Clock.MEDIA, live=False)


def changed(path: Path, **track: object) -> Config:
    """The demo's configuration with another `track` section."""
    config = load_config(path)
    return Config.model_validate(config.model_dump() | {"track": track}, context={"base": path.parent})


def test_a_track_file_is_as_good_as_the_picture_it_was_made_of(demo_config: Path) -> None:
    """What `track build --out` wrote gives a run the same track as building it from the twin."""
    track = load_config(demo_config).track
    assert track.start_line_px is not None
    assert track.lane_hsv is not None
    assert track.measured is not None
    numbers = lambda *values: ",".join(repr(value) for value in values)  # noqa: E731
    out = demo_config.parent / "track.json"
    arguments = ["track", "build", "--image", str(track.image), "--lane-hsv", numbers(*track.lane_hsv)]
    arguments += ["--measured", numbers(*track.measured.from_px, *track.measured.to_px)]
    arguments += ["--length-m", repr(track.measured.length_m), "--name", track.name, "--out", str(out)]
    arguments += ["--start-line", numbers(*track.start_line_px[0], *track.start_line_px[1])]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert make_track(changed(demo_config, file=str(out)).track) == make_track(track)


def test_frames_of_another_size_are_converted_and_of_another_shape_refused(demo_config: Path) -> None:
    """The view made for 1280x720 serves 640x360 by scaling, and says why it cannot serve 640x480."""
    config = load_config(demo_config)
    full, half = (assemble(config, info(*size)).setup.ground for size in ((1280, 720), (640, 360)))
    assert half.point_to_track_m((320.0, 180.0)) == pytest.approx(full.point_to_track_m((640.0, 360.0)))
    with pytest.raises(InputError, match="640x480"):
        assemble(config, info(640, 480))


def test_the_gate_closes_above_the_limit_and_says_by_how_much(demo_config: Path) -> None:
    """A calibration worse than the limit is a reason not to score; a better one is none."""
    assert assemble(load_config(demo_config), info(1280, 720)).setup.not_scored_because is None
    strict = load_config(demo_config, ["view.max_mean_error_m=null", "view.max_mean_error_px=1e-12"])
    reason = assemble(strict, info(1280, 720)).setup.not_scored_because
    assert reason is not None
    assert "above the limit" in reason
