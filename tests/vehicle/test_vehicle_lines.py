"""What a vehicle's line may say, how many are taken, and what becomes of all others."""

import itertools
import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.live.messages import Hello as DaemonHello
from dnb_edge.live.messages import Phase, State, Told, VehicleSays, decode, encode
from dnb_edge.live.vehicle_word import VehicleWord, fault
from dnb_edge.vehicle.channel import Splitter
from dnb_edge.vehicle.ledger import BURST_S, MOST_HZ, SENDER_HZ, Ledger
from dnb_edge.vehicle.signals import Signals
from dnb_edge.vehicle.telemetry import MOST_LINE_BYTES, Hello, Nonsense, parse

SECOND_NS = 1_000_000_000


def test_a_line_says_what_the_page_says() -> None:
    """The documented example, and the least that may be said."""
    line = b'{"car": 1, "inference_ms": 12.3, "steering": -0.2, "throttle": 0.5, "seq": 17, "model": "passed over"}'
    assert parse(line, 5) == VehicleWord(came_ns=5, car=1, seq=17, inference_ms=12.3, steering=-0.2, throttle=0.5)
    assert parse(b'{"throttle": 1}', 5) == VehicleWord(came_ns=5, car=1, throttle=1.0)
    assert parse(b'{"hello": 1, "car": 3}', 5) == Hello(car=3)
    assert parse(b'{"hello": 1}', 5) == Hello(car=None)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b"", "no JSON"),
        (b"\xff\xfe", "no JSON"),
        (b"[" * 400, "no JSON"),
        (b"3", "no JSON object"),
        (b"{}", "none of inference_ms, steering, throttle"),
        (b'{"steering": NaN}', "steering nan is not within -1 to 1"),
        (b'{"steering": 1.01}', "steering 1.01 is not within -1 to 1"),
        (b'{"throttle": "full"}', "throttle 'full' is no number"),
        (b'{"throttle": true}', "throttle True is no number"),
        (b'{"throttle": 0, "car": 0}', "car 0 is not within 1 to 99"),
        (b'{"throttle": 0, "car": 1.5}', "car 1.5 is no whole number"),
        (b'{"throttle": 0, "seq": -1}', "seq -1 is not within 0 to"),
        (b'{"inference_ms": -3}', "inference_ms -3.0 is not within 0 to 60000"),
        (b'{"inference_ms": 1e999}', "inference_ms inf is no number"),
        (b'{"inference_ms": 1%s}' % (b"0" * 400), "inference_ms int is no number"),
        (b'{"hello": 1, "car": 100}', "car 100 is not within 1 to 99"),
        (b'{"throttle": 0, "pad": "%s"}' % (b"x" * MOST_LINE_BYTES), "longer than 512 bytes"),
    ],
)
def test_a_line_that_lies_is_refused_with_a_reason(line: bytes, why: str) -> None:
    """Whatever cannot be meant is named."""
    with pytest.raises(Nonsense) as told:
        parse(line, 0)
    assert str(told.value).startswith(why)


json_like = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
members = st.dictionaries(
    st.sampled_from(["car", "seq", "inference_ms", "steering", "throttle", "hello"]), json_like, max_size=6
)


@given(line=st.binary(max_size=700) | members.map(lambda said: json.dumps(said).encode()))
def test_whatever_comes_is_taken_within_bounds_or_refused(line: bytes) -> None:
    """Any bytes: either `Nonsense`, or a word within its bounds that the daemon's socket carries unchanged."""
    try:
        found = parse(line, 7)
    except Nonsense:
        return
    if isinstance(found, VehicleWord):
        assert fault(found) is None
        message = VehicleSays(ask=1, words=(found,))
        assert decode(encode(message).rstrip(b"\n")) == message


@given(data=st.binary(max_size=3000), cuts=st.lists(st.integers(0, 3000), max_size=10))
def test_a_stream_is_cut_alike_wherever_it_is_broken(data: bytes, cuts: list[int]) -> None:
    """Lines of a serial port do not depend on how the bytes come; a line without end takes no memory, and counts once."""
    splitter, found = Splitter(), []
    places = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    for start, end in itertools.pairwise(places):
        found += splitter.feed(data[start:end])
    short = [line.strip() for line in data.split(b"\n")[:-1] if len(line) <= MOST_LINE_BYTES]
    assert [line for line in found if len(line) <= MOST_LINE_BYTES and line in short] == [
        line for line in short if line
    ]
    assert sum(map(len, found)) <= len(data)


def test_who_says_ever_so_much_leaves_room_for_the_others() -> None:
    """A flood from one address is cut to its limit, counted, and takes nothing from a car at another one."""
    ledger, taken = Ledger(), {"flood": 0, "car": 0}
    for tenth_ms in range(100_000):
        now_ns = tenth_ms * 100_000
        taken["flood"] += ledger.has_room("flood", now_ns)
        if tenth_ms % 333 == 0:
            taken["car"] += ledger.has_room("car", now_ns)
    assert taken["car"] == 301
    assert taken["flood"] == pytest.approx(10 * SENDER_HZ, abs=SENDER_HZ * BURST_S + 2)
    assert ledger.over == 100_000 - taken["flood"]


