"""What systemd hears, over a real notify socket."""

import importlib
import os
import socket
import sys
from pathlib import Path

import pytest
from display_events import board, health, race

from dnb_edge.display.service import ServiceNotifier, status_text
from dnb_edge.errors import InputError

pytest.importorskip("systemd.daemon", reason="the systemd binding is not installed")


class Manager:
    """systemd's end of the socket."""

    def __init__(self, path):
        self.path = str(path)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._socket.bind(self.path)

    def heard(self):
        """All datagrams since the last call."""
        told = []
        while True:
            try:
                told.append(self._socket.recv(4096).decode())
            except BlockingIOError:
                return told

    def close(self):
        self._socket.close()
        Path(self.path).unlink(missing_ok=True)


class Clock:
    """A clock that the test turns."""

    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def manager(tmp_path, monkeypatch):
    for name in ("WATCHDOG_USEC", "WATCHDOG_PID"):
        monkeypatch.delenv(name, raising=False)
    manager = Manager(tmp_path / "notify")
    monkeypatch.setenv("NOTIFY_SOCKET", manager.path)
    yield manager
    manager.close()


def test_ready_and_stopping(manager):
    """Readiness and the end are told in systemd's words."""
    notifier = ServiceNotifier()
    assert notifier.active
    notifier.ready()
    notifier.stopping()
    assert manager.heard() == ["READY=1", "STOPPING=1"]


def test_status_is_told_once_for_each_change(manager):
    """The status line follows the laps, not every frame."""
    notifier = ServiceNotifier()
    state = race(3, time_s=12.483, laps_wanted=10)
    for t_s in (40.0, 41.0, 42.0):
        notifier.show(state.at(t_s))
    notifier.status("waiting\nfor the\rcamera")
    assert manager.heard() == ["STATUS=lap 4 of 10, last 12.483 s", "STATUS=waiting for the camera"]


def test_watchdog_is_fed_at_half_its_patience_and_only_on_progress(manager, monkeypatch):
    """A hung stage starves the watchdog; progress feeds it, no more often than needed."""
    monkeypatch.setenv("WATCHDOG_USEC", "10000000")
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
    clock = Clock()
    notifier = ServiceNotifier(clock)
    assert notifier.period_s == 5.0
    fed = []
    for second in range(20):
        clock.now_s = 100.0 + second
        notifier.feed(progressed=second not in range(9, 14))
        if manager.heard() == ["WATCHDOG=1"]:
            fed.append(second)
    assert fed == [0, 5, 14, 19]


def test_a_phase_that_takes_long_has_the_manager_wait_longer_and_no_longer_than_that(manager, monkeypatch):
    """Before READY nothing is fed: food would set the watchdog going where the start has a longer time. Then the patience grows
    for the phase, and is the usual one again with the next food."""
    monkeypatch.setenv("WATCHDOG_USEC", "10000000")
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
    notifier = ServiceNotifier(Clock())
    notifier.feed_now(for_s=60.0)
    notifier.feed_now()
    assert manager.heard() == []
    notifier.ready()
    notifier.feed_now()
    assert manager.heard() == ["READY=1", "WATCHDOG=1"]
    notifier.feed_now(for_s=60.0)
    assert manager.heard() == ["WATCHDOG_USEC=60000000", "WATCHDOG=1"]
    notifier.feed_now()
    notifier.feed_now()
    assert manager.heard() == ["WATCHDOG_USEC=10000000", "WATCHDOG=1", "WATCHDOG=1"]


@pytest.mark.parametrize(
    "environment",
    [
        {},
        {"WATCHDOG_USEC": "0"},
        {"WATCHDOG_USEC": "soon"},
        {"WATCHDOG_USEC": "10000000", "WATCHDOG_PID": "1"},
    ],
)
def test_no_watchdog_is_not_fed(manager, monkeypatch, environment):
    """Without a watchdog, or with one that is another process's, nothing is sent."""
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    notifier = ServiceNotifier()
    notifier.feed(progressed=True)
    assert notifier.period_s is None
    assert manager.heard() == []


def test_without_a_manager_nothing_happens(monkeypatch):
    """By hand, in a terminal, the notifier does nothing and does not need the binding."""
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    monkeypatch.setitem(sys.modules, "systemd.daemon", None)
    notifier = ServiceNotifier()
    notifier.ready()
    notifier.show(race(1))
    notifier.feed(progressed=True)
    assert not notifier.active


def test_missing_binding_is_told(manager, monkeypatch):
    """Under systemd without the binding there is one clear line, before the watchdog kills the service."""
    monkeypatch.setitem(sys.modules, "systemd.daemon", None)
    with pytest.raises(InputError, match="install systemd-python"):
        ServiceNotifier()


def test_a_manager_that_went_away_is_logged(manager, caplog):
    """A lost notify socket ends no race; the log says so."""
    notifier = ServiceNotifier()
    manager.close()
    notifier.ready()
    assert "READY=1" in caplog.text


def test_a_signal_in_between_loses_no_word(manager, monkeypatch):
    """The binding says that SIGTERM came in between: the word is told again, with no line in the log."""
    daemon = importlib.import_module("systemd.daemon")
    real, interruptions = daemon.notify, [InterruptedError(4, "Interrupted system call")] * 2

    def notify(assignment):
        if interruptions:
            raise interruptions.pop()
        real(assignment)

    monkeypatch.setattr(daemon, "notify", notify)
    ServiceNotifier().stopping()
    assert manager.heard() == ["STOPPING=1"]


def test_a_manager_that_takes_nothing_holds_nobody_up(manager):
    """Its queue is full, and sending would wait for ever: hundreds of words later READY and STOPPING are still heard."""
    notifier = ServiceNotifier()
    for number in range(300):
        notifier.status(f"lap {number}")
        if number == 20:
            notifier.ready()
    notifier.stopping()
    heard = []
    while told := manager.heard():
        heard += told
        notifier.feed(progressed=False)
    assert heard[-1] == "STOPPING=1"
    assert "READY=1" in heard
    assert len(heard) < 100


@pytest.mark.parametrize(
    ("state", "text"),
    [
        (board(), "waiting for the car"),
        (race(3, time_s=12.483, laps_wanted=10), "lap 4 of 10, last 12.483 s"),
        (race(1).after(health(warnings=("disk full", "dark"))), "lap 2, last 10.000 s, disk full; dark"),
    ],
)
def test_status_text(state, text):
    """One line for an operator at `systemctl status`."""
    assert status_text(state) == text
