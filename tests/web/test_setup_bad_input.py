"""What may go wrong at the set-up's API: each said in words, and the draft kept."""

from __future__ import annotations

import errno
import os
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from setup_rig import Daemon, Wizard, jpeg, png, state_of
from web_box import app_in, visitor

from dnb_edge.web.setup_upload import MOST_BYTES

SIZE = 400


def ring_twin() -> np.ndarray:
    """A ring of dark lane on white, 30 px wide, 140 px about the middle."""
    twin = np.full((SIZE, SIZE, 3), 255, dtype=np.uint8)
    cv2.circle(twin, (200, 200), 140, (40, 40, 40), 30)
    return twin


CAMERA_FROM_TWIN = np.array([[1.1, 0.2, 60.0], [0.05, 0.9, 20.0], [0.0001, 0.0008, 1.0]])


def view() -> np.ndarray:
    """The ring as an oblique camera sees it, on a floor with some grain."""
    grain = np.random.default_rng(1).integers(0, 40, (SIZE, SIZE, 3), dtype=np.uint8)
    return cv2.warpPerspective(
        cv2.subtract(ring_twin(), grain), CAMERA_FROM_TWIN, (640, 480), borderValue=(120, 110, 100)
    )


def pairs(count: int = 8) -> list[dict[str, Any]]:
    """Keypoints all round the ring, as exact as can be."""
    angles = np.arange(count) * 2 * np.pi / count + 0.3
    radii = np.where(np.arange(count) % 2, 160.0, 110.0)
    twin_px = np.column_stack((200 + radii * np.cos(angles), 200 + radii * np.sin(angles)))
    camera_px = cv2.perspectiveTransform(twin_px[:, None, :], CAMERA_FROM_TWIN)[:, 0]
    return [
        {"name": str(k), "camera_px": a, "twin_px": b}
        for k, (a, b) in enumerate(zip(camera_px.tolist(), twin_px.tolist(), strict=True), start=1)
    ]


@pytest.fixture
def wizard(tmp_path: Path) -> Wizard:
    return Wizard(tmp_path, Daemon(jpeg(view()), (640, 480)))


def ready(wizard: Wizard, clicked: list[dict[str, Any]] | None = None) -> Any:
    """A draft that could be saved."""
    wizard.ask("POST", "/photo")
    wizard.send("/twin", png(ring_twin()))
    wizard.ask("PUT", "/lane", {"at_px": [200, 60]})
    wizard.ask("PUT", "/route", {"scale": {"measured": {"from_px": [60, 200], "to_px": [340, 200], "length_m": 1.4}}})
    wizard.ask("PUT", "/lines", {"start": {"at_px": [200, 60]}})
    return wizard.ask("PUT", "/keypoints", {"pairs": pairs() if clicked is None else clicked})


def png_head(width: int, height: int) -> bytes:
    """A PNG that claims a size and has nothing in it."""
    head = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + b"\0\0\0\0"


WRONG_PICTURES = {
    "empty": (b"", "neither PNG nor JPEG"),
    "text": (b"hello, I am a twin", "neither PNG nor JPEG"),
    "gif": (b"GIF89a" + bytes(50), "a GIF"),
    "svg": (b"<svg xmlns='http://www.w3.org/2000/svg' onload='x()'/>", "an SVG"),
    "heic": (b"\0\0\0\x18ftypheic" + bytes(50), "telephones"),
    "pdf": (b"%PDF-1.7" + bytes(50), "a PDF"),
    "bomb": (png_head(30_000, 30_000), "too many"),
    "long": (png_head(40_000, 40), "too many"),
    "over the megapixels": (png_head(8_000, 5_001), "megapixels"),
    "tiny": (png(np.zeros((8, 8, 3), np.uint8)), "too few"),
    "torn png": (png_head(500, 500), "damaged"),
    "torn jpeg": (b"\xff\xd8\xff\xe0" + bytes(3), "damaged"),
}


@pytest.mark.parametrize("name", WRONG_PICTURES)
def test_wrong_pictures_are_refused_in_words(wizard: Wizard, name: str) -> None:
    """What is no PNG or JPEG, too large by its head, or damaged never becomes a twin, and the answer says why."""
    data, words = WRONG_PICTURES[name]
    assert words in wizard.send("/twin", data, status=422)["error"]["text"]
    assert wizard.ask("GET", "")["draft"]["twin"] is None


def test_large_bodies_and_other_types_are_refused(wizard: Wizard) -> None:
    """Over 20 MB is not taken at all, nor is a body that says it is something else."""
    wizard.send("/twin", bytes(MOST_BYTES + 1), status=413)
    wizard.send("/twin", png(ring_twin()), "image/webp", status=415)
    assert visitor(app_in(wizard.setup.parent)).get("/api/v1/setup").status_code == 401


