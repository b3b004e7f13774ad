"""The recordings through the API: listed, found, named, pinned, deleted; their laps, tables, reports and the disk."""

import csv
import io
import json
import os
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from runs_made import Guest, guest, header_of, record, recorder, setup
from starlette.testclient import TestClient

from dnb_edge.archive.case import Judge, decide
from dnb_edge.archive.decisions import merging, removing
from dnb_edge.archive.index import RunIndex
from dnb_edge.archive.replayed import replay
from dnb_edge.archive.run_csv import Table, as_csv
from dnb_edge.record.reader import read_run
from dnb_edge.record.retention import Limits, prune

ONE = "run-0000000a-0001.mcap"
TWO = "run-0000000a-0002.mcap"


def made(client: TestClient, address: str, **headers: str):
    """The answer once it is made."""
    for _ in range(200):
        answer = client.get(address, headers=headers)
        if answer.status_code != 202:
            return answer
        assert answer.headers["retry-after"] == "2"
        time.sleep(0.1)
    raise AssertionError("it is never done")


def test_list_says_what_there_is(tmp_path: Path) -> None:
    """A line says who drove, when, how long, how many laps and the best of them, as the recording itself has it."""
    path = record(tmp_path / "runs", 2.4, 2.0, 2.2, name=ONE, entry="alpha", session="spring")
    (run,) = guest(tmp_path).runs()
    told = read_run(path)
    assert (run["file"], run["entry"], run["session"], run["state"]) == (ONE, "alpha", "spring", "finished")
    assert (run["laps"], run["size_bytes"]) == (told.counts["/lap"], path.stat().st_size)
    assert run["best_lap_s"] == min(lap.official_time_s for lap in replay(path).raw_laps if lap.valid)
    assert run["duration_s"] == pytest.approx((told.last_t_ns - told.first_t_ns) / 1e9)
    assert (run["pinned"], run["pinnable"], run["current"], run["notes"]) == (False, True, False, [])


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Guest:
    """Somebody before three recordings: one plain, one pinned, one cut short."""
    folder = tmp_path_factory.mktemp("three")
    runs = folder / "runs"
    record(runs, 2.5, name=ONE, entry="alpha", session="spring")
    record(runs, 2.5, name=TWO, entry="beta", session="spring")
    record(runs, 2.5, name="run-0000000a-0003.mcap", entry="gamma", finish=False)
    (runs / "run-0000000a-0002.pin").touch()
    (runs / "notes.txt").write_text("no recording")
    return guest(folder)


@pytest.mark.parametrize(
    ("query", "wanted"),
    [
        ({}, {"a", "b", "g"}),
        ({"text": "ALPHA"}, {"a"}),
        ({"text": "run-0000000a spring"}, {"a", "b"}),
        ({"text": "nobody"}, set()),
        ({"entry": "beta"}, {"b"}),
        ({"state": "cut"}, {"g"}),
        ({"state": "finished"}, {"a", "b"}),
        ({"pinned": "true"}, {"b"}),
        ({"pinned": "false"}, {"a", "g"}),
        ({"limit": "2"}, None),
        ({"offset": "9"}, set()),
    ],
)
def test_filter(three: Guest, query: dict[str, str], wanted: set[str] | None) -> None:
    """Each filter lets through what it says, and paging takes its part of that."""
    here = three
    found = here.runs(**query)
    if wanted is None:
        assert len(found) == 2
        return
    assert {run["entry"][0] for run in found} == wanted
    answer = here.client.get("/api/v1/runs", params=query).json()
    assert [(one["name"], one["runs"]) for one in answer["sessions"]] == [("spring", 2)]
    if query == {}:
        assert {run["entry"] for run in here.runs(session=answer["sessions"][0]["id"])} == {"alpha", "beta"}


