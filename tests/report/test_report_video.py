"""The annotated video: its pace, its files, and what is drawn into its pictures and where."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.errors import InputError, WorkError
from dnb_edge.report import video
from dnb_edge.report.overlay import CAR_COLOURS, Overlay
from dnb_edge.report.run import RunResult, Sightings
from dnb_edge.report.video import CODECS, PAUSE_S, check_video, paced, picture_rate, write_video
from dnb_edge.track.model import Track
from dnb_edge.values import BgrImage, Crossing, Event, Observation, PassStatus
from dnb_edge.view.ground import GroundMap

GREY = np.full((120, 160, 3), 90, np.uint8)


def pictures(count: int) -> Iterator[BgrImage]:
    for k in range(count):
        image = GREY.copy()
        image[:, : 4 * k] = (200, 120, 40)
        yield image


def read(path: Path) -> list[BgrImage]:
    reader = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    images = []
    while True:
        found, image = reader.read()
        if not found:
            reader.release()
            return images
        images.append(image)


@pytest.mark.parametrize("ending", CODECS)
def test_a_video_opens_again(ending: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """With all its pictures, in order, at its rate; nothing else is left in the folder, nothing said by OpenCV."""
    path = tmp_path / f"run{ending}"
    assert write_video(path, pictures(12), fps=7.5) == 12
    images = read(path)
    assert len(images) == 12
    blue = [float((image[:, :, 0] > 150).mean()) for image in images]
    assert blue == sorted(blue)
    assert blue[11] == pytest.approx(44 / 160, abs=0.02)
    reader = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    assert reader.get(cv2.CAP_PROP_FPS) == pytest.approx(7.5, rel=0.01)
    assert list(tmp_path.iterdir()) == [path]
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("stop", [KeyboardInterrupt, WorkError])
def test_what_is_interrupted_leaves_nothing(stop: type[BaseException], tmp_path: Path) -> None:
    """The video of before stays, and no half one is beside it."""
    path = tmp_path / "run.mp4"
    path.write_text("before")

    def broken() -> Iterator[BgrImage]:
        yield from pictures(5)
        raise stop

    with pytest.raises(stop):
        write_video(path, broken(), fps=5.0)
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("run.mp4", "before")]


def test_a_disk_that_took_not_all_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenCV says nothing where the disk is full: the file is looked at."""

    class Half:
        def __init__(self, path: Path, *_: object) -> None:
            self._path = path

        def isOpened(self) -> bool:  # noqa: N802 OpenCV's name
            return True

        def write(self, _: BgrImage) -> None:
            pass

        def release(self) -> None:
            self._path.write_bytes(b"\0" * 64)

    monkeypatch.setattr(video, "_opened", Half)
    with pytest.raises(WorkError, match="not written whole: is the disk full"):
        write_video(tmp_path / "run.mp4", pictures(3), fps=5.0)
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_no_video_is_refused(tmp_path: Path) -> None:
    """Before anything is raced: another ending, a folder, a folder that is not there."""
    (tmp_path / "is.mp4").mkdir()
    for name, words in (
        ("run.gif", "videos are .mp4"),
        ("no/run.mp4", "there is no directory"),
        ("is.mp4", "directory"),
    ):
        with pytest.raises(InputError, match=words):
            check_video(tmp_path / name)
    with pytest.raises(InputError, match="no picture"):
        write_video(tmp_path / "none.mp4", iter(()), fps=5.0)


@pytest.mark.parametrize(
    ("t_ms", "fps"),
    [([0], 1.0), ([0, 200, 400, 600], 5.0), ([0, 33, 67, 100, 133], 30.0), ([0, 5, 10], 60.0), ([0, 5000], 1.0)],
)
def test_the_rate_is_that_of_most_pictures(t_ms: list[int], fps: float) -> None:
    """Within what players play."""
    assert picture_rate([t * 1_000_000 for t in t_ms]) == fps


@settings(deadline=None, max_examples=60)
@given(st.lists(st.floats(0.02, 0.95 * PAUSE_S), min_size=1, max_size=40))
def test_a_video_lasts_as_long_as_what_it_shows(steps_s: list[float]) -> None:
    """Whatever the stamps: its duration is theirs to a picture's time, and pictures come in their order."""
    fps = 10.0
    at_ns = np.concatenate(([0], np.cumsum(np.round(np.array(steps_s) * 1e9)))).astype(int).tolist()
    shown = [
        int(image[0, 0, 0]) for image in paced(((t, np.full((1, 1, 3), k, np.uint8)) for k, t in enumerate(at_ns)), fps)
    ]
    assert shown == sorted(shown)
    assert (shown[0], shown[-1]) == (0, len(at_ns) - 1) or steps_s[0] < 0.05
    assert len(shown) / fps == pytest.approx(at_ns[-1] * 1e-9 + 1 / fps, abs=1.01 / fps)
    # At each instant the picture of that time, to half an instant.
    for tick, k in enumerate(shown):
        assert at_ns[k] * 1e-9 <= tick / fps + 0.5 / fps + 1e-6


