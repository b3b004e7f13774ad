"""One virtual machine: boot or wake it, run commands in it, cut its power. Plain emulation (TCG), which every machine can do.

Knows qemu, ssh and one image. Knows nothing of dnb-edge. KVM is never used, even where it is offered: on some hosts it answers
and then hangs.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import shlex
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Self

from harness.image import VENV, Image, alone

BOOT_S = 180.0
"""A cold boot takes 20 to 40 s on an idle machine with 2 cores; this is when we give up."""
HOST = "10.0.2.2"
"""This machine's loopback, as the guest sees it."""

log = logging.getLogger("system-test")


class GuestFault(AssertionError):
    """The guest did not do as it was told; says what, and what it answered."""


class Guest:
    """A running guest. `Guest.cold` boots one, `Guest.woken` wakes one that was put to sleep right after boot (seconds).

    Each has a fresh overlay over the image's disk, which dies with it; or `drive`, qemu's own words for another disk.
    """

    def __init__(
        self,
        image: Image,
        logs: Path,
        *,
        drive: Sequence[str] | None = None,
        extra: Sequence[str] = (),
        memory_mb: int = 1024,
    ) -> None:
        """`logs` gets console.log and qemu.log. `extra` goes to qemu's command line. Starts nothing yet."""
        self.image = image
        self.logs = logs
        logs.mkdir(parents=True, exist_ok=True)
        # Short, since the path of a Unix socket may have 107 characters only.
        self.folder = Path(tempfile.mkdtemp(prefix="guest-"))
        self.disk = self.folder / "disk.qcow2"
        self.display_socket = self.folder / "tty"
        """The other end of the guest's second serial port, /dev/ttyS1."""
        self._qmp = self.folder / "qmp"
        self._drive, self._extra, self._memory_mb = drive, extra, memory_mb
        self._process: subprocess.Popen[bytes] | None = None
        self._port = 0

    @classmethod
    def cold(cls, image: Image, logs: Path, **settings: Any) -> Self:
        """Boots from the power button; returns once ssh answers."""
        guest = cls(image, logs, **settings)
        guest.boot()
        return guest

    @classmethod
    def woken(cls, image: Image, logs: Path) -> Self:
        """Wakes a guest that was booted once for this image; its services run as they did then."""
        sleeper = image.folder / f"sleeper-{_machine_key()}"
        with alone():
            if not (sleeper / "done").exists():
                _put_to_sleep(cls(image, logs), sleeper)
        guest = cls(image, logs)
        guest.boot(sleeper)
        return guest

    def boot(self, sleeper: Path | None = None) -> None:
        """Starts the machine, or wakes `sleeper`. May be called again after `kill` or `power_off`: the disk is kept."""
        begun_s = time.monotonic()
        backing = self.image.disk if sleeper is None else sleeper / "disk.qcow2"
        if self._drive is None and not self.disk.exists():
            make_overlay(self.disk, backing)
        self._start(() if sleeper is None else ("-incoming", f"exec:cat {shlex.quote(str(sleeper / 'memory'))}"))
        self._wait_for_ssh()
        # A sleeper's clock is as old as it is; an emulated machine's may be off at boot, too.
        self.run(f"date --set=@{time.time():.3f} >/dev/null")
        log.info("guest: %s in %.1f s", "booted" if sleeper is None else "woken", time.monotonic() - begun_s)

    def run(self, command: str, *, timeout_s: float = 120.0, check: bool = True, stdin: bytes | None = None) -> str:
        """Runs a shell command as root; what it wrote to both outputs. Raises `GuestFault` where it fails, if `check`."""
        try:
            done = subprocess.run(
                [*self._ssh(), command],
                input=stdin, stdin=subprocess.DEVNULL if stdin is None else None,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=timeout_s, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired as late:
            said = (late.output or b"").decode(errors="replace")
            raise GuestFault(f"not done after {timeout_s:g} s: {command}\n{said}") from late
        said = done.stdout.decode(errors="replace")
        if check and done.returncode != 0:
            raise GuestFault(f"exit code {done.returncode}: {command}\n{said}")
        return said

    def start(self, command: str) -> subprocess.Popen[str]:
        """Starts a command whose output the caller reads line by line as it comes."""
        words = [*self._ssh(), command]
        return subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )

    @contextlib.contextmanager
    def forward(self, port: int) -> Iterator[int]:
        """A port of this machine's loopback that leads to the guest's own `port`, through ssh."""
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            here: int = probe.getsockname()[1]
        # A connection of its own: that of the commands belongs to whoever comes first.
        words = [*self._ssh()[:-1], "-o", "ControlPath=none", "-o", "ExitOnForwardFailure=yes", "-N", "-L"]
        line = subprocess.Popen(
            [*words, f"127.0.0.1:{here}:127.0.0.1:{port}", "root@127.0.0.1"], stdin=subprocess.DEVNULL
        )
        try:
            yield here
        finally:
            line.terminate()
            line.wait(10)

    def put(self, content: bytes | str, path: str) -> None:
        """Writes a file in the guest, with the folders that it needs."""
        data = content.encode() if isinstance(content, str) else content
        self.run(f"mkdir -p {shlex.quote(str(Path(path).parent))} && cat > {shlex.quote(path)}", stdin=data)

    def get(self, path: str, to: Path) -> Path:
        """Copies a file out of the guest."""
        to.write_bytes(self.get_output(f"cat {shlex.quote(path)}"))
        return to

    def get_output(self, command: str) -> bytes:
        """What a command writes to its standard output, byte for byte."""
        done = subprocess.run(
            [*self._ssh(), command], stdin=subprocess.DEVNULL, capture_output=True, timeout=120, check=False
        )
        if done.returncode != 0:
            raise GuestFault(f"exit code {done.returncode}: {command}\n{done.stderr.decode(errors='replace')}")
        return done.stdout

    def wait_for(self, command: str, *, timeout_s: float, every_s: float = 0.3) -> str:
        """Repeats a command until it succeeds; what it said then. Raises `GuestFault` after `timeout_s`."""
        deadline_s = time.monotonic() + timeout_s
        while True:
            done = subprocess.run([*self._ssh(), command], stdin=subprocess.DEVNULL, capture_output=True, check=False)
            if done.returncode == 0:
                return done.stdout.decode(errors="replace")
            if time.monotonic() > deadline_s:
                said = (done.stdout + done.stderr).decode(errors="replace")
                raise GuestFault(f"not so within {timeout_s:g} s: {command}\n{said}")
            time.sleep(every_s)

    def clock_s(self) -> float:
        """The guest's CLOCK_MONOTONIC now, seconds: the clock of frames' stamps."""
        return float(self.run("cut -d' ' -f1 /proc/uptime"))

    @property
    def processor_s(self) -> float:
        """How long this machine's processors have worked for it since it was switched on, seconds."""
        assert self._process is not None
        words = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")

    @property
    def running(self) -> bool:
        """Whether the machine is on."""
        return self._process is not None and self._process.poll() is None

    def kill(self) -> None:
        """The power is cut: qemu is killed, and what it had not written to its disk file is lost."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def power_off(self, *, timeout_s: float = 60.0) -> None:
        """An orderly shutdown."""
        assert self._process is not None
        self.run("systemctl poweroff", check=False)
        self._process.wait(timeout_s)
        self._process = None

    def close(self) -> None:
        """Ends the machine and removes its disk; the logs stay."""
        self.kill()
        shutil.rmtree(self.folder, ignore_errors=True)

    def monitor(self, command: str, **arguments: Any) -> Any:
        """One command of QEMU's machine protocol (QMP), such as `system_reset`; its answer."""
        with socket.socket(socket.AF_UNIX) as line:
            line.connect(str(self._qmp))
            file = line.makefile("rw")
            file.readline()
            for asked in ({"execute": "qmp_capabilities"}, {"execute": command, "arguments": arguments}):
                file.write(json.dumps(asked) + "\n")
                file.flush()
                # Events come in between.
                answer = next(told for told in map(json.loads, file) if "return" in told or "error" in told)
        if "error" in answer:
            raise GuestFault(f"qemu refuses {command}: {answer['error']['desc']}")
        return answer["return"]

    def _start(self, more: Sequence[str]) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self._port = probe.getsockname()[1]
        drive = self._drive or ("-drive", f"file={self.disk},if=virtio,format=qcow2,cache=none,discard=unmap")
        with (self.logs / "qemu.log").open("ab") as output:
            # The machine dies with this process, whatever ends it.
            words = [
                "setpriv",
                "--pdeathsig",
                "KILL",
                *_machine(self.image, self._memory_mb),
                *drive,
                *self._wires(),
                *self._extra,
                *more,
            ]
            # A session of its own: Ctrl-C is for pytest, which then ends the guest.
            self._process = subprocess.Popen(
                words, stdin=subprocess.DEVNULL, stdout=output, stderr=output, start_new_session=True
            )

    def _wires(self) -> list[str]:
        """The network, both serial ports and the monitor."""
        return [
            "-netdev", f"user,id=n0,hostfwd=tcp:127.0.0.1:{self._port}-:22", "-device", "virtio-net-pci,netdev=n0,romfile=",
            "-chardev", f"file,id=c0,path={self.logs / 'console.log'},append=on", "-serial", "chardev:c0",
            "-chardev", f"socket,id=c1,path={self.display_socket},server=on,wait=off", "-serial", "chardev:c1",
            "-qmp", f"unix:{self._qmp},server=on,wait=off",
        ]  # fmt: skip

    def _ssh(self) -> list[str]:
        options = {
            "StrictHostKeyChecking": "no", "UserKnownHostsFile": "/dev/null", "BatchMode": "yes", "ConnectTimeout": "10",
            "ControlMaster": "auto", "ControlPath": str(self.folder / "ssh-%p"), "ControlPersist": "60",
        }  # fmt: skip
        words = [word for name, value in options.items() for word in ("-o", f"{name}={value}")]
        return ["ssh", "-q", "-F", "none", "-i", str(self.image.key), "-p", str(self._port), *words, "root@127.0.0.1"]

    def _wait_for_ssh(self) -> None:
        deadline_s = time.monotonic() + BOOT_S
        assert self._process is not None
        while time.monotonic() < deadline_s:
            if self._process.poll() is not None:
                raise GuestFault(f"qemu ended with {self._process.returncode}: see {self.logs}/qemu.log")
            with contextlib.suppress(subprocess.TimeoutExpired):
                if subprocess.run([*self._ssh(), "true"], timeout=20, capture_output=True, check=False).returncode == 0:
                    return
            time.sleep(0.3)
        raise GuestFault(f"no ssh after {BOOT_S:g} s: see {self.logs}/console.log")


