"""The serial display's line protocol: encoder, parser, and its published text."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.display import protocol
from dnb_edge.errors import InputError

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "display-protocol.md"

number = st.integers(0, 999_999)
seconds = st.integers(0, 999_999_999).map(lambda ms: ms / 1000)
tenths = st.none() | st.integers(0, 9_999_999).map(lambda tenth: tenth / 10)
short_text = st.text(max_size=50).map(protocol.plain)

message = st.one_of(
    st.builds(protocol.Hello, version=number),
    st.builds(protocol.State, word=st.sampled_from(["WAITING", "OUT-LAP", "FINISHED"])),
    st.builds(protocol.State, word=st.just("LAP"), lap=number, laps_wanted=st.none() | number),
    st.builds(protocol.Run, lap=number, elapsed_s=seconds),
    st.just(protocol.Run()),
    st.builds(protocol.Cross, t_s=seconds),
    st.builds(
        protocol.Lap, lap=number, time_s=seconds, sigma_s=seconds, valid=st.booleans(), similarity_percent=tenths
    ),
    st.builds(protocol.Why, lap=number, text=short_text),
    st.builds(protocol.Suspect, lap=number, text=short_text),
    st.builds(protocol.Best, lap=number, time_s=seconds),
    st.builds(protocol.Health, fps=tenths, recording=st.sampled_from(["NONE", "RECORDING", "FAILED"]), warnings=number),
    st.builds(protocol.Saved, laps=number),
    st.builds(protocol.Warn, number=number, text=short_text),
)

CASES = [
    (protocol.Hello(), b"HELLO DNB-EDGE 1 *15\r\n"),
    (protocol.State(word="LAP", lap=2, laps_wanted=3), b"STATE LAP 2 OF 3 *02\r\n"),
    (protocol.Run(lap=3, elapsed_s=4.2), b"RUN 3 4.200 *52\r\n"),
    (
        protocol.Lap(lap=2, time_s=12.4831, sigma_s=0.0021, valid=True, similarity_percent=95.78),
        b"LAP 2 12.483 +-0.002 OK 95.8 *69\r\n",
    ),
    (
        protocol.Lap(lap=3, time_s=14.0, sigma_s=0.01, valid=False, similarity_percent=None),
        b"LAP 3 14.000 +-0.010 BAD - *16\r\n",
    ),
]


@pytest.mark.parametrize(("told", "line"), CASES)
def test_lines_on_the_wire(told, line):
    """The exact bytes of the lines that firmware in the field already reads."""
    assert protocol.encode_line(told) == line


@given(message)
def test_round_trip(told):
    """Every message comes back from its line as it was, with and without checksum and line end."""
    line = protocol.encode_line(told)
    assert protocol.parse_line(line) == told
    assert protocol.parse_line(line.removesuffix(b"\r\n")) == told
    assert protocol.parse_line(line[: -len(b" *00\r\n")]) == told


@given(st.text(), st.text())
def test_any_text_makes_one_printable_line_of_at_most_80_bytes(reason, warning):
    """No text from outside can break out of its line, lengthen it, or upset a terminal."""
    for told in (protocol.Why(lap=3, text=reason), protocol.Warn(number=1, text=warning)):
        line = protocol.encode_line(told)
        assert len(line) <= protocol.MAX_LINE_BYTES
        assert re.fullmatch(rb"[ -)+-~]+ \*[0-9A-F]{2}\r\n", line)
        assert type(protocol.parse_line(line)) is type(told)


@given(st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_numbers_out_of_range_are_brought_to_its_end(time_s, percent):
    """A time or percentage beyond the protocol's range still makes a line that parses."""
    told = protocol.Lap(lap=1, time_s=time_s, sigma_s=abs(time_s), valid=True, similarity_percent=percent)
    assert isinstance(protocol.parse_line(protocol.encode_line(told)), protocol.Lap)


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("off the lane", "off the lane"),
        ("  two\r\nlines\tand a tab ", "two lines and a tab"),
        ("Größe 2 ± 1 µm", "Gro?e 2 +- 1 ?m"),
        ("café *5A", "cafe ?5A"),
        ("\x1b[2J", "?[2J"),
        ("", "-"),
    ],
)
def test_plain(text, plain):
    """Accents go, line ends become spaces, and neither escapes nor a checksum can be smuggled in."""
    assert protocol.plain(text) == plain


@given(st.binary(max_size=100))
def test_parser_takes_any_bytes(line):
    """Noise on the wire is refused as wrong input, or is a message that says the same again."""
    try:
        heard = protocol.parse_line(line)
    except InputError:
        return
    assert protocol.parse_line(protocol.encode_line(heard)) == heard


@given(message, st.data())
def test_a_flipped_bit_is_noticed(told, data):
    """One wrong bit anywhere in the body or the checksum's digits never passes as a message."""
    line = bytearray(protocol.encode_line(told))
    star = line.rindex(b" *")
    places = [place for place in range(len(line) - 2) if place not in (star, star + 1)]
    line[data.draw(st.sampled_from(places))] ^= 1 << data.draw(st.integers(0, 7))
    with pytest.raises(InputError):
        protocol.parse_line(bytes(line))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (b"LAP 2 12.483 +-0.002 OK 95.8 *68\r\n", "checksum should be 69"),
        (b"LAP two 12.483 +-0.002 OK 95.8", "looks like this"),
        (b"LAP 2 12.48 +-0.002 OK 95.8", "looks like this"),
        (b"LAP  2 12.483 +-0.002 OK 95.8", "looks like this"),
        (b"lap 2 12.483 +-0.002 OK 95.8", "looks like this"),
        (b"RUN 3", "looks like this"),
        (b"RUN 3 4.200\n\n", "looks like this"),
        (b"RUN 03 4.200", "looks like this"),
        (b"STATE LAP", "looks like this"),
        (b"WARN 1 caf\xc3\xa9", "not ASCII"),
        (b"WARN 1 " + b"x" * 80, "at most 80"),
        (b"", "looks like this"),
    ],
)
def test_parser_refuses(line, words):
    """Each kind of wrong line is refused, and the error says what is wrong."""
    with pytest.raises(InputError, match=re.escape(words)):
        protocol.parse_line(line)


def test_document_and_code_agree():
    """Every example line of the published text parses, is byte for byte what the encoder writes, and covers every kind."""
    blocks = re.findall(r"```text\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), flags=re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines() if line]
    heard = [protocol.parse_line(line.encode("ascii")) for line in lines]
    assert {type(told) for told in heard} == set(protocol.MESSAGES)
    assert [protocol.encode_line(told).decode("ascii").rstrip() for told in heard] == lines
