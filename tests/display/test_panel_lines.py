"""The panel's parser takes exactly the lines that the appliance's own takes, whatever bytes come and however they are cut."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from panel_cases import line
from panel_fuzz import CORPUS, Chance, damaged

from dnb_edge.display import protocol
from dnb_edge.display.panel import grammar
from dnb_edge.display.panel.line import LONGEST, Lines, checked
from dnb_edge.errors import InputError

SPECIFICATION = Path(__file__).parents[2] / "docs" / "display-protocol.md"
KNOWN = {kind.PATTERN.pattern.split(" ")[0] for kind in protocol.MESSAGES}


def is_message(body):
    """Whether the appliance's own reader takes `body`."""
    try:
        protocol.parse_line(body.encode())
    except InputError:
        return False
    return True


def test_every_example_of_the_specification_is_read():
    """The lines that the page shows are lines to the panel."""
    blocks = re.findall(r"```text\n(.*?)```", SPECIFICATION.read_text(encoding="utf-8"), re.DOTALL)
    lines = "".join(blocks).splitlines()
    bodies = Lines().feed("".join(one + "\r\n" for one in lines).encode())
    assert len(bodies) == len(lines) > 30
    assert all(len(grammar.parse(body)) > 1 for body in bodies)


def test_the_same_kinds_are_known():
    """Neither half of the protocol has a kind that the other has not."""
    assert set(grammar._FORMS) == KNOWN


def test_damaged_lines_are_lines_to_both_or_to_none():
    """Of 20,000 damaged lines the panel takes those that the appliance's own reader takes, and no others."""
    chance = Chance(7)
    taken = 0
    for _ in range(20_000):
        raw = damaged(chance, line).split(b"\n")[0]
        body = checked(raw.removesuffix(b"\r"))
        if body is None or body.split(" ")[0] not in KNOWN:
            continue
        assert (grammar.parse(body) is not None) == is_message(body), body
        taken += grammar.parse(body) is not None
    assert taken > 1000


@given(st.text(alphabet="LAPRUNHEO -+.0123456789*=OKBDTS", max_size=40))
def test_any_text_is_a_line_to_both_or_to_none(text):
    """The same for texts of the protocol's own characters."""
    if text.split(" ")[0] in KNOWN:
        assert (grammar.parse(text) is not None) == is_message(text)


@pytest.mark.parametrize(
    ("body", "read"),
    [
        ("RUN - -", ["RUN", "-", "-"]),
        ("RUN 3 4.201", ["RUN", 3, 4201]),
        ("LAP 2 999999.999 +-0.010 BAD -", ["LAP", 2, 999_999_999, 10, "BAD", None]),
        ("LIVE -0.214 95.8", ["LIVE", -214, 958]),
        ("LIVE - -", ["LIVE", None, None]),
        ("PLACE 1= 2 5 12.483 - IN Anna Bo", ["PLACE", (1, True), 2, 5, 12483, None, "IN", "Anna Bo"]),
        ("HEALTH FPS 29.9 REC FAILED WARNINGS 1", ["HEALTH", "FPS", 299, "REC", "FAILED", "WARNINGS", 1]),
        ("TOMORROW 1", ["TOMORROW"]),
        ("RUN 03 4.200", None),
        ("RUN 3 4.20", None),
        ("RUN 1234567 4.200", None),
        ("NOTE a  b", None),
        ("NOTE", None),
        ("", None),
    ],
)
def test_what_is_read(body, read):
    """Seconds are milliseconds, tenths are tenths, and what is misspelt is nothing."""
    assert grammar.parse(body) == read


@pytest.mark.parametrize(
    ("raw", "strict", "body"),
    [
        (b"RUN - - *49", True, "RUN - -"),
        (b"RUN - - *48", True, None),
        (b"RUN - -", True, None),
        (b"RUN - -", False, "RUN - -"),
        (b"RUN - - *48", False, None),
        (b"RUN - - *4a", True, None),
        (b"RUN\t- -", False, None),
        ("RUN é".encode(), False, None),
    ],
)
def test_a_line_needs_its_checksum_unless_it_is_typed(raw, strict, body):
    """A wrong checksum is never taken; a missing one only by hand."""
    assert checked(raw, strict) == body


def test_lines_are_whole_however_they_are_cut():
    """Byte by byte, with empty lines and both ends of line, the same bodies come out."""
    sent = b"\r\n".join([line(body).removesuffix(b"\r\n") for body in CORPUS]) + b"\n\r\n\n"
    whole, cut = Lines(), Lines()
    bodies = whole.feed(sent)
    assert bodies == list(CORPUS)
    assert [body for at in range(len(sent)) for body in cut.feed(sent[at : at + 1])] == bodies
    assert whole.dropped == cut.dropped == 0


def test_a_line_that_never_ends_takes_no_room():
    """Of a megabyte without an end nothing is kept, and the next line is read."""
    lines = Lines()
    for _ in range(1000):
        assert lines.feed(b"x" * 1000) == []
        assert len(lines._torn) < LONGEST
    assert lines.feed(b"\r\n" + line("RUN - -")) == ["RUN - -"]
    assert lines.dropped == 1


def test_the_longest_line_is_read_and_a_longer_one_is_not():
    """80 bytes with the end, as the specification says."""
    for length, taken in ((LONGEST, 1), (LONGEST + 1, 0)):
        text = line("NOTE " + "x" * (length - len("NOTE  *00\r\n")))
        assert len(text) == length
        assert len(Lines().feed(text)) == taken
