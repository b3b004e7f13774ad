"""What the installer and its files are, without running it: checked by the tools that know their languages."""

import re
import shutil
import subprocess

import pytest
from yard import REPOSITORY

SYSTEMD = REPOSITORY / "systemd"
SHELLCHECK = shutil.which("shellcheck")
UDEVADM = shutil.which("udevadm")


@pytest.mark.skipif(SHELLCHECK is None, reason="shellcheck is not installed")
def test_shellcheck_has_nothing_to_say():
    """install.sh with all that it reads, and the workshop's own scripts."""
    verdict = subprocess.run(
        [SHELLCHECK, "-x", "install.sh", ".ci/install", ".ci/lock", ".ci/run"],
        cwd=REPOSITORY, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert (verdict.returncode, verdict.stdout + verdict.stderr) == (0, "")


@pytest.mark.skipif(UDEVADM is None, reason="udevadm is not installed")
def test_udev_understands_the_names():
    """`udevadm verify` (systemd 254) has nothing to say against the rules."""
    verdict = subprocess.run(
        [UDEVADM, "verify", "--no-style", SYSTEMD / "70-dnb-edge.rules"],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    if "Unknown command" in verdict.stderr:
        pytest.skip("this udevadm cannot verify rules")
    assert verdict.returncode == 0, verdict.stderr


def test_everything_shipped_is_installed_or_named():
    """Each file of systemd/ is in the installer's table, but for its own parts, so that none is forgotten."""
    installer = (SYSTEMD / "installer/system.sh").read_text(encoding="utf-8")
    managed = set(re.findall(r"^(\S+) /(?:etc|usr)/\S+ \S+$", installer, flags=re.MULTILINE))
    assert managed == {path.name for path in SYSTEMD.iterdir() if path.is_file()} - {"README.md", "health_check.py"}


def test_the_programs_of_the_units_are_where_releases_are():
    """Whatever a unit starts is found by the one link that install.sh moves."""
    for unit in SYSTEMD.glob("*.service"):
        started = re.findall(r"^ExecStart=(\S+)", unit.read_text(encoding="utf-8"), flags=re.MULTILINE)
        assert started == ["/opt/dnb-edge/venv/bin/dnb-edge"]
