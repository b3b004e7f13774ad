"""The service unit: it holds to the decisions that systemd's own checks do not see."""

import re
import shutil
import subprocess
from functools import partial

import pytest
import units
from units import SYSTEMD

settings = partial(units.settings, SYSTEMD / "dnb-edge.service")

SYSUSERS = shutil.which("systemd-sysusers")
needs_sysusers = pytest.mark.skipif(SYSUSERS is None, reason="systemd-sysusers is not installed")


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("Type", ["notify"]),
        ("NotifyAccess", ["main"]),
        ("WatchdogSec", ["10"]),
        ("Restart", ["on-failure"]),
        ("RestartSec", ["1"]),
        ("StartLimitIntervalSec", ["0"]),
        ("SupplementaryGroups", ["video dialout"]),
        ("DevicePolicy", ["closed"]),
        ("DeviceAllow", ["char-video4linux rw", "char-ttyUSB rw", "char-ttyACM rw"]),
        ("PrivateNetwork", ["yes"]),
        ("RestrictAddressFamilies", ["AF_UNIX"]),
        ("ReadWritePaths", ["-/media/dnb-edge"]),
        ("ProtectSystem", ["strict"]),
        ("Environment", ["ORT_DISABLE_TELEMETRY=1"]),
    ],
)
def test_decisions_stand(key, values):
    """Restarting for ever, a watchdog, two kinds of device, no network, one stick beside its own directories (no error where it
    is not there), no telemetry: what the appliance is built on."""
    assert settings()[key] == values


def test_the_processor_stays_visible():
    """ProcSubset=pid would hide /proc/cpuinfo, from which ONNX Runtime learns what the processor can do."""
    assert "ProcSubset" not in settings()


def test_stop_leaves_time_to_finish_the_recording():
    """SIGTERM finishes the recording within 5 s; systemd kills no earlier."""
    (patience_s,) = settings()["TimeoutStopSec"]
    assert int(patience_s) > 5


def test_paths_are_granted():
    """The recordings and the configuration of the command line lie in directories that the unit makes and may use."""
    (command,) = settings()["ExecStart"]
    runs = re.search(r"--record /var/lib/(\S+)", command)[1]
    config = re.search(r"--config /etc/(\S+)/dnb-edge.yaml", command)[1]
    kept = re.search(r"--last-good /var/lib/(\S+)", command)[1]
    setup = re.search(r"--setup /var/lib/(\S+)", command)[1]
    assert {runs, kept, setup} <= set(settings()["StateDirectory"][0].split())
    assert settings()["ConfigurationDirectory"] == [config]


def test_the_socket_is_for_the_group_alone():
    """It lies in the directory that systemd makes, which others cannot enter, and no other place is named."""
    assert settings()["RuntimeDirectory"] == ["dnb-edge"]
    assert settings()["RuntimeDirectoryMode"] == ["0750"]
    assert "--live" not in settings()["ExecStart"][0]


@needs_sysusers
def test_the_user_of_the_unit_is_made(tmp_path):
    """The shipped sysusers file makes the user and the group that the unit names, and says nothing against it."""
    (tmp_path / "etc").mkdir()
    made = subprocess.run(
        [SYSUSERS, f"--root={tmp_path}", SYSTEMD / "dnb-edge.sysusers.conf"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    if made.returncode != 0 and "ermission denied" in made.stderr:
        pytest.skip("systemd-sysusers needs root here")
    assert made.returncode == 0, made.stderr
    (user,), (group,) = settings()["User"], settings()["Group"]
    assert f"{user}:" in (tmp_path / "etc" / "passwd").read_text(encoding="utf-8")
    assert f"{group}:" in (tmp_path / "etc" / "group").read_text(encoding="utf-8")
