"""install.sh in a real Debian: an upgrade, a bad one that is taken back, the way back by hand, removal; and Debian 12.

The guests were installed by it, too, before their first start: see `harness.image`. None has a network.
"""

import time

from harness import reel
from harness.appliance import DISPLAY_URI, PATIENCE_S, Appliance, note
from harness.image import SOURCE

from dnb_edge.display import protocol

INSTALL_S = 900.0
NEXT = "/usr/src/next"


def next_version(guest, version, *, broken=False):
    """A clone with another version in it, whose service dies as soon as it is started, if `broken`."""
    guest.run(f"rm -rf {NEXT} && cp -r {SOURCE} {NEXT}")
    guest.run(f"sed -i 's/^__version__ = .*/__version__ = \"{version}\"/' {NEXT}/dnb_edge/__init__.py")
    if broken:
        guest.run(f"sed -i 's/^def run(/raise SystemExit(3)\\n&/' {NEXT}/dnb_edge/cli/run.py")


def install(guest, folder=NEXT, *words):
    """Runs install.sh in `folder`; what it says, and how long it took, seconds."""
    begun_s = time.monotonic()
    said = guest.run(
        f"DNB_EDGE_HEALTH_S=240 {folder}/install.sh {' '.join(words)}; echo exit code $?", timeout_s=INSTALL_S
    )
    return said, time.monotonic() - begun_s


def version(guest):
    """Of the release that the link leads to."""
    return guest.run("dnb-edge --version").split()[-1]


def race(appliance, webcam, logs):
    """Begins one, with the camera under the name that udev's rule gives it."""
    webcam.plug(appliance.guest)
    appliance.guest.wait_for("test -e /dev/dnb-edge-camera", timeout_s=60)
    config = reel.configuration(logs / "config", source="v4l2:/dev/dnb-edge-camera", display={"uri": DISPLAY_URI})
    # What a busy host does to an emulated race is not what is tested here.
    appliance.install(config, unit_lines="WatchdogSec=0\nTimeoutStartSec=infinity\n")
    appliance.guest.run("systemctl stop dnb-edge")
    appliance.start()


def first_lap(appliance, since_s):
    """The first lap of a race that begins after `since_s`."""
    return appliance.display.wait(protocol.Lap, lambda lap: lap.lap == 1, since_s=since_s, timeout_s=PATIENCE_S)


def test_a_racing_box_is_upgraded_taken_back_and_freed_of_it(appliance, guest, webcam, logs):
    """A good upgrade races on, so does a bad one that is taken back; --rollback goes further; --uninstall keeps recordings."""
    begun_s = time.monotonic()
    race(appliance, webcam, logs)
    first_lap(appliance, begun_s)
    was = version(guest)
    release = guest.run("readlink -f /opt/dnb-edge/venv").strip()
    assert guest.run("udevadm verify --no-style /etc/udev/rules.d/70-dnb-edge.rules", check=False).count("rror") == 0

    next_version(guest, "9.1")
    said, upgrade_s = install(guest)
    assert said.endswith("exit code 0\n"), said
    assert "with the same Python packages" in said
    assert "racing: frames come" in said
    assert version(guest) == "9.1"
    assert guest.run("systemctl is-enabled dnb-edge-web", check=False).strip() == "disabled"
    upgraded_s = time.monotonic()
    first_lap(appliance, upgraded_s)

    next_version(guest, "9.2", broken=True)
    said, back_s = install(guest)
    assert said.endswith("exit code 1\n"), said
    assert "dnb-edge: rolled back: 9.1-" in said
    assert version(guest) == "9.1"
    assert len(guest.run("ls /opt/dnb-edge/releases").split()) == 2
    rolled_s = time.monotonic()
    first_lap(appliance, rolled_s)

    said, _ = install(guest, "/opt/dnb-edge/venv", "--rollback")
    assert said.endswith("exit code 0\n"), said
    assert version(guest) == was
    assert guest.run("readlink -f /opt/dnb-edge/venv").strip() == release

    appliance.stop()
    runs = guest.run("ls /var/lib/dnb-edge/runs")
    said, _ = install(guest, "/opt/dnb-edge/venv", "--uninstall")
    assert said.endswith("exit code 0\n"), said
    assert runs.split()
    assert guest.run("ls /var/lib/dnb-edge/runs") == runs
    assert guest.run(
        "ls -d /opt/dnb-edge /etc/systemd/system/dnb-edge* /etc/udev/rules.d/*dnb* 2>/dev/null; true"
    ).split() == ["/etc/systemd/system/dnb-edge.service.d"]
    assert guest.run("systemctl show -P LoadState dnb-edge.service").strip() in {"not-found", "bad-setting"}
    note(logs, upgrade_s=round(upgrade_s), taken_back_s=round(back_s))


def test_debian_12_is_installed_and_times_a_lap(boot_older_guest, webcam, logs):
    """Its older Python, systemd and udev: installed again nothing is done, both units are sound, and the first lap is timed."""
    guest = boot_older_guest()
    assert guest.run("python3 --version").startswith("Python 3.11")
    assert guest.run("systemctl is-enabled dnb-edge").strip() == "enabled"
    assert guest.run("systemd-analyze verify dnb-edge.service dnb-edge-web.service") == ""
    said, _ = install(guest, SOURCE)
    assert said.endswith("exit code 0\n"), said
    assert "nothing is built" in said
    assert "it waits" in said
    appliance = Appliance(guest)
    try:
        begun_s = time.monotonic()
        race(appliance, webcam, logs)
        _, lap = first_lap(appliance, begun_s)
        note(logs, debian_12_first_lap_s=round(time.monotonic() - begun_s), lap=str(lap))
    finally:
        appliance.display.close()
