"""The whole appliance on a Raspberry Pi's processor, emulated, installed as a user would: `dnb-edge demo` there and here.

Not a test of `make test`: it needs Linux, root, the network and Debian's `mmdebstrap` and `qemu-user-static`; where one is
missing it says so and ends well. `make aarch64-check` runs it. A Debian 13 for arm64, the base of Raspberry Pi OS today, is
unpacked into build/ and kept there, and this checkout is installed in it by its own install.sh: what it lacks from Debian, the
rest from pip, then an upgrade each time. The first time takes half an hour on two cores, later ones ten minutes.

Pictures, detector, core, recording and report run there. Lap times must agree within 0.1 ms, similarity within 0.1 of a point.
They are not equal to the bit: the detector's windows are placed by what it found, and so every last digit comes round again.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve()
REPOSITORY = HERE.parents[2]
LIMIT_S = 0.0001
LIMIT_POINTS = 0.1
SUITE = "trixie"
PACKAGES = "python3,ca-certificates,systemd"
"""A small system that starts with systemd; install.sh gets itself what it lacks."""
QEMU = Path("/usr/bin/qemu-aarch64-static")
PROCESSOR = "cortex-a72"
"""A Raspberry Pi 4's."""
BINFMT = Path("/proc/sys/fs/binfmt_misc")
MAGIC = (
    r":qemu-aarch64:M::\x7f\x45\x4c\x46\x02\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x02\x00\xb7\x00"
    r":\xff\xff\xff\xff\xff\xff\xff\x00\xff\xff\xff\xff\xff\xff\xff\xff\xfe\xff\xff\xff:"
)
"""The first bytes of an aarch64 program, as qemu's own binfmt.d file has them."""
CERTIFICATES = Path("/etc/ssl/certs/ca-certificates.crt")
PASSED_ON = ("http_proxy", "https_proxy", "no_proxy", "HTTP_PROXY", "HTTPS_PROXY", "NO_PROXY", "PIP_INDEX_URL")


def cannot() -> str | None:
    """Why this machine cannot do it; None where it can."""
    if platform.system() != "Linux" or platform.machine() != "x86_64":
        return f"an x86-64 Linux is needed, this is {platform.system()} on {platform.machine()}"
    if os.geteuid() != 0:
        return "chroot needs root: sudo make aarch64-check"
    for tool in ("mmdebstrap", str(QEMU)):
        if shutil.which(tool) is None:
            return f"{tool} is missing: apt-get install mmdebstrap qemu-user-static"
    return None


@contextmanager
def emulation() -> Iterator[None]:
    """The kernel starts aarch64 programs by qemu meanwhile; what was registered here goes again at the end."""
    if not (BINFMT / "register").exists():
        run(["mount", "-t", "binfmt_misc", "binfmt_misc", str(BINFMT)])
    entry = BINFMT / "qemu-aarch64"
    ours = not entry.exists()
    if ours:
        (BINFMT / "register").write_text(f"{MAGIC}{QEMU}:OPF")
    try:
        yield
    finally:
        if ours:
            entry.write_text("-1")


def run(words: list[str], **more: Any) -> subprocess.CompletedProcess[str]:
    """Runs a command; ends with its name and its last words where it fails."""
    done = subprocess.run(words, check=False, text=True, **more)
    if done.returncode != 0:
        sys.exit(f"{' '.join(words[:4])} ... failed with exit code {done.returncode}\n{(done.stderr or '')[-2000:]}")
    return done


def guest(root: Path, words: list[str], **more: Any) -> subprocess.CompletedProcess[str]:
    """Runs a command in the guest, with /proc for its length."""
    environment = {name: os.environ[name] for name in PASSED_ON if name in os.environ}
    environment |= {
        "HOME": "/root",
        "PATH": "/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
        "LANG": "C.UTF-8",
        "QEMU_CPU": PROCESSOR,
    }
    environment |= {"PIP_CERT": "/etc/ssl/certs/pip.crt", "PIP_DEFAULT_TIMEOUT": "180", "OMP_NUM_THREADS": "1"}
    run(["mount", "-t", "proc", "proc", str(root / "proc")])
    try:
        return run(["chroot", str(root), *words], env=environment, **more)
    finally:
        run(["umount", str(root / "proc")])


