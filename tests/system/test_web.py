"""The pages beside the race, each under its own unit, both as install.sh leaves them: what a browser gets of them.

This machine speaks HTTP to the guest's port 8080 through ssh. Emulation is slow: nothing here is timed.
"""

import re
import shlex
import time

import httpx
import pytest
from harness import reel
from harness.appliance import DISPLAY_URI, PATIENCE_S, RUNS, note
from harness.guest import GuestFault
from mcap.reader import make_reader

from dnb_edge.display import protocol

WEB = "dnb-edge-web"
ENABLE = f"systemctl enable --now dnb-edge {WEB}"
CODE = re.compile(r"\b(\d{4}) ?(\d{4})\b")


@pytest.fixture
def browser(guest):
    """Speaks to the pages as a browser does, cookies and all."""
    with (
        guest.forward(8080) as port,
        httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=PATIENCE_S, trust_env=False) as client,
    ):
        yield client


def phase(browser):
    """What the timing service does, by the pages; None where it is down."""
    answer = browser.get("/api/v1/state")
    assert answer.status_code == 200, answer.text
    state = answer.json()["state"]
    return None if state is None else state["phase"]


def wait_for_phase(browser, wanted):
    """Asks until the timing service does that."""
    deadline_s = time.monotonic() + PATIENCE_S
    while (found := phase(browser)) != wanted:
        if time.monotonic() > deadline_s:
            raise GuestFault(f"the pages say {found}, not {wanted}")
        time.sleep(0.5)


@pytest.fixture
def enabled(guest, appliance, webcam, logs):
    """Both units installed and enabled, and a camera; how long it took until both were ready, seconds."""
    webcam.plug(guest)
    config = reel.configuration(logs / "config", source=f"v4l2:{webcam.node}", display={"uri": DISPLAY_URI})
    # What a busy host does to an emulated race is not what is tested here.
    appliance.install(config, unit_lines="WatchdogSec=0\nTimeoutStartSec=infinity\n")
    guest.put("[Service]\nWatchdogSec=0\nTimeoutStartSec=infinity\n", f"/etc/systemd/system/{WEB}.service.d/test.conf")
    guest.run("systemctl daemon-reload")
    began_s = time.monotonic()
    guest.run(ENABLE, timeout_s=PATIENCE_S)
    return time.monotonic() - began_s


def test_a_race_is_seen_begun_and_fetched_with_a_browser(enabled, guest, appliance, browser, logs):
    """Page, state, the code of the display, another run, a recording while it is made; and what is said without the race."""
    front = browser.get("/")
    assert front.status_code == 200
    assert "text/html" in front.headers["content-type"]
    assert "<main" in front.text
    wait_for_phase(browser, "racing")
    assert browser.post("/api/v1/race/new", json={}).status_code == 401

    asked_s = time.monotonic()
    assert browser.get("/login").status_code == 200
    _, told = appliance.display.wait(
        protocol.Note, lambda said: CODE.search(said.text) is not None, since_s=asked_s, timeout_s=PATIENCE_S
    )
    code = CODE.search(told.text).group()
    entered = browser.post("/api/v1/login", json={"code": code})
    assert entered.status_code == 200, entered.text
    token = {"X-CSRF-Token": entered.json()["csrf"]}

    first = browser.get("/api/v1/state").json()["state"]["run"]
    begun = browser.post("/api/v1/race/new", json={"entry": "Ada"}, headers=token)
    assert begun.status_code < 300, begun.text
    wait_for_phase(browser, "racing")
    second = browser.get("/api/v1/state").json()["state"]["run"]
    assert first != second
    assert guest.run(f"ls {RUNS}/{first}.mcap").strip()

    appliance.display.wait(protocol.Lap, lambda lap: lap.lap == 1, since_s=asked_s, timeout_s=PATIENCE_S)
    (entry,) = [run for run in browser.get("/api/v1/runs").json()["runs"] if run["current"]]
    assert entry["file"].startswith(second)
    assert entry["entry"] == "Ada"
    copied = browser.get(f"/api/v1/runs/{entry['id']}/recording.mcap")
    assert copied.status_code == 200, copied.text
    at = logs / "copy.mcap"
    at.write_bytes(copied.content)
    with at.open("rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert {"/detections", "/lap"} <= topics, topics
    assert guest.run(f"ls {RUNS} | grep -c part").strip() == "1"

    appliance.stop()
    assert appliance.shown("Result") == {"Result": "success"}
    wait_for_phase(browser, None)
    assert browser.get("/").status_code == 200
    appliance.start()
    wait_for_phase(browser, "racing")
    units = guest.run(f"systemctl show {WEB} -p User,Group,NRestarts,MemoryCurrent,Result")
    memory_mb = int(re.search(r"MemoryCurrent=(\d+)", units)[1]) / 1e6
    refusals = guest.run(
        f"journalctl -b -u {shlex.quote(WEB)} -u dnb-edge | grep -ciE 'permission|denied|traceback' || true"
    )
    note(logs, ready_s=round(enabled, 1), web_memory_mb=round(memory_mb), copy_mb=round(len(copied.content) / 1e6, 1))
    assert "NRestarts=0" in units
    assert refusals.strip() == "0"
