"""What a broker refuses: one line that says what is the matter, an end where only a person can mend it, patience elsewhere."""

import dataclasses
import re
import ssl
import time
from pathlib import Path

import pytest
from fleet_rig import TOPICS, Box, HubRig, plain
from mqtt_broker import Mosquitto, certificate, free_port, needs_mosquitto, passwords, until

from dnb_edge.errors import InputError, TemporaryFault
from dnb_edge.fleet import hub as hubs
from dnb_edge.fleet import publisher as publishers
from dnb_edge.fleet.broker import broker as named
from dnb_edge.fleet.link import Link

pytestmark = needs_mosquitto

PAGE = Path(__file__).resolve().parents[2] / "docs" / "fleet.md"


def ended(box) -> str:
    """The line with which a box's publisher, or a hub, ended."""
    failed = until(lambda: box.failed, "its end")
    assert isinstance(failed, InputError), failed
    return str(failed)


def with_password(to: Mosquitto, folder, password: str):
    (folder / "password").write_text(f"{password}\n", encoding="utf-8")
    return named(to.url, ca=None, user="a", password_file=folder / "password")


@pytest.fixture
def secure(tmp_path):
    """A broker whose certificate is for localhost."""
    made, key = certificate(tmp_path, "localhost")
    with Mosquitto(tmp_path, lines=("allow_anonymous true", f"certfile {made}", f"keyfile {key}")) as one:
        yield one


def test_over_tls_laps_arrive(secure, tmp_path, make_box, make_hub):
    """With the broker's own certificate to trust."""
    to = named(f"mqtts://localhost:{secure.port}", ca=tmp_path / "localhost.crt", user=None, password_file=None)
    box, hub = make_box("a", to), make_hub(to)
    hub.start()
    box.start()
    box.race(1, 5)
    hub.wait_for("a", 5)


@pytest.mark.parametrize(
    ("host", "trusted", "words"),
    [
        ("127.0.0.1", "localhost", "not to be trusted: IP address mismatch"),
        ("localhost", "elsewhere", "not to be trusted: self"),
        ("localhost", None, "not to be trusted: self"),
    ],
)
def test_a_certificate_that_is_not_the_brokers_ends_it(host, trusted, words, secure, tmp_path, make_box):
    """Another name than the certificate's, another one's certificate, nobody's that the machine trusts."""
    certificate(tmp_path, "elsewhere")
    ca = None if trusted is None else tmp_path / f"{trusted}.crt"
    box = make_box("a", named(f"mqtts://{host}:{secure.port}", ca=ca, user=None, password_file=None))
    box.start()
    line = ended(box)
    assert line.startswith(f"mqtts://{host}:{secure.port}: its certificate is ")
    assert words in line


def test_tls_where_none_is_spoken_is_told(broker, make_box):
    """A port without TLS hangs up, and so does a broker that is being killed: it is tried again, with the question."""
    box = make_box("a", plain(broker.url.replace("mqtt:", "mqtts:")))
    box.start()
    until(lambda: any("hung up at once: is TLS spoken at this port?" in words for words in box.said), "its word")


@pytest.mark.parametrize("code", [9, 10])
def test_a_certificate_that_does_not_hold_yet_or_any_more_is_waited_out(code):
    """A box without a battery for its clock learns the time from the network, a minute later."""
    error = ssl.SSLCertVerificationError(1, "certificate verify failed")
    error.verify_code, error.verify_message = code, "certificate is not yet valid"
    link = Link(plain("mqtts://host"), client_id="x", will=publishers.will(TOPICS, "a", "q"))
    found = link._unreachable(error)
    assert isinstance(found, TemporaryFault)
    assert "is this machine's clock right?" in str(found)


@pytest.mark.parametrize("password", ["wrong", None])
def test_a_wrong_password_or_none_ends_it(password, tmp_path, make_box):
    """At once, with the broker's own word for it; the queue is as it was."""
    lines = (f"password_file {passwords(tmp_path, a='right')}",)
    with Mosquitto(tmp_path, lines=lines) as one:
        box = make_box("a", plain(one.url) if password is None else with_password(one, tmp_path, password))
        box.race(1, 3)
        box.start()
        assert ended(box) == f"{one.url}: the broker refuses: not authorized"
        until(lambda: box.outbox.waiting == 3, "the laps in its queue")


def test_a_password_that_was_right_before_is_waited_for(tmp_path, make_box, make_hub):
    """The broker is being worked on: the box tries again until it is let in as before."""
    one = Mosquitto(tmp_path, lines=(f"password_file {passwords(tmp_path, a='right')}",))
    with one:
        to = with_password(one, tmp_path, "right")
        box, hub = make_box("a", to), make_hub(to)
        hub.start()
        box.start()
        box.race(1, 2)
        hub.wait_for("a", 2)
        one.kill()
        passwords(tmp_path, a="another")
        one.start()
        until(lambda: any("not authorized: tried again" in words for words in box.said), f"its word: {box.said}")
        one.kill()
        passwords(tmp_path, a="right")
        box.race(3, 4)
        one.start()
        hub.wait_for("a", 4)


