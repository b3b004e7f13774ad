"""`run --entry`: who drives, from the command line into the recording."""

import hashlib
from pathlib import Path

import pytest
from edge_command import edge

from dnb_edge.record.reader import read_run


def test_the_entry_of_the_command_line_is_in_the_recording(config: Path, clip: Path, tmp_path: Path) -> None:
    """A name that looks like a number stays text, wins over the file's, and leaves the rest of the entry as it is."""
    (config.parent / "net.pt").write_bytes(b"weights")
    with config.open("a") as stream:
        stream.write("entry: {version: v2, checkpoint: net.pt}\nsession: monday\n")
    ran = edge("run", "--config", config, "--source", f"file:{clip}", "--record", tmp_path, "--entry", "12", "--json")
    assert ran.code == 0, ran.err
    (recording,) = tmp_path.glob("*.mcap")
    header = read_run(recording).header
    assert (header.name, header.driver.name, header.driver.version, header.session) == ("12", "12", "v2", "monday")
    assert header.driver.checkpoint_sha256 == hashlib.sha256(b"weights").hexdigest()
    assert set(header.identity) == {"track", "calibration", "rules"}


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--entry", " "), "--entry: the name is blank"),
        (("--set", "entry.checkpoint=gone.pt"), "entry.checkpoint: there is no file"),
        (("--set", "entry.name=''"), "entry.name: is blank"),
        (("--set", "entry.name=net"), "name is 'simulated car' and entry.name is 'net'"),
    ],
)
def test_a_wrong_entry_is_one_line_and_nothing_is_recorded(
    config: Path, tmp_path: Path, words: tuple[str, ...], named: str
) -> None:
    """No name, two names or no checkpoint: exit code 2 before anything is opened or written."""
    ran = edge("run", "--config", config, "--source", "sim:", "--record", tmp_path / "new", *words, cwd=tmp_path)
    assert ran.code == 2
    assert named in ran.complaint()
    assert not (tmp_path / "new").exists()
