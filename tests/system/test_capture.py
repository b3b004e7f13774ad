"""The camera source alone, without a detector: no frame between the USB device and the program goes missing unaccounted for."""

import json

import pytest
from harness.appliance import note

SCRIPT = """
import itertools, json, sys, time
from dnb_edge.capture.settings import CaptureSettings
from dnb_edge.capture.source import open_source

uri, width, height, seconds = sys.argv[1], *map(int, sys.argv[2:])
source = open_source(uri, CaptureSettings(width_px=width, height_px=height, fps=30.0))
numbers, stamps = [], []
for frame in source.frames():
    numbers.append(frame.sequence)
    stamps.append(frame.t_ns * 1e-9)
    if stamps[-1] - stamps[0] >= seconds:
        break
print(json.dumps({
    "given": len(numbers), "missing": numbers[-1] - numbers[0] + 1 - len(numbers), "first": numbers[0],
    "lost": {lost.reason: lost.frames for lost in source.lost}, "nominal_fps": source.info.nominal_fps,
    "seconds": stamps[-1] - stamps[0], "longest_s": max(b - a for a, b in itertools.pairwise(stamps)),
}))
source.close()
"""


@pytest.mark.parametrize("size_px", [(640, 360), (1280, 720)], ids=["360p", "720p"])
def test_every_frame_is_given_or_accounted_for(guest, webcam, logs, size_px):
    """Over 20 s at 30 frames a second asked, the numbers of the driver have no gap that the source does not explain, and what
    the camera sent is what was given or lost."""
    webcam.plug(guest)
    before = webcam.sent_frames
    words = f"v4l2:{webcam.node} {size_px[0]} {size_px[1]} 20"
    said = guest.run(f"/opt/dnb-edge/venv/bin/python - {words}", stdin=SCRIPT.encode(), timeout_s=180.0)
    told = json.loads(said.splitlines()[-1])
    sent = webcam.sent_frames - before
    note(logs, size=f"{size_px[0]}x{size_px[1]}", sent=sent, skipped=webcam.skipped_frames, **told)
    # The driver counts from 0, and what it loses before the first frame is in the account, too.
    assert told["first"] + told["missing"] == sum(told["lost"].values())
    # At the end a few frames are under way: in the driver's buffers and on the wire.
    assert 0 <= sent - told["first"] - told["given"] - told["missing"] <= 8
    assert told["nominal_fps"] == pytest.approx(30.0, abs=0.1)
