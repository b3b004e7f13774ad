"""What goes into a recording comes out of it, for us exactly and for anybody with the stock MCAP reader."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from record_samples import HEADER, found, frame, lap, recorder, target

from dnb_edge import values, wire
from dnb_edge.errors import InputError
from dnb_edge.record import reader
from dnb_edge.record.channels import JSON_TOPICS
from dnb_edge.record.reader import iter_frames, read_run
from dnb_edge.values import (
    Detection,
    Direction,
    FrameDetections,
    Lap,
    Observation,
    StampSource,
    Target,
    TargetState,
)

finite = st.floats(allow_nan=False, allow_infinity=False)
positive_ns = st.integers(min_value=0, max_value=4 * 10**18)
pairs = st.tuples(finite, finite)
triples = st.tuples(finite, finite, finite)
detections = st.builds(
    Detection,
    camera_px=pairs,
    sigma_px=finite,
    length_px=finite,
    confidence=finite,
    heading_rad=st.none() | finite,
    moving=st.booleans(),
)
frame_detections = st.builds(
    FrameDetections,
    sequence=st.integers(0, 2**40),
    t_ns=positive_ns,
    detections=st.lists(detections, max_size=3).map(tuple),
    full_frame=st.booleans(),
)
stamped = {"t_ns": positive_ns, "t_s": finite}
events = st.one_of(
    st.builds(
        Observation,
        **stamped,
        camera_px=pairs,
        track_m=pairs,
        covariance_m2=triples,
        confidence=finite,
        length_px=finite,
    ),
    st.builds(
        Target,
        **stamped,
        target_id=st.integers(0, 9),
        state=st.sampled_from(TargetState),
        track_m=pairs,
        velocity_mps=pairs,
        covariance_m2=triples,
    ),
    st.builds(
        values.Crossing,
        **stamped,
        line=st.text(),
        direction=st.sampled_from(Direction),
        sigma_s=finite,
        track_m=pairs,
        target_id=st.integers(0, 9),
        estimated=st.booleans(),
    ),
    st.builds(
        Lap,
        number=st.integers(0, 999),
        start_t_ns=positive_ns,
        end_t_ns=positive_ns,
        start_s=finite,
        time_s=finite,
        sigma_s=finite,
        valid=st.booleans(),
        reasons=st.lists(st.text(), max_size=2).map(tuple),
        similarity_percent=st.none() | finite,
        observed_fraction=finite,
    ),
    st.builds(
        values.Score,
        lap=st.integers(0, 999),
        metric=st.text(),
        clamp_m=st.none() | finite,
        **dict.fromkeys(
            (
                "similarity_percent",
                "dtw_mean_m",
                "frechet_m",
                "baseline_m",
                "completion_time_s",
                "lateral_mean_m",
                "lateral_max_m",
                "path_length_m",
                "route_length_m",
            ),
            finite,
        ),
    ),
    st.builds(
        values.Health,
        **stamped,
        frames=st.integers(0, 2**63 - 1),
        detected_frames=st.integers(0, 2**63 - 1),
        dropped_frames=st.integers(0, 2**63 - 1),
        fps=st.none() | finite,
        latency_ms=st.none() | finite,
        display=st.text(),
        recording=st.text(),
        view_error_mean_px=st.none() | finite,
        view_error_mean_m=st.none() | finite,
        warnings=st.lists(st.text(), max_size=2).map(tuple),
    ),
    st.builds(
        values.RunSummary,
        frames=st.integers(0, 2**63 - 1),
        detected_frames=st.integers(0, 2**63 - 1),
        laps=st.integers(0, 2**63 - 1),
        recording=st.none() | st.text(),
    ),
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None)
@given(items=st.lists(frame_detections | events, max_size=8))
def test_every_value_comes_back_exactly_and_in_order(tmp_path: Path, items) -> None:
    """Detections and events read from a recording equal those written, field by field, in the same order."""
    writer = recorder(tmp_path)
    for item in items:
        if isinstance(item, FrameDetections):
            writer.add_detections(item)
        else:
            writer.add_event(item)
    run = read_run(writer.close())
    assert run.header == HEADER
    assert list(run.messages()) == items
    assert list(run.detections()) == [item for item in items if isinstance(item, FrameDetections)]
    assert list(run.events()) == [item for item in items if not isinstance(item, FrameDetections)]
    kept = read_run(run.path, keep_detections=True)
    assert replace(kept, kept=None) == run
    assert list(kept.detections()) == list(run.detections())


def test_more_detections_than_are_kept_are_read_from_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A recording of any length is read in bounded memory: beyond the bound its detections come from the file again."""
    writer = recorder(tmp_path)
    frames = [found(k, k * 33_000_000) for k in range(20)]
    for one in frames:
        writer.add_detections(one)
    path = writer.close()
    monkeypatch.setattr(reader, "KEPT_BYTES", 1000)
    run = read_run(path, keep_detections=True)
    assert run.kept is None
    assert run.counts["/detections"] == 20
    assert list(run.detections()) == frames


