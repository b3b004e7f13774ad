"""For a car's own computer: tells the box what its network does, and hears ready, go, stop and its laps. UDP.

One file of the standard library, Python 3.9 or later: copy it onto the car. It never blocks and never raises because of the
network: a box that is away costs the car nothing. The protocol is in docs/vehicle.md.

    box = Vehicle("192.168.4.1", car=1)
    while driving:
        steering, throttle = network(camera())
        box.tell(inference_ms=..., steering=steering, throttle=throttle)
        if box.word != "go":
            brake()
"""

from __future__ import annotations

import json
import socket
import time
from typing import Any

PORT = 5610
SILENT_S = 3.0
"""The box repeats its word every second; where nothing is heard for so long the word is `stop`."""
HELLO_S = 5.0
"""So often at least the box hears from us, or it would stop telling."""
MOST_HEARD = 100
MOST_LAPS = 50


class Vehicle:
    """One car, as the box knows it. For one thread."""

    def __init__(self, host: str, port: int = PORT, *, car: int = 1) -> None:
        """Raises `OSError` where `host` has no address."""
        self.car = car
        self.seq = 0
        """Number of the next line."""
        self.laps: list[dict[str, Any]] = []
        """The laps heard of since the last `go`: `lap`, `time_s`, `valid`, `car`; the last ones."""
        self._word = "stop"
        self._heard_s = -SILENT_S
        self._said_s = -HELLO_S
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, kind, protocol)
        self._socket.settimeout(0.0)
        # Connected, so that nobody but the box is heard.
        self._socket.connect(address)
        self._hello()

    def tell(
        self, *, inference_ms: float | None = None, steering: float | None = None, throttle: float | None = None
    ) -> None:
        """Tells how long the network took, and what it decided: -1 to 1, left and ahead are positive."""
        said = {"inference_ms": inference_ms, "steering": steering, "throttle": throttle}
        line = {"car": self.car, "seq": self.seq, **{name: value for name, value in said.items() if value is not None}}
        self.seq += 1
        self._say(line)

    @property
    def word(self) -> str:
        """`stop`, `ready` or `go`: what holds now."""
        self.listen()
        return self._word if time.monotonic() - self._heard_s < SILENT_S else "stop"

    def listen(self) -> None:
        """Takes in what has come. `word` does so too."""
        if time.monotonic() - self._said_s >= HELLO_S:
            self._hello()
        for _ in range(MOST_HEARD):
            try:
                data = self._socket.recv(2048)
            except OSError:
                return  # nothing more, or the box is away
            for line in data.splitlines():
                self._take(line)

    def close(self) -> None:
        """Lets go of the socket."""
        self._socket.close()

    def _take(self, line: bytes) -> None:
        try:
            heard = json.loads(line)
        except ValueError:
            return
        signal = heard.get("signal") if isinstance(heard, dict) else None
        if signal in {"stop", "ready", "go"}:
            if signal == "go" != self._word:
                self.laps = []
            self._word = signal
            self._heard_s = time.monotonic()
        elif signal == "lap" and heard not in self.laps and heard.get("car") in {self.car, None}:
            # Each is told three times.
            self.laps = [*self.laps[-MOST_LAPS:], heard]

    def _hello(self) -> None:
        self._say({"hello": 1, "car": self.car})

    def _say(self, members: dict[str, Any]) -> None:
        self._said_s = time.monotonic()
        try:
            self._socket.send(json.dumps(members).encode() + b"\n")
        except (OSError, ValueError):
            return  # away, or no room: the next line says as much
