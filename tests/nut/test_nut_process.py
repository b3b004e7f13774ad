"""Drivers behind a pipe or a socket, real processes all: what they answer is driven, and whatever else they do ends the run."""

import json
import os
import re
import socket
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nut_driving import BRIEFING, LONG, SHORT, sight

from dnb_edge.errors import InputError
from dnb_edge.nut.link import _Connection
from dnb_edge.nut.open import open_driver
from dnb_edge.nut.patience import Patience
from dnb_edge.nut.process import ProcessDriver
from dnb_edge.sim.control import DriverFailed

HEAD = """
    import json, os, sys, time
    hear, say = sys.stdin.buffer, sys.stdout.buffer
    def tell(**words):
        say.write(json.dumps(words).encode() + b"\\n")
        say.flush()
    hello = json.loads(hear.readline())
"""


def program(tmp_path: Path, body: str, *, ready: str = "tell(ready=True)") -> str:
    """The word for a driver with this loop: `asked` and `picture` are what it was shown."""
    loop = f"""
    {ready}
    while line := hear.readline():
        asked = json.loads(line)
        if asked.get("end"):
            break
        picture = hear.read(asked["bytes"])
        stamp = asked["t_ns"]
"""
    script = tmp_path / "driver.py"
    script.write_text(textwrap.dedent(HEAD + loop) + textwrap.indent(textwrap.dedent(body), "    "))
    return f"exec:{sys.executable} {script}"


@pytest.fixture
def opened():
    """Opens drivers, and closes them at the end."""
    drivers = []

    def opener(word, patience=LONG):
        drivers.append(open_driver(word, patience=patience))
        return drivers[-1]

    yield opener
    for driver in drivers:
        driver.close()


def test_a_program_drives(tmp_path, opened):
    """It is greeted with what the vehicle is, sees each picture as it asked for it, and what it answers is the control."""
    body = """
        means = [sum(picture[c::3]) / (len(picture) / 3 * 255) for c in range(3)]
        tell(t_ns=stamp, steering=means[0], throttle=asked["speed_mps"], seed=hello["seed"])
    """
    driver = opened(program(tmp_path, body))
    assert (driver.name, driver.knows_truth) == ("driver", False)
    driver.start(BRIEFING)
    for number in range(3):
        control = driver.drive(sight(number, speed_mps=number / 4))
        assert (control.steering, control.throttle) == pytest.approx((0.2, number / 4))


@pytest.mark.parametrize(
    ("pictures", "body"),
    [
        ("rgb", "first = list(picture[:3])"),
        ("bgr", "first = list(picture[:3][::-1])"),
        ("jpeg", "import cv2, numpy; first = cv2.imdecode(numpy.frombuffer(picture, 'u1'), 1)[0, 0, ::-1].tolist()"),
    ],
)
def test_pictures_come_as_they_were_asked_for(tmp_path, opened, pictures, body):
    """Raw in either order of colours, or as JPEG: red, green and blue are the picture's."""
    answer = "; tell(t_ns=stamp, steering=first[0] / 255, throttle=first[1] / 255)"
    driver = opened(program(tmp_path, body + answer, ready=f"tell(ready=True, pictures='{pictures}')"))
    driver.start(BRIEFING)
    control = driver.drive(sight(blue=60))
    assert (control.steering, control.throttle) == pytest.approx((0.2, 0.4), abs=0.02)


def test_a_large_picture_goes_through(tmp_path, opened):
    """A picture of megabytes, more than any pipe holds, comes whole while the driver talks on standard error."""
    body = """
        print("x" * 200_000, file=sys.stderr, flush=True)
        tell(t_ns=stamp, steering=0, throttle=len(picture) / 1e7)
    """
    driver = opened(program(tmp_path, body))
    driver.start(BRIEFING)
    assert driver.drive(sight(size_px=(1280, 720))).throttle == pytest.approx(0.27648)