@pytest.mark.parametrize(
    "query",
    ["limit=0", "limit=201", "offset=-1", "offset=x", "state=odd", "pinned=perhaps", "text=" + "x" * 201, "no=1"],
)
def test_bad_queries(three: Guest, query: str) -> None:
    """A question that makes no sense is refused, and with what is wrong with it."""
    answer = three.client.get(f"/api/v1/runs?{query}")
    assert (answer.status_code, answer.json()["error"]["code"]) == (422, "bad-query")
    assert answer.json()["error"]["text"].startswith(query.split("=", maxsplit=1)[0])


def test_names(tmp_path: Path) -> None:
    """A name stays over restarts, leaves the file's own name alone, can be taken away, and is one line for people."""
    record(tmp_path / "runs", 2.0, name=ONE)
    here = guest(tmp_path)
    address = f"/api/v1/runs/{here.only_id()}"
    answer = here.client.patch(address, json={"name": "  <b>Final</b> ☃ "})
    assert (answer.status_code, answer.json()["name"]) == (200, "<b>Final</b> ☃")
    assert guest(tmp_path).runs()[0]["name"] == "<b>Final</b> ☃"
    assert guest(tmp_path).runs(text="final")
    assert (tmp_path / "runs" / ONE).exists()
    for bad in ("two\nlines", "x" * 121, "\u202e backwards"):
        assert here.client.patch(address, json={"name": bad}).status_code == 422, bad
    assert here.client.patch(address, json={"colour": "red"}).status_code == 422
    assert here.client.patch(address, json={"name": ""}).json()["name"] is None
    assert [path.name for path in (tmp_path / "runs").iterdir()] == [ONE]


def test_pins(tmp_path: Path) -> None:
    """A pin is the one that the command line sets; a renamed recording needs none."""
    runs = tmp_path / "runs"
    record(runs, 2.0, name=ONE)
    record(runs, 2.0, name="final of spring.mcap")
    here = guest(tmp_path)
    ids = {run["file"]: run["id"] for run in here.runs()}
    assert here.client.patch(f"/api/v1/runs/{ids[ONE]}", json={"pinned": True}).json()["pinned"] is True
    assert (runs / "run-0000000a-0001.pin").exists()
    assert prune(runs, Limits(max_total_bytes=1)) == []
    assert here.client.patch(f"/api/v1/runs/{ids[ONE]}", json={"pinned": False}).json()["pinned"] is False
    answer = here.client.patch(f"/api/v1/runs/{ids['final of spring.mcap']}", json={"pinned": True})
    assert (answer.status_code, answer.json()["error"]["code"]) == (409, "no-need")


def test_only_who_is_logged_in_changes(tmp_path: Path) -> None:
    """Anybody looks and takes; naming, pinning and deleting need the set-up code."""
    record(tmp_path / "runs", 2.0, name=ONE)
    stranger = guest(tmp_path, logged_in=False)
    address = f"/api/v1/runs/{stranger.only_id()}"
    assert stranger.client.get(f"{address}/recording.mcap").status_code == 200
    assert stranger.client.patch(address, json={"name": "mine"}).status_code == 401
    assert stranger.client.request("DELETE", address, json={"confirm": ONE}).status_code == 401
    assert (tmp_path / "runs" / ONE).exists()


