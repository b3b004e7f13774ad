"""Live in Foxglove: the channels of a recording, over its WebSocket protocol, to look at and nothing else."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from foxglove_peer import Channel, Peer, Served
from judged_runs import Wanderer, priced, record
from mcap.reader import make_reader
from typer.testing import CliRunner

from dnb_edge import wire
from dnb_edge.archive.replayed import Replayed, replay
from dnb_edge.assembly import make_scene
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.cli.main import app
from dnb_edge.daemon.scenery import make_scenery
from dnb_edge.live.messages import Phase, State
from dnb_edge.live.server import LiveServer
from dnb_edge.record import protobuf
from dnb_edge.record.channels import EVENT_TOPICS, JSON_TOPICS, TrackScene
from dnb_edge.record.header import RunHeader
from dnb_edge.record.reader import iter_frames, read_run
from dnb_edge.record.writer import Recorder, RecordingSettings
from dnb_edge.sim.rig import Rig
from dnb_edge.values import (
    Crossing,
    Incident,
    Lap,
    Observation,
    RacePhase,
    RaceState,
    RunSummary,
    Score,
    Target,
)
from dnb_edge.web.foxglove_layout import layout_text
from dnb_edge.web.foxglove_server import FoxgloveSettings

CAR = Wanderer((3.0, 3.1, 2.9, 3.2))
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording with pictures and detections."""
    return record(tmp_path_factory.mktemp("raced") / "run.mcap", CAR)


@pytest.fixture(scope="module")
def raced(recording: Path) -> Replayed:
    """All that the core says of it."""
    return replay(recording, tell_running=True)


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[LiveServer]:
    """A daemon's live socket, that of a race on the round track which has just begun."""
    with LiveServer(tmp_path / "live.sock", version="0") as server:
        server.begin_run()
        server.show(State(phase=Phase.RACING, run="run", scenery=make_scenery(priced())))
        yield server


@pytest.fixture
def served(daemon: LiveServer, tmp_path: Path) -> Iterator[Served]:
    """Our server, which follows it."""
    with Served(FoxgloveSettings(socket=tmp_path / "live.sock", port=0, pictures_per_s=60)) as running:
        yield running


@pytest.fixture
def peer(served: Served) -> Iterator[Peer]:
    """A Foxglove."""
    with Peer(served.server.address) as one:
        yield one


def test_the_channels_are_those_of_a_recording(peer: Peer, recording: Path, raced: Replayed, tmp_path: Path) -> None:
    """Topic, encoding, schema name, schema encoding and schema of every channel, byte for byte."""
    header = read_run(recording).header
    writer = Recorder(RecordingSettings(directory=tmp_path / "whole", lossless=True), header, _scene(raced))
    for frame in iter_frames(recording):
        writer.add_frame(frame)
    for found in read_run(recording).detections():
        writer.add_detections(found)
    for event in raced.events:
        writer.add_event(event)
    path = writer.close()
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    kept = {}
    for one in summary.channels.values():
        schema = summary.schemas[one.schema_id]
        kept[one.topic] = Channel(one.topic, one.message_encoding, schema.name, schema.encoding, schema.data)
    assert {"/camera/image", "/camera/annotations", "/scene", "/car/pose", "/log", "/lap", "/detections"} <= kept.keys()
    for topic, channel in kept.items():
        assert peer.channels[topic] == channel, topic
    assert isinstance(header, RunHeader)
    assert peer.info["capabilities"] == []


def test_events_come_as_they_are_recorded(peer: Peer, daemon: LiveServer, raced: Replayed) -> None:
    """Every event that all are told, in order, in the recording's JSON with its stamp."""
    told = [event for event in raced.events if isinstance(event, Crossing | Lap | Score | Incident | RunSummary)]
    kinds = sorted({EVENT_TOPICS[type(event)] for event in told})
    peer.subscribe(*kinds)
    _wait_for_subscription(peer, daemon)
    for event in told:
        daemon.tell(event)
    for event in told:
        topic, t_ns, data = peer.next(*kinds)
        assert topic == EVENT_TOPICS[type(event)]
        assert json.loads(data) == json.loads(json.dumps(wire.to_dict(event)))
        if isinstance(event, Lap):
            assert t_ns == event.end_t_ns