def test_a_topic_that_the_broker_does_not_take_ends_it(tmp_path, make_box):
    """An access list that forgot the box is named, with the topic."""
    (tmp_path / "acl").write_text("topic read dnb-edge/#\n", encoding="utf-8")
    (tmp_path / "acl").chmod(0o600)
    with Mosquitto(tmp_path, lines=("allow_anonymous true", f"acl_file {tmp_path / 'acl'}")) as one:
        box = make_box("a", plain(one.url))
        box.start()
        assert "the broker does not take dnb-edge/box/a/status: not authorized: see its ACL" in ended(box)


@pytest.mark.parametrize(("box_name", "let_in"), [("a", True), ("b", False)])
def test_the_documented_access_list_lets_a_box_write_its_own_topics_only(
    box_name, let_in, tmp_path, make_box, make_hub
):
    """The block of docs/fleet.md as it stands there."""
    (listed,) = re.findall(r"```\n(user hub\n.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    (tmp_path / "acl").write_text(listed, encoding="utf-8")
    (tmp_path / "acl").chmod(0o600)
    lines = (f"acl_file {tmp_path / 'acl'}", f"password_file {passwords(tmp_path, a='right', hub='right')}")
    with Mosquitto(tmp_path, lines=lines) as one:
        to = with_password(one, tmp_path, "right")
        box, hub = make_box(box_name, to), make_hub(dataclasses.replace(to, user="hub"))
        hub.start()
        box.start()
        if let_in:
            box.race(1, 2)
            hub.wait_for("a", 2)
        else:
            assert "the broker does not take dnb-edge/box/b/status" in ended(box)


def test_a_broker_that_is_away_is_waited_for(tmp_path, make_box, make_hub):
    """One line says so; laps wait, and come when it is there."""
    one = Mosquitto(tmp_path, port=free_port())
    box, hub = make_box("a", plain(one.url)), make_hub(plain(one.url))
    box.start()
    hub.start()
    box.race(1, 4)
    until(lambda: box.outbox.waiting == 4, "the queue")
    until(lambda: box.said == [f"{one.url}: connection refused: tried again; the queue waits"], f"its word: {box.said}")
    assert hub.hub.glance().trouble == f"{one.url}: connection refused"
    with one:
        hub.wait_for("a", 4)
        assert hub.hub.glance().trouble is None


def test_two_boxes_of_one_name_are_not_let_be(broker, tmp_path, make_box, make_hub, monkeypatch):
    """The newcomer ends, with what to do: their states would mix. The first goes on, and is known to be there."""
    monkeypatch.setattr(publishers, "SETTLED_S", 0.3)
    box, hub = make_box("a", plain(broker.url)), make_hub(plain(broker.url))
    hub.start()
    box.start()
    until(lambda: (seen := hub.seen("a")) and seen.online, "the first")
    time.sleep(0.4)
    (tmp_path / "other").mkdir()
    other = Box(tmp_path / "other", "a", plain(broker.url))
    try:
        other.start()
        assert ended(other) == "--box a: another box of this name is on the line: give each its own"
        box.race(1, 3)
        hub.wait_for("a", 3)
        until(lambda: hub.seen("a").online, "the first to say again that it is there")
        assert box.failed is None
    finally:
        other.close()


def test_two_hubs_are_not_let_be(broker, tmp_path, make_hub, monkeypatch):
    """Likewise: either would take the other's word for what is stored."""
    monkeypatch.setattr(hubs, "SETTLED_S", 0.3)
    hub = make_hub(plain(broker.url))
    hub.start()
    until(lambda: hub.said, "the first")
    time.sleep(0.4)
    (tmp_path / "other").mkdir()
    other = HubRig(tmp_path / "other", plain(broker.url))
    try:
        other.start()
        assert ended(other) == "--prefix dnb-edge: another hub is on the line: one hub for each prefix"
        assert hub.failed is None
    finally:
        other.stop()


def test_a_copy_of_an_older_queue_ends_it(broker, make_box, make_hub):
    """Its numbers were given to other laps already."""
    box, hub = make_box("a", plain(broker.url)), make_hub(plain(broker.url))
    hub.start()
    box.start()
    box.race(1, 3)
    hub.wait_for("a", 3)
    box.stop()
    older = box.queue.read_bytes()
    box.race(4, 6)
    box.start()
    hub.wait_for("a", 6)
    box.stop()
    box.queue.write_bytes(older)
    box.daemon.begin_run()
    box.start()
    assert "older than what the hub has of it: a copy? Move it away" in ended(box)