def test_delete(tmp_path: Path) -> None:
    """Only with the file's name, unpinned and not being recorded; then all that belongs to it goes, and nothing else."""
    runs = tmp_path / "runs"
    record(runs, 2.0, name=ONE)
    record(runs, 2.2, name=TWO)
    here = guest(tmp_path)
    address = next(f"/api/v1/runs/{run['id']}" for run in here.runs() if run["file"] == ONE)
    here.client.patch(address, json={"name": "Final", "pinned": True})
    (runs / "run-0000000a-0001.edits.jsonl").write_text("{}\n")
    (runs / "run-0000000a-0001.mcap.part").write_bytes(b"cut short")
    (runs / "run-0000000a-0001.pictures").mkdir()
    (runs / "run-0000000a-0001.pictures" / "000001.mcap").write_bytes(b"ring")

    def delete(confirm: str) -> tuple[int, str]:
        answer = here.client.request("DELETE", address, json={"confirm": confirm})
        return answer.status_code, answer.json().get("error", {}).get("code", "")

    assert delete(ONE) == (409, "pinned")
    here.client.patch(address, json={"pinned": False})
    here.daemon.run = "run-0000000a-0001"
    assert delete(ONE) == (409, "current")
    here.daemon.run = "run-0000000a-0002"
    for wrong in ("", TWO, "run-0000000a-0001", f"{ONE} ", "Final"):
        assert delete(wrong) == (422, "not-confirmed")
    assert len(list(runs.iterdir())) == 6
    assert delete(ONE) == (200, "")
    assert [path.name for path in runs.iterdir()] == [TWO]
    assert delete(ONE) == (404, "not-found")


def test_what_is_being_recorded_is_not_deleted(tmp_path: Path) -> None:
    """Not even where the daemon cannot be asked: the recorder's lock says it."""
    writer = recorder(tmp_path / "runs", header_of(setup()))
    here = guest(tmp_path)
    (run,) = here.runs()
    answer = here.client.request("DELETE", f"/api/v1/runs/{run['id']}", json={"confirm": run["file"]})
    assert (answer.status_code, answer.json()["error"]["code"]) == (409, "current")
    assert writer.close().exists()


def test_laps_in_three_forms(tmp_path: Path) -> None:
    """CSV is what the command line exports, whoever named the entry; JSON and LaTeX say the same laps."""
    path = record(tmp_path / "runs", 2.4, 2.0, 2.2, name=ONE, entry=" =HYPERLINK(1)")
    here = guest(tmp_path)
    address = f"/api/v1/runs/{here.only_id()}/laps"
    run = read_run(path)
    for what in ("laps", "passes", "incidents"):
        answer = here.client.get(f"{address}?format=csv&what={what}")
        # The command line's laps are those that the race said; here are the same, judged by nobody.
        assert answer.text.splitlines()[0] == as_csv(run, Table(what)).splitlines()[0]
        assert answer.text == as_csv(run, Table(what))
        assert answer.headers["content-disposition"] == f'attachment; filename="run-0000000a-0001-{what}.csv"'
    rows = list(csv.DictReader(io.StringIO(here.client.get(f"{address}?format=csv").text)))
    assert rows[0]["run"].startswith("'")
    laps = here.client.get(address).json()["laps"]
    assert [(lap["number"], str(lap["time_s"])) for lap in laps] == [
        (int(row["number"]), row["time_s"]) for row in rows
    ]
    latex = here.client.get(f"{address}?format=latex").text
    assert latex.count(r"\\") == 1 + len(laps)
    assert here.client.get(f"{address}?format=json&what=passes").status_code == 422


def test_laps_after_a_judge(tmp_path: Path) -> None:
    """What a judge decided counts here too, as the command line exports it: removed, added and scored."""
    path = record(tmp_path / "runs", 2.4, 2.0, 2.2, name=ONE)
    judge = Judge(name="Ada", reason="=seen")
    decide(path, judge, removing(1, 1))
    here = guest(tmp_path)
    (run,) = here.runs()
    assert run["edited"]
    address = f"/api/v1/runs/{run['id']}/laps"
    laps = here.client.get(address).json()["laps"]
    assert [lap["removed"] for lap in laps].count(True) == 1
    raced = replay(path)
    assert made(here.client, f"{address}?format=csv").text == as_csv(read_run(path), Table.LAPS, raced.marshalled)
    decide(path, judge, merging(2, 1))
    merged = made(here.client, f"{address}?format=csv").text
    assert merged == as_csv(read_run(path), Table.LAPS, replay(path).marshalled)