def test_stock_reader_opens_it_with_standard_schemas(tmp_path: Path) -> None:
    """The stock reader finds an index, Foxglove's schemas on the picture topics, JSON schemas on ours, stamps as times."""
    writer = recorder(tmp_path)
    for sequence in range(4):
        t_ns = 5_000_000_000 + sequence * 1_000_000_000
        writer.add_frame(frame(sequence, t_ns))
        writer.add_detections(found(sequence, t_ns))
        writer.add_event(target(t_ns))
    writer.add_event(lap(1, 8_000_000_000))
    with writer.close().open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        messages = [(schema, channel.topic, message) for schema, channel, message in reader.iter_messages()]
        attachments = list(reader.iter_attachments())
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    assert summary is not None
    schemas = {channel.topic: summary.schemas[channel.schema_id] for channel in summary.channels.values()}
    assert {topic: schema.name for topic, schema in schemas.items() if schema.encoding == "protobuf"} == {
        "/camera/image": "foxglove.CompressedImage",
        "/camera/annotations": "foxglove.ImageAnnotations",
        "/car/pose": "foxglove.PoseInFrame",
        "/scene": "foxglove.SceneUpdate",
        "/log": "foxglove.Log",
    }
    for topic in ("/detections", "/target", "/lap"):
        assert schemas[topic].encoding == "jsonschema"
        assert json.loads(schemas[topic].data) == wire.json_schema(JSON_TOPICS[topic])
    assert {message.log_time for _, _, message in messages} == {n * 1_000_000_000 for n in (5, 6, 7, 8)}
    assert [record.name for record in attachments] == ["setup.json"]
    assert json.loads(attachments[0].data)["setup"] == HEADER.setup
    assert metadata["dnb-edge"]["clock"] == "simulated"


