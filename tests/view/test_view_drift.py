"""The drift watch: patches found to a fraction of a pixel, one motion agreed on, and when the camera counts as moved."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from drift_pictures import HEIGHT, MM_PER_PX, WIDTH, Floor, watched
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.view.drift import DriftWatch
from dnb_edge.view.drift_judge import DriftJudge, DriftSettings, Verdict
from dnb_edge.view.drift_motion import common_motion
from dnb_edge.view.drift_patches import PatchSize, corner_points, make_patch, match
from dnb_edge.view.drift_reference import PlaceReference, median_of_five

FPS = 6.0
SIZE = PatchSize.for_width(WIDTH)
SEEN_M = 0.003 * watched().span_m
"""0.3 % of the span: what must be found."""

Scene = Callable[[float], np.ndarray]


def shown(watch: DriftWatch, scene: Scene, *, from_s: float, to_s: float) -> list[tuple[float, float | None]]:
    """Shows `scene(t_s)` to the watch, and returns when `moved_m` became known or unknown, and what it became."""
    return [
        (number / FPS, watch.moved_m)
        for number in range(round(from_s * FPS), round(to_s * FPS))
        if watch.look(scene(number / FPS), round(number / FPS * 1e9))
    ]


@pytest.mark.parametrize("shift", [(0.25, -0.5), (0.5, 0.5), (-1.4, 2.3), (3.75, 0.0), (0.0, 0.0)])
def test_a_patch_is_found_to_a_twentieth_of_a_pixel(shift):
    """Whole px, halves and quarters alike, under noise, in another light and with a slope of light across it."""
    floor = Floor()
    before = floor.seen()
    slope = np.linspace(0.5, 1.1, WIDTH)[None, :]
    after = np.clip(floor.seen(*shift) * slope * 0.8 + 12, 0, 255).astype(np.uint8)
    patches = [patch for point in corner_points(before, SIZE) if (patch := make_patch(before, point, SIZE)) is not None]
    assert len(patches) > 20
    found = [match(patch, after, SIZE) for patch in patches]
    off = [
        np.subtract(one.camera_px, patch.camera_px) - shift
        for one, patch in zip(found, patches, strict=True)
        if one.seen
    ]
    assert len(off) > 0.9 * len(patches)
    assert np.abs(np.mean(off, axis=0)).max() < 0.03
    assert np.std(off) < 0.1


def test_what_cannot_be_placed_is_no_patch():
    """Neither a plain floor, nor an edge, nor a pattern that repeats itself within the search."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    plain = np.full((HEIGHT, WIDTH), 128, np.uint8)
    edge = np.where(u < 320, 60, 200).astype(np.uint8)
    checks = np.where((u // 5 + v // 5) % 2 == 0, 60, 200).astype(np.uint8)
    for picture in (plain, edge, checks):
        assert make_patch(picture, (320, 180), SIZE) is None
    assert make_patch(np.where((u < 320) & (v < 180), 60, 200).astype(np.uint8), (320, 180), SIZE) is not None


def test_a_patch_at_the_border_is_none_and_a_hidden_one_not_seen():
    """A search that would leave the picture is refused; another thing in the patch's place is not taken for it."""
    picture = Floor().seen()
    assert make_patch(picture, (SIZE.margin_px - 1, 100), SIZE) is None
    patch = next(patch for point in corner_points(picture, SIZE) if (patch := make_patch(picture, point, SIZE)))
    hidden = picture.copy()
    u, v = patch.camera_px
    hidden[v - 30 : v + 30, u - 30 : u + 30] = Floor(2).seen()[:60, :60]
    assert not match(patch, hidden, SIZE).seen
    assert match(patch, hidden, SIZE, (5.0, 5.0)) is None


motions = st.tuples(*[st.floats(-8, 8)] * 2, *[st.floats(-4, 4)] * 2, *[st.floats(-0.5, 0.5)] * 4)


@settings(max_examples=40, deadline=None)
@given(motions, st.integers(0, 1000))
def test_the_common_motion_is_that_of_the_most(numbers, seed):
    """Of 30 points over the picture, ten go anywhere: the others' motion is found, and they are told from those."""
    random = np.random.default_rng(seed)
    before = random.uniform((20, 20), (WIDTH - 20, HEIGHT - 20), (30, 2))
    x, y = ((before - (WIDTH / 2, HEIGHT / 2)) / (WIDTH / 2)).T
    a, b, s, r, e, f, g, h = numbers
    along = a + s * x - r * y + e * x + f * y + g * x * x + h * x * y
    down = b + s * y + r * x - e * y + f * x + g * x * y + h * y * y
    shift = np.column_stack((along, down)) + random.normal(0.0, 0.05, (30, 2))
    shift[:10] += random.choice([-1, 1], (10, 2)) * random.uniform(4, 12, (10, 2))
    motion = common_motion(before, shift, (WIDTH, HEIGHT), tolerance_px=0.5)
    assert not motion.agreeing[:10].any()
    assert motion.agreeing[10:].sum() >= 16
    assert np.abs(motion.shift_px(before[10:]) - shift[10:]).max() < 1.0


def test_too_few_points_agree_on_nothing():
    """One point, or two in one spot, fix no motion."""
    one = np.array([[100.0, 100.0]])
    assert common_motion(one, one * 0, (WIDTH, HEIGHT), tolerance_px=0.5) is None
    two = np.array([[100.0, 100.0], [104.0, 100.0]])
    assert common_motion(two, two * 0, (WIDTH, HEIGHT), tolerance_px=0.5) is None


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 255), min_size=5, max_size=5))
def test_median_of_five(levels):
    """It is the median, whatever the order."""
    pictures = [np.full((2, 2), level, np.uint8) for level in levels]
    assert (median_of_five(pictures) == sorted(levels)[2]).all()


