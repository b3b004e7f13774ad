"""The units as these tests look at them: their assignments, and systemd's own words on a copy that this machine can judge."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

SYSTEMD = Path(__file__).resolve().parents[2] / "systemd"
ANALYZE = shutil.which("systemd-analyze")
needs_analyze = pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed")


def settings(unit: Path) -> dict[str, list[str]]:
    """A unit's assignments, key to all values in order."""
    found: dict[str, list[str]] = {}
    for key, value in re.findall(r"^(\w+)=(.*)$", unit.read_text(encoding="utf-8"), flags=re.MULTILINE):
        found.setdefault(key, []).append(value)
    return found


def installable(unit: Path, folder: Path, *, extra: str = "", instance: str = "") -> Path:
    """A copy of `unit` whose program exists on this machine, with `extra` lines; of a template, what an instance is called."""
    text = re.sub(r"^ExecStart=.*$", "ExecStart=/bin/true", unit.read_text(encoding="utf-8"), flags=re.MULTILINE)
    (folder / unit.name).write_text(text.replace("[Service]\n", f"[Service]\n{extra}"), encoding="utf-8")
    return folder / unit.name.replace("@", f"@{instance}")


def analyze(*arguments: object) -> subprocess.CompletedProcess[str]:
    """What `systemd-analyze` says."""
    assert ANALYZE is not None
    return subprocess.run(
        [ANALYZE, "--no-pager", *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False
    )
