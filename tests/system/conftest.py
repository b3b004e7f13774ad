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
from harness.recipe import BOOKWORM, CACHE, TRIXIE
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
    return _image_or_skip(TRIXIE)


@pytest.fixture(scope="session")
def clean_image():
    """A Debian 13 as somebody finds it who is about to install dnb-edge, without a network: see `harness.image`."""
    return _image_or_skip(TRIXIE, clean=True)


@pytest.fixture(scope="session")
def older_image():
    """As `system_image`, with Debian 12."""
    return _image_or_skip(BOOKWORM)


def _image_or_skip(suite, *, clean=False):
    if (reason := obstacle()) is not None:
        pytest.skip(f"a virtual machine {reason}")
    try:
        return image(suite, clean=clean)
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
    yield from _boots(system_image, logs)


@pytest.fixture
def boot_clean_guest(clean_image, logs):
    """As `boot_guest`, with a Debian 13 that dnb-edge is not installed on."""
    yield from _boots(clean_image, logs)


@pytest.fixture
def boot_older_guest(older_image, logs):
    """As `boot_guest`, with Debian 12."""
    yield from _boots(older_image, logs)


def _boots(of, logs):
    booted = []

    def boot(**settings):
        booted.append(Guest(of, logs, **settings))
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