FINE = "tell(t_ns=stamp, steering=0, throttle=0)"
BAD = {
    "hangs": ("time.sleep(60)", "no answer to the picture at 1.000 s within 0.5 s: it hangs"),
    "half-a-line": ("say.write(b'{'); say.flush(); time.sleep(60)", "it hangs"),
    "dies": (
        "print('no such layer', file=sys.stderr); sys.exit(3)",
        "ended with exit code 3 (no such layer), no answer",
    ),
    "raises": ("raise ValueError('boo')", "ended with exit code 1 (ValueError: boo), no answer to the"),
    "killed": ("os.kill(os.getpid(), 9)", "ended by SIGKILL, no answer to the picture at 1.000 s"),
    "closes": ("os.close(1); time.sleep(60)", "closed its standard input or output"),
    "old-stamp": ("tell(t_ns=stamp - 1, steering=0, throttle=0)", "answered for the stamp 999999999 to the picture"),
    "no-stamp": ("tell(steering=0, throttle=0)", "answered for the stamp None"),
    "true-stamp": ("tell(t_ns=True, steering=0, throttle=0)", "answered for the stamp True"),
    "nonsense": ("print('hello', flush=True)", "answered 'hello' to the picture at 1.000 s: must be one JSON object"),
    "escape": ("print('\\x1b[2J', flush=True)", "answered '\\x1b[2J'"),
    "binary": ("say.write(b'\\xff\\n'); say.flush()", "must be one JSON object"),
    "deep": ("print('[' * 60_000, flush=True)", "must be one JSON object"),
    "list": ("print([1, 2], flush=True)", "must be one JSON object"),
    "flood": ("say.write(b'x' * 1_000_000); say.flush()", "more than 65536 bytes without a line's end"),
    "too-far": (
        "tell(t_ns=stamp, steering=1.5, throttle=0)",
        "steering 1.5 to the picture at 1.000 s: must be a number",
    ),
    "nan": ("tell(t_ns=stamp, steering=0, throttle=float('nan'))", "throttle nan"),
    "infinite": ('print(\'{"t_ns": %d, "steering": -1e999, "throttle": 0}\' % stamp, flush=True)', "steering -inf"),
    "text": ("tell(t_ns=stamp, steering='0.1', throttle=0)", "steering '0.1'"),
    "truth": ("tell(t_ns=stamp, steering=True, throttle=0)", "steering True"),
    "missing": ("tell(t_ns=stamp, steering=0)", "throttle None"),
}


@pytest.mark.parametrize(("body", "says"), BAD.values(), ids=BAD)
def test_a_bad_answer_ends_the_run_with_its_reason(tmp_path, opened, body, says):
    """One line that names the driver, what it did and at which picture; and closing it leaves no process behind."""
    driver = opened(program(tmp_path, body), SHORT if "it hangs" in says else LONG)
    driver.start(BRIEFING)
    pid = driver._link._process.pid
    with pytest.raises(DriverFailed) as failure:
        driver.drive(sight())
    assert str(failure.value).startswith("driver: ")
    assert says in str(failure.value)
    assert "\n" not in str(failure.value)
    driver.close()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.parametrize(
    ("ready", "says"),
    [
        ("time.sleep(60)", "no answer when it was to get ready within 0.5 s"),
        ("sys.exit('no GPU')", "ended with exit code 1 (no GPU), no answer when it was to get ready"),
        ("tell(ready='yes')", 'must be {"ready": true}'),
        ("tell(ready=True, pictures='png')", "wants pictures 'png': must be one of rgb, bgr, jpeg"),
        ("tell(ready=True, pictures=[])", "wants pictures []"),
    ],
    ids=["hangs", "dies", "not-ready", "png", "list"],
)
def test_a_driver_that_does_not_get_ready_ends_the_run(tmp_path, ready, says):
    """Said before anything drives."""
    patience = Patience(start_s=0.5, end_s=0.2) if "sleep" in ready else LONG
    driver = open_driver(program(tmp_path, FINE, ready=ready), patience=patience)
    with pytest.raises(DriverFailed, match=re.escape(says)):
        driver.start(BRIEFING)
    driver.close()
    driver.close()


