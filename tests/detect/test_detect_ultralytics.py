"""Users' Ultralytics models without Ultralytics: layouts, boxes, settings, and what is refused."""

import math

import cv2
import numpy as np
import onnx
import pytest
from ultralytics_graph import NAMES, metadata, write_constant

from dnb_edge.detect.onnx import open_model
from dnb_edge.detect.ultralytics import UltralyticsDetector, UltralyticsSettings
from dnb_edge.detect.ultralytics_decode import gaussian_overlap, letterbox, prepare
from dnb_edge.detect.ultralytics_file import read_layout
from dnb_edge.errors import InputError, WorkError
from dnb_edge.values import SearchWindow

FRAME = np.full((192, 256, 3), 90, np.uint8)
"""Twice the networks' input of 128 x 96: no grey, scale 1/2."""

# u, v, width, height, confidence, class, angle: in the network's input
STRONG = (30.0, 40.0, 20.0, 10.0, 0.9, 0, 0.5)
DOUBLE = (31.0, 40.0, 20.0, 10.0, 0.8, 0, 0.5)
OTHER_CLASS = (31.0, 40.0, 20.0, 10.0, 0.7, 1, 0.5)
APART = (90.0, 60.0, 12.0, 24.0, 0.6, 2, -0.3)
WEAK = (90.0, 20.0, 12.0, 24.0, 0.2, 0, 0.0)
ROWS = (WEAK, DOUBLE, STRONG, APART, OTHER_CLASS)


def _candidates(rows, *, rotated: bool) -> np.ndarray:
    """(1, 4 + classes (+ 1), n), as without NMS."""
    columns = []
    for u, v, width, height, confidence, number, angle in rows:
        scores = [0.01] * len(NAMES)
        scores[number] = confidence
        columns.append([u, v, width, height, *scores, *([angle] if rotated else [])])
    return np.array(columns, np.float32).T[None]


def _listed(rows, *, rotated: bool) -> np.ndarray:
    """(1, n, 6 or 7), as with NMS inside, with rows of noughts at the end."""
    out = []
    for u, v, width, height, confidence, number, angle in rows:
        corners = [u - width / 2, v - height / 2, u + width / 2, v + height / 2]
        out.append([u, v, width, height, confidence, number, angle] if rotated else [*corners, confidence, number])
    out.append([0.0] * len(out[0]))
    return np.array(out, np.float32)[None]


def _detector(tmp_path, task="detect", *, nms=False, rows=ROWS, settings=None, told=None) -> UltralyticsDetector:
    answer = (_listed if nms else _candidates)(rows, rotated=task == "obb")
    path = write_constant(tmp_path / "m.onnx", answer, told or metadata(task=task, nms=nms))
    return UltralyticsDetector(open_model(path), settings)


def _look(detector, frame=FRAME, windows=()):
    return detector.detect(frame, sequence=3, t_ns=7, windows=windows)


@pytest.mark.parametrize("nms", [False, True])
@pytest.mark.parametrize("task", ["detect", "obb"])
def test_each_layout_gives_the_same_boxes(tmp_path, task, nms):
    """Detect and OBB, with and without NMS inside: the sure boxes of each class once, strongest first, in frame pixels."""
    rows = (STRONG, OTHER_CLASS, APART, WEAK) if nms else ROWS
    boxes = _detector(tmp_path, task, nms=nms, rows=rows).boxes(FRAME)
    assert boxes.classes.tolist() == [0, 1, 2]
    assert boxes.confidences == pytest.approx([0.9, 0.7, 0.6])
    assert boxes.centres_px == pytest.approx(np.array([[60, 80], [62, 80], [180, 120]]), abs=1e-4)
    assert boxes.sizes_px == pytest.approx(np.array([[40, 20], [40, 20], [24, 48]]), abs=1e-4)
    if task == "obb":
        assert boxes.angles_rad == pytest.approx([0.5, 0.5, -0.3])
    else:
        assert boxes.angles_rad is None