def make_overlay(path: Path, backing: Path) -> None:
    """A qcow2 file that holds what is written, over `backing`, which stays as it is."""
    kind = "qcow2" if backing.suffix == ".qcow2" else "raw"
    subprocess.run(
        ["qemu-img", "create", "-q", "-f", "qcow2", "-F", kind, "-b", str(backing), str(path)], check=True, timeout=60
    )


def _put_to_sleep(guest: Guest, folder: Path) -> None:
    """Boots `guest` and keeps its memory and its disk in `folder`: waking them is quicker than another boot."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    try:
        guest.boot()
        # The rest of the boot, once and for all. "degraded" is what the tests are to find out, not a reason to stop here.
        guest.run("systemctl stop dnb-edge; systemctl is-system-running --wait", check=False)
        # What the tests would wait for in each guest anew: drivers, and the appliance's libraries read from the disk.
        guest.run("modprobe -a vhci-hcd uvcvideo vivid && rmmod vivid")
        guest.run(
            f"{VENV}/bin/python -c 'import dnb_edge.cli.run, dnb_edge.capture.v4l2, dnb_edge.detect.markers' && sync"
        )
        guest.monitor("migrate", uri=f"exec:cat > {shlex.quote(str(folder / 'memory'))}")
        while (status := guest.monitor("query-migrate")["status"]) not in ("completed", "failed"):
            time.sleep(0.1)
        if status == "failed":
            raise GuestFault("qemu could not save the guest's memory")
        guest.monitor("quit")
        shutil.copy(guest.disk, folder / "disk.qcow2")
        (folder / "done").touch()
    finally:
        guest.close()


def _machine(image: Image, memory_mb: int) -> list[str]:
    # The processor's own counter is calibrated at boot, badly where the emulated machine has to share its host: lap times would
    # be off by that much. The HPET runs at the host's rate.
    kernel_words = (
        "clocksource=hpet root=/dev/vda rw console=ttyS0 quiet systemd.show_status=no net.ifnames=0 mitigations=off"
    )
    return [
        "qemu-system-x86_64", "-accel", "tcg,thread=multi,tb-size=256", "-cpu", "Nehalem", "-smp", "2", "-m", str(memory_mb),
        "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot", "-device", "virtio-rng-pci",
        "-kernel", str(image.kernel), "-initrd", str(image.initrd), "-append", kernel_words,
    ]  # fmt: skip


def _machine_key() -> str:
    """Changes with qemu's version and with the machine: a sleeper wakes in the very machine that it fell asleep in only."""
    version = subprocess.run(["qemu-system-x86_64", "--version"], capture_output=True, check=True, timeout=60).stdout
    return hashlib.sha256(version + Path(__file__).read_bytes()).hexdigest()[:8]
