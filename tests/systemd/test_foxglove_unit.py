"""The unit of the live server for Foxglove: understood by systemd, hardened, off, and for this machine alone."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

SYSTEMD = Path(__file__).resolve().parents[2] / "systemd"
UNIT = SYSTEMD / "dnb-edge-foxglove.service"

ANALYZE = shutil.which("systemd-analyze")
needs_analyze = pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed")


@pytest.fixture
def installable(tmp_path):
    """A copy of the unit whose program exists on this machine."""
    text = re.sub(r"^ExecStart=.*$", "ExecStart=/bin/true", UNIT.read_text(encoding="utf-8"), flags=re.MULTILINE)
    path = tmp_path / UNIT.name
    path.write_text(text, encoding="utf-8")
    return path


def analyze(*arguments):
    return subprocess.run(
        [ANALYZE, "--no-pager", *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False
    )


@needs_analyze
def test_systemd_understands_every_line(installable):
    """`verify` exits with 0 even for unknown keys, so any word from it is a failure."""
    verdict = analyze("verify", installable)
    assert (verdict.returncode, verdict.stdout, verdict.stderr) == (0, "", "")


@needs_analyze
def test_it_is_hardened(installable):
    """systemd's own exposure level is at most 2.0 of 10."""
    verdict = analyze("security", "--offline=true", "--threshold=20", installable)
    assert verdict.returncode == 0, verdict.stdout
    assert float(re.search(r"exposure level for \S+: ([0-9.]+)", verdict.stdout)[1]) <= 2.0


@pytest.mark.parametrize(
    "line",
    [
        "IPAddressDeny=any",
        "IPAddressAllow=localhost",
        "PrivateDevices=yes",
        "DynamicUser=yes",
        "SupplementaryGroups=dnb-edge",
        "ProtectSystem=strict",
        "ExecStart=/opt/dnb-edge/venv/bin/dnb-edge foxglove --socket /run/dnb-edge/live.sock",
    ],
)
def test_it_shows_the_camera_to_this_machine_alone(line):
    """No other address is let in and no device or file is written to, whatever the configuration says."""
    assert line in UNIT.read_text(encoding="utf-8").splitlines()
    assert not re.search(r"^(ReadWritePaths|StateDirectory)=", UNIT.read_text(encoding="utf-8"), flags=re.MULTILINE)


def test_no_other_unit_starts_it():
    """Off unless somebody enables it."""
    for unit in SYSTEMD.iterdir():
        if unit != UNIT and unit.suffix != ".md":
            assert "foxglove" not in unit.read_text(encoding="utf-8")
