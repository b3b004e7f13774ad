"""The guest itself: what every other file here stands on."""


def test_the_package_is_installed_and_its_unit_is_sound(guest):
    """The README's steps leave the command, the user and the enabled unit; without a configuration it is up and says so."""
    assert guest.run("/opt/dnb-edge/venv/bin/dnb-edge --version").startswith("dnb-edge ")
    assert guest.run("systemctl is-enabled dnb-edge").strip() == "enabled"
    assert "video" in guest.run("systemctl show -P SupplementaryGroups dnb-edge")
    assert guest.run("systemd-analyze verify dnb-edge.service") == ""
    assert guest.run("systemctl start dnb-edge") == ""
    assert "no track is set up yet" in guest.run("journalctl -b -u dnb-edge --no-pager")
    assert "no track is set up yet" in guest.run("systemctl show -P StatusText dnb-edge")
    assert guest.run("systemctl show -P NRestarts dnb-edge").strip() == "0"


def test_a_guest_keeps_its_disk_over_a_cold_boot(guest):
    """What was synced before the power is cut is there after the next boot, so tests of power cuts can trust the disk."""
    guest.put("kept", "/var/tmp/word")
    guest.run("sync")
    guest.kill()
    guest.boot()
    assert guest.run("cat /var/tmp/word") == "kept"
