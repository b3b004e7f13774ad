"""Who drives, as the recording's header tells it: the checkpoint's hash, session and digests."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from dnb_edge.assembly import assemble, check_checkpoint, make_entry, make_header
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.errors import InputError
from dnb_edge.record.identity import identity_of
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Clock, SourceInfo

INFO = SourceInfo(uri="x:", width_px=1280, height_px=720, nominal_fps=30.0, clock=Clock.MEDIA, live=False)


@pytest.fixture(scope="module")
def demo_config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo's own configuration with its files."""
    return write_demo_config(tmp_path_factory.mktemp("demo"), Rig(seed=1, laps=1))


def test_the_header_tells_entry_session_and_conditions(demo_config: Path) -> None:
    """Name, version, notes, the weights' SHA-256, the session, and the digests of what the core was set up with."""
    weights = demo_config.parent / "net.pt"
    weights.write_bytes(bytes(range(256)) * 5000)
    said = {
        "name": "net",
        "entry.version": "v2",
        "entry.checkpoint": weights,
        "entry.notes": "rain",
        "session": "monday",
    }
    config = load_config(demo_config, [f"{key}={value}" for key, value in said.items()])
    assembly = assemble(config, INFO)
    header = make_header(config, assembly, INFO)
    assert header.driver.checkpoint_sha256 == hashlib.sha256(weights.read_bytes()).hexdigest()
    assert (header.name, header.driver.name, header.driver.version, header.driver.notes) == ("net", "net", "v2", "rain")
    assert (header.session, header.identity) == ("monday", identity_of(assembly.setup).to_dict())


def test_without_a_checkpoint_there_is_no_hash(demo_config: Path) -> None:
    """A person has no weights."""
    assert make_entry(load_config(demo_config)).checkpoint_sha256 is None


@pytest.mark.parametrize("name", ["gone.pt", "."])
def test_a_checkpoint_that_is_no_file_is_one_line(demo_config: Path, name: str) -> None:
    """The key and the path, before anything else is opened; a folder is no checkpoint either."""
    path = demo_config.parent / name
    config = load_config(demo_config, [f"entry.checkpoint={path}"])
    for refused in (check_checkpoint, make_entry):
        with pytest.raises(InputError, match=r"entry\.checkpoint: there is no file .*give the network's weights"):
            refused(config)
