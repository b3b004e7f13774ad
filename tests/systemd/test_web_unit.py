"""The pages' unit: without any device, and able to write where it must and nowhere else."""

import re
from functools import partial

import pytest
import units
from units import SYSTEMD

settings = partial(units.settings, SYSTEMD / "dnb-edge-web.service")
settings_of_the_race = partial(units.settings, SYSTEMD / "dnb-edge.service")


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("Type", ["notify"]),
        ("Restart", ["always"]),
        ("StartLimitIntervalSec", ["0"]),
        ("PrivateDevices", ["yes"]),
        ("RestrictAddressFamilies", ["AF_UNIX AF_INET AF_INET6"]),
        ("ReadWritePaths", ["/var/lib/dnb-edge/runs /var/lib/dnb-edge/setup"]),
        ("CacheDirectory", ["dnb-edge-web"]),
        ("ProtectSystem", ["strict"]),
        ("MemoryMax", ["1G"]),
        ("CapabilityBoundingSet", [""]),
        ("UMask", ["0007"]),
    ],
)
def test_decisions_stand(key, values):
    """No device, no privilege, the network, two directories, so much memory; there again whatever happens."""
    assert settings()[key] == values


@pytest.mark.parametrize("key", ["DeviceAllow", "SupplementaryGroups", "StateDirectory"])
def test_what_it_must_not_have(key):
    """A device, the groups of devices, or a directory that systemd would take from the appliance's user."""
    assert key not in settings()


def test_it_does_not_wait_for_the_appliance():
    """The appliance waits for its camera, and these pages say so."""
    assert not [
        value for key in ("After", "Requires", "BindsTo") for value in settings().get(key, []) if "dnb-edge" in value
    ]


def test_when_memory_runs_out_the_race_stays():
    """The pages go first."""
    (pages,), (race,) = settings()["OOMScoreAdjust"], settings_of_the_race()["OOMScoreAdjust"]
    assert int(pages) > 0 > int(race)


def test_both_share_their_files_through_the_group():
    """One group, two users; what either writes there the other may write; the socket's and the files' places are the same."""
    pages, race = settings(), settings_of_the_race()
    assert pages["Group"] == race["Group"]
    assert pages["User"] != race["User"]
    assert pages["UMask"] == race["UMask"] == ["0007"]
    assert race["StateDirectoryMode"] == ["0770"]
    (command,) = pages["ExecStart"]
    for option in ("--runs", "--setup"):
        path = re.search(rf"{option} (\S+)", command)[1]
        assert path in pages["ReadWritePaths"][0].split()
        assert path.removeprefix("/var/lib/") in race["StateDirectory"][0].split()
        made = (SYSTEMD / "dnb-edge.tmpfiles.conf").read_text(encoding="utf-8")
        assert f"d {path} 0770 {race['User'][0]} {race['Group'][0]}\n" in made
    assert f"--socket /run/{race['RuntimeDirectory'][0]}/live.sock" in command


def test_the_users_are_made():
    """Both, in the sysusers file."""
    text = (SYSTEMD / "dnb-edge.sysusers.conf").read_text(encoding="utf-8")
    assert re.search(r"^u dnb-edge-web -:dnb-edge ", text, flags=re.MULTILINE)
    assert re.search(r"^u dnb-edge - ", text, flags=re.MULTILINE)
