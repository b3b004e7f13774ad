"""Refining a calibration by the lane's edges, against simulated pictures whose map is known exactly."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.sim.camera import PinholeCamera
from dnb_edge.sim.circuit import LANE_HSV, TWIN_SCALE, Circuit, demo_circuit, demo_twin, edge_line
from dnb_edge.sim.driver import drive
from dnb_edge.sim.renderer import Renderer
from dnb_edge.sim.rig import demo_camera, floor_to_camera_px
from dnb_edge.sim.solids import box, cylinder, draw_mesh, draw_shadow, mesh
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import LaneColour, default_close_gap_px, lane_mask, load_twin
from dnb_edge.view.calibration import Calibration, CalibrationMethod
from dnb_edge.view.homography import calibration_error, fit_ground_map, ideal_pairs
from dnb_edge.view.keypoints import KeypointPairs, load_npy_pairs
from dnb_edge.view.lens import Lens, LensModel
from dnb_edge.view.refine import Refinement, refine
from dnb_edge.view.refine_edges import LaneEdges, lane_edges, strip_mask
from dnb_edge.view.refine_solve import FoundLines, KnownPoints, PlaneToPicture, solve

WIDTH, HEIGHT = 1280, 720


@dataclass(frozen=True)
class Room:
    """The simulated track, its camera and its twin's edges."""

    circuit: Circuit
    camera: PinholeCamera
    renderer: Renderer
    edges: LaneEdges

    def lane_m(self) -> np.ndarray:
        """Points all over the lane, track m."""
        return np.concatenate([edge_line(self.circuit, offset, 0.05) for offset in (-0.13, 0.0, 0.13)])

    def seen(self, points_m: np.ndarray, lens: Lens | None = None) -> np.ndarray:
        """Where the camera sees them."""
        ideal = floor_to_camera_px(self.camera, points_m)
        return ideal if lens is None else lens.to_camera_px(ideal)

    def clicks(self, seed: int, sigma_px: float, *, count: int = 9, lens: Lens | None = None) -> KeypointPairs:
        """Marks on the lane's borders, clicked with noise, on the twin without."""
        random = np.random.default_rng(seed)
        line = self.circuit.centreline
        s = (np.arange(count) + random.uniform(0.1, 0.9, count)) / count * line.length_m
        points = line.at(s) + random.choice([-0.13, 0.13], count)[:, None] * line.normal(s)
        camera = self.seen(points, lens) + random.normal(0.0, sigma_px, (count, 2))
        return KeypointPairs.from_arrays(camera, TWIN_SCALE.to_twin_px(points), source="clicks")

    def errors_mm(self, calibration: Calibration, lens: Lens | None = None) -> np.ndarray:
        """How far off the map is all over the lane."""
        points = self.lane_m()
        return np.linalg.norm(calibration.ground.to_track_m(self.seen(points, lens)) - points, axis=1) * 1000.0


@pytest.fixture(scope="module")
def room() -> Room:
    circuit, camera = demo_circuit(), demo_camera((WIDTH, HEIGHT))
    twin = demo_twin()
    colour = LaneColour(hue_deg=LANE_HSV[0], saturation_percent=LANE_HSV[1], value_percent=LANE_HSV[2])
    mask = lane_mask(twin, colour, source="twin", close_gap_px=default_close_gap_px(twin))
    return Room(circuit, camera, Renderer(circuit, camera, 21), lane_edges(mask, source="twin"))


@pytest.fixture(scope="module")
def picture(room: Room) -> np.ndarray:
    """The empty room."""
    return room.renderer.picture(0, None)


def calibrated(pairs: KeypointPairs, lens: Lens | None = None) -> Calibration:
    ground = fit_ground_map(pairs, TWIN_SCALE, width_px=WIDTH, height_px=HEIGHT, lens=lens)
    error = calibration_error(ideal_pairs(pairs, lens), metres_per_px=TWIN_SCALE.metres_per_px)
    return Calibration(ground=ground, covariance=None, error=error, method=CalibrationMethod.KEYPOINTS)


def refined(room: Room, picture: np.ndarray, pairs: KeypointPairs) -> Refinement:
    return refine(calibrated(pairs), room.edges, picture, pairs=pairs)


# The twin's edges ---------------------------------------------------------------------------------------------------


