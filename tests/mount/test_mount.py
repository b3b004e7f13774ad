"""The mount plan's geometry against a simulated camera, and its timing sigma against the race's own fit."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnb_edge.errors import InputError
from dnb_edge.mount.advice import advice
from dnb_edge.mount.cameras import CAMERAS
from dnb_edge.mount.geometry import CORNER_NAMES, MountedCamera, Optics, Stand, TrackArea
from dnb_edge.mount.plan import MountPlan, MountRequest, PlannedCar, Rate, plan_mount
from dnb_edge.mount.suggest import Free, MountLimits, suggest
from dnb_edge.mount.timing import crossing_sigma_s, detector_sigma_px, frames_of_fit
from dnb_edge.race.crossing import CrossingSettings, LineWatch
from dnb_edge.race.fix import Fix
from dnb_edge.sim.camera import PinholeCamera, mast_camera
from dnb_edge.track.line import DirectedLine
from dnb_edge.track.scale import TwinScale
from dnb_edge.view.homography import fit_ground_map
from dnb_edge.view.keypoints import load_npy_pairs
from dnb_edge.view.pose import find_pose

PAPER_TRACK = TrackArea(width_m=3.8055, depth_m=3.81)
"""The paper's twin, 2537 x 2540 px at 1.5 mm a px."""
PAPER_OPTICS = Optics(hfov_deg=85.0, width_px=3840, height_px=2160)
"""The photograph's size, and the angle that the house's own pose of the keypoints gives (2,095 px of focal length)."""
PLACES = {
    "the paper's text": Stand(height_m=2.15, pitch_deg=41.0, distance_m=1.14),
    "the keypoints' pose": Stand(height_m=2.234, pitch_deg=43.9, distance_m=0.795, aside_m=-1.703, turn_deg=31.1),
    "too near": Stand(height_m=2.15, pitch_deg=41.0, distance_m=0.2),
    "over the track": Stand(height_m=2.5, pitch_deg=75.0, distance_m=-1.0, aside_m=0.3, turn_deg=-10.0),
    "straight down": Stand(height_m=2.4, pitch_deg=90.0, distance_m=-1.9),
}
CAR = PlannedCar(speed_mps=2.0, length_m=0.25, height_m=0.1)
RATE = Rate(fps=30.0, exposure_s=0.002)


def simulated(optics: Optics, stand: Stand) -> PinholeCamera:
    return mast_camera(
        position_m=(stand.aside_m, -stand.distance_m, stand.height_m),
        pitch_deg=stand.pitch_deg,
        yaw_deg=stand.turn_deg,
        hfov_deg=optics.hfov_deg,
        size_px=(optics.width_px, optics.height_px),
    )


def projected(camera: PinholeCamera, plan_m: np.ndarray) -> np.ndarray:
    """Camera px (n, 2) of floor points (n, 2); NaN behind the camera, which the simulated camera refuses to see."""
    points = np.column_stack((plan_m, np.zeros(len(plan_m))))
    ahead = (points - camera.position_m) @ camera.rotation[2] > 1e-6
    pixels = np.full((len(points), 2), np.nan)
    pixels[ahead] = camera.project(points[ahead])
    return pixels


def inside(camera: PinholeCamera, pixels: np.ndarray) -> np.ndarray:
    low, high = -0.5, np.array([camera.width_px, camera.height_px]) - 0.5
    shown: np.ndarray = np.all((pixels >= low) & (pixels <= high), axis=1)
    return shown


def request(
    *, optics: Optics = PAPER_OPTICS, track: TrackArea = PAPER_TRACK, free: Free, limits: MountLimits | None = None
) -> MountRequest:
    return MountRequest(
        optics=optics,
        rate=RATE,
        track=track,
        car=CAR,
        free=free,
        limits=limits if limits is not None else MountLimits(),
    )


def plan_at(stand: Stand, *, optics: Optics = PAPER_OPTICS) -> MountPlan:
    free = Free(
        height_m=stand.height_m,
        pitch_deg=stand.pitch_deg,
        distance_m=stand.distance_m,
        aside_m=stand.aside_m,
        turn_deg=stand.turn_deg,
    )
    return plan_mount(request(free=free, optics=optics))


