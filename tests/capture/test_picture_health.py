"""What a bad picture is, told from strips of it: which fault, from when and until when."""

import math
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from dnb_edge.capture.picture_health import REMEDIES, PictureFault, PictureJudge
from dnb_edge.display.protocol import MAX_BODY_CHARS, Warn
from dnb_edge.sim.rig import Rig
from dnb_edge.values import BgrImage

FRAME_NS = 33_333_333
RANDOM = np.random.default_rng(5)


@pytest.fixture(scope="module")
def scene() -> BgrImage:
    """A frame of the simulator."""
    picture = Rig(laps=1).frame(40).bgr
    assert picture is not None
    return picture


def noisy(picture: NDArray[Any], sigma: float = 2.0) -> BgrImage:
    noise = RANDOM.standard_normal(picture.shape[:2], dtype=np.float32)[..., None] * sigma
    return np.clip(picture.astype(np.float32) + noise, 0, 255).astype(np.uint8)


def flat(level: float) -> BgrImage:
    return noisy(np.full((720, 1280, 3), level, dtype=np.uint8), 4.0)


def covered() -> BgrImage:
    """A hand before the lens: reddish, brighter to one side, noisy."""
    picture = np.linspace(50, 110, 1280)[None, :, None] * np.array([0.5, 0.6, 1.0])
    return noisy(np.broadcast_to(picture, (720, 1280, 3)).astype(np.uint8), 8.0)


def blurred(scene: BgrImage) -> BgrImage:
    small = cv2.resize(scene, (16, 9), interpolation=cv2.INTER_AREA)
    return noisy(cv2.GaussianBlur(cv2.resize(small, (1280, 720), interpolation=cv2.INTER_CUBIC), (0, 0), 80.0))


def glare(scene: BgrImage) -> BgrImage:
    return noisy(np.clip(scene.astype(np.float32) * 4.0, 0, 255).astype(np.uint8))


def verdicts(judge: PictureJudge, pictures: list[BgrImage], start: int = 0) -> list[PictureFault | None]:
    said = []
    for k, picture in enumerate(pictures, start=start):
        judge.look(picture, k * FRAME_NS)
        said.append(judge.fault)
    return said


