"""Taking recordings home: ranges, resuming, whole copies of what is being recorded, zips, and how many at once."""

import io
import socket
import sys
import threading
import time
import zipfile
from datetime import UTC, datetime
from email.utils import formatdate
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from runs_made import Car, guest, header_of, record, recorder, said, setup
from web_box import served

from dnb_edge.record.chain import read_head
from dnb_edge.record.reader import read_run
from dnb_edge.values import FrameDetections, Lap
from dnb_edge.web import downloads, runs_jobs
from dnb_edge.web.app import make_app
from dnb_edge.web.downloads_parts import Member, Part, Span, Unsatisfiable, disposition, pieces, wanted_span, zipped
from dnb_edge.web.downloads_send import Lanes
from dnb_edge.web.endpoint import Refused
from dnb_edge.web.guard_rates import Limits


def laps_in(path_or_bytes):
    """The laps' numbers, by the stock reader with all checksums checked."""
    stream = io.BytesIO(path_or_bytes) if isinstance(path_or_bytes, bytes) else path_or_bytes.open("rb")
    with stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_summary().statistics.message_count > 0
        return [message.sequence for _, _, message in reader.iter_messages(topics=["/lap"])]


@pytest.mark.parametrize(
    ("header", "size", "span"),
    [
        (None, 100, None),
        ("bytes=0-0", 100, (0, 1)),
        ("bytes=0-", 100, (0, 100)),
        ("bytes=99-", 100, (99, 100)),
        ("bytes=10-19", 100, (10, 20)),
        ("bytes=10-1000", 100, (10, 100)),
        ("bytes=-5", 100, (95, 100)),
        ("bytes=-500", 100, (0, 100)),
        ("BYTES = 3 - 4", 100, (3, 5)),
        ("bytes=100-", 100, Unsatisfiable),
        ("bytes=100-200", 100, Unsatisfiable),
        ("bytes=-0", 100, Unsatisfiable),
        ("bytes=0-", 0, Unsatisfiable),
        ("bytes=-1", 0, Unsatisfiable),
        ("bytes=5-2", 100, None),
        ("bytes=-", 100, None),
        ("bytes=a-b", 100, None),
        ("bytes=0-1,5-6", 100, None),
        ("lines=0-5", 100, None),
        ("bytes=0x1-5", 100, None),
        ("bytes=1e1-", 100, None),
        ("bytes=" + "9" * 40 + "-", 100, None),
        ("bytes=٣-٤", 100, (3, 5)),
        ("", 100, None),
    ],
)
def test_ranges(header, size, span) -> None:
    """What of a file each Range header asks for, by RFC 9110: what is malformed asks for all of it."""
    if span is Unsatisfiable:
        with pytest.raises(Unsatisfiable):
            wanted_span(header, size)
        return
    found = wanted_span(header, size)
    assert found == (None if span is None else Span(start=span[0], stop=span[1]))


@given(st.text(max_size=40))
def test_any_name_makes_one_header_line(name: str) -> None:
    """No file name, whatever it holds, ends the header or its quotes."""
    made = disposition(name)
    assert made.isascii()
    assert made.isprintable()
    assert made.count('"') == 2
    assert "/" not in made
    assert "\\" not in made


@given(st.lists(st.integers(0, 40), min_size=1, max_size=4), st.data())
def test_pieces_of_parts(tmp_path_factory: pytest.TempPathFactory, sizes: list[int], data: st.DataObject) -> None:
    """Any span over several files is what stands there in the files put together."""
    folder = tmp_path_factory.mktemp("parts")
    whole, parts = b"", []
    for number, size in enumerate(sizes):
        path = folder / str(number)
        path.write_bytes(bytes((number * 50 + k) % 256 for k in range(size + 3)))
        parts.append(Part(path=path, size_bytes=size))
        whole += path.read_bytes()[:size]
    start = data.draw(st.integers(0, len(whole)))
    stop = data.draw(st.integers(start, len(whole)))
    assert b"".join(pieces(parts, Span(start=start, stop=stop))) == whole[start:stop]