def ring(size: int = 600, inner: float = 150.0, outer: float = 210.0) -> np.ndarray:
    v, u = np.mgrid[0:size, 0:size]
    radius = np.hypot(u - 300.0, v - 300.0)
    return (radius >= inner) & (radius <= outer)


def test_edges_lie_between_the_pixels_of_lane_and_floor():
    """Both borders of a ring are found to half a pixel, their normals point away from the lane within 15 degrees."""
    edges = lane_edges(ring(), source="ring")
    away = edges.points_px - 300.0
    radius = np.linalg.norm(away, axis=1)
    outside = radius > 180.0
    assert outside.any()
    assert (~outside).any()
    assert radius == pytest.approx(np.where(outside, 210.0, 150.0), abs=0.55)
    assert ((away / radius[:, None]) * edges.outward).sum(axis=1) == pytest.approx(
        np.where(outside, 1.0, -1.0), abs=0.04
    )
    assert edges.width_px == pytest.approx(60.0, rel=0.03)


def test_corners_are_no_edges():
    """A square's corners are left out: nothing there says where an edge runs."""
    mask = np.zeros((500, 500), dtype=bool)
    mask[100:400, 100:400] = True
    mask[170:330, 170:330] = False
    edges = lane_edges(mask, source="square")
    corners = np.array([[100, 100], [100, 400], [400, 100], [400, 400]]) - 0.5
    away = np.linalg.norm(edges.points_px[:, None] - corners[None], axis=2).min()
    assert 2.0 < away < 25.0


def test_a_track_without_its_picture_gives_the_same_lane(room):
    """The strip between a track's edges covers what the twin shows as lane."""
    left, right = (edge_line(room.circuit, offset, 0.02) for offset in (0.13, -0.13))
    strip = strip_mask(left, right, TWIN_SCALE, closed=True)
    shown = room.edges.mask[:, : strip.shape[1]]
    assert strip.shape[0] == room.edges.mask.shape[0]
    assert (strip & shown).sum() / (strip | shown).sum() > 0.96


def test_a_twin_without_lane_is_refused():
    with pytest.raises(InputError, match="hardly an edge"):
        lane_edges(np.zeros((100, 100), dtype=bool), source="twin.png")


# The fit ------------------------------------------------------------------------------------------------------------


def test_exact_edges_give_the_exact_map_whatever_a_few_of_them_say(room):
    """From a map some 8 px off, edges of which a fifth are wild bring it back to a hundredth of a pixel."""
    truth = calibrated(room.clicks(1, 0.0)).ground
    start = calibrated(room.clicks(1, 6.0)).ground
    twin = room.edges.points_px
    plane = PlaneToPicture.about(truth, twin)
    exact, first = (plane.parameters(ground.camera_to_twin) for ground in (truth, start))
    random = np.random.default_rng(3)
    angle = random.uniform(0.0, 2.0 * np.pi, len(twin))
    across = np.column_stack((np.cos(angle), np.sin(angle)))
    on = plane.project(exact, twin) + np.where(random.uniform(size=len(twin)) < 0.2, 25.0, 0.0)[:, None] * across
    lines = FoundLines(twin_px=twin, on_px=on, outward=across, slot=room.edges.slot)
    nothing = KnownPoints(
        twin_px=twin[:4], camera_px=plane.project(first, twin[:4]), sigma_px=1e4, at=first, information=np.zeros((8, 8))
    )
    assert np.abs(plane.project(first, twin) - plane.project(exact, twin)).max() > 3.0
    found = solve(plane, first, nothing, lines)
    assert plane.project(found.p, twin) == pytest.approx(plane.project(exact, twin), abs=0.05)


def test_parameters_and_homography_are_two_forms_of_one_map(room):
    ground = calibrated(room.clicks(1, 0.0)).ground
    plane = PlaneToPicture.about(ground, room.edges.points_px)
    back = plane.camera_to_twin(plane.parameters(ground.camera_to_twin))
    assert back.ravel() == pytest.approx(np.array(ground.camera_to_twin), rel=1e-9)


