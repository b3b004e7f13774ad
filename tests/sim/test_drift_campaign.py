"""The drift watch in drawn rooms: a small campaign, and that its truth is the truth."""

from __future__ import annotations

import json

import numpy as np
import pytest

from dnb_edge.sim import drift_campaign
from dnb_edge.sim.drift_campaign import WITHIN_S, BumpTrial, QuietRun, bump_trial, campaign_rooms, quiet_run, summary
from dnb_edge.sim.drift_rooms import CAMERAS, Bump, DriftRoom, FloorKind, bump_homography, drift_room
from dnb_edge.sim.drift_scene import DriftScene

KINDS = [
    Bump(pan_deg=1.0),
    Bump(tilt_deg=-1.0),
    Bump(roll_deg=1.0),
    Bump(shift_m=(0.03, -0.02, 0.01)),
    Bump(pan_deg=0.5, tilt_deg=0.7, roll_deg=-0.4, shift_m=(0.02, 0.0, 0.0)),
]


@pytest.fixture(scope="module")
def room() -> DriftRoom:
    """A floor of planks under the camera in the corner: small pictures, a steep perspective."""
    return drift_room(FloorKind.PLANKS, CAMERAS[3](), 5)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bump_has_the_size_that_was_asked_for(room: DriftRoom, kind: Bump) -> None:
    """Its greatest displacement over the track is that share of the span, and the picture shows it: floor points appear where
    the moved camera's homography puts them."""
    bump = room.bump_of(kind, 0.003)
    assert room.displacement_m(bump) == pytest.approx(0.003 * room.watched.span_m, rel=1e-3)
    large = room.bump_of(kind, 0.05)
    before, after = room.still.astype(float), room.picture(large).astype(float)
    matrix = bump_homography(room.camera, large)
    u, v = np.meshgrid(np.arange(60, 580, 40), np.arange(60, 300, 40))
    points = np.column_stack((u.ravel(), v.ravel(), np.ones(u.size)))
    there = points @ matrix.T
    there = np.rint(there[:, :2] / there[:, 2:]).astype(int)
    inside = (there >= 5).all(axis=1) & (there < (635, 355)).all(axis=1)
    came = after[there[inside, 1], there[inside, 0]]
    was = before[points[inside, 1].astype(int), points[inside, 0].astype(int)]
    assert np.median(np.abs(came - was)) < 4.0


def test_a_scene_is_the_same_again(room: DriftRoom) -> None:
    """Every frame follows from the seed and its time alone, and no two times look alike."""

    def frame(t_s: float) -> np.ndarray:
        scene = DriftScene(seed=3, size_px=room.size_px, minutes=2.0, lane_px=room.lane_px, jpeg=True)
        return scene.frame(room, t_s)

    assert (frame(30.0) == frame(30.0)).all()
    assert (frame(30.0) != frame(31.0)).mean() > 0.5


def test_a_motion_too_large_to_be_measured_is_told_all_the_same() -> None:
    """A mount that turned and slid by 9 cm over planks that all look alike: patches are found in wrong places and agree on
    nothing, but none is where it was, and after a while that is said."""
    planks = campaign_rooms(1)[11]()
    trial = bump_trial(planks, seed=31, share=0.03266097184903423)
    assert trial.delay_s is not None
    assert WITHIN_S < trial.delay_s < 20.0
    assert trial.told_share == 1.0


def test_bumps_of_a_third_of_a_per_cent_are_found_in_time(room: DriftRoom) -> None:
    """0.3 % of the span and more, of every kind, with people and light going on: told within 5 s with about its size."""
    tiles = drift_room(FloorKind.TILES, CAMERAS[2](), 6)
    trials = [
        bump_trial(where, seed=seed, share=share)
        for seed, (where, share) in enumerate([(room, 0.003), (tiles, 0.003), (tiles, 0.01), (room, 0.04)])
    ]
    for trial in trials:
        assert trial.delay_s is not None, trial
        assert 0.0 <= trial.delay_s <= WITHIN_S
        assert trial.told_share == pytest.approx(trial.share, rel=0.25)


def test_a_bump_of_half_the_threshold_is_none(room: DriftRoom) -> None:
    """0.1 % of the span is below what is told."""
    trial = bump_trial(room, seed=4, share=0.001)
    assert (trial.delay_s, trial.false_alarm) == (None, False)


def test_quiet_minutes_stay_quiet(room: DriftRoom) -> None:
    """People, a pushed chair, cars, clouds, flicker and exposure steps: no alarm, and most looks tell that all is in place."""
    run = quiet_run(room, seed=8, minutes=3.0)
    assert run.alarms_s == ()
    assert run.looks["in_place"] > 0.7 * sum(run.looks.values())
    assert run.looks.get("moved", 0) == 0


def test_the_summary_counts() -> None:
    """Rates, delays, the smallest size found in 95 %, and every miss and false alarm by name."""

    def trial(share: float, delay_s: float | None, *, watched: bool = True) -> BumpTrial:
        told = None if delay_s is None else share * 1.1
        return BumpTrial(room="r", share=share, delay_s=delay_s, told_share=told, false_alarm=False, watched=watched)

    bumps = [trial(0.003, 2.0), trial(0.01, 3.0), trial(0.02, 12.0), trial(0.02, None, watched=False)]
    small = [trial(0.001, None)] * 20 + [trial(0.002, 2.0)] * 19 + [trial(0.002, None)] + [trial(0.003, 1.0)] * 20
    quiet = [
        QuietRun(room="r", minutes=50.0, alarms_s=(), looks={"in_place": 5}),
        QuietRun(room="s", minutes=50.0, alarms_s=(7.0,), looks={"in_place": 3, "moved": 2}),
    ]
    figures = summary(bumps, quiet, small)
    assert (figures["bumps"], figures["found"], figures["not_watched"]) == (4, 2, 1)
    assert (figures["found_share"], figures["found_at_all"]) == (0.5, 3)
    assert figures["found_share_of_watched"] == pytest.approx(2 / 3)
    assert (figures["delay_p50_s"], figures["delay_max_s"]) == (2.5, 3.0)
    assert figures["size_off_p50"] == pytest.approx(0.1)
    assert (figures["quiet_minutes"], figures["false_alarms"]) == (100.0, 1)
    assert figures["quiet_looks"] == {"in_place": 8, "moved": 2}
    assert figures["smallest_found_share"] == 0.002
    assert figures["found_by_share_of_span"] == {"0.001": 0.0, "0.002": 0.95, "0.003": 1.0}


def test_the_command_prints_one_object(
    room: DriftRoom, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With --json: one object on stdout; twenty rooms by default, every floor under every camera."""
    assert len(campaign_rooms(1)) == 20
    monkeypatch.setattr(drift_campaign, "campaign_rooms", lambda _: [lambda: room])
    drift_campaign.main(["--bumps", "1", "--minutes", "0", "--small", "0", "--seed", "2", "--json"])
    figures = json.loads(capsys.readouterr().out)
    assert (figures["bumps"], figures["found"], figures["quiet_minutes"]) == (1, 1, 0)