def test_a_finished_file(tmp_path: Path) -> None:
    """The whole file, its head, its parts and what has not changed, with the headers that a browser resumes by."""
    path = record(tmp_path / "runs", 2.0, 2.0)
    whole, here = path.read_bytes(), guest(tmp_path)
    address = f"/api/v1/runs/{here.only_id()}/recording.mcap"
    answer = here.client.get(address)
    assert (answer.status_code, answer.content) == (200, whole)
    tag, modified = answer.headers["etag"], answer.headers["last-modified"]
    assert answer.headers["accept-ranges"] == "bytes"
    assert answer.headers["content-length"] == str(len(whole))
    assert answer.headers["content-disposition"] == f'attachment; filename="{path.name}"'
    assert answer.headers["x-content-type-options"] == "nosniff"
    head = here.client.head(address)
    assert (head.status_code, head.content, head.headers["content-length"]) == (200, b"", str(len(whole)))
    cases = [
        ({"Range": "bytes=0-9"}, 206, whole[:10]),
        ({"Range": "bytes=-7"}, 206, whole[-7:]),
        ({"Range": "bytes=300000-"}, 416, b"") if len(whole) <= 300000 else ({"Range": "bytes=5-5"}, 206, whole[5:6]),
        ({"Range": f"bytes={len(whole)}-"}, 416, b""),
        ({"Range": "bytes=9-3"}, 200, whole),
        ({"Range": "bytes=0-1,4-5"}, 200, whole),
        ({"Range": "bytes=2-4", "If-Range": tag}, 206, whole[2:5]),
        ({"Range": "bytes=2-4", "If-Range": modified}, 206, whole[2:5]),
        ({"Range": "bytes=2-4", "If-Range": '"another"'}, 200, whole),
        ({"Range": "bytes=2-4", "If-Range": f"W/{tag}"}, 200, whole),
        ({"Range": "bytes=2-4", "If-Range": formatdate(0, usegmt=True)}, 200, whole),
        ({"If-None-Match": tag}, 304, b""),
        ({"If-None-Match": f'"x", {tag}'}, 304, b""),
        ({"If-None-Match": "*"}, 304, b""),
        ({"If-None-Match": '"x"'}, 200, whole),
    ]
    for headers, status, content in cases:
        answer = here.client.get(address, headers=headers)
        assert (answer.status_code, answer.content) == (status, content), headers
        if status == 416:
            assert answer.headers["content-range"] == f"bytes */{len(whole)}"
    part = here.client.get(address, headers={"Range": "bytes=3-5"})
    assert (part.headers["content-range"], part.headers["content-length"]) == (f"bytes 3-5/{len(whole)}", "3")


def test_resumed_in_pieces(tmp_path: Path) -> None:
    """A download that broke off again and again is the whole file in the end."""
    path = record(tmp_path / "runs", 2.0, 2.0)
    here = guest(tmp_path)
    address, got, tag = f"/api/v1/runs/{here.only_id()}/recording.mcap", b"", None
    while len(got) < path.stat().st_size:
        headers = {"Range": f"bytes={len(got)}-{len(got) + 29_999}"} | ({} if tag is None else {"If-Range": tag})
        answer = here.client.get(address, headers=headers)
        assert answer.status_code == 206
        got, tag = got + answer.content, answer.headers["etag"]
    assert got == path.read_bytes()


@pytest.mark.parametrize("run_id", ["0" * 24, "%252e%252e", "..%2f..%2fetc%2fpasswd", "a" * 300, "run-f6a66880-0001"])
def test_foreign_ids(tmp_path: Path, run_id: str) -> None:
    """Nothing but the id of a recording is one; a file's own name is none."""
    record(tmp_path / "runs", 2.0, name="run-f6a66880-0001.mcap")
    here = guest(tmp_path)
    for end in ("", "/recording.mcap", "/recording.zip", "/laps", "/report.html", "/picture.jpg"):
        assert here.client.get(f"/api/v1/runs/{run_id}{end}").status_code == 404
    assert here.client.get(f"/api/v1/sessions/{run_id}.zip").status_code == 404
    assert here.client.get(f"/runs/{run_id}").status_code == 404