@pytest.mark.parametrize("key", ["end2end", "nms"])
def test_an_end_to_end_head_is_nms_inside_too(tmp_path, key):
    """YOLO26's own end-to-end head and `nms=True` are told apart by metadata and read alike."""
    told = metadata(end2end=True) if key == "end2end" else metadata(nms=True)
    detector = _detector(tmp_path, nms=True, rows=(STRONG,), told=told)
    assert detector.layout.nms_inside
    assert len(_look(detector).detections) == 1


def test_metadata_from_before_nms_could_be_inside_is_enough(tmp_path):
    """Exports of 2023 have neither `args` nor `end2end`: their answers are plain candidates."""
    detector = _detector(tmp_path, told=metadata(args=None, end2end=None))
    assert not detector.layout.nms_inside
    assert len(_look(detector).detections) == 3


def test_a_detection_says_where_the_car_is_in_camera_px(tmp_path):
    """The ground point: the box's centre less half a pixel as camera px count from pixel centres; length is its long side."""
    detections = _look(_detector(tmp_path)).detections
    assert detections[0].camera_px == pytest.approx((59.5, 79.5), abs=1e-4)
    assert [one.length_px for one in detections] == pytest.approx([40, 40, 48])
    assert detections[0].sigma_px == pytest.approx(0.05 * 40)
    assert detections[0].heading_rad is None


@pytest.mark.parametrize(
    ("task", "row", "shift_ratio", "down_px"),
    [
        ("detect", STRONG, 0.0, 0.0),
        ("detect", STRONG, 0.5, 10.0),
        ("detect", STRONG, -0.25, -5.0),
        ("detect", APART, 0.5, 24.0),
        ("obb", (40.0, 40.0, 20.0, 10.0, 0.9, 0, 0.0), 0.5, 10.0),
        ("obb", (40.0, 40.0, 20.0, 10.0, 0.9, 0, math.pi / 2), 0.5, 20.0),
    ],
)
def test_shift_ratio_moves_the_ground_point_down_the_box(tmp_path, task, row, shift_ratio, down_px):
    """The ground point lies `shift_ratio` box heights below the centre; a rotated box counts with its height in the picture."""
    settings = UltralyticsSettings(shift_ratio=shift_ratio)
    (one,) = _look(_detector(tmp_path, task, rows=(row,), settings=settings)).detections
    assert one.camera_px == pytest.approx((2 * row[0] - 0.5, 2 * row[1] - 0.5 + down_px), abs=1e-3)


@pytest.mark.parametrize(
    ("settings", "confidences"),
    [
        (UltralyticsSettings(min_confidence=0.1), [0.9, 0.7, 0.6, 0.2]),
        (UltralyticsSettings(min_confidence=0.65), [0.9, 0.7]),
        (UltralyticsSettings(iou=0.95), [0.9, 0.8, 0.7, 0.6]),
        (UltralyticsSettings(classes=("car",)), [0.9]),
        (UltralyticsSettings(classes=(0, "person")), [0.9, 0.6]),
        (UltralyticsSettings(classes=(1,)), [0.7]),
        (UltralyticsSettings(classes=()), []),
        (UltralyticsSettings(most_detections=2), [0.9, 0.7]),
    ],
)
def test_settings_choose_among_the_boxes(tmp_path, settings, confidences):
    """Confidence, overlap, classes by name or number, and the greatest number of boxes."""
    found = _look(_detector(tmp_path, settings=settings)).detections
    assert [one.confidence for one in found] == pytest.approx(confidences)


def test_windows_change_nothing(tmp_path):
    """Such a model always looks at the whole frame, says so, and carries the frame's number and stamp."""
    detector = _detector(tmp_path)
    window = SearchWindow(target_id=1, camera_px=(180.0, 120.0), length_px=40.0)
    assert _look(detector, windows=(window,)) == _look(detector)
    seen = _look(detector)
    assert (seen.full_frame, seen.sequence, seen.t_ns) == (True, 3, 7)


