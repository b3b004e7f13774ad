"""A real mosquitto of the test's own, on a free port of 127.0.0.1: started, killed by its pid, cut off by a relay."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import threading
import time
from pathlib import Path

import pytest

PROGRAM = shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin")
needs_mosquitto = pytest.mark.skipif(
    None in (PROGRAM, shutil.which("mosquitto_passwd"), shutil.which("openssl")),
    reason="mosquitto, or openssl, is not installed",
)
PATIENCE_S = 20.0


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def until(true, what: str, patience_s: float = PATIENCE_S):
    """Waits until `true()` holds, and gives what it gave."""
    end_s = time.monotonic() + patience_s
    while not (found := true()):
        assert time.monotonic() < end_s, f"waited in vain: {what}"
        time.sleep(0.02)
    return found


class Mosquitto:
    """A broker whose configuration is `lines`; it may be killed and started again at the same port."""

    def __init__(
        self, folder: Path, *, lines: tuple[str, ...] = ("allow_anonymous true",), persistent: bool = False, port=None
    ):
        assert PROGRAM is not None
        self.port = free_port() if port is None else port
        self._config = folder / f"mosquitto-{self.port}.conf"
        self._log = folder / f"mosquitto-{self.port}.log"
        kept = (
            ("persistence true", f"persistence_location {folder}/", "autosave_interval 1")
            if persistent
            else ("persistence false",)
        )
        # Root would become the user mosquitto, who may not read a test's folder.
        user = ("user root",) if os.geteuid() == 0 else ()
        self._place = (f"listener {self.port} 127.0.0.1", *user, *kept)
        self.configure(*lines)
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        return f"mqtt://127.0.0.1:{self.port}"

    def configure(self, *lines: str) -> None:
        """From the next start on."""
        self._config.write_text("\n".join((*self._place, *lines, "")), encoding="utf-8")

    def start(self) -> None:
        """Starts it and waits until it listens."""
        with self._log.open("ab") as log:
            command = [PROGRAM, "-c", str(self._config)]
            self._process = subprocess.Popen(command, stdout=log, stderr=log)  # type: ignore[arg-type]
        until(self._listens, f"mosquitto at {self.port}: {self._log.read_text(encoding='utf-8', errors='replace')}")

    def kill(self) -> None:
        """SIGKILL: no word to anybody."""
        self._end(signal.SIGKILL)

    def stop(self) -> None:
        """SIGTERM. Safe to repeat."""
        self._end(signal.SIGTERM)

    def __enter__(self) -> "Mosquitto":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _end(self, how: signal.Signals) -> None:
        if self._process is not None:
            self._process.send_signal(how)
            self._process.wait(PATIENCE_S)
            self._process = None

    def _listens(self) -> bool:
        assert self._process is not None
        assert self._process.poll() is None, self._log.read_text(encoding="utf-8")
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port), timeout=0.2):
            return True
        return False


class Cable:
    """A relay to a port, which can be cut: what is on its way then is lost, and nobody is told."""

    def __init__(self, to_port: int) -> None:
        self._to_port = to_port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self._pairs: list[socket.socket] = []
        self._lock = threading.Lock()
        self._whole = True
        self._closed = False
        self._frozen = 0
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def cut(self) -> None:
        """Ends all connections, and lets nobody through."""
        with self._lock:
            self._whole = False
            pairs, self._pairs = self._pairs, []
        for one in pairs:
            _shut(one)

    def freeze(self) -> None:
        """Nothing passes any more on the connections that there are, and nobody is told; new ones are as ever."""
        self._frozen = len(self._threads)

    def mend(self) -> None:
        self._whole = True

    def close(self) -> None:
        self._closed = True
        _shut(self._listener)
        self.cut()
        for thread in self._threads:
            thread.join(5.0)

    def _accept(self) -> None:
        while not self._closed:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            if not self._whole:
                _shut(near)
                continue
            try:
                far = socket.create_connection(("127.0.0.1", self._to_port), timeout=5.0)
            except OSError:
                _shut(near)
                continue
            far.settimeout(None)
            with self._lock:
                self._pairs += [near, far]
            for one, other in ((near, far), (far, near)):
                number = len(self._threads)
                self._threads.append(threading.Thread(target=self._pass_on, args=(one, other, number), daemon=True))
                self._threads[-1].start()

    def _pass_on(self, one: socket.socket, other: socket.socket, number: int) -> None:
        with contextlib.suppress(OSError):
            while said := one.recv(64 * 1024):
                if number >= self._frozen:
                    other.sendall(said)
        _shut(one)
        _shut(other)


def _shut(one: socket.socket) -> None:
    with contextlib.suppress(OSError):
        one.shutdown(socket.SHUT_RDWR)
    one.close()


def certificate(folder: Path, name: str) -> tuple[Path, Path]:
    """A certificate for the host `name`, signed by itself, and its key."""
    made, key = folder / f"{name}.crt", folder / f"{name}.key"
    command = [
        "openssl",
        "req",
        "-x509",
        "-newkey",
        "ec",
        "-pkeyopt",
        "ec_paramgen_curve:P-256",
        "-nodes",
        "-days",
        "2",
    ]
    command += ["-subj", f"/CN={name}", "-addext", f"subjectAltName=DNS:{name}", "-out", str(made), "-keyout", str(key)]
    subprocess.run(command, check=True, capture_output=True)
    return made, key


def passwords(folder: Path, **users: str) -> Path:
    """mosquitto's file of passwords."""
    path = folder / "passwords"
    path.write_text("".join(f"{user}:{password}\n" for user, password in users.items()), encoding="utf-8")
    path.chmod(0o600)
    subprocess.run(["mosquitto_passwd", "-U", str(path)], check=True, capture_output=True)
    return path
