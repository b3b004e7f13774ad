"""The broker as it is named on the command line, and paho's client for it, made where the extra is installed.

Knows addresses, certificates and password files; knows no topic.
"""

from __future__ import annotations

import importlib
import ssl
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from dnb_edge.errors import InputError

if TYPE_CHECKING:
    from paho.mqtt.client import Client

PORTS = {"mqtt": 1883, "mqtts": 8883}
KEEPALIVE_S = 15
"""The broker holds a box that is silent for one and a half of it for gone."""
CONNECT_S = 5.0
MOST_UNDER_WAY = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Broker:
    """Where it is, and by what right it is spoken to."""

    host: str
    port: int
    tls: bool
    ca: Path | None = None
    """Certificates to trust instead of the machine's own."""
    user: str | None = None
    password: str | None = None

    @property
    def text(self) -> str:
        """As people write it."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'mqtts' if self.tls else 'mqtt'}://{host}:{self.port}"


def broker(address: str, *, ca: Path | None, user: str | None, password_file: Path | None) -> Broker:
    """The broker at `address`, such as mqtts://host:8883. Raises `InputError` naming what is wrong."""
    try:
        found = urlsplit(address)
        port = found.port
    except ValueError as error:
        raise InputError(f"--broker {address}: {error}: write mqtts://HOST or mqtts://HOST:PORT") from error
    if found.scheme not in PORTS or not found.hostname or found.path not in {"", "/"} or found.query:
        raise InputError(
            f"--broker {_without_password(address)}: write mqtts://HOST or mqtts://HOST:PORT (mqtt:// without TLS)"
        )
    if found.username is not None or found.password is not None:
        raise InputError(
            "--broker: give user and password by --user and --password-file: others can read a command line"
        )
    tls = found.scheme == "mqtts"
    if ca is not None and not tls:
        raise InputError(f"--ca {ca}: mqtt:// has no certificates: write mqtts://")
    if password_file is not None and user is None:
        raise InputError("--password-file: whose password is it? Give --user, too")
    return Broker(
        host=found.hostname,
        port=PORTS[found.scheme] if port is None else port,
        tls=tls,
        ca=ca,
        user=user,
        password=None if password_file is None else _password(password_file),
    )


def make_client(to: Broker, client_id: str) -> Client:
    """A client for one connection. Raises `InputError` where the extra is missing or the certificates cannot be read."""
    mqtt = _paho()
    client: Client = mqtt.Client(
        mqtt.CallbackAPIVersion.VERSION2, client_id=client_id, protocol=mqtt.MQTTv5, reconnect_on_failure=False
    )
    client.connect_timeout = CONNECT_S
    client.max_inflight_messages_set(MOST_UNDER_WAY)
    if to.user is not None:
        client.username_pw_set(to.user, to.password)
    if to.tls:
        client.tls_set_context(_context(to.ca))
    return client


def listen(client: Client, topics: tuple[str, ...]) -> None:
    """Subscribes to `topics` with quality 1."""
    options = importlib.import_module("paho.mqtt.subscribeoptions").SubscribeOptions(qos=1)
    client.subscribe([(topic, options) for topic in topics])


def _context(ca: Path | None) -> ssl.SSLContext:
    try:
        context = ssl.create_default_context(cafile=None if ca is None else str(ca))
    except ssl.SSLError as error:
        raise InputError(f"--ca {ca}: no certificates in PEM form") from error
    except OSError as error:
        raise InputError(f"--ca {ca}: {error.strerror}") from error
    context.sslsocket_class = _Closing
    return context


class _Closing(ssl.SSLSocket):
    """Closes where the handshake fails: paho forgets it then."""

    def do_handshake(self, block: bool = False) -> None:
        """As of any socket."""
        try:
            super().do_handshake(block)
        except OSError:
            self.close()
            raise


def _paho() -> ModuleType:
    try:
        return importlib.import_module("paho.mqtt.client")
    except ImportError as error:
        raise InputError("paho-mqtt is missing: pip install 'dnb-edge[fleet]'") from error


def _password(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8").rstrip("\r\n")
    except OSError as error:
        raise InputError(f"--password-file {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"--password-file {path}: no text in UTF-8") from error


def _without_password(address: str) -> str:
    """`address` as it may be logged."""
    head, at, tail = address.rpartition("@")
    return f"{head.partition('://')[0]}://...@{tail}" if at else address
