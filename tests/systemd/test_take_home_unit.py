"""The unit and the rule that take recordings home: strange sticks are left as they are."""

import re
import shutil
import subprocess
from functools import partial

import pytest
import units
from units import SYSTEMD

settings = partial(units.settings, SYSTEMD / "dnb-edge-take-home@.service")
RULE = SYSTEMD / "99-dnb-edge-take-home.rules"
UDEVADM = shutil.which("udevadm")


def test_only_mounting_has_any_privilege():
    """Three commands run as root: mounting to look, mounting to write, unmounting. What reads files does not."""
    found = [command for key in settings() if key.startswith("Exec") for command in settings()[key]]
    privileged = [command.lstrip("+-").split()[0] for command in found if command.startswith("+")]
    assert privileged == ["/usr/bin/systemd-mount", "/usr/bin/nsenter", "/usr/bin/systemd-umount"]
    (command,) = settings()["ExecStart"]
    assert command.startswith("/opt/dnb-edge/venv/bin/dnb-edge runs copy ")
    assert settings()["User"] == ["dnb-edge"]


def test_a_strangers_stick_is_not_written_to():
    """It is mounted read-only, without a repair, until the folder is seen; and never with programs or devices of its own."""
    mount, look = settings()["ExecCondition"]
    assert "--fsck=no" in mount
    assert re.search(r"--options=(\S+)", mount)[1].split(",")[:4] == ["ro", "nosuid", "nodev", "noexec"]
    assert look == "/usr/bin/test -d /run/dnb-edge-take-home/%i/dnb-edge"
    (remount,) = settings()["ExecStartPre"]
    # Where it is remounted in a namespace of the command's own, what copies does not see it.
    assert remount.endswith("nsenter --target 1 --mount /usr/bin/mount -o remount,rw /run/dnb-edge-take-home/%i")


def test_nothing_but_the_stick_may_be_written():
    """Everything else is read-only, the recordings too."""
    assert settings()["ProtectSystem"] == ["strict"]
    assert settings()["ReadWritePaths"] == ["-/run/dnb-edge-take-home/%i"]
    assert not settings().keys() & {"StateDirectory", "RuntimeDirectory", "CacheDirectory", "LogsDirectory"}


def test_it_agrees_with_the_appliance_where_things_are():
    """The recordings and the socket are those of dnb-edge.service."""
    appliance = (SYSTEMD / "dnb-edge.service").read_text(encoding="utf-8")
    (command,) = settings()["ExecStart"]
    runs = re.search(r"runs copy (\S+)", command)[1]
    assert f"--record {runs} " in appliance
    runtime = re.search(r"^RuntimeDirectory=(\S+)$", appliance, flags=re.MULTILINE)[1]
    assert re.search(r"--live (\S+)", command)[1] == f"/run/{runtime}/live.sock"


def test_the_rule_is_for_sticks_alone():
    """New partitions on removable USB disks, with a file system that has no owners; it starts the unit of that device."""
    (rule,) = (line for line in RULE.read_text(encoding="utf-8").splitlines() if not line.startswith("#"))
    assert {part.strip() for part in rule.split(", ")} == {
        'ACTION=="add"',
        'SUBSYSTEM=="block"',
        'ENV{ID_BUS}=="usb"',
        'ENV{ID_FS_USAGE}=="filesystem"',
        'ENV{ID_FS_TYPE}=="vfat|exfat"',
        'ATTRS{removable}=="1"',
        'TAG+="systemd"',
        'ENV{SYSTEMD_WANTS}+="dnb-edge-take-home@%k.service"',
    }


@pytest.mark.skipif(UDEVADM is None, reason="udevadm is not installed")
def test_udev_understands_the_rule():
    """`udevadm verify` (systemd 254) has nothing to say against it."""
    verdict = subprocess.run(
        [UDEVADM, "verify", "--no-style", RULE], capture_output=True, text=True, timeout=60, check=False
    )
    if "Unknown command" in verdict.stderr:
        pytest.skip("this udevadm cannot verify rules")
    assert verdict.returncode == 0, verdict.stderr
