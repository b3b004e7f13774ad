"""The server on real sockets: clients that trickle, stall or hold on are cut off, the others are served; it ends at once."""

from __future__ import annotations

import http.client
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.requests import Request
from starlette.responses import Response
from web_box import app_in, served

from dnb_edge.config.web import WebConfig, load_web
from dnb_edge.errors import InputError
from dnb_edge.web import race
from dnb_edge.web.guard_rates import Limits
from dnb_edge.web.server import (
    MOST_CONNECTIONS,
    MOST_HEAD_BYTES,
    MOST_PER_ADDRESS,
    Patience,
    Server,
    _has_room,
    addresses,
    listener,
    listeners,
)

PATIENCE_S = 20.0
QUICK = Patience(head_s=0.5, stall_s=1.0)


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """An impatient server; its /api/v1/state answers with 64 MB."""
    with pytest.MonkeyPatch.context() as patch:

        async def large(_self: Any, _request: Request) -> Response:
            return Response(b"x" * (64 << 20))

        patch.setattr(race.Race, "state", large)
        app = app_in(tmp_path_factory.mktemp("box"), limits=Limits(per_s=0.0))
    with served(app, QUICK) as port:
        yield port


def opened(port: int) -> socket.socket:
    """A connection."""
    return socket.create_connection(("127.0.0.1", port), PATIENCE_S)


def ended(connection: socket.socket) -> bytes:
    """What comes until the server hangs up."""
    got = b""
    try:
        while more := connection.recv(1 << 16):
            got += more
    except ConnectionError:
        pass
    return got


def trickle(connection: socket.socket, text: bytes) -> None:
    """Says a byte every now and then, for as long as anybody listens."""
    try:
        for letter in text:
            connection.sendall(bytes([letter]))
            time.sleep(0.05)
    except OSError:
        return


def works(port: int) -> None:
    """An honest client is served."""
    client = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE_S)
    client.request("GET", "/login")
    assert client.getresponse().status == 200
    client.close()


POST = b"POST /api/v1/login HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
HEAD = b"GET /login HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"x" * 2000


@pytest.mark.parametrize("beginning", [b"", b"GET /login HTTP/1.1\r\n", b"GET"])
def test_a_client_that_says_nothing_is_cut_off(port: int, beginning: bytes) -> None:
    """It connects, perhaps begins, and waits."""
    with opened(port) as connection:
        connection.sendall(beginning)
        works(port)
        assert ended(connection) == b""


def test_a_head_that_trickles_is_cut_off(port: int) -> None:
    """However lively it is."""
    with opened(port) as connection:
        teller = threading.Thread(target=trickle, args=(connection, HEAD))
        teller.start()
        works(port)
        assert ended(connection) == b""
        connection.close()
        teller.join(PATIENCE_S)


