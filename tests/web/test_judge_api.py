"""The judge's part of the API: the same decisions as the command line's, previews, refusals, pictures, two judges at once."""

from __future__ import annotations

import hashlib
import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from judged_runs import Car, Wanderer, browser, record, setup
from starlette.testclient import TestClient
from typer.testing import CliRunner

from dnb_edge.archive.stored import run_id
from dnb_edge.cli.main import app
from dnb_edge.motion.settings import MotionSettings
from dnb_edge.race.rules import CarSetup
from dnb_edge.record.edits import edits_path

CAR = Wanderer((3.0, 3.1, 2.9, 3.2))
WHO = {"author": "Ada", "reason": "a hand"}
BY = ("--because", "a hand", "--by", "Ada")
ID = run_id("run")
EDITS = f"/api/v1/runs/{ID}/edits"
PASSES = f"/api/v1/runs/{ID}/passes"


@pytest.fixture(scope="session")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of one car with four laps, in the second of which it leaves the lane; for reading only."""
    return record(tmp_path_factory.mktemp("judged") / "run.mcap", CAR)


@pytest.fixture
def run(pristine: Path, tmp_path: Path) -> Path:
    """The same, for the test's own use."""
    (tmp_path / "runs").mkdir()
    return Path(shutil.copy(pristine, tmp_path / "runs" / "run.mcap"))


@pytest.fixture
def client(run: Path) -> TestClient:
    """A judge who has logged in."""
    return browser(run.parent)


def dnb_edge(*words: object) -> str:
    ran = CliRunner().invoke(app, [*map(str, words)])
    assert ran.exit_code == 0, ran.exception
    return ran.stdout


def decided(client: TestClient, **wish: Any) -> dict[str, Any]:
    answer = client.post(EDITS, json=WHO | wish)
    assert answer.status_code == (200 if wish.get("dry_run") else 201), answer.text
    return dict(answer.json())


def refused(client: TestClient, status: int, **wish: Any) -> dict[str, str]:
    answer = client.post(EDITS, json=WHO | wish)
    assert answer.status_code == status, answer.text
    return dict(answer.json()["error"])


def saved(run: Path) -> list[dict[str, Any]]:
    """The file of edits but for when they were made, and for the hashes, which are over that."""
    lines = [json.loads(line) for line in edits_path(run).read_text().splitlines()]
    return [{name: value for name, value in line.items() if name not in {"time", "sha256"}} for line in lines]


SAME = [
    ([{"action": "remove", "lap": 3}], [("remove", "--lap", 3)]),
    ([{"action": "merge", "lap": 3}], [("merge", "--lap", 3)]),
    (
        [{"action": "penalty", "lap": 1, "seconds": 5, "factor": 0.8}],
        [("penalty", "--lap", 1, "--seconds", 5, "--factor", 0.8)],
    ),
    ([{"action": "penalty", "lap": 1, "invalid": True}], [("penalty", "--lap", 1, "--invalid")]),
    ([{"action": "penalty", "lap": 3, "dnf": True}], [("penalty", "--lap", 3, "--dnf")]),
    ([{"action": "forgive", "lap": 2}], [("forgive", "--lap", 2)]),
    ([{"action": "forgive", "lap": 2, "offence": "off_track"}], [("forgive", "--lap", 2, "--offence", "off_track")]),
    ([{"action": "note"}], [("note",)]),
    ([{"action": "note", "lap": 4}], [("note", "--lap", 4)]),
    (
        [{"action": "remove", "lap": 2}, {"action": "add", "start": "pass:2", "end": "pass:3"}],
        [("remove", "--lap", 2), ("add", "--from", "pass:2", "--to", "pass:3")],
    ),
    (
        [{"action": "remove", "lap": 2}, {"action": "add", "start": 3.3, "end": "pass:3", "car": 1}],
        [("remove", "--lap", 2), ("add", "--from", "3.3", "--to", "pass:3")],
    ),
    (
        [{"action": "remove", "lap": 2}, {"action": "undo", "edit": 1}, {"action": "undo", "edit": 2}],
        [("remove", "--lap", 2), ("undo", "--edit", 1), ("undo", "--edit", 2)],
    ),
]


