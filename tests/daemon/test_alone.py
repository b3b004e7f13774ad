"""One appliance a directory."""

import subprocess
import sys
from pathlib import Path

import pytest

from dnb_edge.daemon.alone import alone, lock_directory
from dnb_edge.errors import InputError

HOLD = """
import sys
from pathlib import Path
from dnb_edge.daemon.alone import alone
with alone(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_second_appliance_is_refused_until_the_first_is_gone(tmp_path: Path) -> None:
    """In one line that says what to do; however the first one ends, its lock ends with it, and no file is left behind."""
    runs = tmp_path / "runs"
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(runs)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as first:
        assert first.stdout is not None
        assert first.stdout.readline() == "held\n"
        with pytest.raises(InputError, match=r"runs: another dnb-edge is racing with this directory: stop it"):
            alone(runs).__enter__()
        first.kill()
    with alone(runs):
        assert list(runs.iterdir()) == []


def test_a_directory_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    """Before anything else goes wrong with it."""
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file: cannot record there"):
        alone(tmp_path / "file").__enter__()


def test_which_directory_is_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """That of the recordings; without any, the service's own; at a terminal without recording, none."""
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    assert lock_directory(tmp_path) == tmp_path
    assert lock_directory(None) is None
    with alone(None):
        pass
    monkeypatch.setenv("RUNTIME_DIRECTORY", f"{tmp_path}/run:{tmp_path}/other")
    assert lock_directory(None) == tmp_path / "run"
