"""What the guest is made of, and a key that changes whenever that does.

Knows names, versions and files. Knows no command: `image` builds by it.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[3]
CACHE = REPOSITORY / "build" / "system-test"

EDITION = 2
"""To be raised when `image` makes the Debian in another way."""
MIRROR = "http://deb.debian.org/debian"


@dataclass(frozen=True, slots=True, kw_only=True)
class Suite:
    """A Debian that dnb-edge is installed on."""

    name: str
    python: str
    """Its own Python."""
    cameras: tuple[str, ...]
    """Packages that play cameras, or speak to them."""


TRIXIE = Suite(name="trixie", python="3.13", cameras=("v4l-utils", "usbip", "python3-libcamera", "libcamera-ipa"))
"""Debian 13, the base of today's Raspberry Pi OS."""
BOOKWORM = Suite(name="bookworm", python="3.11", cameras=("v4l-utils", "usbip"))
"""Debian 12, the oldest that is supported."""

SYSTEM = (
    "linux-image-amd64", "systemd-sysv", "udev", "dbus", "kmod", "iproute2", "procps", "psmisc", "openssh-server", "zstd",
    "e2fsprogs", "libcap2-bin", "python3", "sudo", "git", "apt",
)  # fmt: skip
"""A plain Debian with a shell, as somebody finds it who installs dnb-edge."""
DEBS = ("python3-venv", "python3-systemd")
"""What install.sh asks apt for; they lie in the guest, which has no network, in an archive of its own."""
FIRST_MODULES = ("virtio_pci", "virtio_blk", "virtio_net", "ext4", "crc32c_generic", "overlay")
"""What the kernel needs before it sees its disk."""
TEST_PACKAGES = ("pytest", "hypothesis")
"""For those tests of the package that also run in the guest."""

PLATFORMS = ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_24_x86_64", "manylinux_2_17_x86_64",
             "manylinux2014_x86_64")  # fmt: skip

PACKAGE = ("dnb_edge", "systemd", "install.sh", "pyproject.toml", "constraints.txt", "README.md", "LICENSE")
"""Of the repository, what is carried into the guest and installed there."""
TESTS = ("tests/capture", "tests/conftest.py", "pyproject.toml")


def requirements() -> list[str]:
    """What dnb-edge runs on, as its pyproject.toml says."""
    with (REPOSITORY / "pyproject.toml").open("rb") as file:
        return list(tomllib.load(file)["project"]["dependencies"])


def base_key(suite: Suite) -> str:
    """Of the Debian with everything but dnb-edge itself."""
    made_of = (EDITION, suite, MIRROR, SYSTEM, DEBS, FIRST_MODULES, TEST_PACKAGES, requirements())
    return _digest([REPOSITORY / "constraints.txt"], repr(made_of))


def package_key(suite: Suite) -> str:
    """Of that with this checkout's dnb-edge installed."""
    return _digest(sorted(package_files()), base_key(suite))


def package_files() -> Iterable[Path]:
    """Every file of `PACKAGE` and `TESTS`, no caches."""
    for name in (*PACKAGE, *TESTS):
        at = REPOSITORY / name
        files = at.rglob("*") if at.is_dir() else [at]
        yield from (file for file in files if file.is_file() and "__pycache__" not in file.parts)


def _digest(files: Iterable[Path], more: str) -> str:
    digest = hashlib.sha256(more.encode())
    for file in files:
        digest.update(str(file.relative_to(REPOSITORY)).encode())
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:12]