def test_boxes_that_cannot_be_cars_are_left_out(tmp_path):
    """A box outside the picture, one without area and one that is not a number make no detection."""
    rows = (
        (-30.0, 40.0, 20.0, 10.0, 0.9, 0, 0.0),
        (30.0, 40.0, 0.0, 0.0, 0.8, 0, 0.0),
        (float("nan"), 40.0, 20.0, 10.0, 0.95, 0, 0.0),
        (30.0, 70.0, 20.0, float("nan"), 0.7, 0, 0.0),
        APART,
    )
    for task in ("detect", "obb"):
        assert [one.confidence for one in _look(_detector(tmp_path, task, rows=rows)).detections] == pytest.approx(
            [0.6]
        )


def test_an_upright_box_ends_at_the_edge(tmp_path):
    """A car half out of the picture has the centre of the part that is seen, as Ultralytics says it."""
    (one,) = _look(_detector(tmp_path, rows=((2.0, 40.0, 20.0, 10.0, 0.9, 0, 0.0),))).detections
    assert one.camera_px == pytest.approx((11.5, 79.5))
    assert one.length_px == pytest.approx(24.0)


def test_a_rotated_box_gets_its_heading_from_movement(tmp_path):
    """The axis is the long side's, v down made v up; which end is the front is known once the car has moved."""
    angle = math.radians(30)  # towards v: down to the right
    first = _detector(tmp_path, "obb", rows=((30.0, 40.0, 20.0, 10.0, 0.9, 0, angle),))
    assert _look(first).detections[0].heading_rad is None
    step = FRAME.shape[1] / 256 * 10
    moved = np.roll(FRAME, 1, axis=1)
    second = _detector(
        tmp_path,
        "obb",
        # the same box, described by its other side
        rows=((30.0 + step * math.cos(angle), 40.0 + step * math.sin(angle), 10.0, 20.0, 0.9, 0, angle - math.pi / 2),),
    )
    first._model = second._model
    assert _look(first, moved).detections[0].heading_rad == pytest.approx(-angle, abs=1e-5)


@pytest.mark.parametrize(
    ("frame", "size", "dynamic", "expected"),
    [
        # resized width and height, left, top, input width and height
        ((256, 192), (96, 128), False, (128, 96, 0, 0, 128, 96)),
        ((1280, 720), (640, 640), False, (640, 360, 0, 140, 640, 640)),
        ((1280, 720), (640, 640), True, (640, 360, 0, 12, 640, 384)),
        ((720, 1280), (640, 640), True, (360, 640, 12, 0, 384, 640)),
        ((411, 203), (320, 320), False, (320, 158, 0, 81, 320, 320)),
        ((411, 204), (320, 320), False, (320, 159, 0, 80, 320, 320)),  # 80 above and 81 below
        ((3000, 1), (320, 320), False, (320, 1, 0, 159, 320, 320)),
    ],
)
def test_the_frame_lies_in_the_middle_of_the_input(tmp_path, frame, size, dynamic, expected):
    """Even shrinking; grey on both sides, an odd row of it below or right; cut to the stride where the input is dynamic."""
    side = ("height", "width") if dynamic else size
    path = write_constant(tmp_path / "m.onnx", _candidates(ROWS, rotated=False), metadata(size=size), side=side)
    layout = read_layout(open_model(path))
    assert layout.dynamic == dynamic
    box = letterbox(layout, *frame)
    found = (
        box.resized_width_px,
        box.resized_height_px,
        box.left_px,
        box.top_px,
        box.input_width_px,
        box.input_height_px,
    )
    assert found == expected