@pytest.mark.parametrize("stand", PLACES.values(), ids=PLACES)
def test_coverage_and_corners_are_those_of_a_simulated_camera(stand: Stand) -> None:
    """The share of a dense grid that the simulated camera shows, within 0.5 %, and the same corners cut off."""
    plan, camera = plan_at(stand), simulated(PAPER_OPTICS, stand)
    share = (np.arange(600) + 0.5) / 600
    x, y = np.meshgrid((share - 0.5) * PAPER_TRACK.width_m, share * PAPER_TRACK.depth_m)
    shown = inside(camera, projected(camera, np.column_stack((x.ravel(), y.ravel())))).mean()
    assert plan.coverage.share == pytest.approx(shown, rel=0.005)
    corners = PAPER_TRACK.corners_m()
    seen = inside(camera, projected(camera, corners))
    assert plan.coverage.cut_off == tuple(name for name, ok in zip(CORNER_NAMES, seen, strict=True) if not ok)
    if seen.all():
        assert plan.camera.to_camera_px(corners) == pytest.approx(projected(camera, corners), abs=1e-6)


@pytest.mark.parametrize("stand", PLACES.values(), ids=PLACES)
def test_millimetres_a_px_are_those_of_a_simulated_camera(stand: Stand) -> None:
    """Near, far and worst: finite differences through the simulated camera agree within 0.5 % in every direction, and none of
    the track in the picture is coarser than the worst."""
    plan, camera = plan_at(stand), simulated(PAPER_OPTICS, stand)
    turn = math.radians(stand.turn_deg)
    right, ahead = np.array([math.cos(turn), -math.sin(turn)]), np.array([math.sin(turn), math.cos(turn)])
    for point in (plan.near, plan.far, plan.worst):
        resolution, at = point.resolution, np.array(point.resolution.at_m)
        steps = [np.diff(projected(camera, at + np.outer((-1e-4, 1e-4), e)), axis=0)[0] / 0.2 for e in (right, ahead)]
        assert resolution.across_mm == pytest.approx(1.0 / np.linalg.norm(steps[0]), rel=0.005)
        assert resolution.along_mm == pytest.approx(1.0 / np.linalg.norm(steps[1]), rel=0.005)
        coarse, fine = 1.0 / np.linalg.svd(np.column_stack(steps), compute_uv=False)[::-1]
        assert resolution.worst_mm == pytest.approx(coarse, rel=0.005)
        assert resolution.finest_mm == pytest.approx(fine, rel=0.005)
    share = (np.arange(40) + 0.5) / 40
    x, y = np.meshgrid((share - 0.5) * PAPER_TRACK.width_m, share * PAPER_TRACK.depth_m)
    floor = np.column_stack((x.ravel(), y.ravel()))
    for at in floor[inside(camera, projected(camera, floor))]:
        assert plan.camera.resolution((float(at[0]), float(at[1]))).worst_mm <= plan.worst.resolution.worst_mm * 1.001


@pytest.mark.parametrize("stand", PLACES.values(), ids=PLACES)
def test_a_bar_is_as_long_in_the_picture_as_planned(stand: Stand) -> None:
    """A bar of 10 cm laid across at the near and the far end of the line of sight: px by the plan, within 0.5 %."""
    plan, camera = plan_at(stand), simulated(PAPER_OPTICS, stand)
    turn = math.radians(stand.turn_deg)
    half = 0.05 * np.array([math.cos(turn), -math.sin(turn)])
    for point in (plan.near, plan.far):
        at = np.array(point.resolution.at_m)
        ends = projected(camera, np.array([at - half, at + half]))
        assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(100.0 / point.resolution.across_mm, rel=0.005)


