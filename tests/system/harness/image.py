"""The guest's disk: a Debian made by mmdebstrap, dnb-edge installed in it by its own install.sh, written by `mke2fs -d`.

Two steps, each kept under build/system-test/: a clean Debian and one on which dnb-edge was installed, which change seldom; and
this checkout, to which that one is upgraded, all the time. Nothing is mounted. Needs root. Knows no virtual machine.
"""

from __future__ import annotations

import fcntl
import hashlib
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
WHEELS = "/wheels"
DEBS = "/srv/debs"
REPOSITORY = "/srv/dnb-edge.git"
"""In the guest: where the package is installed, what it was installed from, and what only tests import; wheels of all that it
stands on, Debian packages that install.sh asks for, and on a clean one this checkout as git has it."""

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


def image(suite: recipe.Suite = recipe.TRIXIE, *, clean: bool = False) -> Image:
    """The image of this checkout, built where it is not cached. Raises `BuildFailed` where it cannot be.

    A `clean` one has only what somebody finds who is about to install dnb-edge.
    `DNB_EDGE_SYSTEM_IMAGE` names the folder of an older one to take as it is, while the package under it is being worked on.
    """
    chosen = os.environ.get("DNB_EDGE_SYSTEM_IMAGE") if suite == recipe.TRIXIE and not clean else None
    kind = f"image-{suite.name}{'-clean' if clean else ''}"
    folder = Path(chosen).resolve() if chosen else recipe.CACHE / f"{kind}-{recipe.package_key(suite)}"
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
            _remove_unused(f"{kind}-[0-9a-f]*")
            _build(made, suite, clean=clean)
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


def _build(made: Image, suite: recipe.Suite, *, clean: bool) -> None:
    recipe.CACHE.mkdir(parents=True, exist_ok=True)
    if not made.key.exists():
        _run("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", made.key)
    base = _base(suite, made.key)
    shutil.rmtree(made.folder, ignore_errors=True)
    made.folder.mkdir()
    begun_s = time.monotonic()
    tree = base / ("clean" if clean else "installed")
    if clean:
        _publish(tree)
    else:
        _install_package(tree)
    for name, to in (("vmlinuz", made.kernel), ("initrd.img", made.initrd)):
        (at,) = tree.glob(f"boot/{name}-*")
        shutil.copy(at, to)
    _run("mke2fs", "-q", "-t", "ext4", "-d", tree, "-L", "root", "-m", "0", made.disk, SIZE)
    (made.folder / "done").touch()
    what = "a clean disk" if clean else "dnb-edge installed and the disk"
    log.info("image: %s of Debian %s written in %.0f s", what, suite.name, time.monotonic() - begun_s)


def _base(suite: recipe.Suite, key: Path) -> Path:
    """Two folders: a `clean` Debian, and the same with dnb-edge `installed`."""
    base = recipe.CACHE / f"base-{suite.name}-{recipe.base_key(suite)}"
    if (base / "done").exists():
        return base
    for old in (*recipe.CACHE.glob(f"base-{suite.name}-*"), *recipe.CACHE.glob("base-????????????")):
        shutil.rmtree(old)
    if (reason := _no_network(suite)) is not None:
        raise BuildFailed(reason)
    begun_s = time.monotonic()
    log.info("image: making a Debian %s with mmdebstrap; %s has the details", suite.name, _log_file())
    base.mkdir()
    clean, installed = base / "clean", base / "installed"
    _debootstrap(suite, clean)
    made_s = time.monotonic()
    _settle_in(clean, key)
    _archive(clean)
    _fetch_wheels(suite, clean / WHEELS.lstrip("/"))
    fetched_s = time.monotonic()
    _run("cp", "-a", clean, installed)
    _install_package(installed)
    offline = ("install", "--quiet", "--no-index", "--find-links", WHEELS, "-c", f"{SOURCE}/constraints.txt")
    _chroot(installed, f"{VENV}/bin/pip", *offline, "--target", TEST_SITE, *recipe.TEST_PACKAGES)
    (base / "done").touch()
    log.info(
        "image: mmdebstrap %.0f s, wheels %.0f s, install.sh %.0f s",
        made_s - begun_s,
        fetched_s - made_s,
        time.monotonic() - fetched_s,
    )
    return base


def _no_network(suite: recipe.Suite) -> str | None:
    at = f"{recipe.MIRROR}/dists/{suite.name}/InRelease"
    try:
        with urllib.request.urlopen(at, timeout=30):
            return None
    except OSError as error:
        return f"needs the network once, to build the guest's image, and there is none cached: {at}: {error}"


