"""The gateway between real sockets: cars by UDP and serial on one side, the live socket on the other."""

import json
import os
import pty
import socket
import subprocess
import sys
import time
import tty
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from gateways import Box, running, until

from dnb_edge.errors import InputError
from dnb_edge.live.messages import Phase, State
from dnb_edge.values import Lap, RacePhase
from dnb_edge.vehicle import client_micropython
from dnb_edge.vehicle.client import Vehicle
from dnb_edge.vehicle.serial_line import SerialChannel
from dnb_edge.vehicle.udp import MOST_PEERS, UdpChannel

sys.path.insert(0, str(Path(__file__).parents[1] / "display"))
import micropython

GRID = State(phase=Phase.RACING, start="grid")


@pytest.fixture
def box(tmp_path: Path) -> Iterator[Box]:
    """A daemon that can be told of races."""
    made = Box(tmp_path / "live.sock")
    yield made
    made.server.close()


def lap(number: int, car: int = 1) -> Lap:
    return Lap(
        number=number,
        start_t_ns=0,
        end_t_ns=1,
        start_s=0.0,
        time_s=12.4831,
        sigma_s=0.002,
        valid=True,
        reasons=(),
        similarity_percent=None,
        observed_fraction=1.0,
        car=car,
    )


def test_a_car_is_heard_and_hears(box: Box, tmp_path: Path) -> None:
    """Through the client that cars use: its words come with the stamp of their arrival, and red, green, its laps and the end
    come to it; a lap once, though it is sent three times, and no other car's."""
    udp = UdpChannel("127.0.0.1", 0)
    with running(tmp_path / "live.sock", [udp]), closing(Vehicle("127.0.0.1", udp.port, car=2)) as car:
        before_ns = time.monotonic_ns()
        until(lambda: udp.peers == 1)
        box.begins(GRID)
        car.tell(inference_ms=12.3, steering=-0.2, throttle=0.5)
        until(lambda: box.words)
        (word,) = box.words
        assert (word.car, word.seq, word.inference_ms, word.steering, word.throttle) == (2, 0, 12.3, -0.2, 0.5)
        assert before_ns <= word.came_ns <= time.monotonic_ns()
        for phase, said in ((RacePhase.COUNTDOWN, "ready"), (RacePhase.RACING, "go")):
            box.races(phase)
            until(lambda said=said: car.word == said, said)
        for one in (lap(1, car=1), lap(1, car=2), lap(2, car=2)):
            box.server.tell(one)
        until(lambda: (car.listen(), len(car.laps))[1] == 2)
        time.sleep(0.2)
        assert car.word == "go"
        assert [(one["car"], one["lap"], one["time_s"]) for one in car.laps] == [(2, 1, 12.4831), (2, 2, 12.4831)]
        box.races(RacePhase.FINISHED)
        until(lambda: car.word == "stop")


def test_red_where_the_daemon_dies_and_green_again_where_it_is_back(tmp_path: Path) -> None:
    """Nobody drives on a green that nobody answers for; the gateway finds the next daemon by itself."""
    path = tmp_path / "live.sock"
    box = Box(path)
    udp = UdpChannel("127.0.0.1", 0)
    with running(path, [udp]), closing(Vehicle("127.0.0.1", udp.port)) as car:
        for _ in range(2):
            box.begins(GRID)
            box.races(RacePhase.RACING)
            until(lambda: car.word == "go", "green")
            box.server.close()
            until(lambda: car.word == "stop", "red")
            box = Box(path)
        box.server.close()


def test_a_car_alone_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the box has died or is out of reach the client's word is stop after three seconds, and telling costs nothing."""
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as silent:
        silent.bind(("127.0.0.1", 0))
        car = Vehicle("127.0.0.1", silent.getsockname()[1])
        _, address = silent.recvfrom(100)
        silent.sendto(b'{"signal":"go"}\nnonsense\n[]\n', address)
        until(lambda: car.word == "go")
        now_s = time.monotonic()
        monkeypatch.setattr(time, "monotonic", lambda: now_s + 3.1)
        assert car.word == "stop"
    for _ in range(5):
        car.tell(throttle=0.1)
        assert car.word == "stop"
    car.close()


