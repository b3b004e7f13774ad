"""The guest's disk: a Debian made by mmdebstrap, dnb-edge installed in it as systemd/README.md says, written by `mke2fs -d`.

Two steps, each kept under build/system-test/: the Debian with all that dnb-edge needs, which changes seldom, and dnb-edge,
which changes all the time. Nothing is mounted. Needs root. Knows no virtual machine.
"""

from __future__ import annotations

import fcntl
import logging
import os
import shutil
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from harness import recipe

SIZE = "4G"
VENV = "/opt/dnb-edge/venv"
SOURCE = "/usr/src/dnb-edge"
TEST_SITE = "/opt/test-site"
"""In the guest: where the package is installed, what it was installed from, and what only tests import."""

_ENVIRONMENT = {
    "PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
    "HOME": "/root",
    "LC_ALL": "C.UTF-8",
}
_UNWANTED = ("apt-daily.timer", "apt-daily-upgrade.timer", "dpkg-db-backup.timer", "e2scrub_all.timer",
             "e2scrub_reap.service", "fstrim.timer", "man-db.timer", "systemd-pstore.service")  # fmt: skip
"""Services that only cost an emulated machine time."""

_USED: list[TextIO] = []
"""Open files whose locks hold other processes off the images that this one uses."""

log = logging.getLogger("system-test")


@dataclass(frozen=True, slots=True, kw_only=True)
class Image:
    """A disk to boot from; never written to: guests run on overlays over it."""

    folder: Path
    """Holds the three below, and whatever else belongs to exactly this image."""
    disk: Path
    kernel: Path
    initrd: Path
    key: Path
    """The private key that root's ssh in the guest takes."""


def obstacle() -> str | None:
    """Why no guest can be built or run on this machine; None where it can."""
    if os.geteuid() != 0:
        return "needs root, to build the guest's file system: run `sudo make system-test`"
    if not sys.platform.startswith("linux"):
        return "needs Linux"
    wanted = {
        "qemu-system-x86_64": "qemu-system-x86",
        "qemu-img": "qemu-utils",
        "mmdebstrap": "mmdebstrap",
        "mke2fs": "e2fsprogs",
        "ssh": "openssh-client",
        "setpriv": "util-linux",
        "ssh-keygen": "openssh-client",
    }
    missing = [package for program, package in wanted.items() if shutil.which(program) is None]
    if missing:
        return f"needs programs that are not here: apt install {' '.join(dict.fromkeys(missing))}"
    return None


def image() -> Image:
    """The image of this checkout, built where it is not cached. Raises `BuildFailed` where it cannot be.

    `DNB_EDGE_SYSTEM_IMAGE` names the folder of an older one to take as it is, while the package under it is being worked on.
    """
    chosen = os.environ.get("DNB_EDGE_SYSTEM_IMAGE")
    folder = Path(chosen).resolve() if chosen else recipe.CACHE / f"image-{recipe.package_key()}"
    made = Image(
        folder=folder,
        disk=folder / "disk.img",
        kernel=folder / "vmlinuz",
        initrd=folder / "initrd.img",
        key=recipe.CACHE / "ssh-key",
    )
    _use(folder)
    with alone():
        if not (folder / "done").exists():
            _build(made)
    return made


