"""By which names the box may be called: what keeps a foreign page from reaching it under a name of its own (DNS rebinding).

Knows the Host and Origin headers; knows no route.
"""

from __future__ import annotations

import ipaddress
import re
import socket
from dataclasses import dataclass

_HOST = re.compile(r"(?P<name>\[[0-9a-f:.]+\]|[a-z0-9](?:[a-z0-9._-]{0,252}))(?::(?P<port>[0-9]{1,5}))?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Hosts:
    """The names of the box."""

    names: frozenset[str]
    """In lower case, without a full stop at the end; addresses among them count too."""

    def admits(self, host: str | None, server: str | None) -> bool:
        """Whether the Host header `host` calls this box. `server`: the box's own address of the connection."""
        name = host_name(host)
        if name is None:
            return False
        address = _address(name)
        if address is None:
            return name in self.names
        # An address cannot be rebound; one that is ours is where the connection has come in.
        return address.is_loopback or address == _address(server or "") or str(address) in self.names


def own_names(more: tuple[str, ...]) -> Hosts:
    """The box's own names, and `more`."""
    own = socket.gethostname().lower()
    short = own.partition(".")[0]
    given = {name.strip().lower().rstrip(".").strip("[]") for name in more}
    return Hosts(names=frozenset({"localhost", own, short, f"{short}.local"} | given) - {""})


def host_name(host: str | None) -> str | None:
    """The name in a Host header, without port, in lower case; None where the header is missing or malformed."""
    found = _HOST.fullmatch((host or "").lower())
    if found is None or int(found["port"] or 0) > 65535:
        return None
    return found["name"].rstrip(".")


def own_origin(origin: str, scheme: str, host: str) -> bool:
    """Whether the Origin header is exactly the page's of this very host. `scheme`: of the request, http(s) or ws(s)."""
    secure = scheme in {"https", "wss"}
    return origin.lower() == f"{'https' if secure else 'http'}://{host.lower()}"


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        address = ipaddress.ip_address(name.strip("[]").partition("%")[0])
    except ValueError:
        return None
    if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped is not None:
        return address.ipv4_mapped
    return address