@pytest.mark.parametrize(
    ("make", "fault"),
    [
        (np.zeros_like, PictureFault.BLACK),
        (lambda scene: flat(6.0), PictureFault.BLACK),
        (lambda scene: np.full_like(scene, 255), PictureFault.OVEREXPOSED),
        (glare, PictureFault.OVEREXPOSED),
        (lambda scene: covered(), PictureFault.COVERED),
        (lambda scene: flat(120.0), PictureFault.COVERED),
        (blurred, PictureFault.COVERED),
        (noisy, None),
        (lambda scene: noisy(cv2.GaussianBlur(scene, (0, 0), 6.0)), None),
        (lambda scene: noisy((scene * 0.25).astype(np.uint8)), None),
        (lambda scene: noisy(np.clip(scene.astype(np.int16) + 50, 0, 255).astype(np.uint8)), None),
        (lambda scene: noisy(cv2.resize(scene, (160, 90), interpolation=cv2.INTER_AREA)), None),
        (lambda scene: noisy(cv2.resize(scene, (3840, 2160))), None),
    ],
    ids=[
        "black", "nearly black", "white", "glaring", "covered by a hand", "plain wall", "blurred to nothing",
        "good", "out of focus", "dim", "bright", "tiny", "4K",
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_picture(
    scene: BgrImage, make: Callable[[BgrImage], BgrImage], fault: PictureFault | None
) -> None:
    """A bad picture is told within a second and not at once; one that only is poor is good enough."""
    picture = make(scene)
    said = verdicts(PictureJudge(live=False), [picture] * 30)
    assert said[-1] is fault
    assert said[5] is None


def test_a_flash_or_a_hand_passing_by_says_nothing(scene: BgrImage) -> None:
    """A fault of a third of a second is none, but no car is looked for in it."""
    judge = PictureJudge(live=True)
    good = [noisy(scene) for _ in range(12)]
    assert set(verdicts(judge, good)) == {None}
    shows = [judge.shows_something]
    assert set(verdicts(judge, [flat(3.0)] * 9, start=12)) == {None}
    shows.append(judge.shows_something)
    assert set(verdicts(judge, good, start=21)) == {None}
    shows.append(judge.shows_something)
    assert shows == [True, False, True]
    assert judge.lasted_s == {}


def test_a_fault_is_told_once_counted_and_taken_back(scene: BgrImage) -> None:
    """`look` says when it changes: once on, once off; in between the time adds up."""
    judge = PictureJudge(live=True)
    pictures = [noisy(scene) if k < 30 or k >= 90 else flat(4.0) for k in range(150)]
    changes = [(k, judge.fault) for k, picture in enumerate(pictures) if judge.look(picture, k * FRAME_NS)]
    (told, fault), (gone, after) = changes
    assert (fault, after) == (PictureFault.BLACK, None)
    assert 30 < told < 55
    assert 90 < gone < 115
    assert judge.lasted_s == {PictureFault.BLACK: pytest.approx((gone - told) * FRAME_NS * 1e-9)}


def test_cars_are_looked_for_at_the_first_good_look_after_a_fault(scene: BgrImage) -> None:
    """After two black seconds the first look at a good picture lets the search resume, before the fault is taken back."""
    judge = PictureJudge(live=True)
    verdicts(judge, [flat(3.0)] * 60)
    assert (judge.fault, judge.shows_something) == (PictureFault.BLACK, False)
    verdicts(judge, [noisy(scene)] * 6, start=60)
    assert (judge.fault, judge.shows_something) == (PictureFault.BLACK, True)


def test_a_picture_at_the_limit_does_not_flicker() -> None:
    """What is black stays black until it is clearly brighter."""
    judge = PictureJudge(live=True)
    assert verdicts(judge, [flat(2.0)] * 30)[-1] is PictureFault.BLACK
    between = [noisy(np.full((720, 1280, 3), 18, dtype=np.uint8), 2.0) for _ in range(30)]
    assert set(verdicts(judge, between, start=30)) == {PictureFault.BLACK}
    fresh = PictureJudge(live=True)
    assert PictureFault.BLACK not in verdicts(fresh, between)


@pytest.mark.parametrize(("live", "fault"), [(True, PictureFault.FROZEN), (False, None)], ids=["camera", "file"])
def test_only_a_camera_can_be_frozen(scene: BgrImage, live: bool, fault: PictureFault | None) -> None:
    """A camera that repeats one picture for over a second is frozen; a file that pauses is not, nor a still room."""
    judge = PictureJudge(live=live)
    said = verdicts(judge, [scene] * 60)
    assert said[-1] is fault
    assert said[29] is None
    if fault is not None:
        assert said.index(fault) * FRAME_NS < 1_500_000_000
    still = PictureJudge(live=live)
    assert set(verdicts(still, [noisy(scene) for _ in range(60)])) == {None}


def test_a_camera_that_thaws_is_good_again(scene: BgrImage) -> None:
    """Frozen is taken back once pictures differ."""
    judge = PictureJudge(live=True)
    assert verdicts(judge, [scene] * 60)[-1] is PictureFault.FROZEN
    assert verdicts(judge, [noisy(scene) for _ in range(30)], start=60)[-1] is None


@pytest.mark.parametrize("fps", [5.0, 30.0, 120.0])
def test_looks_go_by_the_stamps(scene: BgrImage, fps: float) -> None:
    """At any rate of frames a black picture is told in less than a second."""
    judge = PictureJudge(live=True)
    black = np.zeros_like(scene)
    told = next(k for k in range(math.ceil(2 * fps)) if judge.look(black, round(k * 1e9 / fps)))
    assert 0.3 <= told / fps < 1.0


def test_every_fault_fits_a_line_of_the_serial_display() -> None:
    """The words for a fault reach the display whole."""
    assert set(REMEDIES) == set(PictureFault)
    for text in REMEDIES.values():
        assert Warn(number=1, text=text).body() == f"WARN 1 {text}"
        assert len(f"WARN 1 {text}") <= MAX_BODY_CHARS