@pytest.mark.parametrize(
    ("wishes", "verbs"), SAME, ids=[" ".join(str(word) for verb in row[1] for word in verb) for row in SAME]
)
def test_a_decision_over_the_api_is_the_command_lines(
    client: TestClient, run: Path, tmp_path: Path, wishes: list[dict], verbs: list[tuple]
) -> None:
    """The same lines in the file of edits but for time and hashes; the same exported tables byte for byte, and the same
    answer to a dry run before as to the decision itself."""
    by_command = tmp_path / "other" / "run.mcap"
    by_command.parent.mkdir()
    shutil.copy(run, by_command)
    before = hashlib.sha256(run.read_bytes()).digest()
    for wish, (verb, *options) in zip(wishes, verbs, strict=True):
        words = ("--text", "a hand", "--by", "Ada") if verb == "note" else BY
        dnb_edge("judge", verb, by_command, *options, *words)
        would = decided(client, **wish, dry_run=True)
        done = decided(client, **wish)
        for answer in (would, done):
            for name in ("saved", "edits_so_far"):
                del answer[name]
            del answer["edit"]["time"]
        assert would == done
    assert saved(run) == saved(by_command)
    assert dnb_edge("runs", "export", run) == dnb_edge("runs", "export", by_command)
    after = [json.loads(line) for line in dnb_edge("score", run, "--json").splitlines()]
    laps = [(lap["number"], lap.get("edited_by", [])) for lap in after if lap["event"] == "lap"]
    seen = [(one["lap"]["number"], one["edits"]) for one in client.get(EDITS).json()["laps"] if one["counts"]]
    assert seen == laps
    assert hashlib.sha256(run.read_bytes()).digest() == before


def test_what_a_judge_sees_is_what_the_results_say(client: TestClient, run: Path) -> None:
    """Laps, penalties and standings of the view are those of `score --json`, member for member."""
    decided(client, action="penalty", lap=4, seconds=5)
    decided(client, action="merge", lap=2)
    events = [json.loads(line) for line in dnb_edge("score", run, "--json").splitlines()]
    view = client.get(EDITS).json()
    raced = [event for event in events if event["event"] == "lap"]
    for one, event in zip(view["laps"], raced, strict=True):
        assert one["lap"] == {name: event[name] for name in one["lap"]}
        assert one["edits"] == event.get("edited_by", [])
    (standings,) = [event for event in events if event["event"] == "standings" and event["final"]]
    assert view["standings"] == {name: standings[name] for name in view["standings"]}
    assert [one["incident"]["kind"] for one in view["incidents"]] == ["off_track"]
    assert (view["edits_so_far"], [one["subject"] for one in view["edits"]]) == (2, ["lap 4", "laps 2 and 3"])


def test_a_dry_run_shows_both_sides_and_saves_nothing(client: TestClient, run: Path) -> None:
    """The changed lap before and after, the totals of both sides; no file."""
    answer = decided(client, action="remove", lap=2, dry_run=True)
    ((number, was, will),) = [(one["number"], one["before"], one["after"]) for one in answer["changes"]]
    assert (number, was["counts"], will["counts"], answer["saved"]) == (2, True, False, False)
    assert (answer["before"]["totals"]["laps"], answer["after"]["totals"]["laps"]) == (4, 3)
    assert not edits_path(run).exists()


def test_two_judges_at_once_do_not_overlook_each_other(client: TestClient, run: Path) -> None:
    """Of eight decisions that have all seen none before, one is saved and seven are refused with 409; who has not looked at
    all is let through."""
    with ThreadPoolExecutor(8) as pool:
        asked = [pool.submit(client.post, EDITS, json=WHO | {"action": "note", "seen": 0}) for _ in range(8)]
    answers = [one.result() for one in asked]
    assert sorted(answer.status_code for answer in answers) == [201, *[409] * 7]
    assert {answer.json()["error"]["code"] for answer in answers if answer.status_code == 409} == {"stale"}
    assert "there are 1 edits, not 0" in refused(client, 409, action="remove", lap=1, seen=0, dry_run=True)["text"]
    decided(client, action="remove", lap=1, seen=1)
    decided(client, action="remove", lap=2)
    assert len(saved(run)) == 1 + 3