@contextmanager
def alone() -> Iterator[None]:
    """Only one process at a time makes things under build/system-test/; others wait here."""
    recipe.CACHE.mkdir(parents=True, exist_ok=True)
    with (recipe.CACHE / "lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _use(folder: Path) -> None:
    """Says, as long as this process lives, that an image is in use."""
    recipe.CACHE.mkdir(parents=True, exist_ok=True)
    file = folder.with_suffix(".used").open("w")
    fcntl.flock(file, fcntl.LOCK_SH)
    _USED.append(file)


def _remove_unused(pattern: str) -> None:
    for used in recipe.CACHE.glob(pattern + ".used"):
        with used.open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            shutil.rmtree(used.with_suffix(""), ignore_errors=True)
            used.unlink()


class BuildFailed(Exception):
    """The image could not be built; says which command failed and where its output is."""


def _build(made: Image) -> None:
    recipe.CACHE.mkdir(parents=True, exist_ok=True)
    if not made.key.exists():
        _run("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", made.key)
    tree = _base(made.key)
    _remove_unused("image-*")
    shutil.rmtree(made.folder, ignore_errors=True)
    made.folder.mkdir()
    begun_s = time.monotonic()
    _install_package(tree)
    for name, to in (("vmlinuz", made.kernel), ("initrd.img", made.initrd)):
        (at,) = tree.glob(f"boot/{name}-*")
        shutil.copy(at, to)
    _run("mke2fs", "-q", "-t", "ext4", "-d", tree, "-L", "root", "-m", "0", made.disk, SIZE)
    (made.folder / "done").touch()
    log.info("image: dnb-edge installed and the disk written in %.0f s", time.monotonic() - begun_s)


def _base(key: Path) -> Path:
    """The Debian as a folder, with everything that dnb-edge needs."""
    tree = recipe.CACHE / f"base-{recipe.base_key()}"
    if (tree / "done").exists():
        return tree
    for old in recipe.CACHE.glob("base-*"):
        shutil.rmtree(old)
    if (reason := _no_network()) is not None:
        raise BuildFailed(reason)
    begun_s = time.monotonic()
    log.info("image: making a Debian %s with mmdebstrap; %s has the details", recipe.SUITE, _log_file())
    wheels = recipe.CACHE / "wheels"
    _fetch_wheels(wheels)
    fetched_s = time.monotonic()
    _debootstrap(tree)
    made_s = time.monotonic()
    _settle_in(tree, key)
    shutil.copytree(wheels, tree / "wheels")
    pip = f"{VENV}/bin/pip"
    # As "make VENV_FLAGS=--system-site-packages": libcamera's bindings come from apt.
    _chroot(tree, "python3", "-m", "venv", "--system-site-packages", VENV)
    shutil.copy(recipe.REPOSITORY / "constraints.txt", tree / "wheels")
    offline = ("install", "--quiet", "--no-index", "--find-links", "/wheels", "-c", "/wheels/constraints.txt")
    _chroot(tree, pip, *offline, "--ignore-installed", *recipe.requirements())
    _chroot(tree, pip, *offline, "--target", TEST_SITE, *recipe.TEST_PACKAGES)
    (tree / "done").touch()
    log.info(
        "image: wheels %.0f s, mmdebstrap %.0f s, installing them %.0f s",
        fetched_s - begun_s,
        made_s - fetched_s,
        time.monotonic() - made_s,
    )
    return tree


def _no_network() -> str | None:
    at = f"{recipe.MIRROR}/dists/{recipe.SUITE}/InRelease"
    try:
        with urllib.request.urlopen(at, timeout=30):
            return None
    except OSError as error:
        return f"needs the network once, to build the guest's image, and there is none cached: {at}: {error}"


def _fetch_wheels(folder: Path) -> None:
    """Wheels for the guest's Python of everything that dnb-edge needs, as constraints.txt pins it."""
    shutil.rmtree(folder, ignore_errors=True)
    pip = (sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "-d", folder)
    pins = ("-c", recipe.REPOSITORY / "constraints.txt")
    platforms = [word for platform in recipe.PLATFORMS for word in ("--platform", platform)]
    wanted = [name for name in recipe.requirements() if not name.startswith("systemd-python")]
    _run(*pip, *pins, "--only-binary=:all:", "--python-version", recipe.PYTHON, *platforms, *wanted,
         *recipe.TEST_PACKAGES, "setuptools>=77", "wheel")  # fmt: skip
    # This one has no wheels: it is compiled in the guest's own Debian.
    _run(*pip, *pins, "--no-deps", "--no-binary=:all:", "systemd-python")


def _debootstrap(tree: Path) -> None:
    packages = ",".join((*recipe.SYSTEM, *recipe.AS_THE_README_SAYS, *recipe.CAMERAS))
    early = tree.with_suffix(".early")
    # Before the kernel's own package makes the initial ram disk.
    (early / "conf.d").mkdir(parents=True, exist_ok=True)
    (early / "conf.d" / "guest").write_text("MODULES=list\nCOMPRESS=zstd\n")
    (early / "modules").write_text("\n".join(recipe.FIRST_MODULES) + "\n")
    without = ("man", "doc", "locale")
    _run(
        "mmdebstrap", "--variant=minbase", "--mode=root", f"--include={packages}", "--keyring=/usr/share/keyrings",
        *(f"--dpkgopt=path-exclude=/usr/share/{name}/*" for name in without),
        f'--essential-hook=mkdir -p "$1/etc/initramfs-tools" && cp -r {early}/. "$1/etc/initramfs-tools/"',
        '--customize-hook=rm -rf "$1"/var/cache/apt/* "$1"/var/lib/apt/lists/*',
        recipe.SUITE, tree, recipe.MIRROR,
    )  # fmt: skip
    shutil.rmtree(early)


def _settle_in(tree: Path, key: Path) -> None:
    """Name, disk, network, ssh: what an installer would ask for."""
    texts = {
        "etc/hostname": "trackside\n",
        "etc/hosts": "127.0.0.1 localhost trackside\n",
        "etc/fstab": "LABEL=root / ext4 defaults,errors=remount-ro 0 1\n",
        "etc/systemd/network/80-dhcp.network": "[Match]\nName=eth*\n[Network]\nDHCP=yes\n",
        "etc/ssh/sshd_config.d/guest.conf": "UseDNS no\nUsePAM no\n",
        "root/.ssh/authorized_keys": key.with_suffix(".pub").read_text(),
    }
    for name, text in texts.items():
        at = tree / name
        at.parent.mkdir(parents=True, exist_ok=True)
        at.write_text(text)
    (tree / "root/.ssh").chmod(0o700)
    (tree / "var/log/journal").mkdir(exist_ok=True)
    _chroot(tree, "systemctl", "--quiet", "enable", "systemd-networkd", "ssh")
    _chroot(tree, "systemctl", "--quiet", "mask", *_UNWANTED)


def _install_package(tree: Path) -> None:
    """dnb-edge, by the lines of systemd/README.md; a configuration is each test's own."""
    source = tree / SOURCE.lstrip("/")
    shutil.rmtree(source, ignore_errors=True)
    for file in recipe.package_files():
        to = source / file.relative_to(recipe.REPOSITORY)
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, to)
    pip = f"{VENV}/bin/pip"
    offline = ("--quiet", "--no-index", "--find-links", "/wheels", "-c", f"{SOURCE}/constraints.txt")
    _chroot(tree, pip, "install", *offline, "--force-reinstall", "--no-deps", SOURCE)
    _chroot(tree, pip, "install", *offline, SOURCE)
    shutil.rmtree(source / "build", ignore_errors=True)
    _chroot(
        tree,
        "install",
        "-D",
        "-m",
        "644",
        f"{SOURCE}/systemd/dnb-edge.sysusers.conf",
        "/usr/lib/sysusers.d/dnb-edge.conf",
    )
    _chroot(tree, "systemd-sysusers", "dnb-edge.conf")
    _chroot(tree, "install", "-m", "644", f"{SOURCE}/systemd/dnb-edge.service", "/etc/systemd/system/")
    _chroot(tree, "systemctl", "--quiet", "enable", "dnb-edge")


def _chroot(tree: Path, *words: str) -> None:
    _run("chroot", tree, *words, environment=_ENVIRONMENT)


def _log_file() -> Path:
    return recipe.CACHE / "image.log"


def _run(*words: str | Path, environment: dict[str, str] | None = None) -> None:
    with _log_file().open("ab") as output:
        output.write(f"\n$ {' '.join(map(str, words))}\n".encode())
        output.flush()
        done = subprocess.run(
            [str(word) for word in words],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            env=environment,
            check=False,
        )
    if done.returncode != 0:
        raise BuildFailed(f"{words[0]} failed with {done.returncode}; the end of {_log_file()} says why")
