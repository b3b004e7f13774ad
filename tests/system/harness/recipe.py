"""What the guest is made of, and a key that changes whenever that does.

Knows names, versions and files. Knows no command: `image` builds by it.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Iterable
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[3]
CACHE = REPOSITORY / "build" / "system-test"

EDITION = 1
"""To be raised when `image` makes the Debian in another way."""
SUITE = "trixie"
"""Debian 13, the base of today's Raspberry Pi OS."""
MIRROR = "http://deb.debian.org/debian"
PYTHON = "3.13"
"""That suite's own."""

SYSTEM = (
    "linux-image-amd64", "systemd-sysv", "udev", "dbus", "kmod", "iproute2", "procps", "psmisc", "openssh-server", "zstd",
    "e2fsprogs", "libcap2-bin",
)  # fmt: skip
AS_THE_README_SAYS = ("python3-venv", "python3-dev", "gcc", "libc6-dev", "pkg-config", "libsystemd-dev")
"""What systemd/README.md has its reader install before dnb-edge itself."""
CAMERAS = ("v4l-utils", "usbip", "python3-libcamera", "libcamera-ipa")
FIRST_MODULES = ("virtio_pci", "virtio_blk", "virtio_net", "ext4", "crc32c_generic", "overlay")
"""What the kernel needs before it sees its disk."""
TEST_PACKAGES = ("pytest", "hypothesis")
"""For those tests of the package that also run in the guest."""

PLATFORMS = ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_24_x86_64", "manylinux_2_17_x86_64",
             "manylinux2014_x86_64")  # fmt: skip

PACKAGE = ("dnb_edge", "systemd", "pyproject.toml", "constraints.txt", "README.md", "LICENSE")
"""Of the repository, what is carried into the guest and installed there."""
TESTS = ("tests/capture", "tests/conftest.py", "pyproject.toml")


def requirements() -> list[str]:
    """What dnb-edge runs on, as its pyproject.toml says."""
    with (REPOSITORY / "pyproject.toml").open("rb") as file:
        return list(tomllib.load(file)["project"]["dependencies"])


def base_key() -> str:
    """Of the Debian with everything but dnb-edge itself."""
    made_of = (
        EDITION,
        SUITE,
        MIRROR,
        SYSTEM,
        AS_THE_README_SAYS,
        CAMERAS,
        FIRST_MODULES,
        TEST_PACKAGES,
        requirements(),
    )
    return _digest([REPOSITORY / "constraints.txt"], repr(made_of))


def package_key() -> str:
    """Of that with this checkout's dnb-edge installed."""
    return _digest(sorted(package_files()), base_key())


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
