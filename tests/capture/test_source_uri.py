"""From a URI to a source, and what is said about URIs that name none."""

from pathlib import Path

import pytest

from dnb_edge.capture.simulated import SimulatorOptions, parse_simulator_uri
from dnb_edge.capture.source import open_source
from dnb_edge.errors import InputError


@pytest.mark.parametrize("uri", ["", "clip.mp4", "rtsp://camera", "v4l2:", "libcamera:", "file:", "mcap:", "video0"])
def test_unknown_sources_list_the_known_ones(uri):
    """A URI that names no source is answered with one example of each kind."""
    with pytest.raises(InputError) as caught:
        open_source(uri)
    for known in ("v4l2:/dev/video0", "libcamera:0", "file:", "mcap:", "sim:"):
        assert known in str(caught.value)


def test_recordings_need_their_reader():
    """`mcap:` is opened by the callable of the caller, which gets the path, and is refused without one."""
    with pytest.raises(InputError, match=r"run\.mcap"):
        open_source("mcap:run.mcap")
    seen = []
    open_source("mcap:folder/run.mcap", open_recording=lambda uri, path: seen.append((uri, path)))
    assert seen == [("mcap:folder/run.mcap", Path("folder/run.mcap"))]


@pytest.mark.parametrize(
    ("uri", "options"),
    [
        ("sim:", SimulatorOptions()),
        ("sim:?laps=5", SimulatorOptions(laps=5)),
        ("sim:?laps=2&seed=9&fps=59.94&pace=1", SimulatorOptions(laps=2, seed=9, fps=59.94, pace=1.0)),
    ],
)
def test_simulator_options(uri, options):
    """Every option may be left out."""
    assert parse_simulator_uri(uri) == options


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("sim:track", "'track'"),
        ("sim:?speed=3", "'speed'"),
        ("sim:?laps=three", "'three'"),
        ("sim:?laps=0", "laps"),
        ("sim:?laps", "laps=3"),
        ("sim:?seed=-1", "seed"),
        ("sim:?fps=0", "fps"),
        ("sim:?fps=nan", "fps"),
        ("sim:?pace=-1", "pace"),
    ],
)
def test_wrong_simulator_options_are_named(uri, words):
    """What is wrong in a `sim:` URI is named in one line."""
    with pytest.raises(InputError, match=words):
        parse_simulator_uri(uri)
