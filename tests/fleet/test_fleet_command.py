"""`dnb-edge fleet` as it is typed: real processes, their lines, their exit codes."""

import json
import os
import signal
import subprocess
import sys
import urllib.request

from fleet_rig import Box, plain
from mqtt_broker import Mosquitto, free_port, needs_mosquitto, passwords, until

PATIENCE_S = 60.0


def begun(*words: str) -> subprocess.Popen[str]:
    kept = {name: value for name, value in os.environ.items() if name != "NOTIFY_SOCKET"}
    command = [sys.executable, "-m", "dnb_edge", "fleet", *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=kept)


def ended(process: subprocess.Popen[str], how: signal.Signals | None = None) -> tuple[int, str, str]:
    if how is not None:
        process.send_signal(how)
    out, err = process.communicate(timeout=PATIENCE_S)
    return process.returncode, out, err


@needs_mosquitto
def test_a_box_and_a_hub_speak_and_end(broker, tmp_path):
    """A lap goes all the way to the hub's API; both end at a signal, with code 0 and nothing on stderr."""
    box = Box(tmp_path, "north", plain(broker.url))
    port, store = free_port(), str(tmp_path / "hub.sqlite")
    hub = begun("hub", "--broker", broker.url, "--store", store, "--port", str(port))
    words = ("--box", "north", "--queue", str(box.queue), "--live", str(box.path))
    publish = begun("publish", "--broker", broker.url, *words)

    def laps() -> list[int]:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/v1/laps", timeout=5.0) as answer:
                return [one["event"]["number"] for one in json.load(answer)["laps"]]
        except OSError:
            return []

    box.race(1, 3)
    try:
        until(lambda: laps() == [3, 2, 1], "three laps", PATIENCE_S)
    finally:
        said = ended(publish, signal.SIGTERM), ended(hub, signal.SIGINT)
        box.close()
    assert [(code, err) for code, _, err in said] == [(0, ""), (0, "")]
    assert f"north, {broker.url}: the hub listens" in said[0][1]
    assert said[1][1].splitlines() == [f"http://127.0.0.1:{port}/", f"hub, {broker.url}: on the line"]


@needs_mosquitto
def test_what_only_a_person_can_mend_ends_with_code_2(tmp_path):
    """A wrong password: one line."""
    (tmp_path / "password").write_text("wrong", encoding="utf-8")
    with Mosquitto(tmp_path, lines=(f"password_file {passwords(tmp_path, a='right')}",)) as one:
        words = ("--user", "a", "--password-file", str(tmp_path / "password"), "--queue", str(tmp_path / "q"))
        code, out, err = ended(begun("publish", "--broker", one.url, "--box", "north", *words))
    assert (code, out, err) == (2, "", f"dnb-edge: {one.url}: the broker refuses: not authorized\n")
