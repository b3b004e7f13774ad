"""The benchmark's card: written and read back the same, and anything else refused in one line that names the file."""

import json
from dataclasses import replace

import pytest

from dnb_edge.errors import InputError
from dnb_edge.nut.bench_card import (
    BenchCard,
    ColdStart,
    Host,
    Latency,
    Memory,
    Spread,
    WarmUp,
    card_name,
    card_object,
    card_text,
    read_bench_card,
)


def spread(ms: float) -> Spread:
    return Spread(all_ms=ms, least_ms=ms * 0.9, most_ms=ms * 1.2)


def latency(ms: float) -> Latency:
    return Latency(p50=spread(ms), p95=spread(2 * ms), p99=spread(3 * ms), mean_ms=1.1 * ms, max_ms=4 * ms)


CARD = BenchCard(
    entry="Größe 2",
    model_file="dave2.onnx",
    model_sha256="ab" * 32,
    model_bytes=1234,
    input_shape=(1, 3, 66, 200),
    input_type="float32",
    host=Host(name="box", cpu="Cortex-A76", cores=4, architecture="aarch64", governor="ondemand"),
    threads=1,
    measured_at="2026-01-01T12:00:00Z",
    software={"onnxruntime": "1.27.0"},
    repeats=5,
    passes=200,
    warm_up=WarmUp(passes=20, first_ms=9.0),
    inference=latency(3.0),
    fps=310.0,
    memory=Memory(grown_bytes=10_000_000, peak_bytes=60_000_000),
    cold_start=ColdStart(starts=3, process_ms=20.0, import_ms=200.0, load_ms=30.0, first_answer_ms=5.0, total_ms=255.0),
    preprocessing=latency(0.5),
    frames="clip.mp4",
)


@pytest.mark.parametrize("card", [CARD, replace(CARD, preprocessing=None, frames=None)], ids=["clip", "noise"])
def test_a_card_is_read_as_it_was_written(tmp_path, card):
    """Every field comes back, through the file."""
    path = tmp_path / card_name(card.entry)
    path.write_text(card_text(card), encoding="utf-8")
    assert read_bench_card(path) == card


def test_what_a_table_asks_for_has_short_names():
    """The three percentiles are those over all passes, and the host has words."""
    assert (CARD.p50_ms, CARD.p95_ms, CARD.p99_ms) == (3.0, 6.0, 9.0)
    assert CARD.host.words == "box: Cortex-A76, 4 cores"


@pytest.mark.parametrize(
    ("entry", "name"),
    [
        ("dave2", "dave2.nut.json"),
        ("my net/2", "my-net-2.nut.json"),
        ("../../etc", "etc.nut.json"),
        ("Größe", "Gr-e.nut.json"),
        ("//", "entry.nut.json"),
    ],
)
def test_an_entrys_card_is_a_plain_file_name(entry, name):
    """No entry's name leads out of the folder."""
    assert card_name(entry) == name


def test_a_later_cards_new_keys_are_passed_over(tmp_path):
    """A key more, at the top or below, is no reason to refuse a card."""
    told = card_object(CARD)
    told["new"] = 1
    told["host"]["new"] = 2
    (tmp_path / "a.nut.json").write_text(json.dumps(told))
    assert read_bench_card(tmp_path / "a.nut.json") == CARD


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"format": "other"}, "no benchmark's card"),
        ({"version": 2}, "version 2"),
        ({"threads": 0}, "threads"),
        ({"fps": float("nan")}, "fps"),
        ({"fps": -1.0}, "fps"),
        ({"model_sha256": "xyz"}, "model_sha256"),
        ({"host": None}, "host"),
        ({"inference": {}}, "inference"),
    ],
)
def test_what_is_no_card_is_refused(tmp_path, change, says):
    """The line names the file and the key."""
    path = tmp_path / "a.nut.json"
    path.write_text(json.dumps(card_object(CARD) | change))
    with pytest.raises(InputError) as refusal:
        read_bench_card(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert says in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("content", [b"", b"[1]", b"\xff", b"[" * 100_000, b" " * 1_000_001])
def test_rubbish_is_refused(tmp_path, content):
    """What is no JSON, none of ours, or far too large."""
    path = tmp_path / "a.nut.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"a\.nut\.json"):
        read_bench_card(path)


def test_a_file_that_is_not_there_is_named(tmp_path):
    """One line with the reason."""
    with pytest.raises(InputError, match=r"none\.nut\.json: .*No such file"):
        read_bench_card(tmp_path / "none.nut.json")
