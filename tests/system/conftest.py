"""Fixtures of the system tests: the image, and guests made from it. They run only when named: `make system-test`."""

import logging
import re
import shutil
from pathlib import Path

import pytest
from harness import reel
from harness.appliance import Appliance
from harness.guest import Guest, GuestFault
from harness.image import BuildFailed, image, obstacle
from harness.recipe import CACHE
from harness.webcam import Webcam

HERE = Path(__file__).parent

log = logging.getLogger("system-test")


def pytest_ignore_collect(collection_path, config):
    """`make test` and a plain `pytest` leave this folder out: it takes many minutes and root."""
    named = any(Path(word.split("::")[0]).resolve().is_relative_to(HERE) for word in config.args)
    return None if named or not collection_path.is_relative_to(HERE) else True


@pytest.fixture(scope="session")
def system_image():
    """The guest's image with this checkout's dnb-edge installed; skips where this machine cannot have one."""
    if (reason := obstacle()) is not None:
        pytest.skip(f"a virtual machine {reason}")
    try:
        return image()
    except BuildFailed as failed:
        if "needs the network" in str(failed):
            pytest.skip(f"a virtual machine {failed}")
        raise


@pytest.fixture
def logs(request):
    """build/system-test/logs/TEST/: console, qemu's words, the journal; whatever a test wants to leave for people."""
    folder = CACHE / "logs" / re.sub(r"[^\w.-]+", "-", request.node.name).strip("-")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


@pytest.fixture
def guest(system_image, logs):
    """A running guest with the package in, its unit stopped, a disk of its own; woken from a booted one in seconds."""
    awake = Guest.woken(system_image, logs)
    yield awake
    _end(awake)


@pytest.fixture
def boot_guest(system_image, logs):
    """`boot_guest(**settings)` boots a guest from cold, settings as for `Guest`; several in a test are fine."""
    booted = []

    def boot(**settings):
        booted.append(Guest(system_image, logs, **settings))
        booted[-1].boot()
        return booted[-1]

    yield boot
    for one in booted:
        _end(one)


@pytest.fixture
def webcam():
    """A USB webcam over the simulated oval, not yet plugged in: `webcam.plug(guest)`."""
    camera = Webcam(reel.pictures)
    yield camera
    camera.close()


@pytest.fixture
def appliance(guest):
    """The appliance in `guest`, not yet configured, its display connected."""
    service = Appliance(guest)
    yield service
    service.display.close()


def _end(guest):
    try:
        if guest.running:
            (guest.logs / "journal.txt").write_text(
                guest.run("journalctl -b -o short-monotonic --no-pager", check=False)
            )
    except GuestFault as fault:
        log.warning("no journal: %s", fault)
    finally:
        guest.close()
