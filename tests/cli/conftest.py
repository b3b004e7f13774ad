"""A demo track's configuration, and commands that many tests look at and that run once for all of them."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import pytest
from edge_command import CLIP_FRAMES, LAPS, EdgeOnce, Race

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.sim.rig import Rig


@pytest.fixture(scope="session")
def rig() -> Rig:
    """The drive that `demo` and `sim:?laps=3` simulate, with its truth."""
    return Rig(seed=1, laps=LAPS)


@pytest.fixture(scope="session")
def pristine(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the demo's configuration and its files; for reading only."""
    return write_demo_config(tmp_path_factory.mktemp("pristine"), rig).parent


@pytest.fixture
def config(pristine: Path, tmp_path: Path) -> Path:
    """The demo's configuration with its files beside it, for the test's own use."""
    return shutil.copytree(pristine, tmp_path / "track") / "demo.yaml"


@pytest.fixture(scope="session")
def clip(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first `CLIP_FRAMES` of the drive as a video file; the car crosses the start line in them."""
    path = tmp_path_factory.mktemp("clip") / "clip.mp4"
    size = (rig.camera.width_px, rig.camera.height_px)
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), rig.fps, size)
    for i in range(CLIP_FRAMES):
        writer.write(rig.frame(i).bgr)
    writer.release()
    return path


@pytest.fixture(scope="session")
def edge_once(tmp_path_factory: pytest.TempPathFactory) -> EdgeOnce:
    """Runs a command once for all tests, those of the other workers of pytest-xdist included."""
    own = tmp_path_factory.getbasetemp()
    return EdgeOnce(own.parent if "PYTEST_XDIST_WORKER" in os.environ else own)


@pytest.fixture(scope="session")
def race(edge_once: EdgeOnce) -> Race:
    """One race by `demo`, recorded and reported."""
    directory = edge_once.directory / "race"
    ran = edge_once("demo", "demo", "--fast", "--json", "--laps", LAPS, "--out", directory)
    assert ran.code == 0, ran.err
    (recording,) = directory.glob("*.mcap")
    return Race(ran=ran, directory=directory, recording=recording)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """Mounts a real file system of the size asked for."""
    if os.geteuid() != 0:
        pytest.skip("mounting a small disk needs root")
    place = tmp_path / "disk"
    place.mkdir()

    def mount(size: str) -> Path:
        words = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", place]
        mounted = subprocess.run(words, check=False, capture_output=True, text=True)
        if mounted.returncode != 0:
            pytest.skip(f"cannot mount a small disk here: {mounted.stderr.strip()}")
        return place

    yield mount
    subprocess.run(["umount", "-l", place], check=False, capture_output=True)