def test_a_copy_while_it_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is downloaded while another thread records is each time a whole file with all laps that were saved by then."""
    monkeypatch.setattr(downloads, "FRESH_COPY_S", 0.0)
    here, made = guest(tmp_path), setup()
    writer = recorder(tmp_path / "runs", header_of(made), sync_period_s=0.05)
    saved, stop, faults = [0], threading.Event(), []

    def race() -> None:
        try:
            for one in said(Car([2.5] * 12), made):
                if isinstance(one, FrameDetections):
                    writer.add_detections(one)
                elif isinstance(one, Lap):
                    assert writer.wait_saved(writer.add_event(one))
                    saved[0] += 1
                    stop.wait(0.1)
                else:
                    writer.add_event(one)
        except AssertionError as error:
            faults.append(error)

    thread = threading.Thread(target=race)
    thread.start()
    try:
        seen = []
        while len(seen) < 3:
            at_least = saved[0]
            if at_least < 2 + 2 * len(seen) and thread.is_alive():
                stop.wait(0.02)
                continue
            live = writer.path.read_bytes()
            (run,) = here.runs()
            assert (run["state"], run["current"]) == ("recording", True)
            answer = here.client.get(f"/api/v1/runs/{run['id']}/recording.mcap")
            assert answer.status_code == 200
            assert answer.headers["content-disposition"].endswith('.mcap"')
            assert len(laps_in(answer.content)) >= at_least
            assert writer.path.read_bytes().startswith(live), "the live file is only read"
            seen.append(answer.content)
    finally:
        stop.set()
        thread.join(60)
    assert not faults
    assert len(laps_in(writer.close())) == 12
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(seen[-1])
    run = read_run(copy)
    assert (run.damage, run.warnings) == (None, ())
    assert read_head(copy).header.name == "net"


def test_a_copy_is_resumed_though_the_race_went_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who broke off goes on with the same copy, with or without saying which; after the end it is told to begin anew."""
    monkeypatch.setattr(downloads, "FRESH_COPY_S", 0.0)
    here, made = guest(tmp_path), setup()
    writer = recorder(tmp_path / "runs", header_of(made))
    everything = list(said(Car([2.5] * 6), made))

    def go_on(items) -> None:
        for one in items:
            ticket = writer.add_detections(one) if isinstance(one, FrameDetections) else writer.add_event(one)
        assert writer.wait_saved(ticket)

    go_on(everything[: len(everything) // 2])
    address = f"/api/v1/runs/{here.only_id()}/recording.mcap"
    first = here.client.get(address)
    tag, half = first.headers["etag"], len(first.content) - 500
    go_on(everything[len(everything) // 2 :])
    for extra in ({"If-Range": tag}, {}):
        rest = here.client.get(address, headers={"Range": f"bytes={half}-"} | extra)
        assert (rest.status_code, first.content[:half] + rest.content) == (206, first.content)
    newer = here.client.get(address)
    assert newer.headers["etag"] != tag
    assert len(newer.content) > len(first.content)
    head = here.client.head(address)
    assert here.client.get(address).headers["etag"] == head.headers["etag"]
    path = writer.close()
    again = here.client.get(address, headers={"Range": f"bytes={half}-", "If-Range": tag})
    assert (again.status_code, again.content) == (200, path.read_bytes())


def test_a_copy_that_takes_long_is_given_to_who_asks_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a recording that grows faster than a copy of it is made: the copy that was begun, not another one that is late too."""
    here, made = guest(tmp_path), setup()
    writer = recorder(tmp_path / "runs", header_of(made))
    everything = list(said(Car([2.5] * 6), made))

    def go_on(items) -> None:
        for one in items:
            ticket = writer.add_detections(one) if isinstance(one, FrameDetections) else writer.add_event(one)
        assert writer.wait_saved(ticket)

    go_on(everything[: len(everything) // 2])
    address = f"/api/v1/runs/{here.only_id()}/recording.mcap"
    monkeypatch.setattr(downloads, "COPY_WITHIN_S", 0.0)
    asked, may_end, do = [], threading.Event(), runs_jobs._do

    def slowly(job) -> None:
        asked.append(job)
        may_end.wait(60)
        do(job)

    monkeypatch.setattr(runs_jobs, "_do", slowly)
    refused = here.client.get(address)
    assert (refused.status_code, refused.headers["retry-after"]) == (503, "5")
    go_on(everything[len(everything) // 2 :])
    assert here.client.get(address).status_code == 503
    may_end.set()
    while asked[0].ended_s is None:
        time.sleep(0.01)
    got = here.client.get(address)
    assert (got.status_code, len(asked)) == (200, 1)
    assert laps_in(got.content)
    # Only once: who asks later gets a fresh one.
    monkeypatch.setattr(downloads, "FRESH_COPY_S", 0.0)
    monkeypatch.setattr(downloads, "COPY_WITHIN_S", 60.0)
    assert len(laps_in(here.client.get(address).content)) == 6
    writer.close()


def test_a_word_too_many_from_long_work_ends_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever a library prints into it: the work is done, and so is the next one."""
    path = record(tmp_path / "runs", 2.0, 2.0, finish=False)
    monkeypatch.setattr(runs_jobs, "sys", SimpleNamespace(executable=str(tmp_path / "python")))
    (tmp_path / "python").write_text(f'#!/bin/sh\necho a word; echo 7; exec {sys.executable} "$@"\n')
    (tmp_path / "python").chmod(0o755)
    here = guest(tmp_path)
    answer = here.client.get(f"/api/v1/runs/{here.only_id()}/recording.mcap")
    assert (answer.status_code, answer.content[:1000]) == (200, path.read_bytes()[:1000])


def test_a_recording_that_has_only_just_begun(tmp_path: Path) -> None:
    """Before its header is whole there is nothing to copy: it says so and when to come back."""
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "run-00000000-0001.mcap.part").write_bytes(b"\x89MCAP0\r\n")
    here = guest(tmp_path)
    answer = here.client.get(f"/api/v1/runs/{here.only_id()}/recording.mcap")
    assert (answer.status_code, answer.json()["error"]["code"]) == (409, "not-yet")
    assert int(answer.headers["retry-after"]) >= 1


def test_one_that_was_cut_short_is_a_whole_file_too(tmp_path: Path) -> None:
    """After a power cut, before anybody finished it, a download is whole and the file stays as it is."""
    path = record(tmp_path / "runs", 2.0, 2.0, finish=False)
    torn = path.read_bytes()[:-100]
    path.write_bytes(torn)
    here = guest(tmp_path)
    (run,) = here.runs()
    assert run["state"] == "cut"
    content = here.client.get(f"/api/v1/runs/{run['id']}/recording.mcap").content
    assert len(laps_in(content)) >= 1
    assert path.read_bytes() == torn


def test_zip_of_a_session(tmp_path: Path) -> None:
    """All recordings of the session with edits and names beside them, unpacked as they are, and no other's."""
    runs = tmp_path / "runs"
    one = record(runs, 2.0, session="spring/..\u2603")
    two = record(runs, 2.2, session="spring/..\u2603")
    record(runs, 2.4, session="autumn")
    (runs / f"{one.stem}.edits.jsonl").write_text("{}\n")
    ring = runs / f"{one.stem}.pictures"
    ring.mkdir()
    (ring / "000001.mcap").write_bytes(b"ring")
    (ring / "000002.mcap.part").write_bytes(b"open")
    here = guest(tmp_path)
    session = next(run["session_id"] for run in here.runs() if run["session"].startswith("spring"))
    answer = here.client.get(f"/api/v1/sessions/{session}.zip")
    assert answer.headers["content-disposition"].startswith('attachment; filename="spring')
    with zipfile.ZipFile(io.BytesIO(answer.content)) as found:
        assert found.testzip() is None
        assert set(found.namelist()) == {one.name, two.name, f"{one.stem}.edits.jsonl"}
        assert found.read(one.name) == one.read_bytes()
        assert all(info.compress_type == zipfile.ZIP_STORED for info in found.infolist())
    answer = here.client.get(f"/api/v1/sessions/{session}.zip?pictures=true")
    with zipfile.ZipFile(io.BytesIO(answer.content)) as found:
        assert found.read(f"{one.stem}.pictures/000001.mcap") == b"ring"
        assert len(found.namelist()) == 4


@pytest.mark.parametrize(("year", "said"), [(1970, 1980), (2026, 2026), (2200, 2107)])
def test_a_zip_has_no_other_years(tmp_path: Path, year: int, said: int) -> None:
    """A file of a box without a clock, or with a wrong one, is taken like any."""
    path = tmp_path / "a"
    path.write_bytes(b"x")
    stamp_ns = round(datetime(year, 6, 1, tzinfo=UTC).timestamp() * 1e9)
    data = b"".join(zipped([Member(name="a", parts=(Part(path=path, size_bytes=1),), modified_ns=stamp_ns)]))
    assert zipfile.ZipFile(io.BytesIO(data)).infolist()[0].date_time[0] == said


def test_no_more_downloads_at_once_than_there_are_places(tmp_path: Path) -> None:
    """The one too many is told to come again, and its place is free once another has ended, however that ended."""
    path = record(tmp_path / "runs", *[2.0] * 6)
    here = guest(tmp_path, most_downloads=2, download_mb_per_s=path.stat().st_size / 1e6 / 3)
    address = f"/api/v1/runs/{here.only_id()}/recording.mcap"
    app = make_app(here.settings, daemon=here.daemon, limits=Limits(per_s=0))
    with served(app) as port:

        def begin() -> socket.socket:
            made = socket.create_connection(("127.0.0.1", port), timeout=20)
            made.sendall(f"GET {address} HTTP/1.1\r\nHost: localhost:{port}\r\n\r\n".encode())
            return made

        def status(made: socket.socket) -> int:
            return int(made.recv(64).split()[1])

        first, second = begin(), begin()
        assert (status(first), status(second)) == (200, 200)
        third = begin()
        text = third.recv(4096)
        assert b" 503 " in text
        assert b"retry-after" in text.lower()
        first.close()
        for _ in range(200):
            again = begin()
            if (found := status(again)) == 200:
                break
            again.close()
            threading.Event().wait(0.05)
        assert found == 200
        for made in (second, third, again):
            made.close()


def test_lanes_count(tmp_path: Path) -> None:
    """A place is given back once for each time that it was taken."""
    lanes = Lanes(2, 1e6)
    lanes.enter()
    lanes.enter()
    with pytest.raises(Refused) as refused:
        lanes.enter()
    assert (refused.value.status, lanes.taken) == (503, 2)
    lanes.leave()
    lanes.enter()
