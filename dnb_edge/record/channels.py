"""Which value goes to which topic of a recording, and in what form.

Knows Foxglove's schemas and the project's values. Knows no file, no queue and no clock: each message's log time is the
stamp that its value carries, on the source's clock.
"""

from __future__ import annotations

import json
import math
import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import foxglove
import numpy as np
from foxglove import channels as typed
from foxglove import messages as fg

from dnb_edge import values, wire
from dnb_edge.values import PointM, Points, StampSource

TRACK_FRAME = "track"
CAMERA_FRAME = "camera"

IMAGE_TOPIC = "/camera/image"
IMAGE_NOTE_TOPIC = "/camera/frame"
ANNOTATIONS_TOPIC = "/camera/annotations"
POSE_TOPIC = "/car/pose"
SCENE_TOPIC = "/scene"
LOG_TOPIC = "/log"
DETECTIONS_TOPIC = "/detections"
EVENT_TOPICS: dict[type, str] = {kind: f"/{name}" for kind, name in wire.EVENT_NAMES.items()}
"""Topic of each kind of event: `/observation`, `/target`, `/crossing`, `/lap`, `/score`, `/health`, `/run`."""

JSON_TOPICS: dict[str, type] = {DETECTIONS_TOPIC: values.FrameDetections} | {t: k for k, t in EVENT_TOPICS.items()}
"""The value behind each JSON topic that is read back."""

SCENE_PERIOD_NS = 100_000_000
TRAIL_NS = 5_000_000_000
TRAIL_POINTS = 60
MIN_HEADING_SPEED_MPS = 0.02

