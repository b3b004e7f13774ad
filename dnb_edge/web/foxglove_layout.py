"""The layout that Foxglove shows recordings and live races with: `configs/foxglove-layout.json` is what this makes.

In the form that Foxglove imports and exports. Knows the recording's topics; `Plot` and `Table` paths name members of the
events' JSON.
"""

from __future__ import annotations

import json
from typing import Any

from dnb_edge.record.channels import (
    ANNOTATIONS_TOPIC,
    EVENT_TOPICS,
    IMAGE_TOPIC,
    LOG_TOPIC,
    POSE_TOPIC,
    SCENE_TOPIC,
    TRACK_FRAME,
)
from dnb_edge.values import Health, Lap, Running, Standings

CAMERA, TRACK, LAPS, LAST = "Image!camera", "3D!track", "Plot!laps", "RawMessages!lap"
RUNNING, STANDINGS, HEALTH, LOG = "Plot!running", "Table!standings", "Plot!health", "RosOut!log"
"""The panels: the part before `!` is Foxglove's name of their kind."""


def layout_text() -> str:
    """The layout as JSON."""
    return json.dumps(_layout(), indent=2) + "\n"


def _layout() -> dict[str, Any]:
    left = _split("column", CAMERA, TRACK, 50)
    middle = _split("column", LAPS, _split("column", RUNNING, HEALTH, 50), 34)
    right = _split("column", STANDINGS, _split("column", LAST, LOG, 55), 30)
    return {
        "configById": _panels(),
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", left, _split("row", middle, right, 55), 45),
    }


def _panels() -> dict[str, dict[str, Any]]:
    lap, running, health = (EVENT_TOPICS[kind] for kind in (Lap, Running, Health))
    return {
        CAMERA: {
            "foxglovePanelTitle": "Camera",
            "imageMode": {"imageTopic": IMAGE_TOPIC, "annotations": {ANNOTATIONS_TOPIC: {"visible": True}}},
        },
        TRACK: {
            "foxglovePanelTitle": "Track",
            "followTf": TRACK_FRAME,
            "followMode": "follow-none",
            # From straight above, the plane's x to the right.
            "cameraState": {
                "perspective": False,
                "distance": 6,
                "phi": 0,
                "thetaOffset": 0,
                "target": [0, 0, 0],
                "targetOffset": [2, 1.5, 0],
                "targetOrientation": [0, 0, 0, 1],
                "fovy": 45,
                "near": 0.01,
                "far": 500,
            },
            "topics": {SCENE_TOPIC: {"visible": True}, POSE_TOPIC: {"visible": True}},
            "layers": {},
        },
        LAPS: {
            "foxglovePanelTitle": "Lap times",
            "paths": [_path(f"{lap}.time_s", "measured, s"), _path(f"{lap}.official_time_s", "with penalties, s")],
            "xAxisVal": "custom",
            "xAxisPath": {"value": f"{lap}.number", "enabled": True},
            "showLegend": True,
        },
        RUNNING: {
            "foxglovePanelTitle": "Running lap",
            "paths": [_path(f"{running}.speed_mps", "speed, m/s"), _path(f"{running}.delta_s", "against the best, s")],
            "xAxisVal": "timestamp",
            "followingViewWidth": 30,
            "showLegend": True,
        },
        HEALTH: {
            "foxglovePanelTitle": "Health",
            "paths": [
                _path(f"{health}.fps", "frames a second"),
                _path(f"{health}.latency_ms", "latency, ms"),
                _path(f"{health}.dropped_frames", "dropped frames"),
            ],
            "xAxisVal": "timestamp",
            "followingViewWidth": 120,
            "showLegend": True,
        },
        STANDINGS: {"foxglovePanelTitle": "Standings", "topicPath": f"{EVENT_TOPICS[Standings]}.rows[:]"},
        LAST: {"foxglovePanelTitle": "Last lap", "topicPath": lap},
        LOG: {"foxglovePanelTitle": "Log", "topicToRender": LOG_TOPIC, "minLogLevel": 2, "searchTerms": []},
    }


def _path(value: str, label: str) -> dict[str, Any]:
    return {"value": value, "label": label, "enabled": True, "timestampMethod": "receiveTime"}


def _split(direction: str, first: object, second: object, percent: float) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percent}