def test_the_papers_own_keypoints_give_the_place_that_the_cases_use(real_dir: Path) -> None:
    """The pose of the paper's nine keypoints is the one in `PLACES`, its angle that of `PAPER_OPTICS`."""
    folder = real_dir / "drivenetbench"
    pairs = load_npy_pairs(folder / "keypoints_from_camera.npy", folder / "keypoints_from_diagram.npy")
    scale = TwinScale(metres_per_px=0.0015, height_px=2540)
    ground = fit_ground_map(pairs, scale, width_px=3840, height_px=2160)
    pose = find_pose(ground)
    assert pose.focal_px == pytest.approx(PAPER_OPTICS.focal_px, rel=0.005)
    assert pose.pitch_deg == pytest.approx(43.9, abs=0.05)
    x, y, z = pose.position_m
    stand = PLACES["the keypoints' pose"]
    # The camera stands beyond the twin's upper edge: that edge is the near one, and right and left change places.
    assert (0.5 * PAPER_TRACK.width_m - x, y - PAPER_TRACK.depth_m, z) == pytest.approx(
        (stand.aside_m, stand.distance_m, stand.height_m), abs=0.002
    )
    middle = ground.point_to_track_m((1919.5, 1079.5))
    assert middle is not None
    assert math.degrees(math.atan2(x - middle[0], y - middle[1])) == pytest.approx(stand.turn_deg, abs=0.2)


@given(
    height_m=st.floats(0.5, 6.0),
    pitch_deg=st.floats(10.0, 90.0),
    distance_m=st.floats(-2.0, 3.0),
    aside_m=st.floats(-2.0, 2.0),
    turn_deg=st.floats(-180.0, 180.0),
)
@settings(deadline=None, max_examples=60)
def test_the_seen_part_is_in_the_picture_and_no_larger_than_the_track(
    height_m: float, pitch_deg: float, distance_m: float, aside_m: float, turn_deg: float
) -> None:
    """Wherever the camera stands: every corner of the seen part lies in the picture, and the share is 0 to 1."""
    stand = Stand(height_m=height_m, pitch_deg=pitch_deg, distance_m=distance_m, aside_m=aside_m, turn_deg=turn_deg)
    camera = MountedCamera(optics=Optics(hfov_deg=70.0, width_px=1280, height_px=720), stand=stand)
    cover = camera.coverage(TrackArea(width_m=3.0, depth_m=2.0))
    assert 0.0 <= cover.share <= 1.0
    if cover.seen_m:
        u, v = camera.to_camera_px(np.array(cover.seen_m)).T
        assert u.min() > -0.51
        assert u.max() < 1279.51
        assert v.min() > -0.51
        assert v.max() < 719.51
        back = camera.to_plan_m(camera.ahead_m(np.array(cover.seen_m)))
        assert back == pytest.approx(np.array(cover.seen_m), abs=1e-9)


def test_the_heights_error_is_the_houses_known_one() -> None:
    """8 cm up, 1.5 m off axis, under 2.5 m: 48 mm; and a simulated camera sees it that far off."""
    stand = Stand(height_m=2.5, pitch_deg=60.0, distance_m=0.7)
    camera = MountedCamera(optics=PAPER_OPTICS, stand=stand)
    assert camera.parallax_m((0.0, 0.8), 0.08) == pytest.approx(0.048, abs=1e-9)
    seen_at = np.array([[0.0, 0.8]])
    below = seen_at - 0.048 * np.array([[0.0, 1.0]])
    simulation = simulated(PAPER_OPTICS, stand)
    top = simulation.project(np.column_stack((below, [0.08])))
    assert top == pytest.approx(projected(simulation, seen_at), abs=1e-6)


LINE = DirectedLine(name="start", start_m=(0.0, 3.0), end_m=(0.0, -3.0))
"""Crossed forward by a car that drives to +x."""
TRIALS = 500


