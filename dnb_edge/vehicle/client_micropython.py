"""As client.py, for MicroPython (ESP32, Pico W): copy it onto the board as dnb_vehicle.py. It never blocks and never raises.

from dnb_vehicle import Vehicle

box = Vehicle("192.168.4.1", car=1)
while True:
    box.tell(inference_ms=31.5, steering=-0.2, throttle=0.5)
    if box.word() == "go":
        drive()
"""

import json
import socket
import time

PORT = 5610
SILENT_MS = 3000
HELLO_MS = 5000
MOST_LAPS = 10


class Vehicle:
    """One car, as the box knows it."""

    def __init__(self, host: str, port: int = PORT, car: int = 1) -> None:
        self.car = car
        self.seq = 0
        self.laps: list[dict] = []
        self._word = "stop"
        self._heard_ms: int | None = None
        self._to = socket.getaddrinfo(host, port)[0][-1]
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(0.0)
        self._hello()

    def tell(
        self, inference_ms: float | None = None, steering: float | None = None, throttle: float | None = None
    ) -> None:
        """Tells how long the network took, and what it decided: -1 to 1, left and ahead are positive."""
        said = {"inference_ms": inference_ms, "steering": steering, "throttle": throttle}
        line = {name: value for name, value in said.items() if value is not None}
        line.update(car=self.car, seq=self.seq)
        self.seq += 1
        self._say(line)

    def word(self) -> str:
        """`stop`, `ready` or `go`: what holds now."""
        self.listen()
        if self._heard_ms is None or time.ticks_diff(time.ticks_ms(), self._heard_ms) > SILENT_MS:
            return "stop"
        return self._word

    def listen(self) -> None:
        """Takes in what has come; `laps` grows."""
        if time.ticks_diff(time.ticks_ms(), self._said_ms) > HELLO_MS:
            self._hello()
        for _ in range(20):
            try:
                data = self._socket.recv(512)
            except OSError:
                return
            for line in data.split(b"\n"):
                if line:
                    self._take(line)

    def _take(self, line: bytes) -> None:
        try:
            heard = json.loads(line)
            signal = heard.get("signal")
        except (ValueError, AttributeError):
            return
        if signal in ("stop", "ready", "go"):
            if signal == "go" and self._word != "go":
                self.laps = []
            self._word = signal
            self._heard_ms = time.ticks_ms()
        elif signal == "lap" and heard not in self.laps and heard.get("car") in (self.car, None):
            # Each is told three times.
            self.laps.append(heard)
            if len(self.laps) > MOST_LAPS:
                self.laps.pop(0)

    def _hello(self) -> None:
        self._say({"hello": 1, "car": self.car})

    def _say(self, members: dict[str, float]) -> None:
        self._said_ms = time.ticks_ms()
        try:
            self._socket.sendto(json.dumps(members).encode() + b"\n", self._to)
        except OSError:
            return