def _fetch_wheels(suite: recipe.Suite, folder: Path) -> None:
    """Wheels for the guest's Python of everything that dnb-edge needs, as constraints.txt pins it."""
    pip = (sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "-d", folder)
    pins = ("-c", recipe.REPOSITORY / "constraints.txt")
    platforms = [word for platform in recipe.PLATFORMS for word in ("--platform", platform)]
    # That one has no wheels; install.sh takes Debian's.
    wanted = [name for name in recipe.requirements() if not name.startswith("systemd-python")]
    _run(*pip, *pins, "--only-binary=:all:", "--python-version", suite.python, *platforms, *wanted,
         *recipe.TEST_PACKAGES, "setuptools>=77", "wheel")  # fmt: skip


def _debootstrap(suite: recipe.Suite, tree: Path) -> None:
    packages = ",".join((*recipe.SYSTEM, *suite.cameras))
    early = tree.with_suffix(".early")
    # Before the kernel's own package makes the initial ram disk.
    (early / "conf.d").mkdir(parents=True, exist_ok=True)
    (early / "conf.d" / "guest").write_text("MODULES=list\nCOMPRESS=zstd\n")
    (early / "modules").write_text("\n".join(recipe.FIRST_MODULES) + "\n")
    without = ("man", "doc", "locale")
    download = f"apt-get --yes --no-install-recommends --download-only install {' '.join(recipe.DEBS)}"
    _run(
        "mmdebstrap", "--variant=minbase", "--mode=root", f"--include={packages}", "--keyring=/usr/share/keyrings",
        *(f"--dpkgopt=path-exclude=/usr/share/{name}/*" for name in without),
        f'--essential-hook=mkdir -p "$1/etc/initramfs-tools" && cp -r {early}/. "$1/etc/initramfs-tools/"',
        f'--customize-hook=rm -f "$1"/var/cache/apt/archives/*.deb && APT_CONFIG="$MMDEBSTRAP_APT_CONFIG" {download} &&'
        f' mkdir -p "$1{DEBS}" && mv "$1"/var/cache/apt/archives/*.deb "$1{DEBS}"',
        '--customize-hook=rm -rf "$1"/var/cache/apt/* "$1"/var/lib/apt/lists/*',
        suite.name, tree, recipe.MIRROR,
    )  # fmt: skip
    shutil.rmtree(early)


def _archive(tree: Path) -> None:
    """Makes the folder of Debian packages an archive, and the only one that the guest's apt knows."""
    entries = []
    for deb in sorted((tree / DEBS.lstrip("/")).glob("*.deb")):
        fields = subprocess.run(["dpkg-deb", "-f", deb], capture_output=True, text=True, check=True).stdout
        digest = hashlib.sha256(deb.read_bytes()).hexdigest()
        entries.append(f"{fields}Filename: ./{deb.name}\nSize: {deb.stat().st_size}\nSHA256: {digest}\n")
    (tree / DEBS.lstrip("/") / "Packages").write_text("\n".join(entries))
    (tree / "etc/apt/sources.list").write_text(f"deb [trusted=yes] file:{DEBS} ./\n")
    (tree / "etc/apt/apt.conf.d/90guest").write_text('Acquire::Languages "none";\n')


def _publish(tree: Path) -> None:
    """This checkout as a repository that git clones: the guest has no network."""
    at = tree / REPOSITORY.lstrip("/")
    shutil.rmtree(at, ignore_errors=True)
    shutil.rmtree(tree / SOURCE.lstrip("/"), ignore_errors=True)
    work = at.with_suffix(".work")
    _copy_package(work)
    git = ("git", "-C", work, "-c", "user.name=Test", "-c", "user.email=test@example.org")
    _run(*git, "init", "--quiet", "--initial-branch=main")
    _run(*git, "add", "--all", "--force")
    _run(*git, "commit", "--quiet", "-m", "As it is")
    _run("git", "clone", "--quiet", "--bare", work, at)
    shutil.rmtree(work)


def _copy_package(to: Path) -> None:
    shutil.rmtree(to, ignore_errors=True)
    for file in recipe.package_files():
        at = to / file.relative_to(recipe.REPOSITORY)
        at.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, at)


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
    """dnb-edge by its own install.sh, without a network; a configuration is each test's own."""
    _copy_package(tree / SOURCE.lstrip("/"))
    _chroot(tree, f"{SOURCE}/install.sh", "--wheels", WHEELS, "--no-start")
    # Emulated processors are slow: a test of the pages switches them on.
    _chroot(tree, "systemctl", "--quiet", "disable", "dnb-edge-web")


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
