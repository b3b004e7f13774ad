"""Vehicles by an MQTT broker: telemetry from `TOPIC/<name>/telemetry`, signals to `TOPIC/signal`.

Knows paho-mqtt and what a broker refuses. Knows nothing of what lines say. A thread of its own keeps the line; a broker that is
away is tried again, one that refuses us for good is told by `read`.
"""

from __future__ import annotations

import logging
import os
import ssl
import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from dnb_edge.errors import InputError
from dnb_edge.vehicle.channel import MOST_AT_ONCE, Heard

PORTS = {"mqtt": 1883, "mqtts": 8883}
KEEPALIVE_S = 20
CONNECT_S = 5.0
CLOSE_S = 2.0
LOOK_S = 0.5
BACK_OFF_S = (0.5, 1.0, 2.0, 5.0)
MOST_WAITING = 512
"""Lines that wait for the gateway; the oldest go, counted."""
TOPIC = "dnb-edge/vehicle"
REFUSALS = frozenset(
    {"Not authorized", "Bad user name or password", "Unsupported protocol version", "Client identifier not valid"}
)
"""What a broker says that will say so again, as paho names it."""

_HUNG_UP = "it has hung up"

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Broker:
    """Where and how to connect."""

    uri: str
    """`mqtt://HOST[:PORT]`, or `mqtts://` for TLS."""
    user: str | None = None
    password_file: Path | None = None
    ca: Path | None = None
    """Certificates of who may vouch for the broker; None for those of the system."""
    topic: str = TOPIC


