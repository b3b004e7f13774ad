"""`dnb-edge vehicle`: what cars say of themselves, and what they are told; a process between a network and the race."""

from __future__ import annotations

import logging
import signal
import sys
from contextlib import ExitStack
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from dnb_edge.errors import InputError
from dnb_edge.vehicle.channel import Channel
from dnb_edge.vehicle.gateway import Gateway
from dnb_edge.vehicle.link import Link
from dnb_edge.vehicle.mqtt import TOPIC, Broker, MqttChannel
from dnb_edge.vehicle.serial_line import SerialChannel
from dnb_edge.vehicle.udp import UdpChannel

SYSTEM_SOCKET = Path("/run/dnb-edge/live.sock")
BAUD = 115200
EVERYWHERE = "0.0.0.0"  # noqa: S104 whoever asks for a port alone means the cars' network


def vehicle(
    live: Annotated[Path, typer.Option("--socket", help="The live socket of dnb-edge run.")] = SYSTEM_SOCKET,
    udp: Annotated[
        list[str] | None,
        typer.Option(help="Listen here for cars. May be given several times.", metavar="[HOST:]PORT"),
    ] = None,
    serial: Annotated[
        list[str] | None,
        typer.Option(
            help=f"A car, or its radio, at a serial port; {BAUD} baud. May be given several times.",
            metavar="PATH[@BAUD]",
        ),
    ] = None,
    mqtt: Annotated[
        str | None, typer.Option(help="An MQTT broker: mqtt://HOST[:PORT], mqtts:// for TLS.", metavar="URI")
    ] = None,
    topic: Annotated[str, typer.Option(help="With --mqtt: what stands before the topics.")] = TOPIC,
    user: Annotated[str | None, typer.Option(help="With --mqtt: the user's name.")] = None,
    password_file: Annotated[
        Path | None, typer.Option(help="With --mqtt: a file with the password.", metavar="FILE")
    ] = None,
    ca: Annotated[
        Path | None, typer.Option(help="With mqtts: who may vouch for the broker (PEM).", metavar="FILE")
    ] = None,
) -> None:
    """Take what cars say of themselves into the race's recording and onto the board, and tell them ready, go, stop and laps.

    Runs until Ctrl-C is pressed. Whoever reaches the port can speak for a car, and can change nothing in the race.
    """
    if not (udp or serial or mqtt):
        raise InputError("no way to any car: give --udp PORT, --serial PATH or --mqtt URI")
    if mqtt is None and (user is not None or password_file is not None or ca is not None):
        raise InputError("--user, --password-file and --ca are for --mqtt: give it too")
    logging.getLogger("dnb_edge.vehicle").setLevel(logging.INFO)
    with ExitStack() as stack:
        channels: list[Channel] = []

        def opened(channel: Channel) -> None:
            stack.callback(channel.close)
            channels.append(channel)

        for text in udp or ():
            opened(UdpChannel(*_address(text)))
        for text in serial or ():
            opened(SerialChannel(*_port(text)))
        if mqtt is not None:
            opened(MqttChannel(Broker(uri=mqtt, user=user, password_file=password_file, ca=ca, topic=_topic(topic))))
        gateway = Gateway(Link(live), channels)
        _stop_by_signal(gateway)
        for channel in channels:
            typer.echo(channel.name)
        sys.stdout.flush()
        gateway.run()


def _stop_by_signal(gateway: Gateway) -> None:
    def end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        gateway.stop()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)


def _address(text: str) -> tuple[str, int]:
    """Raises `InputError`."""
    host, _, port = text.rpartition(":")
    if not (port.isascii() and port.isdecimal() and len(port) < 6 and int(port) < 65536):
        raise InputError(f"--udp {text}: use PORT or HOST:PORT, such as 5610")
    return host.strip("[]") or EVERYWHERE, int(port)


def _port(text: str) -> tuple[str, int]:
    """Raises `InputError`."""
    path, _, baud = text.partition("@")
    if not path.startswith("/") or (
        baud and not (baud.isascii() and baud.isdecimal() and 50 <= int(baud) <= 4_000_000)
    ):
        raise InputError(f"--serial {text}: use a port's full path, with its baud rate if need be: /dev/ttyUSB0@57600")
    return path, int(baud) if baud else BAUD


def _topic(text: str) -> str:
    """Raises `InputError`."""
    if not text or any(sign in text for sign in "+#\0") or text.startswith(("/", "$")) or text.endswith("/"):
        raise InputError(f"--topic {text!r}: use a plain topic such as {TOPIC}")
    return text
