"""Vehicles by UDP: whoever sends a line that makes sense hears signals at the address that it came from.

Knows sockets. Knows nothing of what lines say.
"""

from __future__ import annotations

import socket
import struct
import time
from dataclasses import dataclass

from dnb_edge.errors import InputError
from dnb_edge.vehicle.channel import MOST_AT_ONCE, Heard

MOST_PEERS = 32
SILENT_S = 30.0
"""A vehicle that says nothing for so long hears nothing any more."""
MOST_DATAGRAM_BYTES = 2048
MOST_LINES = 8
"""Lines in one datagram that are looked at."""
SO_RXQ_OVFL = 40
"""socket(7): with each datagram the kernel tells how many it has thrown away."""
_COUNT = struct.Struct("=I")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Peer:
    car: int | None
    heard_s: float


class UdpChannel:
    """Listens at `host` and `port`."""

    def __init__(self, host: str, port: int) -> None:
        """Raises `InputError` where it cannot listen there."""
        try:
            self._socket = _listening(host, port)
        except OSError as error:
            why = error.strerror or error
            raise InputError(
                f"--udp {host}:{port}: cannot listen there: {why}: give another address or port"
            ) from error
        self.port = int(self._socket.getsockname()[1])
        """As it is where 0 was asked for."""
        self.name = f"UDP {host}:{self.port}"
        self.thrown_away = 0
        self._peers: dict[tuple[str, int], _Peer] = {}

    @property
    def peers(self) -> int:
        """How many vehicles hear signals."""
        return len(self._peers)

    def fileno(self) -> int | None:
        """Of its socket; None once it is closed."""
        number = self._socket.fileno()
        return None if number < 0 else number

    def read(self) -> list[Heard]:
        """The lines of the datagrams that have come."""
        found: list[Heard] = []
        while len(found) < MOST_AT_ONCE:
            try:
                data, told, _, address = self._socket.recvmsg(MOST_DATAGRAM_BYTES, socket.CMSG_SPACE(_COUNT.size))
            except BlockingIOError:
                break
            except OSError:
                continue  # of a vehicle that has gone: its answer to a signal, not a line
            came_ns = time.monotonic_ns()
            for level, kind, value in told:
                if (level, kind) == (socket.SOL_SOCKET, SO_RXQ_OVFL) and len(value) == _COUNT.size:
                    (self.thrown_away,) = _COUNT.unpack(value)
            where = (str(address[0]), int(address[1]))
            lines = [line.strip() for line in data.split(b"\n", MOST_LINES)]
            found += [
                Heard(line=line, sender=(self.name, where[0]), came_ns=came_ns, address=where) for line in lines if line
            ]
        return found

    def registered(self, heard: Heard, car: int | None, now_s: float) -> None:
        """Signals go to the address that the line came from; of too many the one that was silent for longest is left out."""
        assert heard.address is not None, "a datagram has a sender"
        if heard.address not in self._peers and len(self._peers) >= MOST_PEERS:
            del self._peers[min(self._peers, key=lambda one: self._peers[one].heard_s)]
        self._peers[heard.address] = _Peer(car=car, heard_s=now_s)

    def tell(self, line: bytes, car: int | None, now_s: float) -> None:
        """To each vehicle that was heard lately, and whose number is not another one."""
        for address, peer in list(self._peers.items()):
            if now_s - peer.heard_s > SILENT_S:
                del self._peers[address]
            elif car is None or peer.car is None or peer.car == car:
                try:
                    self._socket.sendto(line, address)
                except OSError:
                    continue  # no way there now, or no room: it is said again

    def tend(self, now_s: float) -> None:
        """A socket needs nothing."""

    def close(self) -> None:
        """Ends it."""
        self._socket.close()


def _listening(host: str, port: int) -> socket.socket:
    """Raises `OSError`."""
    family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    made = socket.socket(family, kind | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC, protocol)
    try:
        made.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
        made.bind(address)
    except OSError:
        made.close()
        raise
    return made