class MqttChannel:
    """A line to one broker."""

    def __init__(self, broker: Broker) -> None:
        """Raises `InputError` where the broker's URI or files are wrong, or paho-mqtt is not installed."""
        host, port, secure = _place(broker.uri)
        self.name = f"MQTT {host}:{port}"
        self.thrown_away = 0
        self._topic = broker.topic
        self._where = (host, port)
        password = _password(broker.password_file)
        self._login = None if broker.user is None else (broker.user, password)
        self._tls = _context(broker.ca) if secure else None
        self._client = self._new_client()
        self._waiting: deque[Heard] = deque(maxlen=MOST_WAITING)
        self._refusal: str | None = None
        self._welcome = False
        """Whether the broker has let us in, this time."""
        self._closing = threading.Event()
        self._over = threading.Event()
        """The connection has ended."""
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._thread = threading.Thread(target=self._keep, name="mqtt", daemon=True)
        self._thread.start()

    def fileno(self) -> int | None:
        """What the thread rouses the gateway by; None once it is closed."""
        return None if self._closing.is_set() else self._wake

    def read(self) -> list[Heard]:
        """The messages that have come. Raises `InputError` where the broker will never let us in."""
        try:
            os.eventfd_read(self._wake)
        except BlockingIOError:
            return []
        if self._refusal is not None:
            raise InputError(f"--mqtt: {self.name}: {self._refusal}")
        found: list[Heard] = []
        while self._waiting and len(found) < MOST_AT_ONCE:
            found.append(self._waiting.popleft())
        if self._waiting:
            os.eventfd_write(self._wake, 1)
        return found

    def registered(self, heard: Heard, car: int | None, now_s: float) -> None:
        """Who hears signals is between the broker and those who subscribe."""

    def tell(self, line: bytes, car: int | None, now_s: float) -> None:  # noqa: ARG002 all subscribers hear it
        """Publishes it, not retained: a `go` that a dead box has left behind would be heard for ever."""
        if self._client.is_connected():
            self._client.publish(f"{self._topic}/signal", line.strip(), qos=0, retain=False)

    def tend(self, now_s: float) -> None:
        """The thread does."""

    def close(self) -> None:
        """Ends the line."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._client.disconnect()
        self._over.set()
        self._thread.join(CLOSE_S)
        if not self._thread.is_alive():
            os.close(self._wake)

    def _keep(self) -> None:
        """The thread: connects, waits for the connection's end, and does so again."""
        tries = 0
        while not self._closing.is_set() and self._refusal is None:
            why = self._once()
            if why is None or self._closing.is_set() or self._refusal is not None:
                return
            tries = 0 if why == _HUNG_UP else tries
            if tries == 0:
                log.warning("%s: away (%s); it is tried again", self.name, why)
            self._closing.wait(BACK_OFF_S[min(tries, len(BACK_OFF_S) - 1)])
            tries += 1

    def _once(self) -> str | None:
        """One connection, and why it ended; None where it is not to be tried again."""
        self._over.clear()
        self._welcome = False
        client = self._client = self._new_client()
        try:
            client.connect(*self._where, keepalive=KEEPALIVE_S)
        except ssl.SSLCertVerificationError as error:
            self._refuse(f"its certificate is not good: {error.verify_message}")
            return None
        except OSError as error:
            return error.strerror or str(error) or type(error).__name__
        # paho's own thread reads and writes, so that others may publish.
        client.loop_start()
        while not self._over.wait(LOOK_S) and not self._closing.is_set():
            pass
        client.loop_stop()
        return _HUNG_UP if self._welcome else "it does not let us in"

    def _new_client(self) -> Any:
        """One for each connection: one that connects again leaves sockets behind. Raises `InputError` without paho-mqtt."""
        try:
            from paho.mqtt import client as mqtt  # noqa: PLC0415 an extra
            from paho.mqtt.enums import CallbackAPIVersion  # noqa: PLC0415 an extra
        except ImportError as error:
            raise InputError("--mqtt: paho-mqtt is not installed: pip install 'dnb-edge[fleet]'") from error
        client = mqtt.Client(CallbackAPIVersion.VERSION2, reconnect_on_failure=False)
        client.connect_timeout = CONNECT_S
        if self._login is not None:
            client.username_pw_set(*self._login)
        if self._tls is not None:
            client.tls_set_context(self._tls)
        client.on_connect = self._connected
        client.on_disconnect = self._disconnected
        client.on_message = self._message
        return client

    def _disconnected(self, client: Any, userdata: Any, flags: Any, reason: Any, properties: Any) -> None:  # noqa: ARG002
        self._over.set()

    def _connected(self, client: Any, userdata: Any, flags: Any, reason: Any, properties: Any) -> None:  # noqa: ARG002
        if not reason.is_failure:
            self._welcome = True
            log.info("%s: connected", self.name)
            client.subscribe(f"{self._topic}/+/telemetry", qos=0)
        elif str(reason) in REFUSALS:
            self._refuse(f"it refuses us: {str(reason).lower()}")

    def _message(self, client: Any, userdata: Any, message: Any) -> None:  # noqa: ARG002
        self.thrown_away += len(self._waiting) == MOST_WAITING
        heard = Heard(
            line=bytes(message.payload).strip(), sender=(self.name, message.topic), came_ns=time.monotonic_ns()
        )
        self._waiting.append(heard)
        os.eventfd_write(self._wake, 1)

    def _refuse(self, why: str) -> None:
        self._refusal = why
        os.eventfd_write(self._wake, 1)


def _place(uri: str) -> tuple[str, int, bool]:
    """Host, port, and whether TLS is meant. Raises `InputError`."""
    wrong = InputError(f"--mqtt {uri}: use mqtt://HOST[:PORT], or mqtts://HOST[:PORT] for TLS")
    try:
        parts = urlsplit(uri)
        port = parts.port
    except ValueError as error:
        raise wrong from error
    if parts.scheme not in PORTS or not parts.hostname or parts.path not in {"", "/"} or parts.username or parts.query:
        raise wrong
    return parts.hostname, PORTS[parts.scheme] if port is None else port, parts.scheme == "mqtts"


def _password(path: Path | None) -> str | None:
    if path is None:
        return None
    try:
        return path.read_text(encoding="utf-8").rstrip("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"--password-file {path}: cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from error


def _context(ca: Path | None) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=None if ca is None else str(ca))
    except (OSError, ssl.SSLError) as error:
        raise InputError(f"--ca {ca}: no certificates can be read there: {error.strerror or error}") from error