def test_the_command_lines_decision_makes_the_page_stale(client: TestClient, run: Path) -> None:
    """What was decided beside the page is seen at the next look, though the run is not raced again for it."""
    seen = client.get(EDITS).json()["edits_so_far"]
    dnb_edge("judge", "remove", run, "--lap", 1, *BY)
    assert refused(client, 409, action="remove", lap=2, seen=seen)["code"] == "stale"
    assert client.get(EDITS).json()["edits_so_far"] == 1


NO_SENSE = [
    ({"action": "remove", "lap": 9}, "there is no lap 9: car 1 has laps 1, 2, 3, 4"),
    ({"action": "remove", "lap": 1, "car": 2}, "there is no lap 1: car 2 has no laps"),
    ({"action": "merge", "lap": 4}, "there is no lap after lap 4"),
    ({"action": "penalty", "lap": 1}, "a penalty must cost something: give seconds, factor, invalid or dnf"),
    ({"action": "penalty", "lap": 1, "seconds": -1}, "seconds -1: must lie between 0 and 86400"),
    ({"action": "penalty", "lap": 1, "factor": 1.5}, "factor 1.5: must lie between 0 and 1"),
    ({"action": "forgive", "lap": 1}, "lap 1 has no penalty of the rules, and is valid"),
    ({"action": "undo", "edit": 3}, "undo edit 3: there is no such edit"),
    ({"action": "add", "start": 1.0, "end": 2.0}, "is driven in the same time"),
    ({"action": "add", "start": 2.0, "end": 1.0}, "to 1.0: must be later than from 2.0"),
    ({"action": "add", "start": 2.0, "end": 99}, "to 99.0: must be seconds from the first frame, 0 to 1"),
    ({"action": "add", "start": "pass:999999999", "end": 9}, "from pass:999999999: there are passes 1 to 5"),
    ({"action": "add", "start": "pass:1", "end": 9, "car": 2}, "that pass is car 1's: say car 1"),
]


@pytest.mark.parametrize(("wish", "text"), NO_SENSE, ids=[row[1] for row in NO_SENSE])
def test_what_makes_no_sense_is_refused_in_words(client: TestClient, run: Path, wish: dict, text: str) -> None:
    """422 with the command line's words, in one line without the place where the run lies; nothing is saved."""
    said = refused(client, 422, **wish)["text"]
    assert text in said
    assert str(run.parent) not in said
    assert "\n" not in said
    assert not edits_path(run).exists()


MALFORMED = [
    ("no object", [], "should be an object"),
    ("no action", WHO, "action"),
    ("unknown action", WHO | {"action": "cheat", "lap": 1}, "'add', 'remove'"),
    ("no lap", WHO | {"action": "remove"}, "remove.lap: Field required"),
    ("no author", {"action": "remove", "lap": 1, "reason": "x"}, "remove.author: Field required"),
    ("blank author", WHO | {"action": "remove", "lap": 1, "author": "  "}, "remove.author: is blank"),
    ("blank reason", WHO | {"action": "note", "reason": "\t"}, "note.reason: is blank"),
    ("two lines", WHO | {"action": "note", "reason": "a\nb"}, "one line of plain text"),
    ("escape", WHO | {"action": "note", "reason": "\x1b[2J"}, "one line of plain text"),
    ("a book", WHO | {"action": "note", "reason": "x" * 501}, "at most 500 characters"),
    ("lap of text", WHO | {"action": "remove", "lap": "1"}, "remove.lap: Input should be a valid integer"),
    ("lap of half", WHO | {"action": "remove", "lap": 1.5}, "remove.lap"),
    ("lap 0", WHO | {"action": "remove", "lap": 0}, "greater than or equal to 1"),
    ("endless lap", WHO | {"action": "remove", "lap": 10**40}, "remove.lap"),
    ("truth", WHO | {"action": "remove", "lap": True}, "remove.lap"),
    ("unknown member", WHO | {"action": "remove", "lap": 1, "lapp": 2}, "remove.lapp: Extra inputs are not permitted"),
    ("dry run of text", WHO | {"action": "remove", "lap": 1, "dry_run": "yes"}, "remove.dry_run"),
    ("seen of less", WHO | {"action": "remove", "lap": 1, "seen": -1}, "remove.seen"),
    ("no such offence", WHO | {"action": "forgive", "lap": 2, "offence": "judge"}, "forgive.offence"),
    ("no moment", WHO | {"action": "add", "start": "pass:0", "end": 3}, "add.start"),
    ("moment before", WHO | {"action": "add", "start": -1, "end": 3}, "add.start"),
]