def test_jpeg_goes_through_untouched_and_raw_frames_are_encoded_once(tmp_path: Path) -> None:
    """JPEG bytes come back bit for bit with stamp and number; a raw frame comes back as a JPEG of the same picture."""
    done, encoded = cv2.imencode(".jpg", np.full((36, 64, 3), 90, np.uint8))
    assert done
    writer = recorder(tmp_path)
    writer.add_frame(frame(17, 1_000, jpeg=encoded.tobytes()))
    writer.add_frame(frame(200, 1_000_000_000))
    first, second = iter_frames(writer.close())
    assert (first.sequence, first.t_ns, first.width_px, first.height_px) == (17, 1_000, 64, 36)
    assert first.jpeg == encoded.tobytes()
    assert first.stamp_source is StampSource.SIMULATED
    assert (second.sequence, second.t_ns) == (200, 1_000_000_000)
    picture = cv2.imdecode(np.frombuffer(second.jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (36, 64, 3)
    assert abs(float(picture.mean()) - 200) < 2


@pytest.mark.parametrize(("image_fps", "expected"), [(None, 0), (5.0, 15), (1000.0, 90)])
def test_pictures_keep_to_the_configured_rate(tmp_path: Path, image_fps: float | None, expected: int) -> None:
    """Of 3 s at 30 frames per second with jittering stamps, image_fps * 3 pictures are kept, spread evenly."""
    writer = recorder(tmp_path, image_fps=image_fps)
    for sequence in range(90):
        writer.add_frame(frame(sequence, round(sequence * 1e9 / 30) + (sequence * 7 % 5) * 1_000_000))
    stamps = [one.t_ns for one in iter_frames(writer.close())]
    assert len(stamps) == expected
    if image_fps == 5.0:
        assert max(np.diff(stamps)) < 0.27e9


def test_missing_recording_is_one_clear_line(tmp_path: Path) -> None:
    """A path that is not there raises InputError naming it."""
    with pytest.raises(InputError, match=r"none\.mcap: there is no such recording"):
        read_run(tmp_path / "none.mcap")


def decoded_messages(path: Path) -> dict[str, list]:
    """All protobuf messages by topic, decoded by Google's library from the schemas in the file itself."""
    descriptor_pb2 = pytest.importorskip("google.protobuf.descriptor_pb2")
    descriptor_pool = pytest.importorskip("google.protobuf.descriptor_pool")
    message_factory = pytest.importorskip("google.protobuf.message_factory")
    decoded: dict[str, list] = {}
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            if schema.encoding == "protobuf":
                pool = descriptor_pool.DescriptorPool()
                for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
                    pool.Add(file)
                kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
                decoded.setdefault(channel.topic, []).append(kind.FromString(message.data))
    return decoded


def test_pictures_pose_and_scene_decode_by_their_own_schemas(tmp_path: Path) -> None:
    """Decoded by the schemas in the file: the circle lies on the detection in camera px, the pose in metres in frame
    `track` looks where the car drives, the route is closed, the lap is in the log, and stamps are the frame's."""
    writer = recorder(tmp_path)
    t_ns = 3_000_000_007
    writer.add_frame(frame(4, t_ns))
    writer.add_detections(found(4, t_ns))
    writer.add_event(target(t_ns))
    writer.add_event(lap(1, t_ns))
    decoded = decoded_messages(writer.close())

    (image,) = decoded["/camera/image"]
    assert (image.format, image.frame_id, image.data[:2]) == ("jpeg", "camera", b"\xff\xd8")
    assert (image.timestamp.seconds, image.timestamp.nanos) == (3, 7)
    (annotations,) = decoded["/camera/annotations"]
    (circle,) = annotations.circles
    assert (circle.position.x, circle.position.y, circle.diameter) == (16.5, 7.25, 9.0)
    assert (circle.timestamp.seconds, circle.timestamp.nanos) == (3, 7)
    (pose,) = decoded["/car/pose"]
    assert (pose.frame_id, pose.pose.position.x, pose.pose.position.y) == ("track", 0.25, 0.5)
    assert (pose.pose.orientation.z, pose.pose.orientation.w) == pytest.approx((0.5**0.5, 0.5**0.5))
    track, car = decoded["/scene"]
    route, line = track.entities
    assert [(point.x, point.y) for point in route.lines[0].points] == [(0, 0), (1, 0), (1, 1), (0, 0)]
    assert (line.id, [(point.x, point.y) for point in line.lines[0].points]) == (
        "line/start",
        [(0.5, -0.1), (0.5, 0.1)],
    )
    assert [entity.id for entity in car.entities] == ["car/1", "trail/1"]
    assert {entity.frame_id for update in (track, car) for entity in update.entities} == {"track"}
    (line,) = decoded["/log"]
    assert line.message == "lap 1: 3.000 s, 95.78 %, valid"


def test_the_example_in_the_documentation_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    """The Python lines of docs/recording.md print the laps of a recording."""
    text = (Path(__file__).parents[2] / "docs" / "recording.md").read_text(encoding="utf-8")
    code = text.split("```python\n")[1].split("```")[0]
    writer = recorder(tmp_path)
    writer.add_event(lap(1, 3_000_000_000))
    writer.close().rename(tmp_path / "run.mcap")
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "docs/recording.md", "exec"), {})
    assert capsys.readouterr().out == "demo driver sim:\n1 3.0 True 95.78\n"
