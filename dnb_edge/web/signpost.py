"""The address of the pages on the box's displays, once after each start, so that nobody has to look for it in a router.

Knows the line to the daemon and the machine's addresses; knows no page.
"""

from __future__ import annotations

import asyncio
import fcntl
import ipaddress
import logging
import socket
import struct
from collections.abc import Callable

from dnb_edge.live.messages import Phase
from dnb_edge.web.box import Daemon
from dnb_edge.web.endpoint import Refused

SHOWN_S = 60.0
AGAIN_S = 3.0
"""How often it is looked whether there is a network, a timing service and no race by now."""
_SIOCGIFADDR = 0x8915
"""Linux' request for an interface's IPv4 address, <linux/sockios.h>."""

_log = logging.getLogger(__name__)


class Signpost:
    """Tells each process of the daemon once, while it does not race: a race is not to be covered by an address."""

    def __init__(self, daemon: Daemon, address: Callable[[], str | None]) -> None:
        """`address()` is what to type into a browser; None while there is no network."""
        self._daemon = daemon
        self._address = address
        self._told: str | None = None
        """The process that was told."""

    async def run(self) -> None:
        """Looks now and then, until it is cancelled."""
        while True:
            await self.look()
            await asyncio.sleep(AGAIN_S)

    async def look(self) -> None:
        """Has the displays show the address where it is time to."""
        state, epoch = self._daemon.state, self._daemon.epoch
        if state is None or epoch == self._told or state.phase is Phase.STARTING:
            return
        if state.phase is Phase.RACING:
            # Whoever races has set it up, and knows where.
            self._told = epoch
            return
        address = self._address()
        if address is None:
            return
        try:
            await self._daemon.ask(show=f"open {address}", for_s=SHOWN_S)
        except Refused as refused:
            _log.info("the displays do not show the address yet: %s", refused.text)
            return
        self._told = epoch


def address_of(host: str, port: int) -> str | None:
    """What to type into a browser to reach pages served at `host` and `port`; None where nobody else can, or by no network."""
    tail = "" if port == 80 else f":{port}"
    try:
        bound = ipaddress.ip_address(host)
    except ValueError:
        return f"http://{host}{tail}"
    if bound.is_loopback:
        return None
    if not bound.is_unspecified:
        return f"http://[{host}]{tail}" if bound.version == 6 else f"http://{host}{tail}"
    own = own_address()
    return None if own is None else f"http://{own}{tail}"


def own_address() -> str | None:
    """The machine's IPv4 address: by which it reaches others, or, in a network of its own, its first; nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
        except OSError:
            return next(filter(None, (_of_interface(probe, name) for _, name in socket.if_nameindex())), None)
        return str(probe.getsockname()[0])


def _of_interface(probe: socket.socket, name: str) -> str | None:
    try:
        found = fcntl.ioctl(probe.fileno(), _SIOCGIFADDR, struct.pack("256s", name.encode()[:15]))
    except OSError:
        return None
    address = ipaddress.IPv4Address(found[20:24])
    return None if address.is_loopback else str(address)