def test_a_second_head_that_trickles_is_cut_off(port: int) -> None:
    """An honest request first does not help."""
    with opened(port) as connection:
        connection.sendall(b"GET /nothing HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert b" 404 " in connection.recv(100)
        teller = threading.Thread(target=trickle, args=(connection, HEAD))
        teller.start()
        assert b"HTTP/1.1" not in ended(connection)
        connection.close()
        teller.join(PATIENCE_S)


def test_many_slow_clients_keep_nobody_out(port: int) -> None:
    """Fifty of them at once."""
    connections = [opened(port) for _ in range(50)]
    for connection in connections:
        connection.sendall(b"GET /login HTTP/1.1\r\nHost: 127.0.0.1\r\n")
    works(port)
    for connection in connections:
        assert ended(connection) == b""
        connection.close()


def test_a_client_that_takes_nothing_is_cut_off(port: int) -> None:
    """It asks for much and does not read it."""
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.settimeout(PATIENCE_S)
        connection.connect(("127.0.0.1", port))
        connection.sendall(b"GET /api/v1/state HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        works(port)
        time.sleep(2.0)
        assert len(ended(connection)) < 64 << 20


def test_a_head_without_end_is_refused(port: int) -> None:
    """More than 16 kB of headers."""
    with opened(port) as connection:
        try:
            connection.sendall(b"GET /login HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"x" * (4 * MOST_HEAD_BYTES))
        except ConnectionError:
            return
        answer = ended(connection)
        assert answer == b"" or b" 400 " in answer.splitlines()[0]


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (POST + b"Content-Length: 999999999\r\n\r\n", b"413"),
        (POST + b"Transfer-Encoding: chunked\r\n\r\n20000\r\n" + b"x" * 0x20000 + b"\r\n", b"413"),
        (b"GET /login HTTP/1.1\r\n\r\n", b"400"),
        (b"GET /login HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: evil.example\r\n\r\n", b"400"),
        (b"GET /login HTTP/1.0\r\n\r\n", b"421"),
        (b"GET http://evil.example/login HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", b"404"),
        (b"GET /login HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\n", b"400"),
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", b"400"),
        (b"CONNECT evil.example:80 HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", b"404"),
        (b"GET /%ff%fe HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", b"404"),
    ],
)  # fmt: skip
def test_odd_requests(port: int, request_: bytes, status: bytes) -> None:
    """Whatever comes by the wire, the answer is a plain refusal and the next client is served."""
    with opened(port) as connection:
        connection.sendall(request_)
        assert connection.recv(4096).split(b" ")[1] == status
    works(port)


def test_an_unwanted_body_is_not_waited_for(port: int) -> None:
    """After a refusal the connection ends, however much somebody still sends."""
    with opened(port) as connection:
        connection.sendall(POST + b"Content-Length: 900000\r\n\r\n")
        teller = threading.Thread(target=trickle, args=(connection, b"x" * 4000))
        teller.start()
        assert b" 413 " in ended(connection).splitlines()[0]
        connection.close()
        teller.join(PATIENCE_S)


def test_a_client_that_leaves_in_the_middle_of_its_body_is_no_failure(
    port: int, caplog: pytest.LogCaptureFixture
) -> None:
    """Nothing of it is an error in the log."""
    with opened(port) as connection:
        connection.sendall(POST + b"Content-Length: 100\r\n\r\n{")
        time.sleep(0.2)
    works(port)
    time.sleep(0.2)
    assert [record for record in caplog.records if record.levelname == "ERROR"] == []


@pytest.mark.parametrize("signal_", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_at_once_and_cleanly(tmp_path: Path, signal_: signal.Signals) -> None:
    """While browsers listen and one has not finished its request; exit code 0 and not a word on stderr but the log's."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "dnb_edge", "web", "--host", "127.0.0.1", "--port", str(port)]
    command += ["--socket", str(tmp_path / "live.sock"), "--runs", str(tmp_path), "--setup", str(tmp_path)]
    environment = {key: value for key, value in os.environ.items() if key != "NOTIFY_SOCKET"}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == f"http://127.0.0.1:{port}/\n"
            _served_at(port)
            with opened(port) as listening, opened(port) as slow:
                listening.sendall(
                    b"GET /api/v1/live HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
                )
                assert b" 101 " in listening.recv(100)
                slow.sendall(b"GET /login")
                process.send_signal(signal_)
                _, stderr = process.communicate(timeout=PATIENCE_S)
        finally:
            process.kill()
    assert process.returncode == 0, stderr
    assert "Traceback" not in stderr
    assert [line for line in stderr.splitlines() if not line.startswith("dnb-edge: ")] == []


def _served_at(port: int) -> None:
    """Waits until somebody answers."""
    for _ in range(400):
        try:
            works(port)
        except ConnectionRefusedError:
            time.sleep(0.05)
        else:
            return
    raise AssertionError("nobody answers")


def test_a_port_that_is_taken_is_said() -> None:
    """In one line that names the option; nobody else's server is replaced."""
    with listener("127.0.0.1", 0) as first:
        first.listen()
        with pytest.raises(InputError, match=r"--port \d+: Address already in use"):
            listener("127.0.0.1", first.getsockname()[1])
    with pytest.raises(InputError, match=r"--host nowhere\.invalid"):
        listener("nowhere.invalid", 8080)


def test_all_addresses_are_of_both_kinds(tmp_path: Path) -> None:
    """The default listens for IPv4 and IPv6 at one port; one that is taken is said of either."""
    listening = listeners(WebConfig().host, 0)
    port = listening[0].getsockname()[1]
    server = Server(app_in(tmp_path))
    thread = threading.Thread(target=server.run, kwargs={"sockets": listening})
    thread.start()
    try:
        _served_at(port)
        if len(listening) == 1:
            pytest.skip("this machine has no IPv6")
        with pytest.raises(InputError, match="--port"):
            listener("::1", port)
        for host in ("[::1]", "localhost", "127.0.0.1"):
            client = http.client.HTTPConnection("::1", port, timeout=PATIENCE_S)
            client.request("GET", "/login", headers={"Host": f"{host}:{port}"})
            assert client.getresponse().status == 200
            client.close()
    finally:
        server.should_exit = True
        thread.join(PATIENCE_S)
        for one in listening:
            one.close()


@pytest.mark.parametrize(
    ("clients", "room"),
    [
        ([f"192.168.1.{k}" for k in range(200)], True),
        (["192.168.1.7"] * MOST_PER_ADDRESS, True),
        (["192.168.1.7"] * (MOST_PER_ADDRESS + 1), False),
        ([f"2001:db8::{k:x}" for k in range(MOST_PER_ADDRESS + 1)], False),
        ([f"2001:db8:0:{k:x}::1" for k in range(MOST_PER_ADDRESS + 1)], True),
        ([f"fe80::{k:x}%eth0" for k in range(MOST_PER_ADDRESS + 1)], False),
        (["127.0.0.1"] * 200, True),
        (["::1"] * 200, True),
        ([f"10.0.{k // 250}.{k % 250}" for k in range(MOST_CONNECTIONS + 1)], False),
    ],
)
def test_connections_of_one_client(clients: list[str], room: bool) -> None:
    """So many and no more; an IPv6 client has a whole network of addresses."""
    connections = [SimpleNamespace(client=(address, 1)) for address in clients]
    new = connections[-1]
    new.connections = connections
    assert _has_room(new) is room  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("host", "port", "wanted"),
    [
        ("127.0.0.1", 8080, r"http://127\.0\.0\.1:8080/"),
        ("192.168.1.5", 80, r"http://192\.168\.1\.5/"),
        ("::1", 8080, r"http://\[::1\]:8080/"),
        ("box.example", 8080, r"http://box\.example:8080/"),
        ("0.0.0.0", 8080, r"http://[a-z0-9-]+\.local:8080/ (http://[0-9.]+:8080/ )?http://localhost:8080/"),
        ("::", 8080, r"http://[a-z0-9-]+\.local:8080/ (http://[0-9.]+:8080/ )?http://localhost:8080/"),
    ],
)
def test_addresses_to_open(host: str, port: int, wanted: str) -> None:
    """What somebody can type into a browser."""
    assert re.fullmatch(wanted, " ".join(addresses(host, port)))


def test_the_section_web_is_read_alone(tmp_path: Path) -> None:
    """Whatever the rest of the file is worth: the pages are there to mend it."""
    path = tmp_path / "dnb-edge.yaml"
    path.write_text("track: 7\nweb:\n  port: 8000\n  names: [race.example.org]\n", encoding="utf-8")
    assert load_web(path) == WebConfig(port=8000, names=("race.example.org",))
    path.write_text("web: {most_downloads: 2, download_mb_per_s: 5}\n", encoding="utf-8")
    assert load_web(path) == WebConfig(most_downloads=2, download_mb_per_s=5.0)
    path.write_text("track: 7\n", encoding="utf-8")
    assert load_web(path) == WebConfig()


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("web: {prot: 1}\n", "line 1: web.prot: unknown key, did you mean port?"),
        ("a: 1\nweb:\n  port: '80'\n", "line 3: web.port: "),
        ("web: {port: 0}\n", "web.port: "),
        ("web: {most_downloads: 0}\n", "web.most_downloads: "),
        ("web: {download_mb_per_s: 0}\n", "web.download_mb_per_s: "),
        ("web: {names: race}\n", "web.names: "),
        ("web: 7\n", "web: "),
        ("web: [\n", "dnb-edge.yaml"),
    ],
)
def test_mistakes_in_the_section_web(tmp_path: Path, text: str, wanted: str) -> None:
    """In one line with file, line and key."""
    path = tmp_path / "dnb-edge.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_web(path)
    assert wanted in str(error.value)
    assert "\n" not in str(error.value)