def test_what_is_no_telemetry_is_counted_and_told_with_what_is(box: Box, tmp_path: Path, caplog) -> None:
    """A lying vehicle does no more than that: the next honest line carries the count, and the log names the first lie."""
    udp = UdpChannel("127.0.0.1", 0)
    lies = [b"\xff" * 40, b'{"steering": 7}', b'{"car": 0, "throttle": 0}', b"{", b"\n\n", b'{"inference_ms": -1}']
    with running(tmp_path / "live.sock", [udp]), closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sender:
        for line in lies:
            sender.sendto(line, ("127.0.0.1", udp.port))
        while not box.words:
            sender.sendto(b'{"throttle": 0.25}\n{"throttle": 0.5}', ("127.0.0.1", udp.port))
            time.sleep(0.05)
        until(lambda: len(box.words) >= 2)
    assert [word.throttle for word in box.words[:2]] == [0.25, 0.5]
    assert {word.refused for word in box.words} == {5}
    told = [one.message for one in caplog.records if "no telemetry" in one.message]
    assert told == [f"{udp.name} 127.0.0.1: a line that is no telemetry: no JSON"]


def test_a_flood_is_cut_down_to_what_a_race_takes(box: Box, tmp_path: Path) -> None:
    """From one address tens of thousands of lines: a hundred a second come through, the others are counted, also those that the
    kernel threw away, and a signal still goes out."""
    udp = UdpChannel("127.0.0.1", 0)
    with (
        running(tmp_path / "live.sock", [udp]) as gateway,
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sender,
        closing(Vehicle("127.0.0.1", udp.port)) as car,
    ):
        began_s, sent = time.monotonic(), 0
        box.begins(GRID)
        box.races(RacePhase.RACING)
        while (lasted_s := time.monotonic() - began_s) < 1.0 or car.word != "go":
            assert lasted_s < 60.0
            for _ in range(100):
                sender.sendto(b'{"car": 1, "throttle": 0.1, "seq": %d}' % sent, ("127.0.0.1", udp.port))
                sent += 1
        until(lambda: gateway.ledger.taken + gateway.ledger.refused >= 0.9 * sent or not udp.read())
        lasted_s = time.monotonic() - began_s
    assert sent > 3000
    assert 0 < len(box.words) <= gateway.ledger.taken <= 100 * (lasted_s + 0.3)
    assert gateway.ledger.over > 0.5 * sent


def test_a_lap_goes_to_the_car_that_drove_it() -> None:
    """And to who has not said which car it is."""
    udp = UdpChannel("127.0.0.1", 0)
    cars = {car: socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for car in (1, 2, None)}
    for car, sender in cars.items():
        sender.settimeout(5.0)
        sender.sendto(b'{"hello": 1}', ("127.0.0.1", udp.port))
        (heard,) = udp.read()
        udp.registered(heard, car, now_s=0.0)
    udp.tell(b"of car 2\n", 2, now_s=1.0)
    udp.tell(b"for all\n", None, now_s=1.0)
    assert cars[1].recv(100) == b"for all\n"
    for car in (2, None):
        assert [cars[car].recv(100) for _ in range(2)] == [b"of car 2\n", b"for all\n"]
    for sender in cars.values():
        sender.close()
    udp.close()


def test_signals_reach_who_was_heard_last_and_no_more_than_fit(tmp_path: Path) -> None:
    """Of more cars than there is room for, those that were silent for longest are left out."""
    udp = UdpChannel("127.0.0.1", 0)
    senders = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(MOST_PEERS + 2)]
    for number, sender in enumerate(senders):
        sender.settimeout(5.0)
        sender.sendto(b'{"hello": 1}', ("127.0.0.1", udp.port))
        (heard,) = udp.read()
        udp.registered(heard, None, now_s=number)
    udp.tell(b"word\n", None, now_s=29.0)
    assert udp.peers == MOST_PEERS
    assert [sender.recv(100) for sender in senders[2:]] == [b"word\n"] * MOST_PEERS
    udp.tell(b"word\n", None, now_s=35.0)
    assert udp.peers == MOST_PEERS - 3
    for sender in senders:
        sender.close()
    udp.close()


