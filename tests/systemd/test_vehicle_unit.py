"""The unit that hears cars: off, in local networks alone, without a device, and never in the race's way."""

import pytest
from units import SYSTEMD, settings

from dnb_edge.vehicle.client import PORT

UNIT = SYSTEMD / "dnb-edge-vehicle.service"


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("IPAddressDeny", ["any"]),
        ("IPAddressAllow", ["localhost link-local 10.0.0.0/8 172.16.0.0/12 192.168.0.0/16"]),
        ("PrivateDevices", ["yes"]),
        ("DynamicUser", ["yes"]),
        ("SupplementaryGroups", ["dnb-edge"]),
        ("ProtectSystem", ["strict"]),
        ("CPUQuota", ["50%"]),
        ("RestartPreventExitStatus", ["2"]),
        ("ExecStart", [f"/opt/dnb-edge/venv/bin/dnb-edge vehicle --socket /run/dnb-edge/live.sock --udp {PORT}"]),
    ],
)
def test_decisions_stand(key, values):
    """Strangers are not heard, nothing is written, and a flood has half a processor at most."""
    assert settings(UNIT)[key] == values
    assert "ReadWritePaths" not in settings(UNIT)


def test_no_other_unit_starts_it():
    """Off unless somebody enables it."""
    for unit in SYSTEMD.glob("*.service"):
        if unit != UNIT:
            assert "dnb-edge-vehicle" not in unit.read_text(encoding="utf-8")
