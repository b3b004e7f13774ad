"""Cars by MQTT, over a real mosquitto: heard, told, refused, and found again when the broker comes back."""

import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from gateways import Box, running, until
from paho.mqtt import client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from dnb_edge.errors import InputError
from dnb_edge.live.messages import Phase, State
from dnb_edge.values import RacePhase
from dnb_edge.vehicle.mqtt import Broker, MqttChannel

sys.path.insert(0, str(Path(__file__).parents[1] / "fleet"))
from mqtt_broker import Mosquitto, certificate, needs_mosquitto

pytestmark = needs_mosquitto


@pytest.fixture
def box(tmp_path: Path) -> Iterator[Box]:
    """A daemon whose race is on."""
    made = Box(tmp_path / "live.sock")
    made.begins(State(phase=Phase.RACING, start="grid"))
    made.races(RacePhase.RACING)
    yield made
    made.server.close()


class Car:
    """A car with an MQTT client of its own."""

    def __init__(self, port: int) -> None:
        self.heard: list[bytes] = []
        self.listens = threading.Event()
        self._client = mqtt.Client(CallbackAPIVersion.VERSION2)
        self._client.on_message = lambda _client, _data, message: self.heard.append(message.payload)
        self._client.on_connect = lambda client, *_: client.subscribe("dnb-edge/vehicle/signal")
        self._client.on_subscribe = lambda *_: self.listens.set()
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        assert self.listens.wait(20.0)

    def say(self, line: bytes, topic: str = "red/telemetry") -> None:
        self._client.publish(f"dnb-edge/vehicle/{topic}", line)

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()


def test_a_car_by_mqtt_is_heard_and_hears_through_a_broker_that_dies(box: Box, tmp_path: Path) -> None:
    """Telemetry comes from its topic, signals go to theirs and are not retained; a broker that was killed is found again."""
    broker = Mosquitto(tmp_path)
    broker.start()
    channel = MqttChannel(Broker(uri=broker.url))
    with running(tmp_path / "live.sock", [channel]):
        for throttle in (0.25, 0.75):
            car = Car(broker.port)
            until(lambda car=car: b'{"signal":"go"}' in car.heard, "green")
            car.say(b"nonsense")
            car.say(b'{"car": 5, "throttle": %.2f}' % throttle)
            until(lambda throttle=throttle: box.words and box.words[-1].throttle == throttle, "the line")
            car.close()
            if throttle < 0.5:
                broker.kill()
                broker.start()
    late = Car(broker.port)
    late.say(b"behind whatever was retained", topic="signal")
    until(lambda: b"behind whatever was retained" in late.heard)
    late.close()
    broker.stop()
    assert [(word.car, word.refused) for word in box.words] == [(5, 1), (5, 2)]
    assert late.heard == [b"behind whatever was retained"]


def test_a_broker_that_refuses_us_ends_the_gateway_with_its_reason(tmp_path: Path) -> None:
    """A wrong password will be wrong again: one line, instead of cars that nobody hears."""
    password = tmp_path / "password"
    password.write_text("wrong\n", encoding="utf-8")
    with Mosquitto(tmp_path, lines=("allow_anonymous false",)) as broker:
        channel = MqttChannel(Broker(uri=broker.url, user="car", password_file=password))
        with (
            pytest.raises(InputError, match=rf"--mqtt: MQTT 127.0.0.1:{broker.port}: it refuses us: not authorized"),
            running(tmp_path / "live.sock", [channel]),
        ):
            until(lambda: channel.fileno() is None, "the end")


# paho-mqtt does not close the socket of a handshake that failed.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_over_tls_a_car_is_told_and_another_ones_certificate_ends_it(box: Box, tmp_path: Path) -> None:
    """With the broker's own certificate to trust it connects; by another name than the certificate's it never will."""
    made, key = certificate(tmp_path, "localhost")
    with Mosquitto(tmp_path, lines=("allow_anonymous true", f"certfile {made}", f"keyfile {key}")) as broker:
        channel = MqttChannel(Broker(uri=f"mqtts://localhost:{broker.port}", ca=made))
        with running(tmp_path / "live.sock", [channel]):
            until(channel._client.is_connected, "the connection")
        channel = MqttChannel(Broker(uri=f"mqtts://127.0.0.1:{broker.port}", ca=made))
        with (
            pytest.raises(InputError, match=r"its certificate is not good: IP address mismatch"),
            running(tmp_path / "live.sock", [channel]),
        ):
            until(lambda: channel.fileno() is None, "the end")


def test_a_broker_that_is_away_harms_nobody(box: Box, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """It is told once, and tried again; the end does not wait for it."""
    with running(tmp_path / "live.sock", [MqttChannel(Broker(uri="mqtt://127.0.0.1:9"))]):
        until(lambda: "is tried again" in caplog.text, "the warning")
    assert "MQTT 127.0.0.1:9: away (Connection refused); it is tried again" in caplog.text


@pytest.mark.parametrize(
    ("broker", "why"),
    [
        (Broker(uri="http://broker"), "use mqtt://HOST"),
        (Broker(uri="mqtt://"), "use mqtt://HOST"),
        (Broker(uri="mqtt://broker:70000"), "use mqtt://HOST"),
        (Broker(uri="mqtt://me:secret@broker"), "use mqtt://HOST"),
        (Broker(uri="mqtts://broker", ca=Path("/nowhere.pem")), "--ca /nowhere.pem: no certificates can be read there"),
        (Broker(uri="mqtt://b", user="u", password_file=Path("/nowhere")), "--password-file /nowhere: cannot be read"),
    ],
)
def test_what_is_wrong_with_a_broker_is_said_at_once(broker: Broker, why: str) -> None:
    """Before anything is connected."""
    with pytest.raises(InputError, match=why):
        MqttChannel(broker)
