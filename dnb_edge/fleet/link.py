"""One lasting line to a broker: connects, comes back with back-off, and says in one line what is the matter.

All of it in one thread, the caller's; whoever uses it is a `Peer`. What a broker refuses at first is wrong configuration and
ends it; what it refuses after it has once accepted is waited out. Knows MQTT 5 by paho's client; knows no topic and no file.
"""

from __future__ import annotations

import socket
import ssl
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from dnb_edge.errors import InputError, TemporaryFault
from dnb_edge.fleet.broker import CONNECT_S, KEEPALIVE_S, Broker, listen, make_client

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage
    from paho.mqtt.reasoncodes import ReasonCode

T = TypeVar("T")

TURN_S = 0.05
"""How long a turn waits for the broker; so late is something told at most that nobody roused us for."""
WAITS_S = (0.5, 1.0, 2.0, 5.0, 10.0)
"""Before each try after the line broke; the last one again and again."""
LAST_WORDS_S = 1.0
TAKEN_OVER = 0x8E
HELD_S = 10.0
"""A line that was up for so long is tried again at once when it breaks."""
SETTLED_S = 5.0
"""Whoever is on the line for so long was there first."""
LATER = frozenset({0x80, 0x88, 0x89, 0x8B, 0x97, 0x9F})
"""Refusals that say come again: unspecified, unavailable, busy, shutting down, quota, rate."""
NOT_YET_VALID, EXPIRED = 9, 10
"""OpenSSL's codes for certificates; a box without a battery for its clock meets them until it has the time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Will:
    """What the broker says, retained, when the line breaks."""

    topic: str
    payload: bytes


class Line(Protocol):
    """What a peer may do with the line while it is up."""

    def publish(self, topic: str, payload: bytes, *, retain: bool = False, qos: int = 1) -> None:
        """Hands a message over; whether the broker took it nobody is told but by its being heard."""


class Peer(Protocol):
    """Who speaks on the line; everything is called in its thread, and is short."""

    @property
    def topics(self) -> tuple[str, ...]:
        """What to listen to."""

    def greeted(self, line: Line) -> None:
        """The line is up and `topics` are listened to: say who you are."""

    def heard(self, line: Line, topic: str, payload: bytes, *, retained: bool) -> None:
        """A message has come; `retained`: it was said before the line came up."""

    def turn(self, line: Line | None) -> None:
        """Time has passed; None while the line is down."""

    def broken(self, why: str) -> None:
        """The line is down, or did not come up."""

    def farewell(self, line: Line) -> None:
        """It is going to be hung up."""


class Link:
    """The line to `broker` as `client_id`."""

    def __init__(self, broker: Broker, *, client_id: str, will: Will, waits_s: tuple[float, ...] = WAITS_S) -> None:
        self._broker = broker
        self._client_id = client_id
        self._will = will
        self._waits_s = waits_s
        self._accepted = False
        """Whether the broker ever took a message."""
        self._client: Client | None = None
        self._inbox: deque[tuple[str, bytes, bool]] = deque()
        self._under_way: dict[int, str] = {}
        """Topics of what the broker has not acknowledged, by its number."""
        self._refusals: deque[str] = deque()
        self._connected: ReasonCode | None = None
        self._subscribed: list[ReasonCode] | None = None
        self._hung_up: ReasonCode | None = None

    def run(self, peer: Peer, stop: Callable[[], bool]) -> None:
        """Keeps the line until `stop()`. Raises `InputError` where nobody but a person can mend it."""
        tries = 0
        while not stop():
            began_s = time.monotonic()
            try:
                self._connect(peer)
                self._converse(peer, stop)
            except TemporaryFault as fault:
                peer.broken(str(fault))
            finally:
                self._drop()
            if time.monotonic() - began_s > HELD_S:
                tries = 0
            wait_s = self._waits_s[min(tries, len(self._waits_s) - 1)]
            tries += 1
            again_s = time.monotonic() + wait_s
            while not stop() and time.monotonic() < again_s:
                peer.turn(None)
                time.sleep(TURN_S)

    def publish(self, topic: str, payload: bytes, *, retain: bool = False, qos: int = 1) -> None:
        """As `Line`."""
        if self._client is not None:
            sent = self._client.publish(topic, payload, qos=qos, retain=retain)
            if qos:
                self._under_way[sent.mid] = topic

    def _connect(self, peer: Peer) -> None:
        """Brings the line up. Raises `TemporaryFault`, or `InputError` where the first try is refused for good."""
        self._connected = self._subscribed = self._hung_up = None
        for queue in (self._inbox, self._under_way, self._refusals):
            queue.clear()
        client = self._client = make_client(self._broker, self._client_id)
        client.on_connect = self._on_connect
        client.on_message = self._on_message
        client.on_publish = self._on_publish
        client.on_subscribe = self._on_subscribe
        client.on_disconnect = self._on_disconnect
        client.will_set(self._will.topic, self._will.payload, qos=1, retain=True)
        try:
            client.connect(self._broker.host, self._broker.port, keepalive=KEEPALIVE_S)
        except (OSError, ValueError) as error:
            raise self._unreachable(error) from error
        greeting = self._wait(lambda: self._connected)
        if greeting.is_failure:
            raise self._refused(f"the broker refuses: {str(greeting).lower()}", greeting.value)
        listen(client, peer.topics)
        for code in self._wait(lambda: self._subscribed):
            if code.is_failure:
                raise self._refused(f"the broker lets us not listen: {str(code).lower()}: see its ACL", code.value)
        peer.greeted(self)

    def _converse(self, peer: Peer, stop: Callable[[], bool]) -> None:
        while not stop():
            self._turn()
            while self._inbox:
                topic, payload, retained = self._inbox.popleft()
                peer.heard(self, topic, payload, retained=retained)
            peer.turn(self)
        peer.farewell(self)
        end_s = time.monotonic() + LAST_WORDS_S
        while self._under_way and time.monotonic() < end_s:
            self._turn()
        if self._client is not None:
            self._client.disconnect()

    def _turn(self) -> None:
        """Has paho read, write and ping. Raises as `_connect` where the line has broken or something is refused."""
        assert self._client is not None
        # paho answers to a socket that it has closed itself with an assertion or an OSError, too.
        try:
            code = self._client.loop(TURN_S)
        except OSError as error:
            raise self._fault(error.strerror or str(error)) from error
        if self._refusals:
            raise self._refused(self._refusals.popleft(), None)
        if code == 0:
            return
        if self._hung_up is not None and self._hung_up.value == TAKEN_OVER:
            raise InputError(
                f"{self._broker.text}: another process is there as {self._client_id}: give one of the two another name"
            )
        if self._connected is None or not self._connected.is_failure:
            raise self._fault("the line has broken")

    def _wait(self, answer: Callable[[], T | None]) -> T:
        end_s = time.monotonic() + CONNECT_S
        while (found := answer()) is None:
            if time.monotonic() > end_s:
                raise self._fault("what listens there does not answer as a broker")
            self._turn()
        return found

    def _drop(self) -> None:
        """Forgets the connection; without a word, so that the broker says the will unless `farewell` was said."""
        client, self._client = self._client, None
        if client is not None and (open_socket := client.socket()) is not None:
            open_socket.close()

    def _unreachable(self, error: OSError | ValueError) -> TemporaryFault | InputError:
        match error:
            case ssl.SSLCertVerificationError() if error.verify_code in {NOT_YET_VALID, EXPIRED}:
                return self._fault(
                    f"its certificate does not hold now ({error.verify_message}): is this machine's clock right?"
                )
            case ssl.SSLCertVerificationError():
                return self._refused(f"its certificate is not to be trusted: {error.verify_message}", None)
            case ssl.SSLEOFError() | ssl.SSLZeroReturnError() | ssl.SSLSyscallError() | ConnectionResetError():
                return self._fault(
                    "hung up at once: is TLS spoken at this port?" if self._broker.tls else "hung up at once"
                )
            case ssl.SSLError():
                return self._refused(
                    f"no TLS is spoken there ({error.reason}): is it the right port? mqtt:// is without", None
                )
            case socket.gaierror():
                return self._fault("no such host is known just now")
            case TimeoutError():
                return self._fault("nobody answers")
            case OSError():
                return self._fault((error.strerror or str(error)).lower())
        return self._refused(str(error), None)

    def _refused(self, why: str, code: int | None) -> TemporaryFault | InputError:
        """An error that only a person can mend, unless it went well before: then the broker is being worked on."""
        if self._accepted or code in LATER:
            return self._fault(why)
        return InputError(f"{self._broker.text}: {why}")

    def _fault(self, why: str) -> TemporaryFault:
        return TemporaryFault(f"{self._broker.text}: {why}")

    def _on_connect(self, _client: Client, _data: Any, _flags: Any, code: ReasonCode, _properties: Any) -> None:
        self._connected = code

    def _on_subscribe(self, _client: Client, _data: Any, _mid: int, codes: list[ReasonCode], _properties: Any) -> None:
        self._subscribed = codes

    def _on_message(self, _client: Client, _data: Any, message: MQTTMessage) -> None:
        self._inbox.append((message.topic, bytes(message.payload), message.retain))

    def _on_publish(self, _client: Client, _data: Any, mid: int, code: ReasonCode, _properties: Any) -> None:
        topic = self._under_way.pop(mid, None)
        if topic is None:
            # Of quality 0: gone, and nobody knows whether it was taken.
            return
        if code.is_failure:
            self._refusals.append(f"the broker does not take {topic}: {str(code).lower()}: see its ACL")
        else:
            self._accepted = True

    def _on_disconnect(self, _client: Client, _data: Any, _flags: Any, code: ReasonCode, _properties: Any) -> None:
        self._hung_up = code