def test_who_comes_later_sees_track_and_laps(peer: Peer, daemon: LiveServer, raced: Replayed, served: Served) -> None:
    """The track's lines are drawn for each who subscribes, and the laps so far told."""
    laps = [event for event in raced.events if isinstance(event, Lap)]
    peer.subscribe("/lap")
    for lap in laps:
        daemon.tell(lap)
    for _ in laps:
        peer.next("/lap")
    with Peer(served.server.address) as late:
        late.subscribe("/lap", "/scene")
        again = [json.loads(late.next("/lap")[2])["number"] for _ in laps]
    assert again == [1, 2, 3, 4]
    with Peer(served.server.address) as late:
        late.subscribe("/scene")
        _, _, scene = late.next("/scene")
    for name in (b"route", b"line/start"):
        assert name in scene


def test_pictures_come_while_somebody_looks(peer: Peer, daemon: LiveServer, recording: Path, served: Served) -> None:
    """The camera's own bytes, with number and size beside them; none are wanted, or asked the daemon for, before."""
    frame = next(iter(iter_frames(recording)))
    _wait_for_subscription(peer, daemon)
    channels = served.server._channels
    assert (daemon.watched, channels.wants_pictures) == (False, False)
    daemon.offer(frame)
    peer.subscribe("/camera/image", "/camera/frame")
    found = dict(peer.next("/camera/image", "/camera/frame")[::2] for _ in range(2))
    assert protobuf.bytes_field(found["/camera/image"], 2) == frame.jpeg
    note = json.loads(found["/camera/frame"])
    assert (note["sequence"], note["width_px"], note["t_ns"]) == (frame.sequence, 1000, frame.t_ns)
    assert (daemon.watched, channels.wants_pictures) == (True, True)


def test_cars_are_drawn_over_the_picture_and_on_the_track(peer: Peer, daemon: LiveServer, raced: Replayed) -> None:
    """An observation is a circle over its frame's picture; a confirmed target has a pose and a place in the scene."""
    seen = [event for event in raced.events if isinstance(event, Observation)][30]
    targets = [event for event in raced.events if isinstance(event, Target) and event.t_ns >= seen.t_ns]
    peer.subscribe("/camera/annotations", "/car/pose", "/scene")
    _wait_for_subscription(peer, daemon)
    daemon.tell(seen)
    daemon.tell(targets[0])
    found = {topic: t_ns for topic, t_ns, _ in (peer.next() for _ in range(3))}
    assert found["/camera/annotations"] == seen.t_ns
    assert found["/car/pose"] == targets[0].t_ns


def test_another_run_begins_anew(peer: Peer, daemon: LiveServer) -> None:
    """Clients are given another session, so that they forget the laps of the run before, and the new track is drawn."""
    peer.subscribe("/scene")
    _wait_for_subscription(peer, daemon)
    session = peer.info["sessionId"]
    daemon.begin_run()
    daemon.tell(_a_state())
    daemon.show(State(phase=Phase.RACING, run="other", scenery=make_scenery(priced())))
    told = peer.next_text()
    while told["op"] != "serverInfo" or told["sessionId"] == session:
        told = peer.next_text()
    # What else of the scene was under way may have come before the session.
    while b"route" not in peer.next("/scene")[2]:
        pass


def test_the_daemon_may_go_and_come_back(tmp_path: Path, raced: Replayed) -> None:
    """The log says that it has gone; when it is back its laps come again."""
    laps = [event for event in raced.events if isinstance(event, Lap)]
    with (
        Served(FoxgloveSettings(socket=tmp_path / "live.sock", port=0)) as running,
        Peer(running.server.address) as peer,
    ):
        peer.subscribe("/log", "/lap")
        for lap in laps[:2]:
            with LiveServer(tmp_path / "live.sock", version="0") as server:
                server.begin_run()
                server.show(State(phase=Phase.RACING, scenery=make_scenery(priced())))
                server.tell(lap)
                assert json.loads(peer.next("/lap")[2])["number"] == lap.number
            while b"has gone" not in peer.next("/log")[2]:
                pass


