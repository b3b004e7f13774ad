"""Which run that was cut short is gone on with, from real recordings; and which is not, with the reason said."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from played import Clip, Watcher, frame, info

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.daemon import appliance, rooms
from dnb_edge.daemon.appliance import RunOptions, run_appliance
from dnb_edge.daemon.resume import Unfinished, find_unfinished, places_there
from dnb_edge.record import names
from dnb_edge.record.chain import continued
from dnb_edge.record.header import RunHeader
from dnb_edge.record.reader import read_run
from dnb_edge.record.recover import recover_file
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.sim.rig import Rig
from dnb_edge.values import (
    Event,
    FrameDetections,
    Health,
    Observation,
    RacePhase,
    RaceState,
    RunSummary,
    SourceInfo,
)

SECOND_NS = 1_000_000_000
BEGUN_NS = 500 * SECOND_NS
CAMERA = replace(info(live=True), camera_id="usb-one")
HEADER = RunHeader(name="car", setup={"core": {"laps": 3}}, config={"display": 1}, source=CAMERA, versions={"dnb": "1"})


def found(sequence: int) -> FrameDetections:
    return FrameDetections(sequence=sequence, t_ns=BEGUN_NS + sequence * 10_000_000, detections=(), full_frame=True)


def seen(sequence: int) -> Observation:
    t_ns = BEGUN_NS + sequence * 10_000_000
    return Observation(
        t_ns=t_ns,
        t_s=0.0,
        camera_px=(1.0, 2.0),
        track_m=(0.1, 0.2),
        covariance_m2=(1e-6, 0.0, 1e-6),
        confidence=0.9,
        length_px=40.0,
    )


def health(frames: int) -> Health:
    return Health(
        t_ns=BEGUN_NS,
        t_s=0.0,
        frames=frames,
        detected_frames=0,
        dropped_frames=0,
        fps=None,
        latency_ms=None,
        display="none",
        recording="recording",
        view_error_mean_px=None,
        view_error_mean_m=None,
    )


STATE = RaceState(t_ns=BEGUN_NS, t_s=0.0, phase=RacePhase.RACING)


def record(directory: Path, *items: FrameDetections | Event, header: RunHeader = HEADER, finish: bool = False) -> Path:
    """A recording of these, finished or as SIGKILL leaves it."""
    recorder = Recorder(RecordingSettings(directory=directory, image_fps=None, lossless=True), header)
    for item in items:
        if isinstance(item, FrameDetections):
            recorder.add_detections(item)
        else:
            recorder.add_event(item)
    if finish:
        return recorder.close()
    assert not items or recorder.wait_saved()
    recorder.abandon()
    return recorder.path


ITEMS = (found(0), seen(0), found(1), STATE, health(2), found(2), seen(2), seen(2))


def look(
    directory: Path, *, header: RunHeader = HEADER, after_s: float = 5.0, within_s: float = 600.0
) -> Unfinished | None:
    now_ns = BEGUN_NS + round(after_s * SECOND_NS)
    return find_unfinished((directory,), header, now_ns=now_ns, within_s=within_s)


def test_a_run_that_was_killed_is_found_with_all_that_it_saved(tmp_path: Path) -> None:
    """Its frames, what boards showed, and how much of the last frame had been told."""
    path = record(tmp_path, *ITEMS)
    run = look(tmp_path)
    assert run is not None
    assert (run.files, run.name) == ((path,), path.name.removesuffix(".part"))
    assert (run.frames, run.first_t_ns, run.last_t_ns, run.last_sequence) == (3, found(0).t_ns, found(2).t_ns, 2)
    assert run.shown == (STATE,)
    assert run.after_last == 2
    assert list(run.detections()) == [found(0), found(1), found(2)]


def test_a_run_that_was_recovered_already_is_found_as_well(tmp_path: Path) -> None:
    """Whoever recovered it: it has not ended by itself."""
    path = recover_file(record(tmp_path, *ITEMS)).path
    run = look(tmp_path)
    assert run is not None
    assert run.files == (path,)
    assert run.parts == ()


def test_a_run_is_read_on_while_another_process_finishes_its_files(tmp_path: Path) -> None:
    """The `.part` gets its final name between being found and being raced again."""
    path = record(tmp_path, *ITEMS)
    run = look(tmp_path)
    assert run is not None
    recover_file(path)
    assert len(list(run.detections())) == 3


def other_setup(header: RunHeader) -> RunHeader:
    return replace(header, setup={"core": {"laps": 4}})


def other_entry(header: RunHeader) -> RunHeader:
    return replace(header, name="another", entry=None, session="today")


def other_camera(header: RunHeader) -> RunHeader:
    return replace(header, source=replace(CAMERA, camera_id="usb-two"))


def other_version(header: RunHeader) -> RunHeader:
    return replace(header, versions={"dnb": "2"})


def a_file(header: RunHeader) -> RunHeader:
    return replace(header, source=info(live=False))


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (other_setup, "another configuration"),
        (other_entry, "another session"),
        (other_camera, "another source"),
        (other_version, "another software"),
        (a_file, "is no live camera"),
    ],
)
def test_another_race_is_not_the_same_one(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, other: Callable[[RunHeader], RunHeader], said: str
) -> None:
    """What differs between the two runs is said."""
    record(tmp_path, *ITEMS)
    assert look(tmp_path, header=other(HEADER)) is None
    (line,) = caplog.messages
    assert "was cut short and is not resumed" in line
    assert said in line


def test_what_changes_nothing_of_the_race_may_change(tmp_path: Path) -> None:
    """Another display, or a camera that took its exposure otherwise, is the same race."""
    record(tmp_path, *ITEMS)
    source: SourceInfo = replace(CAMERA, nominal_fps=29.0, driver="uvcvideo")
    assert look(tmp_path, header=replace(HEADER, config={"display": 2}, wall_offset_ns=7, source=source)) is not None


def test_a_run_that_is_too_old_or_from_the_future_is_left_alone(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """By the stamps of its last frame; the limit is the user's."""
    record(tmp_path, *ITEMS)
    assert look(tmp_path, after_s=700.0) is None
    assert look(tmp_path, after_s=700.0, within_s=800.0) is not None
    assert look(tmp_path, after_s=-1.0) is None
    assert [line.partition("not resumed: ")[2] for line in caplog.messages] == [
        "its last frame is 700 s old (limit 600 s)",
        "its stamps lie in the future",
    ]


