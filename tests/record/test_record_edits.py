"""The file of a judge's edits: it only grows, says when it was touched, and belongs to one recording."""

import fcntl
import json
import os
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.errors import InputError, WorkError
from dnb_edge.race.edit import Action, AddedLap, Edit, LapKey
from dnb_edge.record.edits import RunIdentity, append_edit, edits_path, locked, read_edits
from dnb_edge.values import Penalty

ME = RunIdentity(name="entry", source="sim:", first_t_ns=7, wall_offset_ns=None)
KEY = LapKey(car=2, number=3, start_t_ns=5, end_t_ns=10**18 + 1)


def edit(number, action=Action.NOTE, **facts):
    return Edit(number=number, time="2026-01-01T00:00:00Z", author="Adä", action=action, reason="sëen", **facts)


EDITS = (
    edit(1, Action.REMOVE, laps=(KEY,)),
    edit(2, Action.ADD, added=AddedLap(key=KEY, start_s=0.1, sigma_s=1e-17)),
    edit(3, Action.PENALTY, laps=(KEY,), penalty=Penalty(offence="judge", seconds=0.3, reason="sëen")),
    edit(4, Action.UNDO, undoes=1),
    edit(5),
)


def written(directory, edits=EDITS):
    recording = directory / "run.mcap"
    for one in edits:
        with locked(recording):
            append_edit(read_edits(recording, ME), one, ME)
    return recording


def test_what_was_appended_is_read_back(tmp_path):
    """Every edit, exactly, in its order; the file lies beside the recording."""
    recording = written(tmp_path)
    log = read_edits(recording, ME)
    assert (log.edits, log.warnings, log.next_number) == (EDITS, (), 6)
    assert edits_path(recording) == edits_path(tmp_path / "run.mcap.part") == tmp_path / "run.edits.jsonl"
    assert [json.loads(line).get("author") for line in log.path.read_text().splitlines()] == [None, *["Adä"] * 5]


def test_no_file_means_no_edits(tmp_path):
    """Reading makes no file."""
    assert read_edits(tmp_path / "run.mcap", ME).edits == ()
    assert list(tmp_path.iterdir()) == []


def test_appending_changes_nothing_that_is_there(tmp_path):
    """The file before is the beginning of the file after."""
    recording = written(tmp_path, EDITS[:3])
    before = edits_path(recording).read_bytes()
    with locked(recording):
        append_edit(read_edits(recording, ME), EDITS[3], ME)
    assert edits_path(recording).read_bytes().startswith(before)


def test_a_torn_last_line_is_left_out_and_told(tmp_path):
    """Cut anywhere within the last line, the edits before it hold, and the next edit takes its place."""
    recording = written(tmp_path)
    path = edits_path(recording)
    whole = path.read_bytes()
    last = whole.rindex(b"\n", 0, -1) + 1
    for cut in range(last + 1, len(whole)):
        path.write_bytes(whole[:cut])
        log = read_edits(recording, ME)
        assert log.edits == EDITS[:-1]
        assert "cut short" in log.warnings[0]
    with locked(recording):
        append_edit(read_edits(recording, ME), EDITS[4], ME)
    assert path.read_bytes() == whole


def test_a_file_whose_first_line_was_torn_begins_anew(tmp_path):
    """A power cut while the file was made: no edit was ever saved, the first one is saved now."""
    recording = tmp_path / "run.mcap"
    for left in (b"", b'{"format": "dnb'):
        edits_path(recording).write_bytes(left)
        assert read_edits(recording, ME).edits == ()
        with locked(recording):
            append_edit(read_edits(recording, ME), EDITS[0], ME)
        assert read_edits(recording, ME).edits == EDITS[:1]


def _without(line):
    return lambda lines: [*lines[:line], *lines[line + 1 :]]


def _swapped(lines):
    return [*lines[:2], lines[3], lines[2], *lines[4:]]


def _reworded(lines):
    return [*lines[:3], lines[3].replace(b"0.3", b"0.0"), *lines[4:]]