def test_the_input_is_red_green_blue_from_nought_to_one_with_grey_round_it(tmp_path):
    """Channels are turned round, levels divided by 255, and the edge is 114 grey."""
    path = write_constant(tmp_path / "m.onnx", _candidates(ROWS, rotated=False), metadata(size=(64, 64)), side=(64, 64))
    picture = np.full((16, 32, 3), (51, 102, 255), np.uint8)
    tensor = prepare(picture, letterbox(read_layout(open_model(path)), 32, 16), np.dtype(np.float32))
    assert tensor.shape == (1, 3, 64, 64)
    assert tensor[0, :, 32, 32] == pytest.approx([1.0, 0.4, 0.2])
    assert tensor[0, :, 15, 32] == pytest.approx([114 / 255] * 3)
    assert tensor[0, :, 16, 0] == pytest.approx([1.0, 0.4, 0.2])


def test_overlap_of_rotated_boxes():
    """1 for a box and itself, the same both ways, less with distance and with a turn, nothing far away."""
    spread = np.array([[400 / 12, 100 / 12, 0]], np.float32)
    turned = np.array([[100 / 12, 400 / 12, 0]], np.float32)
    here, near, far = (np.array([[u, 0]], np.float32) for u in (0, 5, 300))
    same = gaussian_overlap(here, spread, here, spread).item()
    apart = gaussian_overlap(here, spread, near, spread).item()
    assert same == pytest.approx(1.0, abs=1e-3)
    assert apart == pytest.approx(gaussian_overlap(near, spread, here, spread).item())
    assert same > apart > gaussian_overlap(here, spread, far, spread).item() == pytest.approx(0.0, abs=1e-3)
    assert gaussian_overlap(here, spread, here, turned).item() < 0.8
    slanted = np.array([[20.0, 20.0, 15.0]], np.float32)  # long from top left to bottom right
    along, across = np.array([[4, 4]], np.float32), np.array([[4, -4]], np.float32)
    assert (
        gaussian_overlap(here, slanted, along, slanted).item()
        > 0.2 + gaussian_overlap(here, slanted, across, slanted).item()
    )


@pytest.mark.parametrize("kind", [onnx.TensorProto.FLOAT, onnx.TensorProto.FLOAT16])
def test_half_precision_inputs_are_fed_so(tmp_path, kind):
    """An export with 16-bit inputs is used like any other."""
    path = write_constant(tmp_path / "m.onnx", _candidates(ROWS, rotated=False), metadata(), kind=kind)
    assert len(_look(UltralyticsDetector(open_model(path))).detections) == 3


GOOD = _candidates(ROWS, rotated=False)