# Refining -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "sigma_px"), [(1, 1.5), (2, 1.5), (3, 6.0), (4, 6.0)])
def test_a_clicked_map_gets_better(room, picture, seed, sigma_px):
    """Careful or careless clicks: the ground error shrinks, stays within the stated sigma, and the advice is to take it."""
    pairs = room.clicks(seed, sigma_px)
    before = calibrated(pairs)
    result = refined(room, picture, pairs)
    was, now = room.errors_mm(before), room.errors_mm(result.calibration)
    assert np.quantile(now, 0.95) < min(10.0, 0.7 * np.quantile(was, 0.95))
    assert result.better
    assert result.after.overlap > max(0.96, result.before.overlap)
    assert result.after.edge_share >= result.before.edge_share
    points = room.lane_m()
    sigma_mm = result.calibration.sigma_m(room.seen(points)) * 1000.0
    assert (now < 4.0 * sigma_mm).all()
    assert result.calibration.method is CalibrationMethod.REFINED
    assert any("still differ" in note for note in result.calibration.notes)


def test_the_lens_a_car_legs_and_shadows_are_borne(room):
    """Through a lens that bends by 20 px, with a tenth of the lane hidden and a shadow over it, the map gets better."""
    focal = float(room.camera.matrix[0, 0])
    lens = Lens(
        model=LensModel.PINHOLE, fx_px=focal, fy_px=focal, cx_px=639.5, cy_px=359.5,
        distortion=(-0.22, 0.06, 0.001, -0.0005, 0.0), width_px=WIDTH, height_px=HEIGHT,
    )  # fmt: skip
    pose = drive(room.circuit, laps=1, seed=3).pose(4.0)
    picture = bent(shaded(with_legs(room, room.renderer.picture(1, pose))), lens)
    pairs = room.clicks(5, 4.0, lens=lens)
    before = calibrated(pairs, lens)
    result = refine(before, room.edges, picture, pairs=pairs)
    was, now = room.errors_mm(before, lens), room.errors_mm(result.calibration, lens)
    assert np.quantile(now, 0.95) < min(8.0, 0.7 * np.quantile(was, 0.95))
    assert result.better
    assert result.calibration.ground.lens == lens


def test_the_lane_may_have_any_colour(room, picture):
    """The lane's look is learnt from the picture: its negative refines as well."""
    result = refined(room, 255 - picture, room.clicks(3, 6.0))
    assert np.quantile(room.errors_mm(result.calibration), 0.95) < 10.0


def test_a_picture_of_another_size_refines_the_calibration_for_its_own(room, picture):
    """Half the size is converted, and the result is for the size that was given."""
    pairs = room.clicks(3, 6.0)
    result = refined(room, cv2.resize(picture, (640, 360), interpolation=cv2.INTER_AREA), pairs)
    assert (result.calibration.ground.width_px, result.calibration.ground.height_px) == (WIDTH, HEIGHT)
    assert np.quantile(room.errors_mm(result.calibration), 0.95) < 8.0


def test_four_keypoints_and_no_keypoints(room, picture):
    """Four cannot be left out one by one; with none the given map's covariance holds, and without that nothing does."""
    pairs = room.clicks(2, 3.0, count=4)
    result = refined(room, picture, pairs)
    assert result.after.left_out_px is None
    assert np.quantile(room.errors_mm(result.calibration), 0.95) < 8.0
    again = refine(replace(result.calibration, method=CalibrationMethod.MARKERS), room.edges, picture)
    assert again.after.keypoints_px is None
    assert again.tension < 3.0
    assert np.quantile(room.errors_mm(again.calibration), 0.95) < 8.0
    with pytest.raises(InputError, match="how far off it may be"):
        refine(calibrated(pairs), room.edges, picture)


@pytest.mark.parametrize(
    "moved", [np.float32([[1, 0, 6], [0, 1, 3]]), cv2.getRotationMatrix2D((640, 360), 2.0, 1.0).astype(np.float32)]
)
def test_a_camera_that_was_moved_is_told(room, picture, moved):
    """Where edges and clicks contradict each other by more than their sigmas, the present map is kept."""
    result = refined(
        room, cv2.warpAffine(picture, moved, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REFLECT), room.clicks(1, 1.5)
    )
    assert result.tension > 3.0
    assert not result.better
    assert "contradict" in result.reason