TAMPERED = [
    ("a line taken out", _without(2), "line 3: it, or the line before it, was changed or taken out"),
    ("the first line taken out", _without(0), "line 1: it was changed"),
    ("two lines swapped", _swapped, "line 3: it, or the line before it"),
    ("a figure changed", _reworded, "line 4: it, or the line before it"),
    ("a line from nowhere", lambda lines: [*lines, lines[-1]], "line 7: it, or the line before it"),
    ("an empty line", lambda lines: [*lines[:2], b"", *lines[2:]], "line 3: no JSON"),
    ("no number", lambda lines: [*lines[:2], b'{"sha256": NaN}', *lines[2:]], "line 3: no JSON"),
    ("another thing", lambda _: [b"[1]"], "line 1: not a line of a file of edits"),
    ("not text", lambda _: [b"\xff\xfe"], "line 1: no JSON"),
    ("deep", lambda _: [b"[" * 100_000], "line 1: no JSON"),
]


@pytest.mark.parametrize(("change", "text"), [row[1:] for row in TAMPERED], ids=[row[0] for row in TAMPERED])
def test_a_file_that_was_touched_is_refused(tmp_path, change, text):
    """One line with the file and the line number, and what to do."""
    recording = written(tmp_path)
    path = edits_path(recording)
    path.write_bytes(b"\n".join([*change(path.read_bytes().splitlines()), b""]))
    with pytest.raises(InputError) as error:
        read_edits(recording, ME)
    assert str(path) in str(error.value)
    assert text in str(error.value)
    assert "--no-edits" in str(error.value)


@given(at=st.integers(0, 2**16), bit=st.integers(0, 7))
def test_no_flipped_bit_passes(at, bit, tmp_path_factory):
    """One bit changed anywhere: refused, or the same edits (a space, or the very last line feed), never others."""
    recording = written(tmp_path_factory.mktemp("flip"), EDITS[:2])
    path = edits_path(recording)
    data = bytearray(path.read_bytes())
    data[at % len(data)] ^= 1 << bit
    path.write_bytes(bytes(data))
    try:
        log = read_edits(recording, ME)
    except InputError:
        return
    assert log.edits == EDITS[:2][: len(log.edits)]
    assert len(log.edits) == 2 or log.warnings


@pytest.mark.parametrize(
    "change", [{"name": "other"}, {"first_t_ns": 8}, {"source": "v4l2:/dev/video0"}, {"wall_offset_ns": 1}]
)
def test_the_edits_of_another_recording_are_refused(tmp_path, change):
    """Whatever tells the two apart."""
    recording = written(tmp_path)
    other = RunIdentity(**({"name": "entry", "source": "sim:", "first_t_ns": 7, "wall_offset_ns": None} | change))
    with pytest.raises(InputError, match="another recording"):
        read_edits(recording, other)


def test_two_judges_at_once_lose_nothing(tmp_path):
    """Both read and append within the lock: all edits are there, numbered in order."""
    recording = tmp_path / "run.mcap"

    def judge():
        for _ in range(10):
            with locked(recording):
                log = read_edits(recording, ME)
                append_edit(log, edit(log.next_number), ME)

    judges = [threading.Thread(target=judge) for _ in range(4)]
    for one in judges:
        one.start()
    for one in judges:
        one.join()
    assert [one.number for one in read_edits(recording, ME).edits] == list(range(1, 41))


def test_nobody_else_has_the_lock_meanwhile(tmp_path):
    """Another judge, of whatever process, waits until the first is done."""
    descriptor = os.open(tmp_path, os.O_RDONLY)
    try:
        with locked(tmp_path / "run.mcap"), pytest.raises(BlockingIOError):
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    finally:
        os.close(descriptor)


def test_a_disk_that_fails_is_told(tmp_path):
    """Here the folder has gone meanwhile: `WorkError` names the file, and says that nothing was saved."""
    log = read_edits(tmp_path / "gone" / "run.mcap", ME)
    with pytest.raises(WorkError, match=r"run\.edits\.jsonl: the edit was not saved"):
        append_edit(log, EDITS[0], ME)
    with pytest.raises(WorkError, match="gone"), locked(tmp_path / "gone" / "run.mcap"):
        pass


def test_an_edit_out_of_its_turn_is_a_fault_of_ours(tmp_path):
    """The caller numbers edits after what it has read."""
    recording = written(tmp_path, EDITS[:1])
    with pytest.raises(ValueError, match="cannot follow"):
        append_edit(read_edits(recording, ME), EDITS[4], ME)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    """`WorkError` names the file."""
    tmp_path.chmod(0o500)
    with pytest.raises(WorkError, match=r"run\.edits\.jsonl"):
        append_edit(read_edits(tmp_path / "run.mcap", ME), EDITS[0], ME)
