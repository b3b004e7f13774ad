"""What install.sh refuses or fails at: one clear line, and the machine is as it was."""

import contextlib
import fcntl
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from yard import REPOSITORY, statement, wait_for

UBUNTU = 'PRETTY_NAME="Ubuntu 24.04.1 LTS"\nVERSION_ID="24.04"\nID=ubuntu\nID_LIKE=debian\n'
BULLSEYE = 'PRETTY_NAME="Debian GNU/Linux 11 (bullseye)"\nVERSION_ID="11"\nID=debian\n'
SID = 'PRETTY_NAME="Debian GNU/Linux forky/sid"\nID=debian\n'


def first_line(done):
    """What is said first, and that it is by us."""
    return done.stderr.splitlines()[0].removeprefix("dnb-edge: ")


@pytest.mark.parametrize(
    ("system", "environment", "words"),
    [
        (UBUNTU, {}, "this is Ubuntu 24.04.1 LTS; dnb-edge is installed on Debian 12 or 13"),
        (BULLSEYE, {}, "this is Debian GNU/Linux 11 (bullseye); dnb-edge"),
        (SID, {}, "this is Debian GNU/Linux forky/sid; dnb-edge"),
        (None, {}, "/etc/os-release is not there"),
        ("", {"ARCHITECTURE": "armhf"}, "this is a system for armhf; a 64-bit one is needed"),
        ("", {"SYSTEMD_VERSION": "247"}, "systemd is 247; 248 or newer is needed"),
        ("", {"PYTHON": "OLD"}, "Python 3.9.2, and 3.11 or newer is needed"),
    ],
)
def test_an_unsupported_system_is_named(machine, checkout, system, environment, words):
    """Each names what it found and what is needed, with exit code 2, before anything is done."""
    release = machine.root / "etc/os-release"
    if system:
        release.write_text(system)
    elif system is None:
        release.unlink()
    machine.program("old-python", '#!/bin/bash\n[ "$1" = -V ] && echo Python 3.9.2 && exit 0\nexit 1\n')
    if environment.get("PYTHON") == "OLD":
        environment = {"PYTHON": str(machine.root / "bin-of-the-test/old-python")}
    before = machine.tree()
    done = machine.install(checkout(), **environment)
    assert done.returncode == 2
    assert words in first_line(done)
    assert len(done.stderr.splitlines()) == 1
    assert machine.tree() == before


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--colour"], "--colour: no such option"),
        (["--wheels"], "--wheels: name what belongs to it"),
        (["--wheels", "/not/there"], "--wheels /not/there: no such folder"),
        (["--purge"], "--purge: only with --uninstall"),
        (["--watchdog"], "this machine has no /dev/watchdog"),
        (["--read-only-root"], "mount a partition of its own on /var/lib/dnb-edge"),
        (["--access-point=" + "x" * 33], "32 letters at most"),
    ],
)
def test_wrong_use_is_told_before_anything_is_done(machine, checkout, options, words):
    """Options that there are not, that lack something, or that this machine cannot have."""
    machine.program("nmcli", "#!/bin/bash\n")
    before = machine.tree()
    done = machine.install(checkout(), *options)
    assert done.returncode == 2
    assert words in first_line(done)
    assert machine.tree() == before


def test_a_read_only_root_is_told_before_all_is_written_into_nothing(machine, checkout):
    """On a root that is laid over in memory an installation would be gone with the next start."""
    (machine.root / "proc/mounts").write_text("overlayroot / overlay rw,relatime 0 0\n")
    done = machine.install(checkout())
    assert done.returncode == 2
    assert "the root is read-only" in first_line(done)


def test_half_a_clone_is_told(machine, checkout):
    """Somebody copied install.sh alone, or the package is missing."""
    clone = checkout()
    (clone / "pyproject.toml").unlink()
    done = machine.install(clone)
    assert done.returncode == 2
    assert "run install.sh in a whole clone" in first_line(done)


@pytest.mark.skipif(os.geteuid() != 0, reason="needs root, to become somebody else")
def test_without_root_it_says_how(tmp_path_factory):
    """On the machine itself, as nobody: it looks at nothing and does nothing."""
    clone = Path("/tmp") / f"dnb-edge-clone-{os.getpid()}"
    shutil.copytree(REPOSITORY / "systemd/installer", clone / "systemd/installer")
    shutil.copy(REPOSITORY / "install.sh", clone)
    try:
        clone.chmod(0o755)
        done = subprocess.run(
            ["bash", clone / "install.sh"],
            user=65534,
            group=65534,
            extra_groups=[],
            capture_output=True,
            text=True,
            check=False,
        )
    finally:
        shutil.rmtree(clone)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "dnb-edge: it needs root: sudo ./install.sh\n"


def test_without_a_network_it_says_what_to_do(machine, checkout):
    """pip reaches no index: nothing is left, and the way without a network is named."""
    before = machine.tree()
    done = machine.install(
        checkout(requires=("not-there-at-all",)),
        PIP_NO_INDEX="0",
        PIP_INDEX_URL="http://127.0.0.1:9/simple",
        PIP_RETRIES="1",
    )
    assert done.returncode == 1
    assert "there is no network: connect the box, or give it what it needs: --wheels DIR" in first_line(done)
    assert "nothing was changed" in done.stderr
    assert machine.tree() == before


def test_wheels_that_lack_one_say_which(machine, checkout, tmp_path):
    """The package that is not in the folder is named, with the folder."""
    done = machine.install(checkout(requires=("not-there-at-all",)), "--wheels", str(tmp_path))
    assert done.returncode == 1
    assert f"No matching distribution found for not-there-at-all: it is not in {tmp_path}" in first_line(done)
    assert not machine.opt.exists()


