"""`dnb-edge vehicle` and what may be wrong with its words."""

import sys
from pathlib import Path

import pytest

from dnb_edge.cli.vehicle import _address, _port, vehicle
from dnb_edge.errors import InputError


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ({}, "no way to any car: give --udp PORT, --serial PATH or --mqtt URI"),
        ({"udp": ["car"]}, "--udp car: use PORT or HOST:PORT, such as 5610"),
        ({"udp": ["65536"]}, "--udp 65536: use PORT or HOST:PORT"),
        ({"udp": ["nowhere.invalid:5610"]}, "--udp nowhere.invalid:5610: cannot listen there"),
        ({"serial": ["ttyUSB0"]}, "--serial ttyUSB0: use a port's full path"),
        ({"serial": ["/dev/ttyUSB0@fast"]}, "--serial /dev/ttyUSB0@fast: use a port's full path"),
        ({"mqtt": "broker"}, "--mqtt broker: use mqtt://HOST"),
        ({"mqtt": "mqtt://broker", "topic": "cars/#"}, "--topic 'cars/#': use a plain topic"),
        ({"udp": ["0"], "user": "me"}, "--user, --password-file and --ca are for --mqtt: give it too"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(words: dict[str, object], why: str) -> None:
    """Before anything is waited for."""
    with pytest.raises(InputError) as told:
        vehicle(live=Path("/nowhere"), **words)  # type: ignore[arg-type]
    assert str(told.value).startswith(why)


def test_without_paho_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """MQTT is an extra; the other ways need nothing."""
    monkeypatch.setitem(sys.modules, "paho.mqtt", None)
    with pytest.raises(InputError, match=r"--mqtt: paho-mqtt is not installed: pip install 'dnb-edge\[fleet\]'"):
        vehicle(live=Path("/nowhere"), mqtt="mqtt://broker")


def test_addresses_and_ports_are_read() -> None:
    """A port alone is the cars' network; a serial port may bring its rate."""
    assert _address("5610") == ("0.0.0.0", 5610)
    assert _address("192.168.4.1:5611") == ("192.168.4.1", 5611)
    assert _address("[::1]:5610") == ("::1", 5610)
    assert _port("/dev/ttyUSB0") == ("/dev/ttyUSB0", 115200)
    assert _port("/dev/ttyUSB0@57600") == ("/dev/ttyUSB0", 57600)