def test_table(tmp_path: Path) -> None:
    """The table of entries over chosen runs, the same in whatever order they are named, and what speaks against it in words."""
    runs = tmp_path / "runs"
    record(runs, 2.4, 2.0, name=ONE, entry="alpha", session="spring")
    record(runs, 2.2, 2.1, name=TWO, entry="beta", session="spring")
    here = guest(tmp_path)
    ids = [run["id"] for run in here.runs()]
    answer = made(here.client, f"/api/v1/table?runs={ids[0]},{ids[1]}")
    assert sorted(row["label"] for row in answer.json()["rows"]) == ["alpha", "beta"]
    again = here.client.get(f"/api/v1/table?runs={ids[1]},{ids[0]}&format=csv")
    assert (again.status_code, again.text.splitlines()[0].split(",")[0]) == (200, "entry")
    assert r"\begin{tabular}" in here.client.get(f"/api/v1/table?runs={ids[1]},{ids[0]}&format=latex").text
    assert here.client.get(f"/api/v1/table?runs={'0' * 24}").status_code == 404
    for bad in ("runs=", "runs=x", f"runs={ids[0]},", f"runs={ids[0].upper()}", f"runs={ids[0]}&session={ids[0]}", ""):
        assert here.client.get(f"/api/v1/table?{bad}").status_code == 422, bad
    session = here.client.get("/api/v1/runs").json()["sessions"][0]["id"]
    rows = made(here.client, f"/api/v1/table?session={session}").json()["rows"]
    assert sorted(row["label"] for row in rows) == ["alpha", "beta"]
    assert here.client.get(f"/api/v1/table?session={'0' * 24}").status_code == 404


def test_report(tmp_path: Path) -> None:
    """The report is made aside, kept, made anew when a judge decides; it can run nothing in the browser."""
    path = record(tmp_path / "runs", 2.4, 2.0, name=ONE, entry="<script>alert(1)</script>")
    here = guest(tmp_path)
    address = f"/api/v1/runs/{here.only_id()}/report.html"
    waiting = here.client.get(address, headers={"Accept": "text/html"})
    assert waiting.status_code in {200, 202}
    if waiting.status_code == 202:
        assert 'http-equiv="refresh"' in waiting.text
    answer = made(here.client, address)
    assert answer.status_code == 200
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "script-src" not in policy
    assert "sandbox" in policy
    assert "<script>alert" not in answer.text
    assert made(here.client, address).text == answer.text
    assert len(list((tmp_path / "made").glob("*.html"))) == 1
    decide(path, Judge(name="Ada", reason="seen"), removing(1, 1))
    assert made(here.client, address).text != answer.text


def test_what_cannot_be_reported_says_why(tmp_path: Path) -> None:
    """A recording that goes on, one that was cut short and one that is no recording: each with its own words."""
    runs = tmp_path / "runs"
    record(runs, 2.0, name=ONE, finish=False)
    (runs / TWO).write_bytes(b"nothing of the kind")
    here = guest(tmp_path)
    states = {run["file"]: (run["state"], run["id"], run["notes"]) for run in here.runs()}
    assert states[f"{ONE}.part"][0] == "cut"
    assert states[TWO][0] == "damaged"
    assert states[TWO][2] == [f"{TWO}: not an MCAP file"]
    for _, run_id, _ in states.values():
        answer = here.client.get(f"/api/v1/runs/{run_id}/report.html")
        assert (answer.status_code, answer.json()["error"]["code"]) == (409, "not-whole")
        assert here.client.get(f"/api/v1/runs/{run_id}/picture.jpg").status_code == 200


def test_picture(tmp_path: Path) -> None:
    """A small drawing with the best lap's path, the same as long as nothing changes."""
    record(tmp_path / "runs", 2.4, 2.0, name=ONE)
    here = guest(tmp_path)
    address = f"/api/v1/runs/{here.only_id()}/picture.jpg"
    answer = here.client.get(address)
    image = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
    assert image.shape == (270, 480, 3)
    assert len(answer.content) < 40_000
    blue, red = image[..., 0].astype(int), image[..., 2].astype(int)
    assert np.count_nonzero(blue - red > 60) > 300, "the path is there"
    assert here.client.get(address, headers={"If-None-Match": answer.headers["etag"]}).status_code == 304