@given(senders=st.lists(st.tuples(st.integers(0, 200), st.integers(0, 3_000_000)), max_size=400))
def test_all_together_never_say_more_than_a_race_takes(senders: list[tuple[int, int]]) -> None:
    """However many senders there are, forged ones too: in any second no more than the limit, and memory stays bounded."""
    ledger, now_ns, taken = Ledger(), 0, []
    for sender, after_ns in senders:
        now_ns += after_ns
        if ledger.has_room(sender, now_ns):
            taken.append(now_ns)
    most = 1 + MOST_HZ * (1.0 + BURST_S)
    assert all(sum(start <= one < start + SECOND_NS for one in taken) <= most for start in taken[:3])
    assert ledger.over == len(senders) - len(taken)
    assert len(ledger._senders) <= 64


def test_missing_lines_and_the_rate_are_counted_by_car() -> None:
    """By a car's own count; one that begins anew, or runs backwards, misses nothing."""
    ledger = Ledger()

    def said(car: int, seq: int | None, at_s: float) -> VehicleWord:
        return ledger.take(VehicleWord(came_ns=round(at_s * SECOND_NS), car=car, seq=seq, throttle=0.0))

    assert (said(1, 5, 0.0).missing, said(1, 6, 0.1).missing, said(1, 9, 0.2).missing) == (0, 0, 2)
    assert said(2, 100, 0.25).missing == 0
    assert (said(1, 0, 0.3).missing, said(1, 5000, 0.4).missing, said(1, None, 0.5).missing) == (2, 2, 2)
    rate_hz = said(1, 5001, 0.6).rate_hz
    assert rate_hz is not None
    assert math.isclose(rate_hz, 10.0, rel_tol=1e-9)
    assert said(2, 101, 9.0).rate_hz is None


def race(phase: str, sequence: int = 0) -> Told:
    return Told(sequence=sequence, event={"event": "race", "phase": phase})


RACING = {"phase": Phase.RACING}
HELLO = DaemonHello(protocol=1, version="1", epoch="e", next_sequence=10, first_sequence=0)


@pytest.mark.parametrize(
    ("state", "phases", "word"),
    [
        (None, [], "stop"),
        ({"phase": Phase.STARTING}, [], "stop"),
        ({**RACING, "start": "rolling"}, [], "ready"),
        ({**RACING, "start": "rolling"}, ["waiting"], "go"),
        ({**RACING, "start": "rolling"}, ["waiting", "racing"], "go"),
        ({**RACING, "start": "rolling"}, ["waiting", "racing", "finished"], "stop"),
        ({**RACING, "start": "grid"}, ["waiting"], "stop"),
        ({**RACING, "start": "grid"}, ["waiting", "countdown"], "ready"),
        ({**RACING, "start": "grid"}, ["waiting", "countdown", "racing"], "go"),
        ({**RACING, "start": "grid"}, ["countdown", "racing", "grace"], "go"),
        ({**RACING, "start": "grid"}, ["countdown", "racing", "finished"], "stop"),
        ({**RACING, "start": "grid"}, ["a word of a later version"], "stop"),
        ({"phase": Phase.FINISHED, "start": "grid"}, ["racing"], "stop"),
    ],
)
def test_what_a_race_makes_a_car_do(state: dict[str, Any] | None, phases: list[str], word: str) -> None:
    """A rolling start is green from the first picture on, a grid at the end of its countdown; without a race it is red."""
    signals = Signals()
    signals.greeted(HELLO)
    if state is not None:
        signals.state(State(**state))
    for phase in phases:
        assert signals.told(race(phase)) is None
    assert (signals.word, signals.standing.line) == (word, b'{"signal":"%s"}\n' % word.encode())


def test_green_never_outlives_its_race() -> None:
    """Another run begins with its own colour; a daemon that goes leaves red, and one that comes back green if it races on."""
    signals = Signals()
    signals.greeted(HELLO)
    signals.state(State(phase=Phase.RACING, start="grid", first_sequence=0))
    signals.told(race("racing"))
    assert signals.word == "go"
    signals.state(State(phase=Phase.RACING, start="grid", first_sequence=20))
    assert signals.word == "stop"
    signals.told(race("racing", 21))
    signals.gone()
    assert signals.word == "stop"
    signals.greeted(HELLO)
    signals.state(State(phase=Phase.RACING, start="grid", first_sequence=20))
    signals.told(race("racing", 3))
    assert signals.word == "go"


def test_only_laps_that_have_just_been_driven_are_told() -> None:
    """What a gateway hears of that was driven before it came is no news."""
    signals = Signals()
    signals.greeted(HELLO)
    lap = {"event": "lap", "car": 2, "number": 3, "time_s": 12.4831, "valid": True, "sigma_s": 0.002}
    assert signals.told(Told(sequence=9, event=lap)) is None
    told = signals.told(Told(sequence=10, event=lap))
    assert told is not None
    assert told.car == 2
    assert json.loads(told.line) == {"signal": "lap", "car": 2, "lap": 3, "time_s": 12.4831, "valid": True}
