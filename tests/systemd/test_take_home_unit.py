"""The unit and the rule that take recordings home: understood by systemd, hardened, and strange sticks left as they are."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

SYSTEMD = Path(__file__).resolve().parents[2] / "systemd"
UNIT = SYSTEMD / "dnb-edge-take-home@.service"
RULE = SYSTEMD / "99-dnb-edge-take-home.rules"
ANALYZE = shutil.which("systemd-analyze")
UDEVADM = shutil.which("udevadm")


def settings():
    """The unit's assignments, key to all values in order."""
    found = {}
    for key, value in re.findall(r"^(\w+)=(.*)$", UNIT.read_text(encoding="utf-8"), flags=re.MULTILINE):
        found.setdefault(key, []).append(value)
    return found


@pytest.fixture
def installable(tmp_path):
    """A copy of the unit whose program exists on this machine."""

    def write(extra="", instance=""):
        text = re.sub(r"^ExecStart=.*$", "ExecStart=/bin/true", UNIT.read_text(encoding="utf-8"), flags=re.MULTILINE)
        (tmp_path / UNIT.name).write_text(text.replace("[Service]\n", f"[Service]\n{extra}"), encoding="utf-8")
        return tmp_path / UNIT.name.replace("@", f"@{instance}")

    return write


def analyze(*arguments):
    return subprocess.run(
        [ANALYZE, "--no-pager", *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False
    )


@pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed")
def test_systemd_understands_every_line(installable):
    """`verify` exits with 0 even for unknown keys, so any word from it is a failure; a misspelt key makes it speak."""
    verdict = analyze("verify", installable(instance="sda1"))
    assert (verdict.returncode, verdict.stdout, verdict.stderr) == (0, "", "")
    assert "ProtectHoom" in analyze("verify", installable("ProtectHoom=yes\n", "sda1")).stderr


@pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed")
def test_what_reads_the_stick_is_hardened(installable):
    """systemd's own exposure level is at most 1.0 of 10: it may write to the stick, and speak to the appliance."""
    verdict = analyze("security", "--offline=true", "--threshold=10", installable())
    assert verdict.returncode == 0, verdict.stdout
    assert float(re.search(r"exposure level for \S+: ([0-9.]+)", verdict.stdout)[1]) <= 1.0


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
