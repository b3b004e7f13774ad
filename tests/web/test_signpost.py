"""The displays tell where the pages are."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from dnb_edge.live.messages import Phase, State
from dnb_edge.web import signpost as room
from dnb_edge.web.endpoint import Refused
from dnb_edge.web.signpost import Signpost, address_of, own_address


class Line:
    """A line to a daemon that does as the test says."""

    def __init__(self) -> None:
        self.state: State | None = None
        self.epoch: str | None = None
        self.busy = False
        self.asked: list[dict[str, Any]] = []

    async def ask(self, **what: Any) -> None:
        if self.busy:
            raise Refused(503, "daemon-down", "not now")
        self.asked.append(what)


def test_each_start_is_told_once_and_no_race_is_covered() -> None:
    """Not before there is a service, a network and a phase that is no race; once for each process of the service."""
    line, address = Line(), [None]
    post = Signpost(line, lambda: address[0])  # type: ignore[arg-type]

    def look(epoch: str | None, phase: Phase | None) -> int:
        line.epoch, line.state = epoch, None if phase is None else State(phase=phase)
        asyncio.run(post.look())
        return len(line.asked)

    assert look(None, None) == 0
    assert look("a", Phase.SETUP) == 0
    address[0] = "http://192.168.1.20:8080"  # type: ignore[call-overload]
    assert look("a", Phase.STARTING) == 0
    line.busy = True
    assert look("a", Phase.FAULT) == 0
    line.busy = False
    assert look("a", Phase.FAULT) == 1
    assert line.asked == [{"show": "open http://192.168.1.20:8080", "for_s": 60.0}]
    assert look("a", Phase.SETUP) == 1
    assert look("b", Phase.RACING) == 1
    assert look("b", Phase.FINISHED) == 1
    assert look("c", Phase.FINISHED) == 2


@pytest.mark.parametrize(
    ("host", "port", "own", "address"),
    [
        ("::", 8080, "10.42.0.1", "http://10.42.0.1:8080"),
        ("0.0.0.0", 80, "10.42.0.1", "http://10.42.0.1"),
        ("::", 8080, None, None),
        ("127.0.0.1", 8080, "10.42.0.1", None),
        ("::1", 8080, "10.42.0.1", None),
        ("192.168.1.20", 8080, "10.42.0.1", "http://192.168.1.20:8080"),
        ("fd00::2", 8080, None, "http://[fd00::2]:8080"),
        ("box.lan", 8080, None, "http://box.lan:8080"),
    ],
)
def test_what_to_type(
    host: str, port: int, own: str | None, address: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The address that another device can type; none where only this machine can."""
    monkeypatch.setattr(room, "own_address", lambda: own)
    assert address_of(host, port) == address


def test_this_machines_own_address_is_no_loopback() -> None:
    """Of the machine that runs the test, be it in a network or not."""
    own = own_address()
    assert own is None or not own.startswith("127.")
