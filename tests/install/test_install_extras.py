"""What install.sh does only where it is asked to: sticks, the watchdog, a Wi-Fi of its own; and that upgrades keep it."""

import configparser

import pytest
from yard import REPOSITORY

KEYFILE = "etc/NetworkManager/system-connections/dnb-edge-ap.nmconnection"


def test_sticks_and_the_watchdog_stay_through_upgrades(machine, checkout):
    """Asked for once: there, refreshed by an upgrade without the options, and gone with the rest."""
    (machine.root / "dev/watchdog").touch()
    clone = checkout()
    assert machine.install(clone, "--take-home", "--watchdog").returncode == 0
    rules = machine.root / "etc/udev/rules.d/99-dnb-edge-take-home.rules"
    watchdog = machine.root / "etc/systemd/system.conf.d/dnb-edge-watchdog.conf"
    assert rules.read_bytes() == (REPOSITORY / "systemd/99-dnb-edge-take-home.rules").read_bytes()
    assert "RuntimeWatchdogSec=15" in watchdog.read_text()
    clone = checkout(version="1.1")
    (clone / "systemd/dnb-edge-watchdog.conf").write_text("[Manager]\nRuntimeWatchdogSec=14\n")
    assert machine.install(clone).returncode == 0
    assert watchdog.read_text() == "[Manager]\nRuntimeWatchdogSec=14\n"
    assert rules.exists()
    assert machine.install(clone, "--uninstall").returncode == 0
    assert not rules.exists()
    assert not watchdog.parent.exists()


def test_an_access_point_has_a_password_of_its_own_that_stays(machine, checkout):
    """A file for NetworkManager that only root reads; named and asked again, the name changes and the password does not."""
    machine.program("nmcli", "#!/bin/bash\n")
    clone = checkout()
    done = machine.install(clone, "--access-point")
    assert done.returncode == 0, done.stderr
    keyfile = machine.root / KEYFILE
    assert keyfile.stat().st_mode & 0o777 == 0o600
    first = configparser.ConfigParser(interpolation=None)
    first.read(keyfile)
    password = first["wifi-security"]["psk"]
    assert len(password) == 12
    assert f"password '{password}'" in done.stdout
    assert (first["wifi"]["mode"], first["wifi"]["ssid"], first["ipv4"]["method"]) == ("ap", "dnb-edge", "shared")
    done = machine.install(clone, "--access-point=race track")
    assert done.returncode == 0, done.stderr
    second = configparser.ConfigParser(interpolation=None)
    second.read(keyfile)
    assert (second["wifi"]["ssid"], second["wifi-security"]["psk"]) == ("race track", password)
    assert machine.install(clone, "--uninstall").returncode == 0
    assert not keyfile.exists()


@pytest.mark.parametrize("password", ["short", "x" * 64, "back\\slash1"])
def test_a_password_that_no_wifi_takes_is_refused(machine, checkout, password):
    """WPA takes 8 to 63 plain letters."""
    machine.program("nmcli", "#!/bin/bash\n")
    done = machine.install(checkout(), "--access-point", DNB_EDGE_AP_PASSWORD=password)
    assert done.returncode == 2
    assert not machine.opt.exists()


def test_optional_packages_stay_through_upgrades(machine, checkout):
    """Extras that were asked for once are those of the next release, too."""
    clone = checkout()
    assert machine.install(clone, "--extra", "luma").returncode == 0
    assert "extras=luma" in (machine.current / ".complete").read_text()
    assert machine.install(checkout(version="1.1")).returncode == 0
    assert "extras=luma" in (machine.current / ".complete").read_text()


def test_a_read_only_root_leaves_recordings_alone(machine, checkout):
    """Only the root is laid over: what is mounted on /var/lib/dnb-edge is written on; uninstalling takes it back."""
    machine.program("mountpoint", f'#!/bin/bash\n[ "${{!#}}" = {machine.root}/var/lib/dnb-edge ]\n')
    clone = checkout()
    done = machine.install(clone, "--read-only-root")
    assert done.returncode == 0, done.stderr
    conf = machine.root / "etc/overlayroot.local.conf"
    assert conf.read_text().splitlines()[-1] == 'overlayroot="tmpfs:recurse=0"'
    assert machine.install(clone, "--uninstall").returncode == 0
    assert not conf.exists()