def test_a_car_by_serial_comes_goes_and_comes_back(box: Box, tmp_path: Path) -> None:
    """A port that is away is waited for; lines go both ways; one that is pulled out and put in again is found."""
    port = tmp_path / "ttyCAR"
    channel = SerialChannel(str(port), 115200)
    box.begins(GRID)
    box.races(RacePhase.RACING)
    with running(tmp_path / "live.sock", [channel]):
        for throttle in (0.25, 0.75):
            ours, theirs = pty.openpty()
            tty.setraw(ours)
            port.unlink(missing_ok=True)
            port.symlink_to(os.ttyname(theirs))
            until(lambda: channel.fileno() is not None, "the port")
            os.close(theirs)
            os.write(ours, b'garbage of a torn line\n{"car": 3, "thr')
            os.write(ours, b'ottle": %.2f}\r\n' % throttle)
            until(lambda throttle=throttle: box.words and box.words[-1].throttle == throttle)
            heard = b""
            while b'{"signal":"go"}\n' not in heard:
                heard += os.read(ours, 100)
            os.close(ours)
            until(lambda: channel.fileno() is None, "the end of the port")
    assert [word.car for word in box.words] == [3, 3]


CAR_PY = """
import sys
sys.path.insert(0, {room!r})
from client_micropython import Vehicle
box = Vehicle("127.0.0.1", {port}, car=4)
seen = []
while len(box.laps) < 1:
    box.tell(inference_ms=31.5, steering=-0.25)
    if not seen or seen[-1] != box.word():
        seen.append(box.word())
print(seen[-1], box.laps[0]["lap"], box.laps[0]["time_s"])
"""


def test_a_car_with_micropython_is_heard_and_hears(box: Box, tmp_path: Path) -> None:
    """The file that is copied onto a board, run by MicroPython itself."""
    program = micropython.found()
    if program is None:
        pytest.skip("no micropython on this machine: apt install micropython (Debian 13), or set MICROPYTHON")
    udp = UdpChannel("127.0.0.1", 0)
    script = tmp_path / "car.py"
    room = str(Path(client_micropython.__file__).parent)
    script.write_text(CAR_PY.format(room=room, port=udp.port), encoding="utf-8")
    with running(tmp_path / "live.sock", [udp]):
        box.begins(State(phase=Phase.RACING, start="rolling"))
        box.races(RacePhase.WAITING)
        car = subprocess.Popen([program, str(script)], stdout=subprocess.PIPE, text=True)
        until(lambda: box.words and udp.peers == 1)
        time.sleep(0.2)
        box.server.tell(lap(1, car=4))
        said, _ = car.communicate(timeout=60)
    assert said.split() == ["go", "1", "12.4831"]
    assert (box.words[0].car, box.words[0].inference_ms, box.words[0].steering) == (4, 31.5, -0.25)


def test_an_address_that_cannot_be_listened_at_is_named() -> None:
    """Taken, or not this machine's: one line that says what to do."""
    first = UdpChannel("127.0.0.1", 0)
    with pytest.raises(InputError, match=rf"--udp 127.0.0.1:{first.port}: cannot listen there: Address already in use"):
        UdpChannel("127.0.0.1", first.port)
    first.close()
    with pytest.raises(InputError, match=r"--udp 192.0.2.7:5610: cannot listen there"):
        UdpChannel("192.0.2.7", 5610)


def test_signals_are_plain_lines(box: Box, tmp_path: Path) -> None:
    """Without any client: one JSON object a line, at once in answer to a hello, and again within a second or so."""
    udp = UdpChannel("127.0.0.1", 0)
    with running(tmp_path / "live.sock", [udp]), closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as car:
        car.settimeout(10.0)
        car.sendto(b'{"hello": 1}\n', ("127.0.0.1", udp.port))
        assert [json.loads(car.recv(200)) for _ in range(2)] == [{"signal": "stop"}] * 2