def test_missing_debian_packages_without_a_network(machine, checkout):
    """apt-get reaches no mirror: the packages are named."""
    machine.program("python", f'#!/bin/bash\n[[ "$*" != *"import systemd"* ]] || exit 1\nexec {sys.executable} "$@"\n')
    done = machine.install(checkout())
    assert done.returncode == 1
    assert "apt-get could not install python3-systemd: there is no network" in first_line(done)
    assert not machine.opt.exists()


@contextlib.contextmanager
def small_disk(at, size):
    """A disk of that size on /opt of the machine; skips where none may be mounted."""
    if (
        os.geteuid() != 0
        or subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", at], check=False).returncode
    ):
        pytest.skip("needs root and the right to mount a small disk")
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", at], check=True)


def test_a_full_disk_is_told_before_anything_is_done(machine, checkout):
    """How much room there is, and how much is needed."""
    with small_disk(machine.root / "opt", "20m"):
        done = machine.install(checkout())
        assert done.returncode == 1
        assert "has 20 MB of room, 900 MB are needed" in first_line(done)
        assert not machine.opt.exists()


@pytest.mark.parametrize("size", ["12m", "60m"])
def test_a_disk_that_is_full_in_the_middle_is_left_as_it_was(machine, checkout, size):
    """While the virtual environment is made, or the package is unpacked: all that was written goes again."""
    fill = statement("open('dnb_edge/large.py', 'w').write('# ' + 'x' * 100_000_000)")
    with small_disk(machine.root / "opt", size):
        done = machine.install(checkout(middle=fill), DNB_EDGE_NEEDED_MB="1")
        assert done.returncode == 1
        assert "the disk is full: make room" in first_line(done)
        assert not machine.opt.exists()


def test_a_unit_that_cannot_be_written_undoes_the_upgrade(machine, checkout):
    """The disk of /etc fails in the middle of the files: release, link and files are those of before."""
    machine.install(checkout(version="1.0"))
    before = machine.tree()
    clone = checkout(version="1.1")
    with (clone / "systemd/70-dnb-edge.rules").open("a") as rules:
        rules.write("# changed\n")
    with (clone / "systemd/dnb-edge.service").open("a") as unit:
        unit.write("# changed\n")
    machine.program("install", '#!/bin/bash\n[[ "$*" != *70-dnb-edge.rules.new ]] && exec /usr/bin/install "$@"\n')
    done = machine.install(clone)
    assert done.returncode == 1
    assert "70-dnb-edge.rules could not be written" in first_line(done)
    assert "rolled back: 1.0-" in done.stderr
    assert machine.tree() == before
    assert machine.running("dnb-edge") is not None


def test_two_at_once_are_one_too_many(machine, checkout):
    """The second one says so and leaves the first one alone."""
    lock = machine.root / "run/lock/dnb-edge-install.lock"
    lock.parent.mkdir()
    with lock.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        done = machine.install(checkout())
    assert done.returncode == 1
    assert "another install.sh is at work" in first_line(done)
    assert not machine.opt.exists()


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_while_it_builds_leaves_nothing(machine, checkout, by):
    """Ended within seconds, pip with it; no release, no link, no file is left."""
    before = machine.tree()
    waits = statement(f"open({str(machine.root / 'run/reached')!r}, 'w').close(); time.sleep(120)")
    process = machine.begin(checkout(middle=waits))
    wait_for(machine.root / "run/reached")
    process.send_signal(by)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 1, out
    assert "dnb-edge: interrupted" in err
    assert machine.tree() == before
    assert not machine.opt.exists()
    assert not left_behind(machine)


def test_ctrl_c_while_health_is_checked_rolls_back(machine, checkout):
    """The new release is in place and silent: the old one runs again."""
    machine.install(checkout(version="1.0"))
    before = machine.tree()
    (machine.root / "run/dnb-edge/live.sock").unlink()
    process = machine.begin(checkout(version="1.1", behaviour="silent"), DNB_EDGE_HEALTH_S="120")
    wait_for(machine.root / "run/dnb-edge/live.sock")
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "rolled back: 1.0-" in err
    assert machine.tree() == before
    assert machine.running("dnb-edge") is not None


def test_what_a_power_cut_left_is_swept_away(machine, checkout):
    """Killed in the middle: the old release still runs, and the next installation removes the half one."""
    machine.install(checkout(version="1.0"))
    first = machine.current
    waits = statement(f"open({str(machine.root / 'run/reached')!r}, 'w').close(); time.sleep(120)")
    process = machine.begin(checkout(version="1.1", middle=waits))
    wait_for(machine.root / "run/reached")
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    for pid in left_behind(machine):
        os.kill(pid, signal.SIGKILL)
    assert machine.current == first
    (half,) = set(machine.releases) - {first.name}
    done = machine.install(checkout(version="1.2"))
    assert done.returncode == 0, done.stderr
    assert half not in machine.releases
    assert machine.current.name.startswith("1.2-")


def test_a_dry_run_says_what_it_would_do_and_does_nothing(machine, checkout):
    """Not even a log or a lock."""
    before = machine.tree()
    done = machine.install(checkout(), "--dry-run", "--take-home")
    assert done.returncode == 0, done.stderr
    assert "would write /etc/systemd/system/dnb-edge.service" in done.stdout
    assert "would set up --take-home" in done.stdout
    assert machine.tree() == before
    assert not (machine.root / "var/log").exists()
    assert not machine.opt.exists()


def left_behind(machine):
    """Processes that still build a release of this machine."""
    found = []
    for at in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            if f"{machine.opt}/releases".encode() in at.read_bytes() and b"service" not in at.read_bytes():
                words = at.read_bytes().split(b"\0")
                if b"pip" in words or any(word.endswith(b".py") for word in words):
                    found.append(int(at.parent.name))
    return found