_ROUTE_COLOUR = fg.Color(r=0.25, g=0.6, b=1.0, a=1.0)
_LINE_COLOUR = fg.Color(r=1.0, g=1.0, b=1.0, a=1.0)
_CAR_COLOUR = fg.Color(r=1.0, g=0.55, b=0.0, a=1.0)
_GHOST_COLOUR = fg.Color(r=0.6, g=0.6, b=0.65, a=0.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageNote:
    """What a recorded picture's own message cannot say: its number and size. Same log time as the picture."""

    sequence: int
    t_ns: int
    stamp_source: StampSource
    width_px: int
    height_px: int
    camera: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackScene:
    """The track as the 3D panel shows it, in track m."""

    route_m: Points
    """The route, shape (n, 2), float64; where it is closed the last point is joined to the first."""
    lines_m: dict[str, tuple[PointM, PointM]]
    """The directed lines by name, the start line among them."""
    car_length_m: float = 0.2
    """Length of the car as drawn."""
    closed: bool = True
    """False for a route from its first point to its last."""


_KEPT: dict[int, object] = getattr(sys.modules[foxglove.Channel.__module__], "_channels_by_id", {})
"""Where the library keeps all channels for ever, for its own `log`: a process that records race after race would grow by it."""


def stamp(t_ns: int) -> fg.Timestamp:
    """`t_ns` of the source's clock as a Foxglove time stamp."""
    return fg.Timestamp(sec=t_ns // 1_000_000_000, nsec=t_ns % 1_000_000_000)


def further_topic(topic: str, camera: int) -> str:
    """The topic of a camera after the first that is `topic`, such as /camera/image, for the first: /camera_2/image."""
    return topic.replace("/camera/", f"/camera_{camera + 1}/", 1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _CameraChannels:
    """What a camera after the first says."""

    image: typed.CompressedImageChannel
    annotations: typed.ImageAnnotationsChannel


class RunChannels:
    """All channels of one recording in one foxglove context; each method logs one value to its topics."""

    def __init__(self, context: foxglove.Context, scene: TrackScene | None, *, images: bool) -> None:
        self._json = {
            topic: foxglove.Channel(topic, schema=wire.json_schema(kind), context=context)
            for topic, kind in ({IMAGE_NOTE_TOPIC: ImageNote} | JSON_TOPICS).items()
        }
        for channel in self._json.values():
            _KEPT.pop(channel.id(), None)
        self._image = typed.CompressedImageChannel(IMAGE_TOPIC, context=context)
        self._annotations = typed.ImageAnnotationsChannel(ANNOTATIONS_TOPIC, context=context)
        self._pose = typed.PoseInFrameChannel(POSE_TOPIC, context=context)
        self._scene = typed.SceneUpdateChannel(SCENE_TOPIC, context=context)
        self._log = typed.LogChannel(LOG_TOPIC, context=context)
        self._context = context
        self._cameras: dict[int, _CameraChannels] = {}
        self._track = scene
        self._images = images
        self._track_drawn = False
        self._trails: dict[int, deque[tuple[int, PointM]]] = {}
        self._yaw_rad: dict[int, float] = {}
        self._scene_due_ns: dict[int, int] = {}

    def image(self, note: ImageNote, jpeg: bytes) -> None:
        """One picture, `jpeg` as it came, and its note."""
        frame_id = CAMERA_FRAME if note.camera == 0 else f"{CAMERA_FRAME}_{note.camera + 1}"
        picture = fg.CompressedImage(timestamp=stamp(note.t_ns), frame_id=frame_id, data=jpeg, format="jpeg")
        if note.camera == 0:
            self._json[IMAGE_NOTE_TOPIC].log(_json_text(note), log_time=note.t_ns)
            self._image.log(picture, log_time=note.t_ns)
        else:
            self._further(note.camera).image.log(picture, log_time=note.t_ns)

    def _further(self, camera: int) -> _CameraChannels:
        """The channels of a camera after the first, made when it first has something to say."""
        if camera not in self._cameras:
            self._cameras[camera] = _CameraChannels(
                image=typed.CompressedImageChannel(further_topic(IMAGE_TOPIC, camera), context=self._context),
                annotations=typed.ImageAnnotationsChannel(
                    further_topic(ANNOTATIONS_TOPIC, camera), context=self._context
                ),
            )
        return self._cameras[camera]

    def detections(self, found: values.FrameDetections) -> None:
        """One frame's detections: exactly, as JSON, and as circles over the picture where pictures are recorded."""
        self._json[DETECTIONS_TOPIC].log(_json_text(found), log_time=found.t_ns)
        if self._images and found.camera == 0:
            self.annotate(found.t_ns, found.detections)
        elif self._images:
            circles = _annotations(found.t_ns, found.detections)
            self._further(found.camera).annotations.log(circles, log_time=found.t_ns)

    def annotate(self, t_ns: int, found: Sequence[values.Detection | values.Observation]) -> None:
        """What was found in the frame at `t_ns`, as circles over its picture."""
        self._annotations.log(_annotations(t_ns, found), log_time=t_ns)

    def exactly(self, event: values.Event, t_ns: int) -> None:
        """One event as JSON with log time `t_ns`, and nothing else."""
        self._json[EVENT_TOPICS[type(event)]].log(_json_text(event), log_time=t_ns)

    def event(self, event: values.Event, t_ns: int) -> None:
        """One event, exactly, as JSON with log time `t_ns`, and what the 3D and log panels make of it."""
        self.exactly(event, t_ns)
        match event:
            case values.Target(state=values.TargetState.CONFIRMED | values.TargetState.COASTING):
                self._target(event)
            case values.Target(state=values.TargetState.LOST, target_id=gone):
                for memory in (self._trails, self._yaw_rad, self._scene_due_ns):
                    memory.pop(gone, None)
            case values.Lap():
                self.log(_lap_text(event), t_ns, level=fg.LogLevel.Info)
            case values.Incident():
                self.log(f"car {event.car}: {event.text}", t_ns, level=fg.LogLevel.Warning)
            case values.RaceState(text=text) if text:
                self.log(text, t_ns, level=fg.LogLevel.Info)
            case values.Running():
                self._ghost(event)
            case values.Crossing():
                text = f"{event.line} crossed {event.direction.value} at {event.t_s:.4f} s"
                self.log(text, t_ns, level=fg.LogLevel.Debug)
            case _:
                pass

    def log(self, message: str, t_ns: int, *, level: fg.LogLevel) -> None:
        """One line for the log panel."""
        line = fg.Log(timestamp=stamp(t_ns), level=level, message=message, name="dnb-edge")
        self._log.log(line, log_time=t_ns)

    def begin(self, scene: TrackScene | None, t_ns: int) -> None:
        """Another run begins, on this track: nothing of the one before is drawn or remembered any more."""
        self._track, self._track_drawn = scene, False
        for memory in (self._trails, self._yaw_rad, self._scene_due_ns):
            memory.clear()
        gone = fg.SceneEntityDeletion(timestamp=stamp(t_ns), type=fg.SceneEntityDeletionType.All)
        self._scene.log(fg.SceneUpdate(deletions=[gone]), log_time=t_ns)

    @property
    def wants_images(self) -> bool:
        """Whether anything takes the pictures: a file always does, a server while somebody looks at them."""
        return self._image.has_sinks()

    def draw_track(self, t_ns: int, *, again: bool = False) -> None:
        """The route and the lines, the first time it is called, or `again` for who has come later; they stay for the run."""
        if self._track is None or (self._track_drawn and not again):
            return
        self._track_drawn = True
        route = self._track.route_m
        if self._track.closed:
            route = np.vstack([route, route[:1]])
        entities = [_line_entity("route", t_ns, [(float(x), float(y)) for x, y in route], _ROUTE_COLOUR)]
        entities += [
            _line_entity(f"line/{name}", t_ns, list(ends), _LINE_COLOUR) for name, ends in self._track.lines_m.items()
        ]
        self._scene.log(fg.SceneUpdate(entities=entities), log_time=t_ns)

    def _target(self, target: values.Target) -> None:
        speed_mps = math.hypot(*target.velocity_mps)
        if speed_mps > MIN_HEADING_SPEED_MPS:
            self._yaw_rad[target.target_id] = math.atan2(target.velocity_mps[1], target.velocity_mps[0])
        yaw_rad = self._yaw_rad.get(target.target_id, 0.0)
        pose = _pose(target.track_m, yaw_rad)
        in_frame = fg.PoseInFrame(timestamp=stamp(target.t_ns), frame_id=TRACK_FRAME, pose=pose)
        self._pose.log(in_frame, log_time=target.t_ns)

        trail = self._trails.setdefault(target.target_id, deque(maxlen=TRAIL_POINTS))
        if target.t_ns < self._scene_due_ns.get(target.target_id, target.t_ns):
            return
        self._scene_due_ns[target.target_id] = target.t_ns + SCENE_PERIOD_NS
        trail.append((target.t_ns, target.track_m))
        self._scene.log(self._car(target, pose, trail), log_time=target.t_ns)

    def _ghost(self, running: values.Running) -> None:
        """Where the car was in its best lap after the same time, as a pale car that goes when it is told no more."""
        if running.ghost_m is None:
            return
        length_m = self._track.car_length_m if self._track else 0.2
        disc = fg.CylinderPrimitive(
            pose=_pose(running.ghost_m, 0.0),
            size=fg.Vector3(x=length_m * 0.8, y=length_m * 0.8, z=length_m * 0.1),
            bottom_scale=1.0,
            top_scale=1.0,
            color=_GHOST_COLOUR,
        )
        entity = fg.SceneEntity(
            timestamp=stamp(running.t_ns),
            frame_id=TRACK_FRAME,
            id=f"ghost/{running.car}",
            lifetime=fg.Duration(sec=1),
            cylinders=[disc],
        )
        self._scene.log(fg.SceneUpdate(entities=[entity]), log_time=running.t_ns)

    def _car(self, target: values.Target, pose: fg.Pose, trail: deque[tuple[int, PointM]]) -> fg.SceneUpdate:
        length_m = self._track.car_length_m if self._track else 0.2
        car = fg.SceneEntity(
            timestamp=stamp(target.t_ns),
            frame_id=TRACK_FRAME,
            id=f"car/{target.target_id}",
            lifetime=fg.Duration(sec=1),
            cubes=[
                fg.CubePrimitive(
                    pose=pose, size=fg.Vector3(x=length_m, y=length_m * 0.6, z=length_m * 0.4), color=_CAR_COLOUR
                )
            ],
        )
        recent = [point for t_ns, point in trail if target.t_ns - t_ns <= TRAIL_NS]
        driven = _line_entity(f"trail/{target.target_id}", target.t_ns, recent, _CAR_COLOUR)
        return fg.SceneUpdate(entities=[car, driven])


def _json_text(value: object) -> str:
    return json.dumps(wire.to_dict(value), allow_nan=False)


def event_t_ns(event: values.Event, last_t_ns: int) -> int:
    """The event's own stamp; for those that have none `last_t_ns`, the last frame's."""
    match event:
        case values.Lap() | values.Incident():
            return event.end_t_ns
        case values.Score() | values.RunSummary():
            return last_t_ns
        case _:
            return event.t_ns


def _annotations(t_ns: int, found: Sequence[values.Detection | values.Observation]) -> fg.ImageAnnotations:
    when = stamp(t_ns)
    circles = [
        fg.CircleAnnotation(
            timestamp=when,
            position=fg.Point2(x=one.camera_px[0], y=one.camera_px[1]),
            diameter=one.length_px,
            thickness=2.0,
            outline_color=_CAR_COLOUR,
        )
        for one in found
    ]
    points = fg.PointsAnnotation(
        timestamp=when,
        type=fg.PointsAnnotationType.Points,
        points=[fg.Point2(x=one.camera_px[0], y=one.camera_px[1]) for one in found],
        outline_color=_CAR_COLOUR,
        thickness=4.0,
    )
    return fg.ImageAnnotations(timestamp=when, circles=circles, points=[points] if found else [])


def _pose(track_m: PointM, yaw_rad: float) -> fg.Pose:
    return fg.Pose(
        position=fg.Vector3(x=track_m[0], y=track_m[1], z=0.0),
        orientation=fg.Quaternion(x=0.0, y=0.0, z=math.sin(yaw_rad / 2), w=math.cos(yaw_rad / 2)),
    )


def _line_entity(name: str, t_ns: int, points_m: list[PointM], colour: fg.Color) -> fg.SceneEntity:
    line = fg.LinePrimitive(
        type=fg.LinePrimitiveLineType.LineStrip,
        pose=_pose((0.0, 0.0), 0.0),
        thickness=3.0,
        scale_invariant=True,
        points=[fg.Point3(x=x, y=y, z=0.0) for x, y in points_m],
        color=colour,
    )
    return fg.SceneEntity(timestamp=stamp(t_ns), frame_id=TRACK_FRAME, id=name, lines=[line])


def _lap_text(lap: values.Lap) -> str:
    similarity = "" if lap.similarity_percent is None else f", {lap.similarity_percent:.2f} %"
    verdict = "valid" if lap.valid else "not valid: " + "; ".join(lap.reasons)
    if lap.suspect:
        verdict += ", suspect: " + "; ".join(lap.suspect)
    return f"lap {lap.number}: {lap.time_s:.3f} s{similarity}, {verdict}"