def test_a_driver_that_does_not_listen_ends_the_run(tmp_path, opened):
    """A picture that nobody takes, larger than the pipe, is no reason to wait for ever."""
    driver = opened(program(tmp_path, FINE, ready="tell(ready=True); time.sleep(60)"), SHORT)
    driver.start(BRIEFING)
    with pytest.raises(DriverFailed, match="it hangs"):
        driver.drive(sight(size_px=(640, 480)))


def test_an_answer_before_the_picture_is_none_for_it(tmp_path, opened):
    """Two answers to one picture: the second is taken for no later one."""
    driver = opened(program(tmp_path, f"{FINE}; {FINE}"))
    driver.start(BRIEFING)
    driver.drive(sight(1_000_000_000))
    with pytest.raises(DriverFailed, match=r"answered for the stamp 1000000000 to the picture at 2\.000 s"):
        driver.drive(sight(2_000_000_000))


def test_closing_ends_what_the_driver_started(tmp_path, opened):
    """One that ignores goodbye and SIGTERM is killed, with the processes of its own."""
    body = """
        import signal, subprocess
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        child = subprocess.Popen(["sleep", "300"])
        tell(t_ns=stamp, steering=0, throttle=child.pid / 1e7)
        time.sleep(300)
    """
    driver = opened(program(tmp_path, body))
    driver.start(BRIEFING)
    child = round(driver.drive(sight()).throttle * 1e7)
    os.kill(child, 0)
    driver.close()
    deadline_s = time.monotonic() + 10
    # Whoever inherits the orphan reaps it, or leaves it a zombie.
    while (state := Path(f"/proc/{child}/stat")).exists() and state.read_text().rpartition(")")[2].split()[0] != "Z":
        assert time.monotonic() < deadline_s
        time.sleep(0.02)


def test_a_driver_can_be_started_again(tmp_path, opened):
    """Each start is another process."""
    driver = opened(program(tmp_path, "tell(t_ns=stamp, steering=0, throttle=os.getpid() / 1e7)"))
    pids = set()
    for _ in range(2):
        driver.start(BRIEFING)
        pids.add(driver.drive(sight()).throttle)
        driver.close()
    assert len(pids) == 2


def listener(family, address):
    server = socket.socket(family)
    server.bind(address)
    server.listen()
    return server


def test_drivers_behind_sockets_drive(tmp_path):
    """Over TCP and over a Unix socket the same is said; closing says that it is the end; hanging up ends the run."""
    servers = {
        "tcp": listener(socket.AF_INET, ("127.0.0.1", 0)),
        "unix": listener(socket.AF_UNIX, str(tmp_path / "a.sock")),
    }
    words = {"tcp": f"tcp:127.0.0.1:{servers['tcp'].getsockname()[1]}", "unix": f"unix:{tmp_path}/a.sock"}
    last: list[bytes] = []

    def serve(server):
        connection, _ = server.accept()
        with connection, connection.makefile("rb") as hear:
            hear.readline()
            connection.sendall(b'{"ready": true}\n')
            for _ in range(2):
                hear.readline()
                hear.read(16 * 12 * 3)
                connection.sendall(b'{"t_ns": 5, "steering": -1, "throttle": 1}\n')
            last.append(hear.readline())

    for kind, server in servers.items():
        thread = threading.Thread(target=serve, args=(server,))
        thread.start()
        driver = open_driver(words[kind], patience=LONG)
        driver.start(BRIEFING)
        assert (driver.drive(sight(5)).steering, driver.drive(sight(5)).throttle) == (-1.0, 1.0)
        driver.close()
        thread.join()
        server.close()
    assert last == [b'{"end": true}\n'] * 2
    assert driver.name == "a"