def crossing_errors_s(rng: np.random.Generator, *, sigma_m: float, speed_mps: float, fps: float) -> np.ndarray:
    """Errors of the race's own fit for a car whose fixes scatter by `sigma_m` along its way."""
    errors = []
    for _ in range(TRIALS):
        true_s = 1.0 + rng.uniform() / fps
        watch, found = LineWatch(LINE, CrossingSettings()), []
        for k in range(round(0.4 * fps), round(1.7 * fps)):
            x = (k / fps - true_s) * speed_mps + rng.normal(0.0, sigma_m)
            found += watch.feed(fix(k / fps, x, sigma_m))
        errors += [crossing.t_s - true_s for crossing in found + watch.finish()]
    assert len(errors) == TRIALS
    return np.array(errors)


def fix(t_s: float, x_m: float, sigma_m: float) -> Fix:
    return Fix(
        t_ns=round(t_s * 1e9), t_s=t_s, target_id=1, observed_m=(x_m, 0.0), covariance_m2=(sigma_m**2, 0.0, sigma_m**2),
        track_m=(x_m, 0.0), s_m=0.0, d_m=0.0, outside_m=-0.1, progress_m=0.0,
    )  # fmt: skip


@pytest.mark.parametrize("fps", [5.0, 15.0, 20.0, 29.97, 30.0, 60.0, 120.0])
@pytest.mark.parametrize(("sigma_m", "speed_mps"), [(0.005, 2.0), (0.002, 0.8), (0.012, 3.0)])
def test_the_timing_sigma_is_that_of_the_races_fit(fps: float, sigma_m: float, speed_mps: float) -> None:
    """Monte Carlo through `race/crossing`: the scatter of the instants is the planned sigma within 15 %."""
    rng = np.random.default_rng(round(fps * 100))
    errors = crossing_errors_s(rng, sigma_m=sigma_m, speed_mps=speed_mps, fps=fps)
    planned = crossing_sigma_s(sigma_m, speed_mps=speed_mps, fps=fps)
    assert float(np.std(errors)) == pytest.approx(planned, rel=0.15)


def test_the_sigma_of_a_whole_plan_is_that_of_simulated_drives() -> None:
    """A car that drives away at the far end of the paper's view, seen by the simulated camera with the planned scatter in
    px and placed frame by frame: its crossings scatter as planned within 15 %."""
    plan = plan_at(PLACES["the paper's text"])
    camera = simulated(PAPER_OPTICS, PLACES["the paper's text"])
    to_floor = np.linalg.inv(camera.floor_homography())
    rng, errors, fps = np.random.default_rng(4), [], RATE.fps
    line_m = plan.far.resolution.at_m[1] - 0.4
    there = plan.camera.resolution((0.0, line_m))
    for _ in range(TRIALS):
        true_s = 1.0 + rng.uniform() / fps
        t = np.arange(round(0.4 * fps), round(1.4 * fps)) / fps
        way = np.column_stack((np.zeros(len(t)), line_m + (t - true_s) * CAR.speed_mps))
        pixels = projected(camera, way) + rng.normal(0.0, plan.far.sigma_px, (len(t), 2))
        floor = np.column_stack((pixels, np.ones(len(t)))) @ to_floor.T
        y = floor[:, 1] / floor[:, 2] - line_m
        watch, found = LineWatch(LINE, CrossingSettings()), []
        for t_s, y_m in zip(t.tolist(), y.tolist(), strict=True):
            found += watch.feed(fix(t_s, y_m, 0.005))
        errors += [crossing.t_s - true_s for crossing in found + watch.finish()]
    planned = crossing_sigma_s(plan.far.sigma_px * there.worst_mm / 1000.0, speed_mps=CAR.speed_mps, fps=fps)
    assert len(errors) == TRIALS
    assert float(np.std(errors)) == pytest.approx(planned, rel=0.15)


def test_the_fit_is_the_races() -> None:
    """The counts of frames before and behind the line are what a watch with the race's default settings really fits."""
    counts = [frames_of_fit(fps) for fps in (5.0, 15.0, 20.0, 30.0, 60.0)]
    assert counts == [(3, 3), (8, 4), (11, 6), (16, 8), (31, 16)]


