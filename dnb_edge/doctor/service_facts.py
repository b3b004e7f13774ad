"""Facts of what serves: the pages, the display, the watchdogs, and who may write where.

Knows HTTP on this machine, serial ports and modes. What it tells a display is a line for people, and takes nothing back.
"""

from __future__ import annotations

import grp
import http.client
import os
import pwd
import select
import stat
import time
from collections.abc import Sequence
from pathlib import Path

import serial

from dnb_edge.display import messages, protocol
from dnb_edge.display.luma_device import need_luma, parse_spi
from dnb_edge.display.serial_port import PORT_FAULTS, write_lines
from dnb_edge.display.state import BoardState
from dnb_edge.display.uri import check_uri
from dnb_edge.doctor.access import access_of
from dnb_edge.doctor.service_rules import Port, Reached, Taking, Watchdogs
from dnb_edge.doctor.unit_facts import Ask, UnitLook, systemctl
from dnb_edge.doctor.verdict import CannotTell
from dnb_edge.errors import InputError

ANSWER_S = 0.4
"""How long a display that has something to say is heard."""
WEB_TIMEOUT_S = 5.0
_ANSWER_BYTES = 60


def reach_web(port: int, *, is_installed: bool) -> Reached:
    """Asks for the first page, as a browser on this machine would."""
    url = f"http://127.0.0.1:{port}/"
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=WEB_TIMEOUT_S)
    try:
        connection.request("GET", "/", headers={"Host": f"localhost:{port}"})
        return Reached(url=url, status=connection.getresponse().status, fault=None, is_installed=is_installed)
    except (OSError, http.client.HTTPException) as error:
        why = getattr(error, "strerror", None) or str(error) or type(error).__name__
        return Reached(url=url, status=None, fault=why, is_installed=is_installed)
    finally:
        connection.close()


def find_port(uri: str | None, *, unit_groups: Sequence[str], dev: Path) -> Port:
    """The port of the display at `uri`."""
    if uri is None:
        return Port(uri=None)
    try:
        check_uri(uri)
        if uri.startswith("spi:"):
            need_luma()
    except InputError as error:
        return Port(uri=uri, fault=str(error))
    node = port_of(uri)
    if node is None:
        return Port(uri=uri)
    return Port(
        uri=uri,
        needs_port=True,
        access=access_of(node, unit_groups=unit_groups) if node.exists() else None,
        ports=tuple(str(one) for pattern in ("ttyUSB*", "ttyACM*", "spidev*") for one in sorted(dev.glob(pattern))),
    )


def port_of(uri: str) -> Path | None:
    """The device behind a display's URI; None where it has none."""
    scheme, _, rest = uri.partition(":")
    if scheme == "spi":
        return Path(parse_spi(rest).path)
    return Path(rest) if scheme == "serial" else None


def try_display(uri: str) -> Taking:
    """Paints an empty board on the serial display at `uri` and hears what it says. Raises `CannotTell` where it has no port."""
    node = port_of(uri)
    if node is None or not uri.startswith("serial:"):
        raise CannotTell(f"{uri} is no serial display: it takes what it is told, and cannot say that it did")
    told = b"".join(protocol.encode_line(message) for message in messages.repaint(BoardState()))
    try:
        with serial.Serial(str(node), protocol.BAUD, timeout=0, write_timeout=1.0, exclusive=True) as port:
            write_lines(port, told, fresh=True)
            answer = _hear(port)
            if port.out_waiting:
                port.reset_output_buffer()
                return Taking(uri=uri, by_service=False, fault="takes no bytes")
    except serial.SerialTimeoutException:
        return Taking(uri=uri, by_service=False, fault="takes no bytes")
    except PORT_FAULTS as error:
        number = error.args[0] if error.args else None
        return Taking(uri=uri, by_service=False, fault=os.strerror(number) if isinstance(number, int) else str(error))
    return Taking(uri=uri, by_service=False, fault=None, answer=answer)


def _hear(port: serial.Serial) -> str:
    """What comes back for a moment, as far as it is text."""
    heard = b""
    deadline_s = time.monotonic() + ANSWER_S
    while (left_s := deadline_s - time.monotonic()) > 0 and len(heard) < _ANSWER_BYTES:
        if select.select([port.fileno()], [], [], left_s)[0]:
            heard += port.read(_ANSWER_BYTES)
    text = heard.decode("ascii", "replace").strip()
    return "".join(letter if letter.isprintable() else " " for letter in text)[:_ANSWER_BYTES]


def find_watchdogs(unit: UnitLook, *, dev: Path, ask: Ask | None = None) -> Watchdogs:
    """Who starts what hangs."""
    said = (systemctl if ask is None else ask)(("show", "--property=RuntimeWatchdogUSec"))
    value = said.strip().partition("=")[2]
    return Watchdogs(
        unit=unit,
        hardware=any(dev.glob("watchdog*")),
        armed=value not in ("0", "infinity") if value else None,
    )


def may_write(directory: Path, user: str) -> bool | None:
    """Whether `user` may make files in `directory`, by its owner, group and mode; None where there is no such user."""
    try:
        entry = pwd.getpwnam(user)
    except KeyError:
        return None
    found = directory.stat()
    needed = stat.S_IWOTH | stat.S_IXOTH
    if found.st_uid == entry.pw_uid:
        return found.st_mode >> 6 & needed == needed
    groups = {*os.getgrouplist(user, entry.pw_gid), *(one.gr_gid for one in grp.getgrall() if user in one.gr_mem)}
    shift = 3 if found.st_gid in groups else 0
    return found.st_mode >> shift & needed == needed
