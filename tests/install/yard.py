"""A machine to install on, without one: a folder as its root, a service manager that starts programs for real, and a small
package in dnb-edge's place, whose behaviour each test chooses. install.sh, pip and the virtual environments are the real ones.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import dataclass, field
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
DEBIAN = 'PRETTY_NAME="Debian GNU/Linux 13 (trixie)"\nVERSION_ID="13"\nID=debian\n'

SERVICE = '''
"""Serves the live socket of a daemon that does what behaviour.txt says."""
import json, os, pathlib, socket, sys, time

VERSION = {version!r}
BEHAVIOUR = {behaviour!r}

def main():
    if sys.argv[1:] == ["--version"]:
        print("dnb-edge", VERSION)
        return
    root = pathlib.Path(os.environ["DNB_EDGE_ROOT"])
    if sys.argv[1:] == ["web"]:
        time.sleep(600)
    if BEHAVIOUR == "dies":
        sys.exit(3)
    path = root / "run/dnb-edge/live.sock"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    server = socket.socket(socket.AF_UNIX)
    server.bind(str(path))
    server.listen()
    clients = []
    while True:
        client, _ = server.accept()
        clients.append(client)
        for line in {{
            "races": [{{"say": "state", "phase": "racing"}}, {{"say": "event", "sequence": 1, "event": {{"event": "health"}}}}],
            "waits": [{{"say": "state", "phase": "fault", "reason": "no camera is there"}}],
            "silent": [],
        }}[BEHAVIOUR]:
            client.sendall(json.dumps(line).encode() + b"\\n")
'''

BACKEND = '''
"""Builds the wheel of this small package; first does what a test wants to happen in the middle of an installation."""
import os, pathlib, time, zipfile

def build_wheel(folder, settings=None, metadata=None):
    {middle}
    name = "dnb_edge-{version}"
    with zipfile.ZipFile(pathlib.Path(folder) / f"{{name}}-py3-none-any.whl", "w") as wheel:
        for path in sorted(pathlib.Path("dnb_edge").rglob("*.py")):
            wheel.write(path)
        info = f"{{name}}.dist-info"
        wheel.writestr(f"{{info}}/METADATA", "Metadata-Version: 2.1\\nName: dnb-edge\\nVersion: {version}\\n{requires}")
        wheel.writestr(f"{{info}}/WHEEL", "Wheel-Version: 1.0\\nGenerator: test\\nRoot-Is-Purelib: true\\nTag: py3-none-any\\n")
        wheel.writestr(f"{{info}}/entry_points.txt", "[console_scripts]\\ndnb-edge = dnb_edge.service:main\\n")
        wheel.writestr(f"{{info}}/RECORD", "")
    return f"{{name}}-py3-none-any.whl"
'''

SYSTEMCTL = """#!/bin/bash
# A service manager for tests: units are programs of the release that the link leads to.
state=$DNB_EDGE_ROOT/run/state
mkdir -p "$state/enabled" "$state/pids"
echo "$*" >>"$state/asked"
words=()
for word in "$@"; do case $word in --quiet|-P|Result) ;; *) words+=("${word%.service}") ;; esac; done
set -- "${words[@]}"
verb=$1
shift
alive() { [ -e "$state/pids/$1" ] && kill -0 "$(cat "$state/pids/$1")" 2>/dev/null; }
end() { if alive "$1"; then kill "$(cat "$state/pids/$1")"; fi; rm -f "$state/pids/$1"; }
begin() {
    local word=run
    if [ "$1" = dnb-edge-web ]; then word=web; fi
    # As a service manager does: what the installer ignores on its way, a service does not.
    env --default-signal "$DNB_EDGE_ROOT/opt/dnb-edge/venv/bin/dnb-edge" $word </dev/null >/dev/null 2>&1 9>&- &
    echo $! >"$state/pids/$1"
    sleep 0.3
    alive "$1"
}
case $verb in
    --version) echo "systemd ${SYSTEMD_VERSION:-252} (test)" ;;
    is-enabled) [ -e "$state/enabled/$1" ] ;;
    is-active) for unit in "$@"; do alive "$unit" || exit 3; done ;;
    enable)
        for unit in "$@"; do
            [ -e "$DNB_EDGE_ROOT/etc/systemd/system/$unit.service" ] || exit 1
            touch "$state/enabled/$unit"
        done
        ;;
    disable) for unit in "$@"; do rm -f "$state/enabled/$unit"; done ;;
    stop) for unit in "$@"; do end "$unit"; done ;;
    start) for unit in "$@"; do alive "$unit" || begin "$unit" || exit 1; done ;;
    restart) for unit in "$@"; do end "$unit"; begin "$unit" || exit 1; done ;;
    show) echo exit-code ;;
