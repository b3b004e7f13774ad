"""The unit that publishes to a fleet's broker: off, without a device, and it ends where only a person can mend it."""

import re

import pytest
from units import SYSTEMD, settings

UNIT = SYSTEMD / "dnb-edge-fleet.service"


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("EnvironmentFile", ["/etc/dnb-edge/fleet.env"]),
        ("ConditionPathExists", ["/etc/dnb-edge/fleet.env"]),
        ("RestartPreventExitStatus", ["2"]),
        ("PrivateDevices", ["yes"]),
        ("ProtectSystem", ["strict"]),
        ("ReadWritePaths", ["/var/lib/dnb-edge/fleet"]),
        ("SocketBindDeny", ["any"]),
        ("User", ["dnb-edge-fleet"]),
        ("Group", ["dnb-edge"]),
    ],
)
def test_decisions_stand(key, values):
    """Nothing is published that nobody has set up; one folder to write, no port to listen at."""
    assert settings(UNIT)[key] == values


def test_its_user_and_folder_are_made():
    """Before it starts; the folder is on the recordings' partition, so that a read-only root keeps the queue."""
    assert re.search(
        r"^u dnb-edge-fleet -:dnb-edge ", (SYSTEMD / "dnb-edge.sysusers.conf").read_text(), flags=re.MULTILINE
    )
    made = (SYSTEMD / "dnb-edge.tmpfiles.conf").read_text()
    assert re.search(r"^d /var/lib/dnb-edge/fleet 0700 dnb-edge-fleet dnb-edge$", made, flags=re.MULTILINE)


def test_no_other_unit_starts_it():
    """Off unless somebody enables it."""
    for unit in SYSTEMD.glob("*.service"):
        if unit != UNIT:
            assert "dnb-edge-fleet" not in unit.read_text(encoding="utf-8")