def test_the_sigma_follows_speed_rate_and_stamps() -> None:
    """Twice the speed halves it, or nearly (a fast car strays further from its parabola), more frames lower it, and the
    stamps' own sigma adds as squares do."""
    one = crossing_sigma_s(0.005, speed_mps=1.0, fps=30.0)
    assert one / 2 <= crossing_sigma_s(0.005, speed_mps=2.0, fps=30.0) < 0.6 * one
    assert crossing_sigma_s(0.005, speed_mps=1.0, fps=60.0) < 0.8 * one
    assert crossing_sigma_s(0.005, speed_mps=1.0, fps=30.0, stamp_sigma_s=0.003) == pytest.approx(
        math.hypot(one, 0.003)
    )
    assert detector_sigma_px(100.0) == pytest.approx(2.0)
    assert detector_sigma_px(10.0) == pytest.approx(0.5)


USUAL = Optics(hfov_deg=66.0, width_px=1280, height_px=720)
TABLE = TrackArea(width_m=3.0, depth_m=2.2)


@pytest.mark.parametrize(
    ("free", "limits"),
    [
        (Free(), MountLimits()),
        (Free(), MountLimits(max_height_m=3.2)),
        (Free(distance_m=0.9), MountLimits()),
        (Free(height_m=2.3), MountLimits()),
        (Free(pitch_deg=50.0), MountLimits(margin_m=0.0)),
        (Free(aside_m=0.3, turn_deg=-5.0), MountLimits(max_height_m=3.0)),
    ],
    ids=["all free", "high ceiling", "distance given", "height given", "pitch given", "askew"],
)
def test_nothing_tried_at_random_is_better_than_the_suggestion(free: Free, limits: MountLimits) -> None:
    """Among 8,000 random places that show the track with its margin, none has a worst px 2 % finer than the suggested one."""
    found = suggest(USUAL, TABLE, limits, free)
    assert found.fits
    camera = MountedCamera(optics=USUAL, stand=found.stand)
    spare = camera.spare_px(TABLE.corners_m(limits.margin_m))
    assert spare is not None
    assert spare > -1e-6
    best = max(camera.resolution((float(x), float(y))).worst_mm for x, y in TABLE.corners_m())
    rng, tried = np.random.default_rng(1), 0
    for _ in range(8_000):
        stand = Stand(
            height_m=free.height_m or rng.uniform(1.2, limits.max_height_m),
            pitch_deg=free.pitch_deg or rng.uniform(20.0, 90.0),
            distance_m=free.distance_m if free.distance_m is not None else rng.uniform(-1.1, 2.0),
            aside_m=free.aside_m,
            turn_deg=free.turn_deg,
        )
        other = MountedCamera(optics=USUAL, stand=stand)
        room = other.spare_px(TABLE.corners_m(limits.margin_m))
        if room is not None and room >= 0:
            tried += 1
            worst = max(other.resolution((float(x), float(y))).worst_mm for x, y in TABLE.corners_m()[2:])
            assert worst > 0.98 * best, stand
    assert tried > 0


def test_the_better_place_is_said_and_is_better() -> None:
    """For the paper's place a higher, steeper one is offered, with the figures of its own plan; from there none better is."""
    plan = plan_at(Stand(height_m=2.15, pitch_deg=41.0, distance_m=1.14))
    assert plan.better is not None
    assert plan.better.worst.resolution.worst_mm < 0.97 * plan.worst.resolution.worst_mm
    assert any(sentence.startswith("Better: ") for sentence in advice(plan))
    again = plan_at(plan.better.camera.stand)
    assert again.worst.resolution == plan.better.worst.resolution
    # From 0.2 m no height and pitch show the whole track: another distance is offered, too.
    near = plan_at(PLACES["too near"])
    assert near.better is not None
    assert near.better.coverage.share == pytest.approx(1.0)
    assert any("the whole track would be in the picture" in sentence for sentence in advice(near))


STEEP = plan_mount(request(optics=USUAL, track=TrackArea(width_m=1.5, depth_m=0.8), free=Free()))