esac
"""
SYSUSERS = """#!/bin/bash
[ -e "$DNB_EDGE_ROOT/usr/lib/sysusers.d/dnb-edge.conf" ] || exit 1
for name in dnb-edge dnb-edge-web; do
    grep -q "^$name:" "$DNB_EDGE_ROOT/etc/passwd" || echo "$name:x:990:990::/:/usr/sbin/nologin" >>"$DNB_EDGE_ROOT/etc/passwd"
done
"""
TMPFILES = '#!/bin/bash\nmkdir -p "$DNB_EDGE_ROOT"/var/lib/dnb-edge/{runs,setup}\n'
USERDEL = '#!/bin/bash\nsed -i "/^${!#}:/d" "$DNB_EDGE_ROOT/etc/passwd"\n'
APT_GET = '#!/bin/bash\necho "E: Could not resolve deb.debian.org" >&2\nexit 100\n'


PYTHON = """#!/bin/bash
# Python whose virtual environments are copies of one that was made before: that takes seconds each time.
if [ "$1 $2" = "-m venv" ]; then exec cp -a "$TEMPLATE/." "${!#}"; fi
exec PYTHON_OF_THE_TEST "$@"
"""


@dataclass(kw_only=True)
class Checkout:
    """A clone of dnb-edge with a small package in it."""

    folder: Path
    version: str = "1.0"
    behaviour: str = "races"
    middle: str = "pass"
    """A statement of Python that is run in the middle of the installation."""
    requires: tuple[str, ...] = ()

    def write(self) -> Checkout:
        """Makes its files, anew where they are there."""
        shutil.rmtree(self.folder, ignore_errors=True)
        package = self.folder / "dnb_edge"
        package.mkdir(parents=True)
        shutil.copy(REPOSITORY / "install.sh", self.folder)
        shutil.copytree(
            REPOSITORY / "systemd", self.folder / "systemd", ignore=shutil.ignore_patterns("__pycache__", "*.md")
        )
        lines = "".join(f"Requires-Dist: {name}\\n" for name in self.requires)
        (package / "__init__.py").write_text(f'__version__ = "{self.version}"\n')
        (package / "service.py").write_text(SERVICE.format(version=self.version, behaviour=self.behaviour))
        (package / "backend.py").write_text(BACKEND.format(version=self.version, middle=self.middle, requires=lines))
        (self.folder / "pyproject.toml").write_text(
            '[build-system]\nrequires = []\nbuild-backend = "backend"\nbackend-path = ["dnb_edge"]\n'
            f'[project]\nname = "dnb-edge"\nversion = "{self.version}"\n'
            f"dependencies = [\n{''.join(f'    {name!r},' for name in self.requires)}\n]\n"
        )
        for name in ("constraints.txt", "README.md", "LICENSE"):
            (self.folder / name).write_text("")
        return self


@dataclass(kw_only=True)
class Machine:
    """A folder that stands for a machine."""

    root: Path
    template: Path
    """A virtual environment to copy instead of making one."""
    environment: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("etc", "run/systemd/system", "opt", "proc", "dev", "usr/lib", "bin-of-the-test"):
            (self.root / name).mkdir(parents=True, exist_ok=True)
        (self.root / "etc/os-release").write_text(DEBIAN)
        (self.root / "etc/passwd").write_text("root:x:0:0::/root:/bin/bash\n")
        for name, text in {
            "systemctl": SYSTEMCTL, "systemd-sysusers": SYSUSERS, "systemd-tmpfiles": TMPFILES, "userdel": USERDEL,
            "python": PYTHON.replace("PYTHON_OF_THE_TEST", sys.executable),
            "udevadm": "#!/bin/bash\n", "apt-get": APT_GET, "dpkg": "#!/bin/bash\necho ${ARCHITECTURE:-amd64}\n",
        }.items():  # fmt: skip
            self.program(name, text)

    def program(self, name: str, text: str) -> None:
        """Puts a program before those of this machine."""
        at = self.root / "bin-of-the-test" / name
        at.write_text(text)
        at.chmod(0o755)

    @property
    def opt(self) -> Path:
        """Where releases are."""
        return self.root / "opt/dnb-edge"

    @property
    def releases(self) -> list[str]:
        """Their names."""
        return sorted(path.name for path in self.opt.glob("releases/*"))

    @property
    def current(self) -> Path:
        """Where the link leads to."""
        return (self.opt / "venv").resolve()

    def begin(self, checkout: Path, *options: str, **environment: str) -> subprocess.Popen[str]:
        """Starts install.sh of `checkout`."""
        words = {
            "DNB_EDGE_ROOT": str(self.root), "PYTHON": f"{self.root}/bin-of-the-test/python", "TEMPLATE": str(self.template),
            "DNB_EDGE_HEALTH_S": "60", "LC_ALL": "C.UTF-8", "HOME": str(self.root.parent),
            "PATH": f"{self.root}/bin-of-the-test:{os.environ['PATH']}", "PIP_RETRIES": "0", "PIP_NO_INDEX": "1",
        }  # fmt: skip
        return subprocess.Popen(
            ["bash", str(checkout / "install.sh"), *options],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env=words | self.environment | environment, start_new_session=True,
        )  # fmt: skip

    def install(self, checkout: Path, *options: str, **environment: str) -> subprocess.CompletedProcess[str]:
        """Runs install.sh of `checkout` to its end."""
        process = self.begin(checkout, *options, **environment)
        out, err = process.communicate(timeout=300)
        return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    def running(self, unit: str) -> Path | None:
        """The program of a unit that is up, by its link; None where it is down."""
        pid = self.root / "run/state/pids" / unit
        deadline_s = time.monotonic() + 30.0
        while pid.exists() and time.monotonic() < deadline_s:
            try:
                words = Path(f"/proc/{pid.read_text().strip()}/cmdline").read_bytes().split(b"\0")
            except FileNotFoundError:
                return None
            # Until then it is the service manager's own fork.
            if len(words) > 1 and words[1].endswith(b"/dnb-edge"):
                return Path(os.fsdecode(words[1]))
            time.sleep(0.05)
        return None

    def tree(self) -> dict[str, object]:
        """All files but logs, locks and what the service manager keeps, with what tells that they have changed."""
        found: dict[str, object] = {}
        for path in self.root.rglob("*"):
            name = str(path.relative_to(self.root))
            if name.startswith(("run/", "var/log", "bin-of-the-test", "var/lib")) or "__pycache__" in name:
                continue
            if path.is_symlink():
                found[name] = path.readlink()
            elif path.is_file():
                status = path.stat()
                found[name] = (status.st_size, status.st_ino if "releases" in name else path.read_bytes())
        return found

    def close(self) -> None:
        """Ends whatever its service manager has started."""
        for pid in (self.root / "run/state/pids").glob("*"):
            try:
                os.kill(int(pid.read_text()), signal.SIGKILL)
            except (ProcessLookupError, ValueError):
                continue


def wait_for(path: Path, *, timeout_s: float = 60.0) -> None:
    """Returns once `path` is there."""
    deadline_s = time.monotonic() + timeout_s
    while not path.exists():
        assert time.monotonic() < deadline_s, f"{path} does not come"
        time.sleep(0.05)


def statement(text: str) -> str:
    """Statements of Python on one line of a function."""
    return f"exec({textwrap.dedent(text)!r})"