def test_pictures_of_a_list_are_one_look_at_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand recordings take a twentieth of a second to look at, and a list shows fifty pictures at once."""
    record(tmp_path / "runs", 3.0, 3.0)
    one = guest(tmp_path)
    address = f"/api/v1/runs/{one.only_id()}/picture.jpg"
    looks = []
    monkeypatch.setattr("dnb_edge.web.runs_results.PICTURE_OF_S", 3600.0)
    monkeypatch.setattr(RunIndex, "_runs", lambda self, look=RunIndex._runs: (looks.append(1), look(self))[1])
    assert {one.client.get(address).status_code for _ in range(20)} == {200}
    assert len(looks) <= 1


def test_disk(tmp_path: Path) -> None:
    """How much room there is, and what would go first: never what is pinned or the last, as retention has it."""
    runs = tmp_path / "runs"
    sizes = [record(runs, 2.0, name=name).stat().st_size for name in (ONE, TWO, "run-0000000a-0003.mcap")]
    (runs / "run-0000000a-0001.pin").touch()
    here = guest(tmp_path)
    disk = here.client.get("/api/v1/disk").json()
    assert (disk["recordings_bytes"], disk["pictures_bytes"], disk["short"]) == (sum(sizes), 0, None)
    assert disk["next"]["file"] == TWO
    assert 0 < disk["free_bytes"] <= disk["total_bytes"]


def test_names_that_are_no_utf_8(tmp_path: Path) -> None:
    """A file from elsewhere with such a name is listed, shown, taken and deleted like any."""
    path = record(tmp_path / "runs", 3.0, 3.0, name="fine.mcap")
    path.rename(os.fsdecode(os.fsencode(path).replace(b"fine", b"b\xffd")))
    one = guest(tmp_path)
    (line,) = one.runs()
    assert line["file"] == "b?d.mcap"
    address = f"/api/v1/runs/{line['id']}"
    for what in (
        "",
        "/recording.mcap",
        "/recording.zip",
        "/laps",
        "/laps?format=csv",
        "/laps?format=latex",
        "/picture.jpg",
    ):
        assert one.client.get(address + what).status_code == 200, what
    assert one.client.get(f"/runs/{line['id']}").status_code == 200
    assert one.client.get("/api/v1/disk").json()["next"] is None
    answer = one.client.get(f"{address}/report.html")
    while answer.status_code == 202:
        answer = one.client.get(f"{address}/report.html")
    assert answer.status_code == 200
    wrong = one.client.request("DELETE", address, json={"confirm": "x"})
    assert (wrong.status_code, "b?d.mcap" in wrong.text) == (422, True)
    assert one.client.request("DELETE", address, json={"confirm": "b?d.mcap"}).json()["files"] == ["b?d.mcap"]


def test_pages_hold_no_data(tmp_path: Path) -> None:
    """The pages are the same whatever a recording is called; all names come through the API as text."""
    record(tmp_path / "runs", 2.0, name=ONE, entry="<img src=x onerror=alert(1)>")
    here = guest(tmp_path)
    for address in ("/runs", f"/runs/{here.only_id()}"):
        answer = here.client.get(address)
        assert answer.status_code == 200
        assert "onerror" not in answer.text
    assert json.loads(here.client.get("/api/v1/runs").text)["runs"][0]["entry"] == "<img src=x onerror=alert(1)>"


def test_there_is_no_directory(tmp_path: Path) -> None:
    """A box that has recorded nothing yet says so, and breaks nowhere."""
    here = guest(tmp_path)
    here.settings.runs.rmdir()
    assert here.runs() == []
    assert here.client.get("/api/v1/disk").status_code in {200, 500}
