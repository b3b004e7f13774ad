"""The tilt joint: it locks at every whole degree, and no two parts want the same room."""

import math
from itertools import pairwise

import pytest

pytest.importorskip("build123d", reason="the modeller is not installed: make hardware-check")

from build123d import Pos, Rot
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.cameras import BOARDS, C920, PI_CAMERA, PI_HQ_GS, WEBCAMS
from hardware.fasteners import CAMERA, M2, M2_5, M3, M4, M5, nut_pocket, trap_depth_mm, trap_flats_mm
from hardware.mount import bases, cradles, joint
from hardware.mount.assembly import BASES, mount

LIFT_MM = 0.02  # teeth that touch have no room in common, but rounding would find some
TILTS = range(joint.MAX_TILT_DEG + 1)


def common_mm3(first, second) -> float:
    """The volume that two solids share."""
    if not boxes_meet(first, second):
        return 0.0
    shared = first.intersect(second)
    if shared is None:
        return 0.0
    return sum(part.volume for part in (shared if isinstance(shared, list) else [shared]))


def boxes_meet(first, second) -> bool:
    a, b = first.bounding_box(), second.bounding_box()
    return all(low <= high for low, high in zip([*a.min, *b.min], [*b.max, *a.max], strict=True))


@pytest.mark.parametrize("tilt_deg", TILTS)
def test_every_degree_has_its_teeth(tilt_deg: int) -> None:
    """Turned to the figure that the rule names, ring and arm stand on whole teeth on both sides, at every whole degree."""
    ring_deg = joint.ring_turn_deg(tilt_deg)
    low_steps = ring_deg / joint.SIZE.low.step_deg
    high_steps = (-tilt_deg - ring_deg) / joint.SIZE.high.step_deg
    assert low_steps == pytest.approx(round(low_steps), abs=1e-9)
    assert high_steps == pytest.approx(round(high_steps), abs=1e-9)


@pytest.mark.parametrize("tilt_deg", [t for t in TILTS if t > 0])
def test_the_figure_is_the_digit_sum(tilt_deg: int) -> None:
    """The figure to set is the tilt's digit sum, again and again, 9 counting as 0: that is what the page tells people."""
    digits = tilt_deg
    while digits > 9:
        digits = sum(int(digit) for digit in str(digits))
    assert joint.ring_figure(tilt_deg) == digits % 9


def test_a_figure_leaves_one_choice_in_nine_degrees() -> None:
    """Tilts with the same figure are 9 degrees apart, so a scale read to a few degrees leaves no doubt."""
    by_figure: dict[int, list[int]] = {}
    for tilt_deg in TILTS:
        by_figure.setdefault(joint.ring_figure(tilt_deg), []).append(tilt_deg)
    assert set(by_figure) == set(range(9))
    assert all(b - a == 9 for tilts in by_figure.values() for a, b in pairwise(tilts))


@settings(max_examples=3, deadline=None)
@given(tilt_deg=st.integers(0, joint.MAX_TILT_DEG))
def test_teeth_fit_and_hold(tilt_deg: int) -> None:
    """At any whole degree the crowns fit into each other; half a degree beside it they are in each other's way."""
    ring = Pos(0, 0, LIFT_MM) * Rot(0, 0, joint.ring_turn_deg(tilt_deg)) * joint.ring()
    arm = Pos(0, 0, 2 * LIFT_MM) * Rot(0, 0, -tilt_deg) * joint.arm()
    cheek = joint.cheek()
    assert common_mm3(cheek, ring) == pytest.approx(0, abs=1e-6)
    assert common_mm3(ring, arm) == pytest.approx(0, abs=1e-6)
    for turn_deg in (-0.5, 0.5):
        assert common_mm3(ring, Rot(0, 0, turn_deg) * arm) > 10
        assert common_mm3(cheek, Rot(0, 0, turn_deg) * ring) > 10


def test_a_wrong_figure_does_not_go_together() -> None:
    """With the ring one figure off, the arm cannot be pressed home at that tilt."""
    ring = Pos(0, 0, LIFT_MM) * Rot(0, 0, joint.ring_turn_deg(42)) * joint.ring()
    arm = Pos(0, 0, 2 * LIFT_MM) * Rot(0, 0, -41) * joint.arm()
    assert common_mm3(ring, arm) > 10