@pytest.mark.parametrize("finish", [True, False], ids=["finished", "killed between its summary and its end"])
def test_a_run_that_ended_is_over(tmp_path: Path, caplog: pytest.LogCaptureFixture, finish: bool) -> None:
    """Its summary says so; nothing is said about it."""
    summary = RunSummary(frames=3, detected_frames=2, laps=0, recording=None)
    record(tmp_path, *ITEMS, summary, finish=finish)
    assert look(tmp_path) is None
    assert caplog.messages == []


def test_a_run_of_another_boot_is_told_of_and_left_alone(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a power cut nobody knows how long the box was off: a new race begins, loudly."""
    record(tmp_path, *ITEMS)
    monkeypatch.setattr(names, "boot_tag", lambda: "00000000")
    assert look(tmp_path) is None
    (line,) = caplog.messages
    assert "its clock has ended with it" in line


def test_a_run_whose_recording_lacks_frames_is_left_alone(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A disk that could not keep up: raced again, it would give other laps."""
    record(tmp_path, found(0), health(1), found(1), health(5))
    assert look(tmp_path) is None
    assert "3 frames of it were not recorded" in caplog.text


def test_a_run_that_is_too_long_is_left_alone(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Nobody waits for minutes at a start."""
    record(tmp_path, *ITEMS)
    assert find_unfinished((tmp_path,), HEADER, now_ns=BEGUN_NS + SECOND_NS, within_s=600.0, look_s=0.0) is None
    assert "too long to be gone on with" in caplog.text


def test_a_run_that_went_on_on_another_disk_is_found_there(tmp_path: Path) -> None:
    """Its files are read in order, wherever they lie: the first on the disk that failed, the last on the stick."""
    card, stick = tmp_path / "card", tmp_path / "stick"
    first = record(card, *ITEMS)
    after = replace(HEADER, resumed_from=first.name.removesuffix(".part"))
    stick.mkdir()
    settings = RecordingSettings(directory=stick, fallback=(card,), image_fps=None, lossless=True)
    recorder = Recorder(settings, after)
    assert recorder.wait_saved(recorder.add_detections(found(3)))
    recorder.abandon()
    assert recorder.path.name != first.name
    # A clock that was set back between them changes nothing.
    os.utime(first, ns=(2**62, 2**62))
    for places in ((card, stick), (stick, card)):
        run = find_unfinished(places, HEADER, now_ns=BEGUN_NS + SECOND_NS, within_s=600.0)
        assert run is not None
        assert run.files == (first, recorder.path)
        assert [one.sequence for one in run.detections()] == [0, 1, 2, 3]


def test_of_two_disks_the_run_that_was_written_last_counts(tmp_path: Path) -> None:
    """One that began on the stick, since the disk was gone; the older one on the disk is over."""
    card, stick = record(tmp_path / "card", *ITEMS), record(tmp_path / "stick", *ITEMS, found(3))
    for late, early in ((stick, card), (card, stick)):
        os.utime(early, ns=(1, 1))
        os.utime(late, ns=(2, 2))
        run = find_unfinished((card.parent, stick.parent), HEADER, now_ns=BEGUN_NS + SECOND_NS, within_s=600.0)
        assert run is not None
        assert run.files == (late,)


def test_what_was_cut_short_on_a_stick_is_recovered_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the next run, whose recording goes to the disk again."""
    part = record(tmp_path / "stick", *ITEMS)
    (tmp_path / "card").mkdir()
    config = load_config(
        write_demo_config(tmp_path, Rig(laps=1)),
        [f"record.fallback=[{part.parent}]", f"record.directory={tmp_path / 'card'}"],
    )
    monkeypatch.setattr(appliance, "make_source", lambda uri, config: Clip([frame(number) for number in range(3)]))
    monkeypatch.setattr(rooms, "make_detector", lambda *_: Watcher())
    summary = run_appliance(config, RunOptions(source_uri="played:"))
    assert [path.name for path in part.parent.glob("run-*.mcap*")] == [part.name.removesuffix(".part")]
    assert summary.recording is not None
    assert Path(summary.recording).parent == tmp_path / "card"


def test_a_disk_that_is_away_is_passed_over(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A stick that is not plugged in is nothing to tell of; one that may not be looked at is."""
    endless = tmp_path / ("x" * 300)
    there = places_there(tmp_path, (tmp_path / "gone", tmp_path, endless))
    assert there == (tmp_path,)
    assert [record.getMessage() for record in caplog.records] == [
        f"{endless}: not looked at for earlier runs: File name too long"
    ]


def test_each_process_counts_its_own_frames(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """What the second process did not record is missed, though the first one had recorded more frames than that."""
    first = record(tmp_path, *ITEMS)
    record(tmp_path, found(3), health(3), header=replace(HEADER, resumed_from=first.name.removesuffix(".part")))
    assert look(tmp_path) is None
    assert "2 frames of it were not recorded" in caplog.text


def test_a_run_that_is_damaged_inside_is_left_alone(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A torn end is what SIGKILL leaves; a flipped byte is not."""
    path = record(tmp_path, *ITEMS)
    data = bytearray(path.read_bytes())
    path.write_bytes(data[:-5])
    assert look(tmp_path) is not None
    data[data.index(b"zstd") + 60] ^= 0xFF
    path.write_bytes(data)
    assert look(tmp_path) is None
    assert "damaged inside" in caplog.text


def test_a_run_that_goes_on_just_now_is_left_alone(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Its file is locked."""
    recorder = Recorder(RecordingSettings(directory=tmp_path, image_fps=None), HEADER)
    recorder.add_detections(found(0))
    assert recorder.wait_saved()
    assert look(tmp_path) is None
    recorder.abandon()
    assert caplog.messages == []


def test_a_run_without_a_frame_has_nothing_to_go_on_with(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Killed while it waited for the camera; nor is a file without a header anything."""
    record(tmp_path)
    assert look(tmp_path) is None
    assert "before its first frame was saved" in caplog.text
    (tmp_path / f"run-{names.boot_tag()}-0009.mcap.part").write_bytes(b"")
    assert look(tmp_path) is None


@pytest.fixture
def chain(tmp_path: Path) -> tuple[Path, Path, Path]:
    """One race, cut short twice; the last part goes on."""
    first = record(tmp_path, *ITEMS)
    names_of = [first.name.removesuffix(".part")]
    second = record(tmp_path, seen(2), found(3), health(1), header=replace(HEADER, resumed_from=names_of[0]))
    recover_file(first)
    third_header = replace(HEADER, resumed_from=second.name.removesuffix(".part"))
    third = record(tmp_path, found(4), header=third_header)
    return tmp_path / names_of[0], second, third


def test_a_race_that_was_cut_short_twice_is_one(chain: tuple[Path, Path, Path]) -> None:
    """Its files are read in order, whether finished or not, for resuming and for everybody else."""
    first, second, third = chain
    run = look(third.parent)
    assert run is not None
    assert run.files == (first, second, third)
    assert (run.frames, run.after_last) == (5, 0)
    finished = recover_file(third).path
    whole = read_run(finished)
    assert whole.files == (first, second, finished)
    assert [one.sequence for one in whole.detections()] == [0, 1, 2, 3, 4]
    assert [type(event) for event in whole.events()].count(Observation) == 4
    assert whole.counts["/detections"] == 5
    assert whole.first_t_ns == BEGUN_NS
    assert continued([first, second, finished]) == {first: finished, second: finished}


def test_a_part_that_is_not_there_is_missed(chain: tuple[Path, Path, Path], caplog: pytest.LogCaptureFixture) -> None:
    """A race without its beginning is not gone on with; its last part can be read by itself, which is said."""
    first, _, third = chain
    first.rename(first.with_suffix(".bak"))
    assert look(third.parent) is None
    assert f"{first.name}, from which it went on, is not there" in caplog.text
    run = read_run(recover_file(third).path)
    assert [one.sequence for one in run.detections()] == [3, 4]
    assert f"it goes on from {first.name}, which is not beside it: what came before is left out" in run.warnings


@pytest.mark.parametrize("name", ["../other.mcap", "/etc/passwd", "."])
def test_a_name_that_leads_elsewhere_is_not_followed(tmp_path: Path, name: str) -> None:
    """A hostile recording reads nothing outside its directory; one that goes on from itself ends."""
    path = record(tmp_path / "runs", found(0), header=replace(HEADER, resumed_from=name), finish=True)
    assert read_run(path).files == (path,)


def test_a_chain_in_a_ring_ends(tmp_path: Path) -> None:
    """Two files that go on from one another are read once each."""
    number = f"run-{names.boot_tag()}-000"
    one = record(tmp_path, found(0), header=replace(HEADER, resumed_from=f"{number}2.mcap"), finish=True)
    two = record(tmp_path, found(1), header=replace(HEADER, resumed_from=f"{number}1.mcap"), finish=True)
    assert read_run(two).files == (one, two)


def test_the_log_is_silent_where_there_is_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The first run of all."""
    with caplog.at_level(logging.DEBUG):
        assert look(tmp_path) is None
    assert caplog.messages == []