CASES = [
    ("in place", {}, Verdict.IN_PLACE, 0.0),
    ("a tenth of a per cent of the span", {"right_px": 0.5}, Verdict.IN_PLACE, 2.5),
    ("0.3 % of the span", {"right_px": SEEN_M * 1e3 / MM_PER_PX}, Verdict.MOVED, SEEN_M * 1e3),
    ("downwards", {"down_px": -3.0}, Verdict.MOVED, 15.0),
    ("beyond the search", {"right_px": 40.0, "down_px": 25.0}, Verdict.MOVED, 235.8),
    ("turned", {"turn_deg": 1.0}, Verdict.MOVED, 21.0),
    ("turned and shifted far", {"turn_deg": 3.0, "right_px": 60.0}, Verdict.MOVED, None),
]


@pytest.mark.parametrize(
    ("shift", "verdict", "moved_mm"), [case[1:] for case in CASES], ids=[case[0] for case in CASES]
)
def test_one_picture_tells_how_far_the_camera_has_moved(shift, verdict, moved_mm):
    """The verdict of a single comparison, and its size over the track, to 0.05 % of the span or 3 %."""
    floor = Floor()
    judge = DriftJudge(reference=PlaceReference.of(floor.seen()), watched=watched(), settings=DriftSettings())
    look = judge.look_at(floor.seen(**shift))
    assert look.verdict is verdict
    if moved_mm is not None:
        assert look.moved_m * 1e3 == pytest.approx(moved_mm, abs=1.2, rel=0.03)


def test_a_bump_is_told_within_five_seconds_and_cleared_when_it_is_undone():
    """0.3 % of the span: told in time, with its size, in words; put back, it is forgotten after a while, not before."""
    floor, watch = Floor(), DriftWatch(watched())
    shift = SEEN_M * 1e3 / MM_PER_PX

    def scene(t_s: float) -> np.ndarray:
        return floor.seen(right_px=shift if 6.33 <= t_s < 14.0 else 0.0)

    (told_s, moved_m), (back_s, none) = shown(watch, scene, from_s=0.0, to_s=24.0)
    assert 6.33 < told_s <= 11.33
    assert moved_m == pytest.approx(SEEN_M, rel=0.1)
    assert none is None
    assert 18.0 < back_s < 23.0
    assert watch.warning is None


