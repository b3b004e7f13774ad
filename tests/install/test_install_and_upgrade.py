"""install.sh from nothing to a second and third release, and all the ways back."""

import sys
from pathlib import Path

import pytest
from yard import REPOSITORY

UNITS = ("dnb-edge", "dnb-edge-web")


def leads_to(machine, version):
    """Whether the link leads to a whole release of that version that works."""
    assert not (machine.opt / "venv").readlink().is_absolute()
    assert (machine.current / ".complete").is_file()
    return machine.current.name.startswith(f"{version}-")


def test_a_fresh_machine_gets_everything_and_a_second_run_changes_nothing(machine, checkout):
    """Release, link, units, rules, limits, users, directories and both services; run again, not one file is another."""
    clone = checkout()
    # With a virtual environment that it makes itself.
    done = machine.install(clone, PYTHON=sys.executable)
    assert done.returncode == 0, done.stderr
    assert leads_to(machine, "1.0")
    for unit in UNITS:
        assert (
            machine.running(unit) == machine.opt / "venv/bin/dnb-edge"
            or machine.running(unit) == machine.current / "bin/dnb-edge"
        )
        assert (machine.root / f"run/state/enabled/{unit}").exists()
    for name, place in {
        "dnb-edge.service": "etc/systemd/system/dnb-edge.service",
        "70-dnb-edge.rules": "etc/udev/rules.d/70-dnb-edge.rules",
        "dnb-edge-journald.conf": "etc/systemd/journald.conf.d/dnb-edge.conf",
        "dnb-edge.tmpfiles.conf": "usr/lib/tmpfiles.d/dnb-edge.conf",
    }.items():
        assert (machine.root / place).read_bytes() == (REPOSITORY / "systemd" / name).read_bytes()
        assert (machine.root / place).stat().st_mode & 0o777 == 0o644
    assert (machine.root / "usr/local/bin/dnb-edge").readlink() == Path("/opt/dnb-edge/venv/bin/dnb-edge")
    assert "dnb-edge-web:" in (machine.root / "etc/passwd").read_text()
    assert (machine.root / "var/lib/dnb-edge/runs").is_dir()
    # What was not asked for is not there.
    assert not list(machine.root.glob("etc/udev/rules.d/99-*"))
    assert not (machine.root / "etc/systemd/system.conf.d").exists()
    assert not {".venv-link", "source", "scratch"} & {path.name for path in machine.opt.rglob("*")}
    assert "racing: frames come" in done.stdout

    before, pid = machine.tree(), (machine.root / "run/state/pids/dnb-edge").read_text()
    again = machine.install(clone, PYTHON=sys.executable)
    assert again.returncode == 0, again.stderr
    assert machine.tree() == before
    assert (machine.root / "run/state/pids/dnb-edge").read_text() == pid
    assert "installed already" in again.stdout


def test_a_file_that_was_changed_by_hand_is_mended_by_a_second_run(machine, checkout):
    """The release is kept, the unit is as shipped again and the services have been started with it."""
    clone = checkout()
    machine.install(clone)
    release, unit = machine.current, machine.root / "etc/systemd/system/dnb-edge.service"
    unit.write_text("damaged")
    pid = (machine.root / "run/state/pids/dnb-edge").read_text()
    done = machine.install(clone)
    assert done.returncode == 0, done.stderr
    assert machine.current == release
    assert unit.read_bytes() == (REPOSITORY / "systemd/dnb-edge.service").read_bytes()
    assert (machine.root / "run/state/pids/dnb-edge").read_text() != pid


def test_upgrades_share_packages_and_two_releases_are_kept(machine, checkout):
    """The third release shares the second's packages without any index, the first is gone; back and forth is one word each."""
    machine.install(checkout(version="1.0"))
    first = machine.current
    done = machine.install(checkout(version="1.1"))
    assert done.returncode == 0, done.stderr + (machine.root / "var/log/dnb-edge-install.log").read_text()
    second = machine.current
    pip = next(second.glob("lib/python3*/site-packages/pip/__init__.py"))
    assert pip.stat().st_nlink == 2
    assert str(first) not in (second / "bin/dnb-edge").read_text()
    assert str(first) not in (second / "bin/pip").read_text()
    done = machine.install(checkout(version="1.2"))
    assert done.returncode == 0, done.stderr
    assert leads_to(machine, "1.2")
    third = machine.current
    assert not first.exists()
    assert machine.releases == sorted((second.name, third.name))
    # Without the clone, by the copy that lies in the release.
    for wanted in (second, third):
        back = machine.install(machine.opt / "venv", "--rollback")
        assert back.returncode == 0, back.stderr
        assert machine.current == wanted
        assert machine.running("dnb-edge") is not None
    assert machine.releases == sorted((second.name, third.name))