def build(root: Path) -> None:
    """Debian with Python and a compiler in `root`; about four minutes and 400 MB."""
    partial = root.with_name(root.name + ".part")
    shutil.rmtree(partial, ignore_errors=True)
    words = ["mmdebstrap", "--mode=root", "--arch=arm64", "--variant=minbase", f"--include={PACKAGES}"]
    words += [f"--dpkgopt=path-exclude=/usr/share/{name}/*" for name in ("man", "locale", "doc")]
    run([*words, SUITE, str(partial), "http://deb.debian.org/debian"])
    partial.rename(root)


def install(root: Path) -> None:
    """This checkout, by its own install.sh; where the pins are the same it is an upgrade of what is there."""
    source = root / "src"
    shutil.rmtree(source, ignore_errors=True)
    source.mkdir()
    for name in ("pyproject.toml", "constraints.txt", "README.md", "LICENSE", "install.sh"):
        shutil.copy(REPOSITORY / name, source)
    for name in ("dnb_edge", "systemd"):
        shutil.copytree(REPOSITORY / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(os.environ.get("PIP_CERT", CERTIFICATES), root / "etc/ssl/certs/pip.crt")
    shutil.copy("/etc/resolv.conf", root / "etc/resolv.conf")
    guest(root, ["/src/install.sh", "--no-start"])
    for unit in ("dnb-edge", "dnb-edge-web"):
        guest(root, ["systemctl", "is-enabled", unit], stdout=subprocess.DEVNULL)


def laps_of(lines: str) -> list[dict[str, Any]]:
    """The laps in what `demo --json` printed."""
    events = [json.loads(line) for line in lines.splitlines()]
    return [event for event in events if event["event"] == "lap"]


def compare(here: list[dict[str, Any]], there: list[dict[str, Any]]) -> dict[str, Any]:
    """How far the laps are apart; another number of them, or another verdict, is infinitely far."""
    alike = [(one["number"], one["valid"], one["reasons"]) for one in here]
    equal = bool(here) and alike == [(one["number"], one["valid"], one["reasons"]) for one in there]
    pairs = list(zip(here, there, strict=False))
    apart_s = max((abs(a["time_s"] - b["time_s"]) for a, b in pairs), default=0.0)
    apart_points = max((abs(a["similarity_percent"] - b["similarity_percent"]) for a, b in pairs), default=0.0)
    return {
        "laps": len(here),
        "equal": equal,
        "time_s": [one["time_s"] for one in here],
        "time_there_s": [one["time_s"] for one in there],
        "largest_time_difference_s": apart_s if equal else float("inf"),
        "largest_similarity_difference": apart_points if equal else float("inf"),
    }


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(
        description="Install and race on aarch64, emulated, and compare with this processor."
    )
    parser.add_argument(
        "--root", type=Path, default=REPOSITORY / "build/aarch64-box", help="its folder; made if absent"
    )
    parser.add_argument("--laps", type=int, default=1)
    given = parser.parse_args()
    why_not = cannot()
    if why_not is not None:
        print(f"skipped: {why_not}")
        return
    root: Path = given.root.resolve()
    root.parent.mkdir(parents=True, exist_ok=True)
    demo = ["demo", "--laps", str(given.laps), "--fast", "--json", "--out"]
    with emulation(), tempfile.TemporaryDirectory() as scratch:
        if not root.exists():
            build(root)
        install(root)
        here = run(
            [sys.executable, "-m", "dnb_edge", *demo, scratch], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        started_s = time.monotonic()
        there = guest(root, ["dnb-edge", *demo, "/tmp/demo"], capture_output=True)
    figures = compare(laps_of(here.stdout), laps_of(there.stdout))
    print(json.dumps({"processor": PROCESSOR, "took_s": round(time.monotonic() - started_s), **figures}))
    far = figures["largest_time_difference_s"] > LIMIT_S or figures["largest_similarity_difference"] > LIMIT_POINTS
    sys.exit(f"differs by more than {LIMIT_S} s or {LIMIT_POINTS} points" if far else 0)


if __name__ == "__main__":
    main()