@pytest.mark.parametrize(
    ("base", "camera", "tilt_deg"),
    [
        ("ceiling", C920, 0),
        ("ceiling", C920, 41),
        ("ceiling", C920, 90),
        ("boom", C920, 90),
        ("shelf", C920, 90),
        ("shelf", PI_HQ_GS, 90),
        ("shelf", PI_CAMERA, 0),
    ],
)
def test_a_mount_put_together_has_room(base: str, camera, tilt_deg: int) -> None:
    """No two bodies of a mount, its camera among them, share any room, from looking straight ahead to straight down."""
    bodies = mount(base, camera, tilt_deg, lift_mm=LIFT_MM)
    # What sits on what: cradle on arm, camera in cradle, jaw on plate; they touch, and rounding may find a film.
    for i, first in enumerate(bodies):
        for second in bodies[i + 1 :]:
            shared = common_mm3(first.shape, second.shape)
            assert shared == pytest.approx(0, abs=1e-3), f"{first.name} and {second.name} share {shared:.2f} mm3"


@pytest.mark.parametrize("base", sorted(BASES))
def test_the_joint_turns_freely_past_the_scale(base: str) -> None:
    """With the knob loosened by a tooth's height, the arm turns through all its range without touching the base."""
    clear_mm = joint.SIZE.low.height_mm + joint.SIZE.high.height_mm
    for tilt_deg in (0, 30, 60, 90):
        arm = Pos(0, 0, clear_mm) * Rot(0, 0, -tilt_deg) * joint.arm()
        assert common_mm3(BASES[base](), arm) == pytest.approx(0, abs=1e-6)


def test_the_pointer_is_above_the_scale_and_below_the_ring() -> None:
    """At home the pointer's fin ends less than a millimetre above the scale, so that it can be read from any side."""
    arm = joint.arm()
    radius = joint.SIZE.disc_radius_mm
    fin = [v.Z for v in arm.vertices() if math.hypot(v.X, v.Y) > radius and v.Y > 20 and abs(v.X) < 5]
    lowest_fin = min(fin)
    assert 0 < lowest_fin - joint.SIZE.cheek_mm < 1


@pytest.mark.parametrize("screw", [M2, M2_5, M3, M4, M5])
def test_screws_pass_and_nuts_cannot_turn(screw) -> None:
    """A hole is wider than its screw and narrower than its nut; a nut goes into its pocket, and not round in it."""
    nominal_mm = float(screw.name[1:])
    assert nominal_mm + 0.3 <= screw.hole_mm <= nominal_mm + 0.6
    assert screw.hole_mm < screw.nut_flats_mm
    flats_mm = trap_flats_mm(screw)
    assert screw.nut_flats_mm < flats_mm < screw.nut_flats_mm * 2 / math.sqrt(3)
    assert trap_depth_mm(screw) > screw.nut_mm


def test_the_camera_thread_is_a_quarter_inch() -> None:
    """The camera screw's hole passes 6.35 mm, and its nut is 7/16 inch across."""
    assert 6.35 + 0.3 <= CAMERA.hole_mm <= 6.35 + 0.6
    assert CAMERA.nut_flats_mm == pytest.approx(7 / 16 * 25.4, abs=0.02)


@pytest.mark.parametrize("tube_mm", [bases.BOOM.tube_min_mm, 25.0, bases.BOOM.tube_max_mm])
def test_the_tube_clamp_grips_its_range(tube_mm: float) -> None:
    """A tube of any promised diameter is held by the flanks of both grooves before the two halves touch, between the bolts."""
    gap_mm = tube_mm * math.sqrt(2) - 2 * bases.BOOM.groove_mm
    assert gap_mm > 0
    assert tube_mm + M5.hole_mm < bases.BOOM.bolt_across_mm
    touch_mm = tube_mm / 2 / math.sqrt(2)
    assert touch_mm <= bases.BOOM.groove_mm


@pytest.mark.parametrize("camera", [*WEBCAMS, *BOARDS], ids=lambda camera: camera.name)
def test_a_cradle_holds_its_camera_and_keeps_its_screws(camera) -> None:
    """Every cradle is one body that leaves room for its camera and for the four nuts of the arm's screws."""
    cradle = cradles.webcam_cradle(camera) if camera in WEBCAMS else cradles.board_cradle(camera)
    assert len(cradle.solids()) == 1
    half = joint.SIZE.plate_screws_mm / 2
    nut = Pos(0, 0, cradles.CRADLE.back_mm + 0.05) * Rot(180, 0, 0)
    for x in (-half, half):
        for y in (-half, half):
            way_in = Pos(x, y, 0) * nut * nut_pocket(M4, M4.nut_mm)
            assert common_mm3(cradle, way_in) == pytest.approx(0, abs=1e-6)
            before = Pos(x, y, cradles.CRADLE.back_mm + 3) * Rot(180, 0, 0) * nut_pocket(M4, 3)
            if camera in WEBCAMS:
                assert common_mm3(cradle, before) == pytest.approx(0, abs=1e-6)
