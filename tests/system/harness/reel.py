"""What the played camera sees: a car with a marker on its roof, lap after lap on a small oval, in one cycle that never ends.

The car drives every lap alike, so a lap's true time is known to the last digit however long the reel plays: as many frames as
the cycle has. Pictures are drawn once and kept under build/system-test/. Knows the simulator; knows no camera's wire.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from roof_markers import Roof, put_car

from dnb_edge.sim.camera import PinholeCamera, mast_camera
from dnb_edge.sim.driver import Drive, Style, drive
from dnb_edge.sim.files import course_files
from dnb_edge.sim.places import table_oval
from dnb_edge.sim.room import draw_room
from harness.recipe import CACHE

FPS = 30
DRAWN_PX = (640, 360)
ROOF = Roof(marker_id=7, size_m=0.09, height_m=0.115)
_STYLE = Style(lowest_mps=0.24, top_mps=0.34, pace=(1.0, 1.0), wander=0.0)
"""Slow: an emulated machine sees few of the 30 frames a second, and a car must not leap from one of them to the next."""
_SEED = 3

log = logging.getLogger("system-test")


def camera(size_px: tuple[int, int]) -> PinholeCamera:
    """The camera over the oval, for pictures of that size."""
    return mast_camera(position_m=(0.60, 0.06, 1.50), pitch_deg=73.0, yaw_deg=1.0, hfov_deg=62.0, size_px=size_px)


@functools.cache
def _driven() -> tuple[Drive, int]:
    """The drive, and the frames in a cycle: a lap's time to the nearest frame."""
    driven = drive(table_oval(), laps=2, seed=_SEED, style=_STYLE)
    return driven, round((driven.crossings_s[2] - driven.crossings_s[1]) * FPS)


def lap_s() -> float:
    """The true time of every lap at full rate, seconds."""
    return _driven()[1] / FPS


@functools.cache
def pictures(size_px: tuple[int, int]) -> tuple[bytes, ...]:
    """The JPEGs of one cycle. The first shows the car half a lap from the start line."""
    driven, count = _driven()
    words = f"{Path(__file__).read_text()}{size_px}"
    folder = CACHE / f"reel-{size_px[1]}-{hashlib.sha256(words.encode()).hexdigest()[:8]}"
    if not (folder / "done").exists():
        _draw(folder, driven, count, size_px)
    return tuple(path.read_bytes() for path in sorted(folder.glob("*.jpg")))


def configuration(
    folder: Path, *, source: str, size_px: tuple[int, int] = DRAWN_PX, **more: Mapping[str, Any]
) -> dict[str, bytes]:
    """The files of /etc/dnb-edge for the reel, by name: as a user would write them. `more` is merged into the sections."""
    over = camera(size_px)
    files = course_files(folder, table_oval(), over)
    sections: dict[str, Any] = {
        "name": "played car",
        "track": {
            "name": "table oval",
            "image": files.twin.name,
            "lane_hsv": list(files.lane_hsv),
            "measured": {
                "from_px": list(files.measured_from_px),
                "to_px": list(files.measured_to_px),
                "length_m": files.measured_length_m,
            },
            "start_line_px": [list(point) for point in files.start_line_px],
        },
        "view": {
            "keypoints_camera": files.camera_keypoints.name,
            "keypoints_twin": files.twin_keypoints.name,
            "image_size_px": list(files.keypoints_image_size_px),
            "max_mean_error_m": 0.02,
        },
        "detector": {
            "kind": "markers",
            "markers": {"ids": [ROOF.marker_id], "marker_size_m": ROOF.size_m, "marker_height_m": ROOF.height_m},
        },
        "capture": {"source": source, "width_px": size_px[0], "height_px": size_px[1], "fps": FPS},
        # Frames are few where a processor is emulated: a car is not lost as soon as it is where all of them come.
        "race": {"max_gap_s": 4.0},
        "score": {"metric": "dtw", "clamp_m": 0.5, "baseline_m": 0.5},
    }
    for name, settings in more.items():
        sections[name] = {**sections.get(name, {}), **settings}
    text = yaml.safe_dump(sections, sort_keys=False).encode()
    named = (files.twin, files.camera_keypoints, files.twin_keypoints)
    return {"dnb-edge.yaml": text} | {path.name: path.read_bytes() for path in named}


def _draw(folder: Path, driven: Drive, count: int, size_px: tuple[int, int]) -> None:
    """Draws at the smaller size; the larger is the same enlarged, which is enough for who only counts frames."""
    begun_s = time.monotonic()
    folder.mkdir(parents=True, exist_ok=True)
    over = camera(DRAWN_PX)
    room = draw_room(driven.circuit, over, _SEED)
    random = np.random.default_rng(_SEED)
    # A few pictures of noise, as large as the frames: no two frames in a row are the same.
    noises = [random.normal(0.0, 2.0, (size_px[1], size_px[0], 1)).astype(np.int8) for _ in range(5)]
    start_s, end_s = driven.crossings_s[1:3]
    for k in range(count):
        pose = driven.pose(start_s + (end_s - start_s) * (((k / count) + 0.5) % 1.0))
        picture = room.copy()
        put_car(picture, over, track_m=pose.track_m, heading_rad=pose.heading_rad, roof=ROOF)
        enlarged = cv2.resize(picture, size_px, interpolation=cv2.INTER_LINEAR)
        noisy = np.clip(enlarged.astype(np.int16) + noises[k % len(noises)], 0, 255).astype(np.uint8)
        done, jpeg = cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, 85])
        assert done
        (folder / f"{k:04}.jpg").write_bytes(jpeg.tobytes())
    (folder / "done").touch()
    log.info("reel: %d pictures of %d x %d in %.0f s", count, *size_px, time.monotonic() - begun_s)