@pytest.mark.parametrize(
    ("plan", "words"),
    [
        (plan_at(PLACES["too near"]), "outside the picture, the corners near left and near right"),
        (plan_at(Stand(height_m=2.15, pitch_deg=41.0, distance_m=1.02)), "not the margin of 0.1 m"),
        (STEEP, "set view.camera_height_m"),
        (plan_at(Stand(height_m=2.0, pitch_deg=20.0, distance_m=3.0)), "degrees above the horizon"),
        (plan_at(PLACES["the paper's text"], optics=Optics(hfov_deg=110.0, width_px=640, height_px=360)), "44 px long"),
        (plan_at(PLACES["the paper's text"], optics=Optics(hfov_deg=110.0, width_px=640, height_px=360)), "bends"),
        (plan_at(PLACES["the paper's text"]), "roof markers are corrected"),
    ],
    ids=["cut off", "margin", "steep", "horizon", "small car", "wide lens", "parallax"],
)
def test_what_is_wrong_is_said(plan: MountPlan, words: str) -> None:
    """Each fault of a place has its sentence."""
    assert any(words in sentence for sentence in advice(plan)), advice(plan)


def test_a_steep_suggestion_names_the_gentler_one() -> None:
    """Where straight down is best, the best place at 80 degrees or less stands beside it, and what it costs."""
    assert STEEP.camera.stand.pitch_deg > 80.0
    assert STEEP.gentler is not None
    assert STEEP.gentler.camera.stand.pitch_deg <= 80.0
    assert STEEP.gentler.worst.resolution.worst_mm >= STEEP.worst.resolution.worst_mm


@pytest.mark.parametrize(
    ("free", "words"),
    [
        (Free(), r"no place below --max-height 2.5 .* mount it up to .* m high"),
        (Free(height_m=2.0), "--height 2"),
        (Free(pitch_deg=30.0, distance_m=-1.0), "leave --pitch out, or leave --distance out"),
        (Free(height_m=0.05, pitch_deg=41.0), "--height 0.05: the camera must be above the car"),
        (Free(height_m=1.0, pitch_deg=90.0, distance_m=50.0), "shows nothing of the track"),
    ],
    ids=["narrow", "height", "pitch and distance", "below the car", "looks elsewhere"],
)
def test_what_cannot_be_says_which_option(free: Free, words: str) -> None:
    """One line that names the option and what to do."""
    with pytest.raises(InputError, match=words) as caught:
        plan_mount(request(optics=Optics(hfov_deg=40.0, width_px=1280, height_px=720), free=free))
    assert "\n" not in str(caught.value)


def test_the_ceiling_that_is_named_is_enough() -> None:
    """Under the height that the refusal names, the track fits; 20 cm below it does not."""
    narrow = Optics(hfov_deg=40.0, width_px=1280, height_px=720)
    with pytest.raises(InputError) as caught:
        plan_mount(request(optics=narrow, track=TABLE, free=Free()))
    needed = float(str(caught.value).partition("--max-height 2.5")[2].partition("--max-height ")[2].partition(")")[0])
    assert suggest(narrow, TABLE, MountLimits(max_height_m=needed), Free()).fits
    assert not suggest(narrow, TABLE, MountLimits(max_height_m=needed - 0.2), Free()).fits


def test_rolling_rows_and_known_cameras() -> None:
    """The rows' delay is the track's share of the readout; every camera of the table gives a plan for a small track."""
    plan = plan_mount(
        MountRequest(
            optics=USUAL, rate=Rate(fps=30.0, exposure_s=0.002, readout_s=0.03), track=TABLE, car=CAR, free=Free(),
            limits=MountLimits(),
        )
    )  # fmt: skip
    assert plan.row_delay_s is not None
    assert 0.015 < plan.row_delay_s <= 0.03
    assert any("Rolling shutter" in sentence for sentence in advice(plan))
    for known in CAMERAS.values():
        optics = Optics(hfov_deg=known.hfov_deg, width_px=known.width_px, height_px=known.height_px)
        assert (
            plan_mount(request(optics=optics, track=TrackArea(width_m=1.2, depth_m=0.8), free=Free())).coverage.share
            == 1
        )