def test_a_connection_that_is_cut_ends_the_run():
    """Nobody there, and gone in the middle: one line each."""
    server = listener(socket.AF_INET, ("127.0.0.1", 0))
    word = f"tcp:127.0.0.1:{server.getsockname()[1]}"
    driver = open_driver(word, patience=LONG)

    def serve():
        connection, _ = server.accept()
        with connection, connection.makefile("rb") as hear:
            hear.readline()
            connection.sendall(b'{"ready": true}\n')
        server.close()

    thread = threading.Thread(target=serve)
    thread.start()
    driver.start(BRIEFING)
    thread.join()
    with pytest.raises(
        DriverFailed, match=r"127\.0\.0\.1-\d+: closed the connection, no answer to the picture at 1\.000 s"
    ):
        driver.drive(sight())
    driver.close()
    with pytest.raises(DriverFailed, match=rf"{word} cannot be reached: Connection refused"):
        driver.start(BRIEFING)


NUMBERS = st.one_of(st.floats(), st.integers(), st.none(), st.text(max_size=3), st.just(1_000_000_000))
ANSWERS = st.one_of(
    st.binary(max_size=200),
    st.fixed_dictionaries({"t_ns": NUMBERS, "steering": NUMBERS, "throttle": NUMBERS}).map(
        lambda told: json.dumps(told).encode() + b"\n"
    ),
)


@given(answer=ANSWERS)
def test_whatever_is_answered_is_a_control_or_ends_the_run(answer):
    """Any bytes and any values: a control within its bounds, or one line of plain characters, never another fault."""
    ours, theirs = socket.socketpair()
    driver = ProcessDriver("test", lambda limit_s: _Connection(ours), name="test", patience=LONG)
    theirs.sendall(b'{"ready": true}\n' + answer)
    theirs.shutdown(socket.SHUT_WR)
    driver.start(BRIEFING)
    said = "test: "
    try:
        control = driver.drive(sight(1_000_000_000))
        assert max(abs(control.steering), abs(control.throttle)) <= 1.0
    except DriverFailed as failure:
        said = str(failure)
    finally:
        driver.close()
        theirs.close()
    assert said.startswith("test: ")
    assert said.isprintable()


@pytest.mark.parametrize(
    ("word", "says"),
    [
        ("exec:", "give exec:COMMAND"),
        ("exec:no-such-program-here --x", "there is no program no-such-program-here"),
        ("exec:'open", "No closing quotation"),
        ("tcp:localhost", "give tcp:HOST:PORT"),
        ("tcp:localhost:0", "give tcp:HOST:PORT"),
        ("tcp::80", "give tcp:HOST:PORT"),
        ("unix:", "give unix:PATH"),
    ],
)
def test_a_place_that_is_none_is_refused(word, says):
    """Told when the driver is named, not when it drives."""
    with pytest.raises(InputError, match=re.escape(says)):
        open_driver(word)


def test_the_pages_example_drives(tmp_path):
    """The driver that docs/nut.md shows works as it stands there: it steers to the brighter half."""
    page = (Path(__file__).resolve().parents[2] / "docs" / "nut.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```python\n(# my_driver\.py\n.*?)^```$", page, re.MULTILINE | re.DOTALL)
    (tmp_path / "my_driver.py").write_text(example)
    driver = open_driver(f"exec:{sys.executable} {tmp_path}/my_driver.py", patience=Patience(end_s=20.0))
    driver.start(BRIEFING)
    assert driver.name == "my_driver"
    half = sight()
    half.bgr.flags.writeable = True
    half.bgr[:, :8] = 0
    assert driver.drive(half).steering < 0.0
    half.bgr[:, :] = np.ascontiguousarray(cv2.flip(half.bgr, 1))
    assert driver.drive(half).steering > 0.0
    process: subprocess.Popen[bytes] = driver._link._process
    driver.close()
    assert process.returncode == 0
