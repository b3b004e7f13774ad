"""Messages to bytes and back, and what is no message."""

import json
import types
import typing
from enum import Enum

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.errors import WorkError
from dnb_edge.live import messages
from dnb_edge.live.messages import Answer, Hello, Message, Picture, Told, blob_bytes, decode, encode

KINDS = typing.get_args(messages.FromDaemon) + typing.get_args(messages.ToDaemon)

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63) + 1, 2**63 - 1) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
).filter(lambda value: "Infinity" not in json.dumps(value))


def of(kind: typing.Any) -> st.SearchStrategy[typing.Any]:
    """Values of a member of the type `kind`."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        return st.one_of([st.none() if one is type(None) else of(one) for one in arguments])
    if origin is tuple and arguments[1:] == (Ellipsis,):
        return st.lists(of(arguments[0]), max_size=4).map(tuple)
    if origin is tuple:
        return st.tuples(*map(of, arguments))
    if origin is dict:
        return st.dictionaries(st.text(), PLAIN, max_size=4)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return st.sampled_from(list(kind))
    plain = {
        int: st.integers(-(2**63) + 1, 2**63 - 1),
        float: st.floats(allow_nan=False, allow_infinity=False),
        str: st.text(),
        bool: st.booleans(),
        bytes: st.binary(),
    }
    return plain[kind] if kind in plain else made(kind)


def made(kind: type) -> st.SearchStrategy[typing.Any]:
    """Instances of the dataclass `kind`."""
    return st.builds(kind, **{name: of(one) for name, one in typing.get_type_hints(kind).items()})


@given(st.one_of([made(kind) for kind in KINDS]))
def test_what_is_sent_is_what_is_read(message: Message) -> None:
    """Every kind of message, whatever its members: one line, then as many bytes as the line says."""
    line, feed, blob = encode(message).partition(b"\n")
    assert feed == b"\n"
    assert blob_bytes(line) == len(blob)
    assert decode(line, blob) == message


@given(made(Told))
def test_an_event_stays_one_line(told: Told) -> None:
    """Line feeds in an event's texts are no ends of lines."""
    assert encode(told).count(b"\n") == 1


@given(st.binary() | st.text().map(str.encode) | PLAIN.map(json.dumps).map(str.encode))
def test_any_bytes_are_a_message_or_are_refused(line: bytes) -> None:
    """In one line; nothing else is ever raised."""
    told = None
    try:
        decode(line)
        blob_bytes(line)
    except WorkError as error:
        told = str(error)
    assert told is None or "\n" not in told


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"[1, 2]",
        b'"hello"',
        b"\xff\xfe",
        b'{"say": "answer"}',
        b'{"say": "answer", "ask": "one", "done": true}',
        b'{"say": "answer", "ask": 1, "done": "yes"}',
        b'{"say": "answer", "ask": 1e400, "done": true}',
        b'{"say": "state", "phase": "asleep"}',
        b'{"say": "pictures", "ask": 1, "every_s": NaN}',
        b'{"say": "event", "sequence": 1, "event": []}',
        b"[" * 100_000,
    ],
)
def test_damaged_lines_are_refused(line: bytes) -> None:
    """Cut off, of another form, a member missing or of another type, nested without end."""
    with pytest.raises(WorkError):
        decode(line)


@pytest.mark.parametrize("count", ["-1", "1.5", '"9"', str(messages.MOST_BLOB_BYTES + 1)])
def test_wrong_counts_of_bytes_are_refused(count: str) -> None:
    """Nobody waits for bytes that cannot come, or makes room for more than any picture has."""
    with pytest.raises(WorkError):
        blob_bytes(f'{{"say": "picture", "blob_bytes": {count}}}'.encode())


def test_newer_messages_are_passed_over() -> None:
    """A kind that we do not know is none; a member that we do not know does not matter."""
    assert decode(b'{"say": "weather", "rain": true}') is None
    assert decode(b'{"say": "answer", "ask": 1, "done": true, "colour": "red"}') == Answer(ask=1, done=True)


def test_a_picture_goes_behind_its_line() -> None:
    """Its bytes may hold line feeds; the line says how many there are."""
    picture = Picture(t_ns=1, frame=2, width_px=3, height_px=4, jpeg=b"\xff\xd8\n\n\xff\xd9")
    line, _, blob = encode(picture).partition(b"\n")
    assert blob == picture.jpeg
    assert json.loads(line) == {
        "say": "picture",
        "t_ns": 1,
        "frame": 2,
        "width_px": 3,
        "height_px": 4,
        "blob_bytes": 6,
    }


def test_a_hello_can_be_read_by_people() -> None:
    """As `nc -U` shows it."""
    hello = Hello(protocol=1, version="0.1.0", epoch="ab", next_sequence=3, first_sequence=0)
    assert json.loads(encode(hello)) == {
        "say": "hello",
        "protocol": 1,
        "version": "0.1.0",
        "epoch": "ab",
        "next_sequence": 3,
        "first_sequence": 0,
    }