def test_a_slow_drift_is_found_too():
    """A mount that sags by 1 px a minute: the reference does not follow it."""
    floor, watch = Floor(), DriftWatch(watched())
    changes = shown(watch, lambda t_s: floor.seen(down_px=t_s / 20.0), from_s=0.0, to_s=40.0)
    assert len(changes) == 1
    assert 15.0 < changes[0][0] < 30.0
    assert watch.warning.startswith("camera moved ")
    assert watch.warning.endswith(" mm: laps are suspect, calibrate again")


def test_a_view_of_another_place_is_told():
    """Where nothing of the reference is found any more, ten seconds on it is said, with the span as the distance."""
    floor, elsewhere, watch = Floor(), Floor(7), DriftWatch(watched())
    changes = shown(watch, lambda t_s: (floor if t_s < 6.0 else elsewhere).seen(), from_s=0.0, to_s=24.0)
    assert changes == [(pytest.approx(18.0, abs=3.0), watched().span_m)]
    assert "another place" in watch.warning


def _half_hidden(floor: Floor) -> Scene:
    hand = np.full((HEIGHT, WIDTH // 2), 90, np.uint8)

    def scene(t_s: float) -> np.ndarray:
        picture = floor.seen()
        if t_s > 6.0:
            picture[:, : WIDTH // 2] = hand
        return picture

    return scene


def _all_hidden(floor: Floor) -> Scene:
    """For less than a view of another place takes."""
    hand = Floor(9).seen()
    return lambda t_s: hand if 6.0 < t_s < 14.0 else floor.seen()


def _pushed(floor: Floor) -> Scene:
    """A thing with texture on a third of the picture is pushed by 3 px."""
    thing = Floor(5).seen()[:240, :300]

    def scene(t_s: float) -> np.ndarray:
        picture = floor.seen()
        left = 200 if t_s < 6.0 else 203
        picture[60:300, left : left + 300] = thing
        return picture

    return scene


def _light(floor: Floor) -> Scene:
    """It fades to a third, from one side more than from the other, flickers and steps."""

    def scene(t_s: float) -> np.ndarray:
        slope = np.linspace(1.0, 1.0 - t_s / 40.0, WIDTH)[None, :]
        flicker = 1.0 + 0.05 * ((round(t_s * FPS) % 3) - 1) - (0.3 if 12.0 < t_s < 16.0 else 0.0)
        return np.clip(floor.seen() * slope * flicker * (1.0 - t_s / 60.0), 0, 255).astype(np.uint8)

    return scene


def _walker(floor: Floor) -> Scene:
    def scene(t_s: float) -> np.ndarray:
        picture = floor.seen()
        left = round((t_s * 90.0) % (WIDTH + 200)) - 200
        cv2.rectangle(picture, (left, 40), (left + 200, HEIGHT), (40,), -1)
        return picture

    return scene


@pytest.mark.parametrize("quiet", [_half_hidden, _all_hidden, _pushed, _light, _walker])
def test_what_is_not_the_camera_raises_no_alarm(quiet):
    """Half the view hidden for long, all of it for a moment, a thing pushed aside, the light, and people from the start on."""
    watch = DriftWatch(watched())
    assert shown(watch, quiet(Floor()), from_s=0.0, to_s=20.0) == []
    assert watch.note is None
    assert watch.last is not None


def test_what_was_pushed_has_no_voice_after_ten_looks():
    """Patches on a thing that was pushed while the rest stayed are seen, but not with the rest; then they are asked no more."""
    floor, watch = Floor(), DriftWatch(watched())
    thing = Floor(5).seen()[:150, :200]

    def scene(t_s: float) -> np.ndarray:
        picture = floor.seen()
        left = 200 if t_s < 6.0 else 203
        picture[60:210, left : left + 200] = thing
        return picture

    assert shown(watch, scene, from_s=0.0, to_s=12.0) == []
    assert watch.last.agreeing < watch.last.seen
    assert shown(watch, scene, from_s=12.0, to_s=22.0) == []
    assert watch.last.agreeing == watch.last.seen < watch.last.patches


def test_what_stands_in_the_first_frames_is_not_taken_for_the_floor():
    """Somebody who passes while the reference is made is in one picture of five: the patches are the floor's."""
    floor, watch = Floor(), DriftWatch(watched())

    def scene(t_s: float) -> np.ndarray:
        picture = floor.seen()
        left = round(t_s * 250.0)
        picture[:, left : left + 150] = 30
        return picture

    assert shown(watch, scene, from_s=0.0, to_s=6.0) == []
    assert watch.last.seen >= 0.9 * watch.last.patches


def test_a_plain_floor_is_told_once_it_is_known():
    """Patches in one part of the picture fix no motion: the watch says what to do, and raises no alarm."""
    floor, watch = Floor(plain=True), DriftWatch(watched())
    assert watch.note is None
    assert shown(watch, lambda _: floor.seen(noise=1.0), from_s=0.0, to_s=6.0) == []
    assert watch.note == "the floor shows too little for the camera's place to be watched: lay down markers"


def test_a_view_that_is_hidden_for_long_is_told():
    """Where no look has told anything for a minute, a note says that nobody watches; it goes when the view is free again."""
    floor, watch = Floor(), DriftWatch(watched())
    hand = np.full((HEIGHT, WIDTH), 90, np.uint8)

    def scene(t_s: float) -> np.ndarray:
        picture = floor.seen()
        if 6.0 < t_s < 75.0:
            picture[:, 60:] = hand[:, 60:]
        return picture

    assert shown(watch, scene, from_s=0.0, to_s=60.0) == []
    assert watch.note is None
    assert shown(watch, scene, from_s=60.0, to_s=74.0) == []
    assert (
        watch.note == "the camera's place cannot be told at present: too much of the view is hidden or looks otherwise"
    )
    assert shown(watch, scene, from_s=74.0, to_s=78.0) == []
    assert watch.note is None


def test_a_given_reference_finds_what_moved_before_the_run():
    """With the calibration's own picture a camera that was moved meanwhile is told soon after the start."""
    floor = Floor()
    watch = DriftWatch(watched(), reference=floor.seen())
    ((told_s, moved_m),) = shown(watch, lambda _: floor.seen(right_px=2.0), from_s=0.0, to_s=4.0)
    assert told_s <= 2.0
    assert moved_m == pytest.approx(0.010, rel=0.1)


def test_the_same_pictures_give_the_same_verdicts():
    """No clock and no chance: two watches over one clip agree frame by frame."""
    floor = Floor()
    clip = [floor.seen(right_px=0.0 if number < 50 else 1.7) for number in range(100)]
    told = []
    for _ in range(2):
        watch = DriftWatch(watched())
        told.append([(watch.look(picture, number * 100_000_000), watch.moved_m) for number, picture in enumerate(clip)])
    assert told[0] == told[1]
    assert any(changed for changed, _ in told[0])


def test_a_pause_ends_a_look_that_was_begun():
    """What was seen before a gap in the frames is not mixed with what is seen after it: the bump in the gap is told right."""
    floor, watch = Floor(), DriftWatch(watched())
    assert shown(watch, lambda _: floor.seen(), from_s=0.0, to_s=5.2) == []
    ((told_s, moved_m),) = shown(watch, lambda _: floor.seen(right_px=1.6), from_s=60.0, to_s=66.0)
    assert told_s <= 65.0
    assert moved_m == pytest.approx(0.008, rel=0.1)