def test_camera_picture_turned_by_a_note_is_refused(wizard: Wizard) -> None:
    """A photograph that browsers show turned would be clicked on otherwise than frames lie."""
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    plain = jpeg(view())
    turned = plain[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + plain[2:]
    assert "EXIF" in wizard.send("/photo", turned, "image/jpeg", status=422)["error"]["text"]


def test_picture_that_shows_nothing_is_refused(wizard: Wizard) -> None:
    """A capped lens is said when the picture is taken, not when no car is found."""
    wizard.daemon.jpeg = jpeg(np.zeros((480, 640, 3), np.uint8))
    assert "lens cap" in wizard.refused("POST", "/photo")
    assert wizard.ask("GET", "/look")["fault"].startswith("the picture is black")


def test_no_camera_and_no_daemon_are_said(wizard: Wizard) -> None:
    """Without a camera there is no picture; a save is in place all the same and used later."""
    ready(wizard)
    wizard.daemon.jpeg = None
    assert "plug it in" in wizard.refused("POST", "/photo", status=503)
    assert "plug it in" in wizard.refused("GET", "/look", status=503)
    saved = wizard.ask("POST", "/save")
    assert saved["run"] == "later"
    assert "not running" in saved["text"]
    assert (wizard.setup / "dnb-edge.yaml").is_file()


def test_twin_without_a_lane_is_said(wizard: Wizard) -> None:
    """A blank sheet has no lane, by shade or by colour, and an open ring does not close."""
    wizard.send("/twin", png(np.full((300, 300, 3), 250, np.uint8)))
    for body in ({"shade": "auto"}, {"at_px": [150, 150]}):
        state, text = state_of(wizard.ask("PUT", "/lane", body), "route")
        assert state == "wrong", text
        assert "--" not in text
    assert "outside" in wizard.refused("PUT", "/lane", {"at_px": [900, 10]})
    torn = ring_twin()
    torn[180:220, 300:] = 255
    wizard.send("/twin", png(torn))
    state, text = state_of(wizard.ask("PUT", "/lane", {"at_px": [200, 60]}), "route")
    assert state == "wrong"
    assert "not closed" in text
    assert "--" not in text


def test_swapped_keypoints_are_named(wizard: Wizard) -> None:
    """Two places clicked in the wrong order are named as a pair, in words and by their marks."""
    clicked = pairs()
    clicked[2]["twin_px"], clicked[5]["twin_px"] = clicked[5]["twin_px"], clicked[2]["twin_px"]
    answer = ready(wizard, clicked)
    state, text = state_of(answer, "keypoints")
    assert state == "wrong"
    assert "3 and 6 seem swapped" in text
    assert answer["keypoints"]["swapped"] == ["3", "6"]
    assert [point["name"] for point in answer["keypoints"]["points"] if point["state"] == "swapped"] == ["3", "6"]
    assert "swapped" in wizard.refused("POST", "/save")


def test_wrong_keypoint_is_named_and_does_not_forbid_saving(wizard: Wizard) -> None:
    """One click 40 px off is found, without a word of the command line's options."""
    clicked = pairs(10)
    clicked[3]["camera_px"][0] += 40.0
    answer = ready(wizard, clicked)
    assert state_of(answer, "keypoints") == (
        "wrong",
        "Keypoint 4 contradicts the others: click it anew, or delete it",
    )
    assert any("Keypoint 4 lies" in note and "--" not in note for note in answer["keypoints"]["notes"])
    wizard.ask("POST", "/save")


def test_mirrored_twin_is_said(wizard: Wizard) -> None:
    """A twin seen from below is told from a bad map."""
    clicked = [{**pair, "twin_px": [SIZE - pair["twin_px"][0], pair["twin_px"][1]]} for pair in pairs()]
    assert "mirrored" in state_of(ready(wizard, clicked), "keypoints")[1]


@pytest.mark.parametrize("count", [0, 3])
def test_too_few_keypoints_are_counted(wizard: Wizard, count: int) -> None:
    """Three pairs make no map: the step says how many there are and saving waits."""
    state, text = state_of(ready(wizard, pairs()[:count]), "keypoints")
    assert state == "open"
    assert text.startswith(f"{count} of at least 4")
    assert "Keypoints" in wizard.refused("POST", "/save")
    assert not (wizard.setup / "dnb-edge.yaml").exists()


def test_half_a_pair_is_told(wizard: Wizard) -> None:
    """A keypoint clicked on one side only is named, and left out of what is saved."""
    answer = ready(wizard, [*pairs(), {"name": "9", "camera_px": [300, 200]}])
    assert "Keypoint 9 is clicked on one side only" in state_of(answer, "keypoints")[1]
    wizard.ask("POST", "/save")
    assert "'9'" not in next(wizard.setup.glob("keypoints-*")).read_text()


def test_line_off_the_lane_is_said(wizard: Wizard) -> None:
    """A place far from the route is refused; ends that do not cross it are said and forbid saving; sectors likewise."""
    ready(wizard)
    assert "put it on the route's lane" in wizard.refused("PUT", "/lines", {"start": {"at_px": [200, 200]}})
    assert "one of the two" in wizard.refused("PUT", "/lines", {"start": {}})
    answer = wizard.ask("PUT", "/lines", {"start": {"ends_px": [[190, 190], [210, 210]]}})
    state, text = state_of(answer, "start")
    assert (state, "crosses the route 0 times" in text) == ("wrong", True)
    assert "crosses the route 0 times" in wizard.refused("POST", "/save")
    good = {"start": {"at_px": [200, 60]}}
    answer = wizard.ask("PUT", "/lines", {**good, "sectors": [{"ends_px": [[190, 190], [210, 210]]}]})
    assert state_of(answer, "start")[0] == "done"
    assert state_of(answer, "sectors")[0] == "wrong"


@pytest.mark.parametrize(
    ("path", "body", "words"),
    [
        ("/camera", {"source": "file:/etc/passwd"}, "must be a camera"),
        ("/camera", {"fps": 100, "exposure_us": 20000}, "longer than a frame"),
        ("/camera", {"shutter": 1}, "shutter"),
        ("/keypoints", {"pairs": [{"name": "1"}, {"name": "1"}]}, "two keypoints have one name"),
        ("/keypoints", {"pairs": [{"name": "1", "camera_px": [1e308, 0]}]}, "camera_px"),
        ("/keypoints", {"pairs": [{"name": "\u0007"}]}, "name"),
        ("/route", {"scale": {"lap_m": 1, "metres_per_px": 1}}, "one of"),
        ("/route", {"scale": {"measured": {"from_px": [5, 5], "to_px": [5, 5], "length_m": 1}}}, "far apart"),
        ("/lane", {}, "one of the two"),
    ],
)
def test_wrong_bodies_are_refused_in_words(wizard: Wizard, path: str, body: Any, words: str) -> None:
    """Values that no configuration would take are refused where they are given, and nothing changes."""
    before = wizard.ask("GET", "")
    assert words in wizard.refused("PUT", path, body)
    assert wizard.ask("GET", "") == before


def test_full_disk_keeps_draft_and_configuration(wizard: Wizard, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that takes nothing is said; what was there before is there still, and no half of a file is left."""
    before = ready(wizard)
    wizard.ask("POST", "/save")
    kept = {path.name: path.read_bytes() for path in wizard.setup.iterdir() if path.is_file()}
    with monkeypatch.context() as patch:

        def full(_fd: int) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        patch.setattr(os, "fsync", full)
        for answer in (
            wizard.ask("PUT", "/keypoints", {"pairs": pairs(7)}, status=500),
            wizard.send("/twin", png(ring_twin()[::-1]), status=500),
            wizard.ask("POST", "/save", status=500),
        ):
            assert "No space left" in answer["error"]["text"]
    assert wizard.ask("GET", "")["draft"]["pairs"] == before["draft"]["pairs"]
    assert {path.name: path.read_bytes() for path in wizard.setup.iterdir() if path.is_file()} == kept


def test_damaged_draft_is_said_and_can_be_forgotten(wizard: Wizard) -> None:
    """A draft that cannot be read says so; beginning anew mends it and leaves what was saved."""
    ready(wizard)
    wizard.ask("POST", "/save")
    (wizard.setup / "draft" / "draft.json").write_text('{"version": 1, "pears": []}')
    assert "begin anew" in wizard.refused("GET", "")
    assert wizard.ask("DELETE", "")["draft"]["revision"] == 0
    assert (wizard.setup / "dnb-edge.yaml").is_file()
    assert wizard.get("/twin.png").status_code == 404


def test_other_twin_forgets_what_was_clicked_on_the_one_before(wizard: Wizard) -> None:
    """Lines and twin points mean nothing on another picture; the camera's clicks stay. The same picture changes nothing."""
    ready(wizard)
    same = wizard.send("/twin", png(ring_twin()))
    assert same["draft"]["lines"]["start_px"] is not None
    other = wizard.send("/twin", png(ring_twin()[:, ::-1].copy() // 2))["draft"]
    assert other["lane"] is None
    assert other["lines"]["start_px"] is None
    assert all(pair["twin_px"] is None and pair["camera_px"] is not None for pair in other["pairs"])
