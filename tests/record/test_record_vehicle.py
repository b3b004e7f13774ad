"""What vehicles say in a recording: read back as it was, and the first to give way, without the recording being less whole."""

from pathlib import Path

from record_samples import found, lap, recorder

from dnb_edge.record.mailbox import Mailbox, Rank
from dnb_edge.record.reader import iter_told, read_run
from dnb_edge.values import VehicleReport


def said(t_ns: int, **members: int | float | None) -> VehicleReport:
    known = {"seq": 3, "inference_ms": 12.25, "steering": -0.2, "throttle": None, "rate_hz": 30.5}
    return VehicleReport(t_ns=t_ns, t_s=t_ns * 1e-9, came_ns=t_ns + 7, car=2, missing=1, refused=4, **(known | members))


def test_what_a_vehicle_said_is_read_back_exactly(tmp_path: Path) -> None:
    """Every member, by the run's own reader and by kind."""
    writer = recorder(tmp_path)
    items = [found(0, 0), said(5), found(1, 33_000_000), said(33_000_001, seq=None, steering=1.0), lap(1, 40_000_000)]
    for item in items:
        writer.add_detections(item) if item in (items[0], items[2]) else writer.add_event(item)
    path = writer.close()
    assert list(read_run(path).messages()) == items
    assert list(iter_told(path, VehicleReport)) == [items[1], items[3]]
    assert read_run(path).counts["/vehicle"] == 2


def test_it_gives_way_before_anything_else_and_is_not_missed(tmp_path: Path) -> None:
    """A disk that cannot keep up: half of the queue is for what a race is scored by, all laps get in, and nothing is lost
    that scoring again would need."""
    mail: Mailbox[str] = Mailbox(capacity=10, picture_capacity=2)
    assert all(mail.put("said", Rank.EXTRA, wait=True) for _ in range(5))
    assert mail.put("said", Rank.EXTRA, wait=True) is None
    assert all(mail.put("seen", Rank.DATA, wait=False) for _ in range(5))
    assert mail.put("seen", Rank.DATA, wait=False) is None
    assert mail.put("lap", Rank.VITAL, wait=False) is not None
    assert (mail.lost, mail.lost_extras, mail.dropped_pictures) == (1, 1, 0)


def test_a_recording_that_left_words_out_is_whole(tmp_path: Path) -> None:
    """With room for a few messages only, in a live race: words are left out, no message is told as lost, all laps are there."""
    writer = recorder(tmp_path, lossless=False, queue_messages=6)
    for number in range(3000):
        writer.add_event(said(number))
    for number in (1, 2):
        writer.add_event(lap(number, 3000 + number))
    run = read_run(writer.close())
    assert (run.lost_messages, run.warnings, run.counts["/lap"]) == (0, (), 2)
    assert 0 < run.counts["/vehicle"] < 3000
