"""The health check against the real live socket: what counts as healthy, and how soon that is known."""

import importlib.util
import threading
import time

import pytest
from yard import REPOSITORY

from dnb_edge.live.messages import Phase, State
from dnb_edge.live.server import LiveServer
from dnb_edge.values import Health

SPEC = importlib.util.spec_from_file_location("health_check", REPOSITORY / "systemd/health_check.py")
health_check = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(health_check)

HEALTH = Health(
    t_ns=1, t_s=0.0, frames=1, detected_frames=0, dropped_frames=0, fps=None, latency_ms=None, display="none", recording="none",
    view_error_mean_px=None, view_error_mean_m=None,
)  # fmt: skip


@pytest.fixture
def daemon(tmp_path):
    """The daemon's real end of the socket."""
    with LiveServer(tmp_path / "s", version="1") as server:
        yield server


def later(server, *steps):
    """Shows states and tells events one after the other, in a moment."""

    def work():
        for step in steps:
            time.sleep(0.2)
            server.show(step) if isinstance(step, State) else server.tell(step)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


@pytest.mark.parametrize(
    ("steps", "must_race", "healthy", "words"),
    [
        ((State(phase=Phase.RACING), HEALTH), False, True, "racing: frames come"),
        ((State(phase=Phase.RACING), HEALTH), True, True, "racing: frames come"),
        ((State(phase=Phase.RACING),), False, False, "says nothing"),
        ((State(phase=Phase.FINISHED),), True, True, "the race is over"),
        (
            (State(phase=Phase.SETUP, reason="no track is set up yet"),),
            False,
            True,
            "it waits to be set up: no track is set up yet",
        ),
        ((State(phase=Phase.FAULT, reason="no camera"),), False, True, "it waits: no camera"),
        ((State(phase=Phase.FAULT, reason="no camera"),), True, False, "it raced before, and now: it waits: no camera"),
        (
            (State(phase=Phase.FAULT, reason="no camera"), State(phase=Phase.RACING), HEALTH),
            True,
            True,
            "racing: frames come",
        ),
        ((), False, False, "says nothing"),
    ],
)
def test_what_counts_as_healthy(daemon, tmp_path, steps, must_race, healthy, words):
    """Frames that are raced, an end, a reason to wait; not a race that says nothing, nor waiting where it raced before."""
    thread = later(daemon, *steps)
    found, said = health_check.wait(tmp_path / "s", within_s=30.0 if healthy else 2.0, must_race=must_race)
    thread.join()
    assert found == healthy
    assert words in said


def test_a_daemon_that_comes_up_late_is_waited_for(tmp_path):
    """No socket, then one: both are asked."""
    assert health_check.phase(tmp_path / "s") is None
    found, said = health_check.wait(tmp_path / "s", within_s=0.7, must_race=False)
    assert (found, "does not answer" in said) == (False, True)
    with LiveServer(tmp_path / "s", version="1") as server:
        server.show(State(phase=Phase.RACING))
        assert health_check.phase(tmp_path / "s") == "racing"
        server.tell(HEALTH)
        assert health_check.wait(tmp_path / "s", within_s=30.0, must_race=True) == (True, "racing: frames come")