def test_nobody_can_change_anything(peer: Peer, daemon: LiveServer, raced: Replayed) -> None:
    """What a client publishes, calls or sets is refused or ignored, and malformed messages end nothing for others."""
    for hostile in (
        {"op": "advertise", "channels": [{"id": 1, "topic": "/lap", "encoding": "json", "schemaName": "x"}]},
        {"op": "setParameters", "parameters": [{"name": "a", "value": 1}]},
        {"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99999}]},
        {"op": "nonsense"},
        b"\x01\xff\xff",
        b"",
    ):
        peer.say(hostile)
    lap = next(event for event in raced.events if isinstance(event, Lap))
    peer.subscribe("/lap")
    daemon.tell(lap)
    assert json.loads(peer.next("/lap")[2])["number"] == 1


def test_a_port_that_is_taken_is_told(tmp_path: Path) -> None:
    """`dnb-edge foxglove` ends with code 2 and one line that names host and port."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        words = ["foxglove", "--port", port, "--socket", tmp_path / "live.sock"]
        ran = subprocess.run(
            [sys.executable, "-m", "dnb_edge", *map(str, words)],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
    assert ran.returncode == 2, ran.stderr
    (line,) = ran.stderr.splitlines()
    assert f"--host 127.0.0.1 --port {port}: " in line


def test_it_listens_to_this_machine_alone_unless_told_otherwise(tmp_path: Path) -> None:
    """The defaults of the command line, of the settings and of the configuration."""
    assert FoxgloveSettings(socket=tmp_path).host == "127.0.0.1"
    config = tmp_path / "dnb-edge.yaml"
    config.write_text("web: {foxglove: {host: 192.0.2.1, port: 1}}\n")
    ran = CliRunner().invoke(app, ["foxglove", "--config", str(config), "--socket", str(tmp_path / "live.sock")])
    assert "--host 192.0.2.1 --port 1: " in str(ran.exception)


def test_the_shipped_layout_is_the_printed_one() -> None:
    """`configs/foxglove-layout.json` is what `dnb-edge foxglove --layout` prints."""
    assert CliRunner().invoke(app, ["foxglove", "--layout"]).stdout == layout_text()
    assert (ROOT / "configs" / "foxglove-layout.json").read_text() == layout_text()


def test_the_layout_names_only_what_there_is(peer: Peer) -> None:
    """Every topic in it is a channel's, every member of an event one of its schema, every panel in its place once."""
    layout = json.loads(layout_text())
    named = set(_texts(layout["configById"]))
    topics = {text for text in named if text in peer.channels}
    assert {"/camera/image", "/camera/annotations", "/scene", "/car/pose", "/log", "/lap"} <= topics
    for text in named - topics:
        if text.startswith("/"):
            topic, _, members = text.partition(".")
            kind = JSON_TOPICS[topic]
            assert members.removesuffix("[:]") in wire.json_schema(kind)["properties"], text
    placed = [text for text in _texts(layout["layout"]) if "!" in text]
    assert sorted(placed) == sorted(layout["configById"])


def test_a_simulated_race_is_seen_live(tmp_path: Path) -> None:
    """The daemon as a process of its own races the simulator; its laps, as its JSON lines say them, come to Foxglove with
    annotations, scene, pose and log."""
    config = write_demo_config(tmp_path / "track", Rig(seed=1, laps=1))
    live = tmp_path / "live.sock"
    words = ["run", "--config", config, "--source", "sim:?laps=1", "--laps", "1", "--live", live, "--json"]
    with Served(FoxgloveSettings(socket=live, port=0)) as running, Peer(running.server.address) as peer:
        peer.subscribe("/lap", "/camera/annotations", "/scene", "/car/pose", "/log", "/health", "/camera/image")
        with subprocess.Popen(
            [sys.executable, "-m", "dnb_edge", *map(str, words)], stdout=subprocess.PIPE, text=True, cwd=tmp_path
        ) as race:
            seen: dict[str, list[bytes]] = {}
            while "/lap" not in seen or not any(b"lap 1: " in line for line in seen.get("/log", [])):
                topic, _, data = peer.next()
                seen.setdefault(topic, []).append(data)
            said = [json.loads(line) for line in race.communicate(timeout=60)[0].splitlines()]
        assert race.returncode == 0
    laps = [
        {name: value for name, value in event.items() if name != "event"} for event in said if event["event"] == "lap"
    ]
    assert [json.loads(data) for data in seen["/lap"]] == laps
    assert {"/camera/annotations", "/scene", "/car/pose", "/log", "/camera/image"} <= seen.keys()


def _texts(value: object) -> Iterator[str]:
    """All texts in plain JSON, names of members that are topics included."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, inner in value.items():
            if name.startswith("/"):
                yield name
            yield from _texts(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner)


def _scene(raced: Replayed) -> TrackScene:
    return make_scene(raced.setup)


def _a_state() -> RaceState:
    return RaceState(t_ns=1, t_s=0.0, phase=RacePhase.WAITING)


def _wait_for_subscription(peer: Peer, daemon: LiveServer) -> None:
    """Until what is told now reaches the peer: fleeting events are lost before that."""
    peer.subscribe("/race")
    daemon.tell(_a_state())
    peer.next("/race")
