"""A recording scored again says what the race said when it was recorded, bit for bit."""

from pathlib import Path

from edge_command import edge

from dnb_edge import wire
from dnb_edge.cli.bench_score import record_drive
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.record.reader import read_run
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Health, Lap


def test_a_recording_scored_again_tells_every_event_of_the_race(tmp_path: Path) -> None:
    """All that `score` prints, observations, crossings, laps and scores, was recorded, in this order, as this text."""
    config = load_config(write_demo_config(tmp_path, Rig(seed=1, laps=1)))
    path = record_drive(config, tmp_path, laps=3, jpeg=b"not looked at")
    recorded = [event for event in read_run(path).events() if not isinstance(event, Health)]
    assert sum(isinstance(event, Lap) for event in recorded) == 3
    again = edge("score", path, "--json", "--observations")
    told = again.out.splitlines()
    live = [wire.event_to_json(event) for event in recorded]
    wanted = {line.split(",")[0] for line in told}
    assert (again.code, again.err) == (0, "")
    assert len(wanted) >= len({"observation", "crossing", "lap", "score", "run"})
    assert told[:-1] == [line for line in live if line.split(",")[0] in wanted]
