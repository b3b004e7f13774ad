"""What is typed: brokers, names, prefixes; what is wrong with them, in a line."""

import pytest

from dnb_edge.errors import InputError
from dnb_edge.fleet.broker import Broker, broker, make_client
from dnb_edge.fleet.messages import Topics, box_name, topics


@pytest.mark.parametrize(
    ("address", "host", "port", "tls"),
    [
        ("mqtts://host.example", "host.example", 8883, True),
        ("mqtt://host", "host", 1883, False),
        ("mqtt://10.0.0.7:1999/", "10.0.0.7", 1999, False),
        ("mqtts://[fe80::1]:8884", "fe80::1", 8884, True),
    ],
)
def test_a_broker_is_read_from_its_address(address, host, port, tls):
    """And written as people write it."""
    found = broker(address, ca=None, user=None, password_file=None)
    assert found == Broker(host=host, port=port, tls=tls)
    assert broker(found.text, ca=None, user=None, password_file=None) == found


@pytest.mark.parametrize(
    ("address", "options", "words"),
    [
        ("host:1883", {}, "--broker host:1883: write mqtts://HOST"),
        ("http://host", {}, "write mqtts://HOST"),
        ("mqtts://", {}, "write mqtts://HOST"),
        ("mqtts://host:99999", {}, "write mqtts://HOST"),
        ("mqtts://host/topic", {}, "write mqtts://HOST"),
        ("mqtts://ada:secret@host", {}, "--user and --password-file"),
        ("https://ada:secret@host", {}, "https://...@host"),
        ("mqtt://host", {"ca": "x.pem"}, "mqtt:// has no certificates"),
        ("mqtts://host", {"password_file": "p"}, "whose password is it"),
        ("mqtts://host", {"user": "ada", "password_file": "missing"}, "missing: No such file"),
        ("mqtts://host", {"user": "ada", "password_file": "bytes"}, "no text in UTF-8"),
    ],
)
def test_a_wrong_address_is_told_without_a_password(address, options, words, tmp_path):
    """In one line, with what to write."""
    (tmp_path / "bytes").write_bytes(b"\xff\xfe")
    given = {name: tmp_path / value if name != "user" else value for name, value in options.items()}
    with pytest.raises(InputError) as error:
        broker(address, **({"ca": None, "user": None, "password_file": None} | given))
    assert words in str(error.value)
    assert "secret" not in str(error.value)


@pytest.mark.parametrize(("name", "words"), [("none.pem", "No such file"), ("text.pem", "no certificates in PEM form")])
def test_certificates_that_are_none_are_told(name, words, tmp_path):
    """Before anything is tried."""
    (tmp_path / "text.pem").write_text("precious", encoding="utf-8")
    to = broker("mqtts://host", ca=tmp_path / name, user=None, password_file=None)
    with pytest.raises(InputError, match=words):
        make_client(to, "x")


def test_a_missing_extra_is_told(monkeypatch):
    """With what to type."""
    monkeypatch.setitem(__import__("sys").modules, "paho.mqtt.client", None)
    with pytest.raises(InputError, match=r"pip install 'dnb-edge\[fleet\]'"):
        make_client(broker("mqtt://host", ca=None, user=None, password_file=None), "x")


@pytest.mark.parametrize("name", ["", "a/b", "+", "#", "a b", ".a", "ä", "x" * 49])
def test_a_name_that_no_topic_can_have_is_refused(name):
    """It would be another topic, or none; a prefix may have levels."""
    with pytest.raises(InputError, match="--box"):
        box_name(name)
    if name != "a/b":
        with pytest.raises(InputError, match="--prefix"):
            topics(name)


def test_topics_are_read_back():
    """The box and the kind, and nothing of another prefix."""
    found = Topics(prefix="lab/two")
    assert found.box_of(found.parcel("a-1")) == ("a-1", "parcel")
    assert found.box_of("lab/box/a-1/parcel") is None
    assert found.box_of(found.hub) is None