@pytest.mark.parametrize(
    ("behaviour", "word"),
    [
        ("dies", "dnb-edge does not start"),
        ("silent", "its socket"),
        ("waits", "it raced before, and now: it waits: no camera is there"),
    ],
)
def test_an_upgrade_that_is_not_healthy_is_taken_back(machine, checkout, behaviour, word):
    """A service that dies, says nothing or no longer races: release, link, units and the running race are as they were."""
    machine.install(checkout(version="1.0"))
    before = machine.tree()
    clone = checkout(version="2.0", behaviour=behaviour)
    with (clone / "systemd/dnb-edge.service").open("a") as unit:
        unit.write("# another one\n")
    (clone / "systemd/dnb-edge-journald.conf").unlink()
    failed = machine.install(clone, DNB_EDGE_HEALTH_S="3")
    assert failed.returncode == 1
    assert word in failed.stderr.splitlines()[0]
    assert "rolled back: 1.0-" in failed.stderr
    assert machine.tree() == before
    assert leads_to(machine, "1.0")
    assert machine.running("dnb-edge") is not None
    assert machine.running("dnb-edge-web") is not None


def test_a_box_without_a_camera_yet_is_healthy(machine, checkout):
    """What it waits for is said, and that is enough for a box that never raced."""
    done = machine.install(checkout(behaviour="waits"))
    assert done.returncode == 0, done.stderr
    assert "it waits: no camera is there" in done.stdout


def test_a_first_installation_that_is_not_healthy_leaves_nothing(machine, checkout):
    """Files, links, users and directories are those of before."""
    before = machine.tree()
    failed = machine.install(checkout(behaviour="dies"))
    assert failed.returncode == 1
    assert "everything was removed again" in failed.stderr
    assert machine.tree() == before
    assert not (machine.root / "var/lib/dnb-edge").exists()
    assert not list((machine.root / "run/state/enabled").iterdir())


@pytest.fixture
def older(machine):
    """An installation by hand, from before there were releases: a real folder, a unit of its own, one service."""
    folder = machine.opt / "venv"
    (folder / "bin").mkdir(parents=True)
    program = folder / "bin/dnb-edge"
    program.write_text("#!/bin/bash\nexec sleep 600\n")
    program.chmod(0o755)
    unit = machine.root / "etc/systemd/system/dnb-edge.service"
    unit.parent.mkdir(parents=True)
    unit.write_text("[Service]\nExecStart=/opt/dnb-edge/venv/bin/dnb-edge run\n")
    (machine.root / "run/state/enabled").mkdir(parents=True)
    (machine.root / "run/state/enabled/dnb-edge").touch()
    return unit


def test_an_installation_from_before_releases_is_kept_and_can_come_back(machine, checkout, older):
    """Its folder becomes a release; only the unit that was enabled is started; --rollback brings folder and unit back."""
    text = older.read_text()
    done = machine.install(checkout())
    assert done.returncode == 0, done.stderr
    assert leads_to(machine, "1.0")
    (kept,) = (machine.opt / "releases").glob("before-*")
    assert (kept / "bin/dnb-edge").is_file()
    assert machine.running("dnb-edge-web") is None
    assert older.read_text() != text
    machine.environment["DNB_EDGE_HEALTH_S"] = "1"
    # It serves no socket, so it cannot be healthy, and the newer one stays.
    assert machine.install(machine.opt / "venv", "--rollback").returncode == 1
    assert leads_to(machine, "1.0")
    back = machine.install(machine.opt / "venv", "--rollback", "--no-start")
    assert back.returncode == 0, back.stderr
    assert machine.current == kept
    assert older.read_text() == text
    assert not (machine.root / "etc/udev/rules.d/70-dnb-edge.rules").exists()


def test_an_installation_from_before_releases_survives_an_unhealthy_upgrade(machine, checkout, older):
    """What raced goes on, by its own unit."""
    text = older.read_text()
    failed = machine.install(checkout(behaviour="dies"))
    assert failed.returncode == 1
    assert "rolled back" in failed.stderr
    assert older.read_text() == text
    assert (machine.opt / "venv/bin/dnb-edge").is_file()
    assert machine.install(checkout()).returncode == 0


def test_uninstalling_leaves_what_users_made_and_purging_does_not(machine, checkout):
    """Configuration and recordings stay until --purge; then the machine is as before. Twice is no error."""
    before = machine.tree()
    machine.install(checkout(), "--take-home")
    config, run = machine.root / "etc/dnb-edge/dnb-edge.yaml", machine.root / "var/lib/dnb-edge/runs/a.mcap"
    config.write_text("name: mine\n")
    run.write_text("laps")
    # By the copy in the release, which goes on the way.
    done = machine.install(machine.opt / "venv", "--uninstall")
    assert done.returncode == 0, done.stderr
    assert not machine.opt.exists()
    assert machine.running("dnb-edge") is None
    assert config.is_file()
    assert run.is_file()
    assert not list(machine.root.glob("etc/udev/rules.d/*"))
    for _ in range(2):
        assert machine.install(checkout(), "--uninstall", "--purge").returncode == 0
        assert not run.exists()
        assert machine.tree() == before