def test_the_clock_stands_over_a_long_pause() -> None:
    """Pictures of two incidents an hour apart: a few seconds of the first, then the second."""
    hour_ns = 3_600_000_000_000
    stamps = [0, 100_000_000, hour_ns, hour_ns + 100_000_000]
    shown = [
        int(image[0, 0, 0])
        for image in paced(((t, np.full((1, 1, 3), k, np.uint8)) for k, t in enumerate(stamps)), 10.0)
    ]
    assert shown[0] == 0
    assert shown[-2:] == [2, 3]
    assert shown.count(1) == pytest.approx(10 * PAUSE_S, abs=1)


def camera(track: Track) -> GroundMap:
    """Straight above, 440 x 240 px for 4.4 m x 2.4 m."""
    return GroundMap(camera_to_twin=(4.0, 0, 0, 0, 4.0, 0, 0, 0, 1.0), scale=track.scale, width_px=440, height_px=240)


@pytest.fixture
def overlay(oval: Track, drive_oval: Callable[..., list[Event]]) -> Overlay:
    """Of three laps of the oval."""
    events = [replace(event, status=PassStatus.LAP) if isinstance(event, Crossing) else event for event in drive_oval()]
    seen = Sightings(event for event in events if isinstance(event, Observation))
    run = RunResult.from_events(events, entry="Blue car", source_uri="sim:", track=oval)
    return Overlay(run, camera(oval), seen.sorted())


def near(image: BgrImage, at_px: tuple[float, float], colour: tuple[int, int, int]) -> bool:
    u, v = round(at_px[0]), round(at_px[1])
    return bool((np.abs(image[v, u].astype(int) - colour) < 30).all())


@pytest.mark.parametrize("since_s", [2.0, 5.5, 20.0])
def test_the_car_is_drawn_where_it_was(
    since_s: float, overlay: Overlay, drive_oval: Callable[..., list[Event]]
) -> None:
    """Its colour at its ground point through the map, and at the point of a second before, but not at that of one to come."""
    observations = [event for event in drive_oval() if isinstance(event, Observation)]
    t_ns = 1_000_000_000 + round(since_s * 1e9)
    base = np.full((240, 440, 3), 90, np.uint8)
    image = overlay.draw(base, t_ns)
    assert (base == 90).all(), "the picture itself stays as it was"
    ground = camera(overlay._result.track)

    def at_px(then_ns: int) -> tuple[float, float]:
        seen = max((one for one in observations if one.t_ns <= then_ns), key=lambda one: one.t_ns)
        found = ground.point_to_camera_px(seen.track_m)
        assert found is not None
        return found

    placed = overlay.place_px(1, t_ns)
    assert placed == pytest.approx(at_px(t_ns), abs=1.0)
    assert placed is not None
    assert near(image, placed, CAR_COLOURS[0])
    assert near(image, at_px(t_ns - 1_000_000_000), CAR_COLOURS[0])
    assert not near(image, at_px(t_ns + 1_500_000_000), CAR_COLOURS[0])


def test_the_start_line_is_drawn_in_the_picture(overlay: Overlay) -> None:
    """White along its middle, where the map puts it."""
    image = overlay.draw(np.full((240, 440, 3), 90, np.uint8), 0)
    track = overlay._result.track
    ends_m = np.array([track.start_line.start_m, track.start_line.end_m])
    u, v = camera(track).to_camera_px(0.7 * ends_m[:1] + 0.3 * ends_m[1:])[0]
    assert near(image, (u, v), (255, 255, 255))


def test_a_car_that_is_gone_is_not_drawn(overlay: Overlay) -> None:
    """Before it was seen first and long after it was seen last."""
    assert overlay.place_px(1, 500_000_000) is None
    assert overlay.place_px(1, 10**12) is None
    image = overlay.draw(np.full((240, 440, 3), 90, np.uint8), 10**12)
    assert not (np.abs(image.astype(int) - CAR_COLOURS[0]) < 10).all(axis=2).any()


def test_the_clock_and_the_laps_are_told(overlay: Overlay, monkeypatch: pytest.MonkeyPatch) -> None:
    """The running lap with its time, the last and the best lap, and the similarity, once they are known."""
    told: list[str] = []
    put = cv2.putText

    def heard(image: BgrImage, words: str, *rest: object) -> object:
        told.append(words)
        return put(image, words, *rest)

    monkeypatch.setattr(cv2, "putText", heard)
    base = np.full((240, 440, 3), 90, np.uint8)
    for since_s in (-0.5, 3.25, 12.4831 + 2.0, 24.5853 + 1.0):
        overlay.draw(base, 1_000_000_000 + round(since_s * 1e9))
    assert told[0] == "Blue car"
    assert told[1] == "Blue car   lap 1  3.25 s"
    assert told[2] == "lap 2  2.00 s   last 12.483   best 12.483   97.5 %"
    assert told[3] == "lap 3  1.00 s   last 12.102   best 12.102   95.2 %"


def test_a_smaller_picture_is_drawn_to_its_own_scale(overlay: Overlay) -> None:
    """Recorded at half the size, the car is at half the coordinates."""
    t_ns = 6_000_000_000
    at_px = overlay.place_px(1, t_ns)
    assert at_px is not None
    image = overlay.draw(np.full((120, 220, 3), 90, np.uint8), t_ns)
    assert near(image, (at_px[0] / 2, at_px[1] / 2), CAR_COLOURS[0])
