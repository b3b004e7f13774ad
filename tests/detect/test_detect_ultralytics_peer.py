"""Our reading of exported models against Ultralytics itself, on random and drawn pictures; see the extra `ultralytics`."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from ultralytics_peer import SETTINGS

from dnb_edge.detect.onnx import open_model
from dnb_edge.detect.ultralytics import UltralyticsDetector, UltralyticsSettings

MISSING = [
    name for name in ("torch", "torchvision", "ultralytics", "onnxslim") if importlib.util.find_spec(name) is None
]
pytestmark = pytest.mark.skipif(
    bool(MISSING), reason=f"needs the extra 'ultralytics' ({', '.join(MISSING)} not installed)"
)

PLAIN, NMS, ONE_TO_ONE = {}, {"nms": True}, {"nms": False}
VARIANTS = {
    "yolov8n": {"plain": PLAIN, "nms": NMS},
    "yolo11n": {"plain": PLAIN, "nms": NMS, "dynamic": {"dynamic": True}, "oblong": {"imgsz": [192, 320]}},
    "yolo26n": {"plain": PLAIN, "nms": NMS, "one_to_one": ONE_TO_ONE},
    "yolov8n-obb": {"plain": PLAIN, "nms": NMS},
    "yolo11n-obb": {"plain": PLAIN, "nms": NMS},
    "yolo26n-obb": {"plain": PLAIN, "nms": NMS, "one_to_one": ONE_TO_ONE},
}
"""`plain` leaves NMS to us, `nms` puts it into the graph, `one_to_one` is YOLO26's own head without NMS."""


def _pictures() -> dict[str, np.ndarray]:
    """Random pictures of three shapes, and one of rectangles and discs on a plain floor."""
    rng = np.random.default_rng(1)
    pictures = {}
    for number, (height, width) in enumerate([(240, 320), (203, 411), (720, 1280)]):
        grid = (320, round(320 * height / width))  # all are as rough as one another once the network sees them
        blobs = cv2.resize(rng.uniform(0, 255, (9, 16, 3)), grid, interpolation=cv2.INTER_LINEAR)
        noisy = np.clip(blobs + rng.normal(0, 25, blobs.shape), 0, 255).astype(np.uint8)
        pictures[f"random{number}"] = cv2.resize(noisy, (width, height), interpolation=cv2.INTER_LINEAR)
    drawn = np.full((600, 800, 3), (150, 155, 160), np.uint8)
    for _ in range(30):
        colour = rng.uniform(0, 255, 3).tolist()
        u, v, width, height = rng.integers(20, 500, 4).tolist()
        cv2.rectangle(drawn, (u, v), (u + width // 4, v + height // 4), colour, -1)
        cv2.circle(drawn, (v + 100, u), width // 10, colour[::-1], -1)
    return pictures | {"drawn": drawn}


@pytest.fixture(scope="module", params=VARIANTS)
def exported(request, tmp_path_factory) -> Path:
    """A folder with the variants of one model and what Ultralytics finds with them."""
    folder = tmp_path_factory.mktemp(request.param)
    np.savez(folder / "pictures.npz", **_pictures())
    script = Path(__file__).with_name("ultralytics_peer.py")
    command = [sys.executable, str(script), f"{request.param}.yaml", str(folder), json.dumps(VARIANTS[request.param])]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return folder


def _rows(detector: UltralyticsDetector, picture: np.ndarray) -> np.ndarray:
    """What we find, as Ultralytics writes it: see `ultralytics_peer`."""
    found = detector.boxes(picture)
    low, high = found.centres_px - found.sizes_px / 2, found.centres_px + found.sizes_px / 2
    where = [low, high] if found.angles_rad is None else [found.centres_px, found.sizes_px, found.angles_rad[:, None]]
    return np.concatenate([*where, found.confidences[:, None], found.classes[:, None]], axis=1)


def _worst(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, float]:
    """Largest difference in px and in confidence between the rows and their nearest of the same class, both ways."""
    px = np.abs(ours[:, None, :4] - theirs[None, :, :4]).max(axis=2)
    other_class = ours[:, None, -1] != theirs[None, :, -1]
    confidence = np.abs(ours[:, None, -2] - theirs[None, :, -2])
    apart = px + 100 * confidence + np.where(other_class, np.inf, 0.0)
    pairs = [(np.arange(len(ours)), apart.argmin(axis=1)), (apart.argmin(axis=0), np.arange(len(theirs)))]
    assert np.isfinite(apart.min(axis=1)).all()
    assert np.isfinite(apart.min(axis=0)).all()
    return max(float(px[pair].max()) for pair in pairs), max(float(confidence[pair].max()) for pair in pairs)


def test_ultralytics_finds_the_same(exported):
    """Every box of Ultralytics within 1 px and 0.01 confidence, and no other, for all variants, pictures and settings."""
    pictures = dict(np.load(exported / "pictures.npz"))
    compared = 0
    for path in sorted(exported.glob("*.onnx")):
        model, said = open_model(path), np.load(path.with_suffix(".npz"))
        for name, picture in pictures.items():
            for number, how in enumerate(SETTINGS):
                classes = tuple(how["classes"]) if "classes" in how else None
                settings = UltralyticsSettings(min_confidence=how["conf"], iou=how["iou"], classes=classes)
                ours, theirs = _rows(UltralyticsDetector(model, settings), picture), said[f"{name}_{number}"]
                what = f"{path.stem}, {name}, {how}"
                assert ours.shape == theirs.shape, what
                if len(theirs):
                    worst_px, worst_confidence = _worst(ours, theirs)
                    assert worst_px < 1.0, what
                    assert worst_confidence < 0.01, what
                compared += len(theirs)
    assert compared > 1000, "too few boxes to say anything"


def test_a_detection_is_the_middle_of_ultralytics_box(exported):
    """The whole detector, not its boxes alone: as many cars, with their middles where Ultralytics has them."""
    picture = np.load(exported / "pictures.npz")["drawn"]
    detector = UltralyticsDetector(open_model(exported / "plain.onnx"))
    theirs = np.load(exported / "plain.npz")["drawn_0"]
    middles = theirs[:, :2] if theirs.shape[1] == 7 else (theirs[:, :2] + theirs[:, 2:4]) / 2
    found = detector.detect(picture, sequence=0, t_ns=0, windows=()).detections
    assert found
    for one in found:
        nearest = np.abs(middles - 0.5 - np.array(one.camera_px)).max(axis=1) + np.abs(theirs[:, -2] - one.confidence)
        assert nearest.min() < 0.01