def test_a_twin_that_is_drawn_wrongly_is_told(room, picture):
    """A quarter of the track drawn 30 mm off: the contradiction is seen, and clicks keep the map from following it."""
    mask = room.edges.mask.copy()
    mask[:, 850:] = np.roll(room.edges.mask[:, 850:], 12, axis=1)
    pairs = room.clicks(1, 1.5)
    result = refine(calibrated(pairs), lane_edges(mask, source="twin"), picture, pairs=pairs)
    assert not result.better
    assert np.quantile(room.errors_mm(result.calibration), 0.95) < 25.0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda p: np.roll(p, 45, axis=1), "not within 12 px"),
        (lambda p: np.full_like(p, 128), "cannot be told from the floor"),
        (np.zeros_like, "cannot be told from the floor"),
        (lambda p: p[:, ::-1].copy(), "not within|cannot be told"),
        (lambda p: cv2.resize(p, (960, 720)), "aspect ratio"),
    ],
    ids=["moved far", "grey", "black", "mirrored", "4:3"],
)
def test_a_picture_of_something_else_is_refused(room, picture, change, says):
    """One line that names the picture or what is wrong with it, and no map."""
    with pytest.raises(InputError, match=says) as caught:
        refined(room, change(picture), room.clicks(1, 1.5))
    assert "\n" not in str(caught.value)


def test_the_papers_photograph(real_dir):
    """Nine poor keypoints, a twin that is not quite true: overlap grows a lot, left-out keypoints do not get worse."""
    folder = real_dir / "drivenetbench"
    pairs = load_npy_pairs(folder / "keypoints_from_camera.npy", folder / "keypoints_from_diagram.npy")
    twin = load_twin(folder / "digital-twin.jpg")
    colour = LaneColour(hue_deg=330.0, saturation_percent=23.0, value_percent=84.0)
    mask = lane_mask(twin, colour, source="twin", close_gap_px=default_close_gap_px(twin))
    scale = TwinScale(metres_per_px=0.0015, height_px=float(twin.shape[0]))
    ground = fit_ground_map(pairs, scale, width_px=3840, height_px=2160)
    given = Calibration(
        ground=ground, covariance=None, error=calibration_error(pairs), method=CalibrationMethod.KEYPOINTS
    )
    photo = cv2.resize(cv2.imread(str(folder / "photo.jpg")), (1920, 1080), interpolation=cv2.INTER_AREA)
    result = refine(given, lane_edges(mask, source="twin"), photo, pairs=pairs)
    assert result.before.left_out_px.mean() == pytest.approx(57.96, abs=0.01)
    assert result.before.keypoints_px.mean() == pytest.approx(26.69, abs=0.01)
    assert result.after.left_out_px.mean() < 50.0
    assert result.after.overlap > result.before.overlap + 0.1
    assert result.better


def with_legs(room: Room, picture: np.ndarray) -> np.ndarray:
    """Somebody stands on the lane."""
    x, y = room.circuit.centreline.at(np.array([2.6]))[0]
    trousers, shoe = (90.0, 60.0, 40.0), (200.0, 200.0, 210.0)
    person = mesh([
        cylinder((x - 0.1, y, 0.45), 0.07, 0.9, 2, trousers), box((x - 0.1, y - 0.05, 0.04), (0.1, 0.26, 0.08), shoe),
        cylinder((x + 0.15, y + 0.1, 0.45), 0.07, 0.9, 2, trousers), box((x + 0.15, y + 0.05, 0.04), (0.1, 0.26, 0.08), shoe),
    ])  # fmt: skip
    shadow = np.zeros(picture.shape[:2], dtype=np.uint8)
    draw_shadow(shadow, person, room.camera, offset_px=(0.0, 0.0), scale=1.0)
    darker = (picture * (1.0 - 0.5 * cv2.GaussianBlur(shadow, (0, 0), 6)[..., None] / 255.0)).astype(np.uint8)
    draw_mesh(darker, person, room.camera, offset_px=(0.0, 0.0), scale=1.0)
    return darker


def shaded(picture: np.ndarray) -> np.ndarray:
    """A broad shadow across everything."""
    mask = np.zeros(picture.shape[:2], dtype=np.float32)
    cv2.fillPoly(mask, [np.array([[300, 0], [620, 0], [900, 720], [500, 720]])], 1.0)
    return (picture * (1.0 - 0.5 * cv2.GaussianBlur(mask, (0, 0), 4)[..., None])).astype(np.uint8)


def bent(picture: np.ndarray, lens: Lens) -> np.ndarray:
    """As the lens would have shown it."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    ideal = lens.to_ideal_px(np.column_stack((u.ravel(), v.ravel())).astype(np.float64)).reshape(HEIGHT, WIDTH, 2)
    at = ideal.astype(np.float32)
    return cv2.remap(picture, at[..., 0], at[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