@pytest.mark.parametrize(
    ("told", "answer", "kinds", "message"),
    [
        ({"author": None, "description": None}, GOOD, {}, "does not say that Ultralytics exported it"),
        ({"task": None}, GOOD, {}, "metadata 'task' is missing; export it again"),
        ({"task": "segment"}, GOOD, {}, "task 'segment' gives no boxes of cars; use one for detect or obb"),
        ({"task": "pose"}, GOOD, {}, "task 'pose'"),
        ({"task": "classify"}, GOOD, {}, "task 'classify'"),
        ({"names": None}, GOOD, {}, "metadata 'names' is missing"),
        ({"names": "{0: 'car', 2: 'cone'}"}, GOOD, {}, "'names' does not name classes 0, 1, 2"),
        ({"names": "{"}, GOOD, {}, "'names' cannot be understood"),
        ({"names": "[" * 3000}, GOOD, {}, "'names' cannot be understood"),
        ({"imgsz": None}, GOOD, {}, "metadata 'imgsz' is missing"),
        ({"imgsz": "[96]"}, GOOD, {}, r"'imgsz' is \[96\], not a height and a width"),
        ({"imgsz": "[640, 640]"}, GOOD, {}, r"input is \[96, 128\], its metadata 'imgsz' says \[640, 640\]"),
        ({"stride": None}, GOOD, {}, "metadata 'stride' is missing"),
        ({"stride": "0"}, GOOD, {}, "'stride' is 0"),
        (
            {"names": "['car']"},
            GOOD,
            {},
            r"output is \(1, 7, 5\).* \(detect, 1 classes, without NMS\) means \(1, 5, n\)",
        ),
        ({"task": "obb"}, GOOD, {}, r"means \(1, 8, n\)"),
        ({"end2end": True}, GOOD, {}, r"with NMS\) means \(1, n, 6\)"),
        ({}, GOOD[0], {}, r"output is \(7, 5\)"),
        ({}, GOOD, {"batch": 4}, "batches of 4 pictures; export it again .* batch=1"),
        ({}, GOOD, {"channels": 1}, "pictures of 1 channels"),
        ({}, GOOD, {"kind": onnx.TensorProto.UINT8}, r"input is of tensor\(uint8\)"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(tmp_path, told, answer, kinds, message):
    """Other heads, missing or odd metadata and wrong shapes: one line with the file's name and what to do."""
    path = write_constant(tmp_path / "bad.onnx", answer, metadata(**told), **kinds)
    with pytest.raises(InputError, match=message) as caught:
        UltralyticsDetector(open_model(path))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_class_that_the_model_does_not_know_is_refused(tmp_path):
    """The message names the key, the class and what the model knows."""
    for wanted in ("lorry", 3):
        with pytest.raises(InputError, match=rf"detector\.classes: {wanted!r} is no class.*knows car, cone, person"):
            _detector(tmp_path, settings=UltralyticsSettings(classes=("car", wanted)))


@pytest.mark.parametrize(
    "bad", [{"min_confidence": 1.5}, {"iou": -0.1}, {"sigma_ratio": 0.0}, {"shift_ratio": float("nan")}]
)
def test_settings_out_of_range_are_refused(bad):
    """A value that makes no sense is a ValueError that names its key."""
    with pytest.raises(ValueError, match=f"detector.{next(iter(bad))}"):
        UltralyticsSettings(**bad)


def test_a_network_that_fails_says_so(tmp_path):
    """A fault in the middle of a run is a WorkError of one line."""
    detector = _detector(tmp_path)
    with pytest.raises(WorkError, match=r"m\.onnx: the network failed on an input of shape \(1, 3, 32, 32\)"):
        detector._model.run(np.zeros((1, 3, 32, 32), np.float32))


def test_many_candidates_are_sorted_out_like_few(tmp_path):
    """Thousands of rotated candidates, more than fit one block of the comparison, leave one of each heap."""
    rng = np.random.default_rng(5)
    heaps = [(20.0 + 30 * i, 20.0 + 25 * j) for i in range(4) for j in range(3)]
    rows = []
    for u, v in heaps:
        rows += [(u + du, v + dv, 12.0, 6.0, 0.5 + 0.4 * sure, 0, 0.3) for du, dv, sure in rng.random((100, 3))]
    found = _look(_detector(tmp_path, "obb", rows=rows, settings=UltralyticsSettings(iou=0.2))).detections
    assert len(found) == len(heaps)
    for u, v in heaps:
        best = max((row for row in rows if abs(row[0] - u) <= 1 and abs(row[1] - v) <= 1), key=lambda row: row[4])
        assert min(math.dist(one.camera_px, (2 * best[0] - 0.5, 2 * best[1] - 0.5)) for one in found) < 1e-3


def test_a_frame_of_another_shape_is_shrunk_evenly(tmp_path):
    """Boxes come back to where they were in a frame that needs grey at its sides."""
    frame = cv2.resize(FRAME, (480, 640))
    box = letterbox(_detector(tmp_path).layout, 480, 640)
    assert box.left_px == 28
    (one, *_) = _look(_detector(tmp_path, rows=((64.0, 48.0, 20.0, 10.0, 0.9, 0, 0.0),)), frame).detections
    assert one.camera_px == pytest.approx((239.5, 319.5), abs=1e-3)
