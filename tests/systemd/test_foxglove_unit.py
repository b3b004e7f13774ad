"""The unit of the live server for Foxglove: off, and for this machine alone."""

import re

import pytest
from units import SYSTEMD

UNIT = SYSTEMD / "dnb-edge-foxglove.service"


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
        if unit != UNIT and unit.is_file() and unit.suffix != ".md":
            assert "foxglove" not in unit.read_text(encoding="utf-8")