@pytest.mark.parametrize(("body", "text"), [row[1:] for row in MALFORMED], ids=[row[0] for row in MALFORMED])
def test_a_malformed_decision_is_refused_with_the_member(client: TestClient, run: Path, body: Any, text: str) -> None:
    """422, and which member is wrong; nothing is saved."""
    answer = client.post(EDITS, json=body)
    assert answer.status_code == 422, answer.text
    assert text in answer.json()["error"]["text"]
    assert not edits_path(run).exists()


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"\xff\xfe",
        b'{"action": "note", "author": "A", "reason": "\\ud800"}',
        b'{"action": "penalty", "lap": 1, "author": "A", "reason": "x", "seconds": NaN}',
        b'{"action": "penalty", "lap": 1, "author": "A", "reason": "x", "seconds": Infinity}',
        b"[" * 30000,
    ],
)
def test_what_is_no_json_is_refused(client: TestClient, run: Path, body: bytes) -> None:
    """400 or 422, in words, and nothing is saved."""
    answer = client.post(EDITS, content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code in {400, 422}, answer.text
    assert answer.json()["error"]["text"]
    assert not edits_path(run).exists()


def test_a_pass_has_a_picture_of_the_car_there(client: TestClient) -> None:
    """A JPEG whose middle is the car, for every pass and for the incident; what there is not is a 404 in words."""
    view, passes = client.get(EDITS).json(), client.get(PASSES).json()["passes"]
    assert [one["number"] for one in passes] == [1, 2, 3, 4, 5]
    addresses = [*(one["picture"] for one in passes), *(one["picture"] for one in view["incidents"])]
    assert len(addresses) == 6
    for address in addresses:
        answer = client.get(address)
        assert (answer.status_code, answer.headers["content-type"]) == (200, "image/jpeg")
        image = cv2.imdecode(np.frombuffer(answer.content, dtype=np.uint8), cv2.IMREAD_COLOR)
        height_px, width_px = image.shape[:2]
        red = np.argwhere((image[..., 2] > 150) & (image[..., 0] < 90))
        assert np.abs(red.mean(axis=0) - (height_px / 2, width_px / 2)).max() < 8
    assert client.get(f"{PASSES}/6.jpg").json()["error"]["text"] == "there is no pass 6: there are 5"
    for name in ("0", "-1", "x", "9999999999", "1.5"):
        assert client.get(f"{PASSES}/{name}.jpg").status_code == 404
    assert client.get(f"/api/v1/runs/{ID}/incidents/1/2.jpg").status_code == 404
    assert client.get("/api/v1/runs/0123/edits").status_code == 404


def test_a_run_that_is_still_recorded_can_be_looked_at_and_tried(tmp_path: Path) -> None:
    """The laps so far, and what a decision would do; saving it is refused in words until the recording is finished."""
    part = record(tmp_path / "runs" / "run.mcap", CAR, finish=False)
    client = browser(part.parent)
    view = client.get(EDITS).json()
    assert (view["unfinished"], [one["lap"]["number"] for one in view["laps"]]) == (True, [1, 2, 3, 4])
    assert len(client.get(PASSES).json()["passes"]) == 5
    assert client.get(f"{PASSES}/1.jpg").json()["error"]["code"] == "no-picture"
    assert decided(client, action="remove", lap=1, dry_run=True)["after"]["totals"]["laps"] == 3
    assert "still being recorded" in refused(client, 409, action="remove", lap=1)["text"]
    assert [path.name for path in part.parent.iterdir()] == [part.name]


def test_a_damaged_run_and_damaged_edits_are_told(client: TestClient, run: Path) -> None:
    """422 with the file's name and what to do, without the place where it lies."""
    decided(client, action="remove", lap=1)
    text = edits_path(run).read_text()
    edits_path(run).write_text(text.replace("a hand", "a foot"))
    said = client.get(EDITS).json()["error"]["text"]
    assert said.startswith("run.edits.jsonl, line 2: ")
    edits_path(run).write_text(text)
    run.write_bytes(run.read_bytes()[:-2000])
    answer = client.get(EDITS)
    assert (answer.status_code, answer.json()["error"]["text"].startswith("run.mcap: ")) == (422, True)


def test_only_those_with_the_code_judge(run: Path) -> None:
    """Without a session nothing is shown or saved, and the page leads to the login; without the token nothing is saved."""
    stranger = browser(run.parent, logged_in=False)
    wish = WHO | {"action": "remove", "lap": 1}
    for answer in (
        stranger.get(EDITS),
        stranger.get(PASSES),
        stranger.get(f"{PASSES}/1.jpg"),
        stranger.post(EDITS, json=wish),
    ):
        assert answer.status_code == 401
    page = stranger.get(f"/runs/{ID}/judge", follow_redirects=False)
    assert (page.status_code, page.headers["location"].startswith("/login")) == (303, True)
    known = browser(run.parent)
    del known.headers["X-CSRF-Token"]
    assert known.post(EDITS, json=wish).status_code == 403
    assert not edits_path(run).exists()


def test_the_page_is_served_and_escapes_names(run: Path) -> None:
    """It holds no script or style of its own, and the run's id."""
    hostile = run.with_name("<script>alert(1)<.mcap")
    run.rename(hostile)
    page = browser(run.parent).get(f"/runs/{run_id(hostile.name.removesuffix('.mcap'))}/judge")
    assert page.status_code == 200, page.text
    assert "<script>alert" not in page.text
    assert "&lt;script&gt;alert" in page.text


def test_a_dry_run_shows_the_standings_of_both_sides(client: TestClient) -> None:
    """What the car is ranked by before and after: its best lap is taken away."""
    answer = decided(client, action="remove", lap=3, dry_run=True)
    before, after = (answer[side]["standings"]["rows"][0]["value"] for side in ("before", "after"))
    assert before < after


def test_several_cars_are_judged_each_by_itself(tmp_path: Path) -> None:
    """A car's lap, its passes' pictures and who leads: as the command line has it for `--car`."""
    made = setup(motion=replace(MotionSettings(), cars=2), cars=(CarSetup(name="Ann"), CarSetup(name="Bob")))
    path = record(tmp_path / "runs" / "run.mcap", Car((3.0, 3.1, 2.9)), Car((3.3, 3.4, 3.5), start_rad=-1.8), made=made)
    client = browser(path.parent)
    would = decided(client, action="penalty", lap=1, dnf=True, dry_run=True)
    sides = [[row["name"] for row in would[side]["standings"]["rows"]] for side in ("before", "after")]
    assert sides == [["Ann", "Bob"], ["Bob", "Ann"]]
    decided(client, action="remove", lap=2, car=2)
    laps = [(one["lap"]["car"], one["lap"]["number"]) for one in client.get(EDITS).json()["laps"] if one["counts"]]
    scored = [json.loads(line) for line in dnb_edge("score", path, "--json").splitlines()]
    assert laps == [(lap["car"], lap["number"]) for lap in scored if lap["event"] == "lap"]
    assert (2, 2) not in laps
    number, other = next((n, one) for n, one in enumerate(client.get(PASSES).json()["passes"], start=1)
                         if one["crossing"]["car"] == 2)  # fmt: skip
    assert client.get(other["picture"]).status_code == 200
    said = refused(client, 422, action="add", start=f"pass:{number}", end=9, car=1)
    assert "that pass is car 2's: say car 2" in said["text"]
