"""The world of the closed loop: truth to the instant, collisions, delay, and conditions that a seed makes identical."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from dnb_edge.nut.pursuit import PurePursuit
from dnb_edge.sim.control import Control, Obstacle
from dnb_edge.sim.driver import Pose
from dnb_edge.sim.light import LightChange
from dnb_edge.sim.places import PLACES, demo_camera, place
from dnb_edge.sim.renderer import Renderer
from dnb_edge.sim.solids import cylinder, mesh
from dnb_edge.sim.task import LoopTask, obstacles_beside
from dnb_edge.sim.vehicle import VehicleSettings
from dnb_edge.sim.witness import limit_s
from dnb_edge.sim.world import STEP_NS, World
from dnb_edge.values import Direction

MS = 1_000_000
STRAIGHT = VehicleSettings()


class Scripted:
    """Does what a function of the time in seconds says."""

    name = "scripted"
    knows_truth = True

    def __init__(self, wanted):
        self._wanted = wanted
        self.seen = []

    def start(self, briefing):
        """Nothing to get ready."""

    def drive(self, sight):
        """What the function says, the sight kept."""
        self.seen.append(sight)
        return self._wanted(sight.t_ns * 1e-9)

    def close(self):
        """Nothing to end."""


def ahead(throttle=0.4):
    """Straight on, as far as the trim lets it."""
    return Scripted(lambda _: Control(steering=0.0, throttle=throttle))


def small(**changes):
    """A task whose front pictures cost little."""
    return LoopTask(**{"front_size_px": (32, 24), "size_px": (160, 90), **changes})


def driven(world, driver, seconds=200.0, look_ms=5):
    """Drives until the world's end or for `seconds`; all states on the way, `look_ms` apart."""
    driver.start(world.brief(driver))
    states, t = [], 0
    while world.ended is None and t < seconds * 1000:
        world.drive_until(t * MS, driver)
        states.append(world.state(t * MS))
        t += look_ms
    return states


def test_the_laps_of_truth_are_those_that_were_driven():
    """Crossings from the arcs agree with the ground points sampled each millisecond far below 0.1 ms; laps are their gaps."""
    world = World(small(laps=2, seed=4))
    states = driven(world, PurePursuit(), look_ms=1)
    (x, y), (end_x, end_y) = world.circuit.start_line_m
    left = np.array([(end_x - x) * (s.track_m[1] - y) - (end_y - y) * (s.track_m[0] - x) for s in states])
    near = np.array([math.dist(s.track_m, world.circuit.start_line_m[0]) < 0.4 for s in states])
    at = np.flatnonzero((left[:-1] < 0.0) & (left[1:] >= 0.0) & near[1:])
    sampled_s = (at + left[at] / (left[at] - left[at + 1])) * 1e-3
    truth = world.truth()
    assert truth.ended == "laps"
    assert truth.completed
    assert [crossing.t_s for crossing in truth.crossings] == pytest.approx(sampled_s, abs=2e-6)
    assert [lap.time_s for lap in truth.laps] == pytest.approx(np.diff(sampled_s), abs=4e-6)
    assert truth.distance_m == pytest.approx(
        sum(math.dist(a.track_m, b.track_m) for a, b in itertools.pairwise(states)), rel=1e-3
    )


def test_the_same_task_is_the_same_drive_and_another_seed_is_not():
    """Frames, front pictures and truth are the same bytes twice; another seed has another car, room and way."""
    runs = []
    for seed in (5, 5, 6):
        world, driver = World(small(seed=seed, place="table", light=LightChange(depth=0.3))), ahead()
        frames = []
        for index in range(20):
            world.drive_until(world.frame_t_ns(index), driver)
            frames.append(world.frame(index).bgr.tobytes() if index % 7 == 0 else b"")
        runs.append((frames, world.state(world.frame_t_ns(19)), [sight.bgr.tobytes() for sight in driver.seen]))
    assert runs[0] == runs[1]
    assert runs[0][0] != runs[2][0]
    assert runs[0][1] != runs[2][1]
    assert runs[0][2] != runs[2][2]


@pytest.mark.parametrize("delay_s", [0.0, 0.05, 0.2])
def test_a_control_takes_hold_the_delay_later(delay_s):
    """The car stands until the first picture's control takes hold, at most one step after its instant, and moves after."""
    world, driver = World(small(delay_s=delay_s)), ahead()
    states = driven(world, driver, seconds=delay_s + 0.1)
    starts = next(k for k, state in enumerate(states) if state.speed_mps > 0.0)
    # The step in which it takes hold begins standing; the first state in motion is the one after.
    assert 0 <= starts * STEP_NS - round(delay_s * 1e9) <= 2 * STEP_NS


def test_the_delay_is_simulated_whatever_the_driver_takes():
    """A control is applied by the picture's stamp: rate and delay fix how many are shown before."""
    world, driver = World(small(delay_s=0.1, front_fps=50.0)), ahead()
    driven(world, driver, seconds=0.3)
    assert [sight.t_ns for sight in driver.seen[:4]] == [0, 20 * MS, 40 * MS, 60 * MS]
    moving = [sight.t_ns for sight in driver.seen if sight.speed_mps > 0.0]
    assert moving[0] == 120 * MS


@pytest.mark.parametrize(("fps", "front_fps"), [(60.0, 20.0), (29.97, 50.0), (7.3, 20.0)])
def test_how_often_the_overhead_camera_looks_changes_nothing(fps, front_fps):
    """The vehicle drives the same way to the bit, whatever the rate at which it is looked at from above."""
    ends = []
    for rate in (30.0, fps):
        world = World(small(fps=rate, front_fps=front_fps))
        swerving = Scripted(lambda t: Control(steering=0.3 * math.sin(3.0 * t), throttle=0.3))
        index = 0
        while world.frame_t_ns(index) < 2_000 * MS:
            world.drive_until(world.frame_t_ns(index), swerving)
            assert world.frame_t_ns(index) - STEP_NS < world.truth().duration_s * 1e9 + 1.0
            index += 1
        world.drive_until(2_000 * MS, swerving)
        ends.append((world.state(2_000 * MS), [sight.t_ns for sight in swerving.seen]))
    assert ends[0] == ends[1]


def in_the_way(seed=2, s_m=-0.1, aside_m=0.0):
    """A task with one obstacle on the straight on which the car is put down."""
    task = small(seed=seed)
    circuit, s = place("demo").circuit, np.array([place("demo").circuit.start_s_m + s_m])
    x, y = (circuit.centreline.at(s) + aside_m * circuit.centreline.normal(s))[0]
    return replace(task, obstacles=(Obstacle(track_m=(float(x), float(y)), radius_m=0.04),))


def test_the_car_stops_at_what_it_runs_into():
    """Its bumper meets the obstacle's edge at the told instant, and there it stands however long it pushes; it is told once."""
    task = in_the_way()
    world = World(task)
    states = driven(world, ahead(), seconds=6.0)
    (collision,) = world.truth().collisions
    last = states[-1]
    thing = task.obstacles[0]
    assert collision.obstacle == 0
    assert collision.speed_mps > 0.5
    assert collision.track_m == pytest.approx(last.track_m, abs=1e-9)
    assert last.speed_mps == 0.0
    gap = math.dist(last.track_m, thing.track_m) - thing.radius_m - 0.5 * STRAIGHT.length_m
    assert gap == pytest.approx(0.0, abs=0.01)
    before = states[math.floor(collision.t_s * 200)]
    assert before.speed_mps > 0.5
    assert math.dist(before.track_m, last.track_m) < 0.006


def test_backing_off_and_running_into_it_again_is_told_again():
    """The car can leave what it touches; only once it is away does touching count anew."""
    world = World(in_the_way())
    back_and_forth = Scripted(lambda t: Control(steering=0.0, throttle=-0.2 if 4.0 < t < 5.0 else 0.4))
    driven(world, back_and_forth, seconds=7.0)
    hits = world.truth().collisions
    assert len(hits) == 2
    assert hits[0].t_s < 4.0
    assert hits[1].t_s > 5.0


def test_a_car_that_stands_is_stuck_and_one_that_leaves_has_left():
    """Both end the drive, and so does the time limit."""
    stands = World(small())
    driven(stands, ahead(0.0), look_ms=50)
    leaves = World(small())
    driven(leaves, ahead(), look_ms=50)
    late = World(small(time_limit_s=1.0))
    driven(late, ahead(), look_ms=50)
    assert [world.ended for world in (stands, leaves, late)] == ["stuck", "left", "time"]
    assert stands.truth().duration_s == pytest.approx(8.0, abs=0.1)
    assert leaves.truth().off_lane_s > 0.1
    assert not leaves.truth().completed


def test_a_crossing_back_and_forth_is_no_lap():
    """A car that rolls back over the line and comes again has the line crossed three times, and no lap."""
    world = World(small())
    shunting = Scripted(lambda t: Control(steering=0.0, throttle=-0.2 if 2.2 < t < 4.4 else 0.25))
    driven(world, shunting, seconds=6.5)
    truth = world.truth()
    assert [crossing.direction for crossing in truth.crossings] == [
        Direction.FORWARD,
        Direction.REVERSE,
        Direction.FORWARD,
    ]
    assert truth.laps == ()


def test_a_turn_round_the_lines_end_is_no_lap():
    """A car that runs in circles crosses the line forward again and again, passing beside its end, and has driven no lap."""
    world = World(small(time_limit_s=25.0))
    circles = Scripted(lambda t: Control(steering=0.0 if t < 1.5 else 0.6, throttle=0.25))
    driven(world, circles, look_ms=20)
    truth = world.truth()
    assert len(truth.crossings) >= 4
    assert {crossing.direction for crossing in truth.crossings} == {Direction.FORWARD}
    assert truth.laps == ()


@pytest.mark.parametrize("name", ["eight", "hairpin", "table"])
def test_laps_are_told_on_every_circuit(name):
    """Where the route crosses itself, or two of its lanes lie side by side, each lap is counted once."""
    world = World(small(place=name, laps=2, seed=3))
    driven(world, PurePursuit(), look_ms=20)
    truth = world.truth()
    assert (truth.ended, len(truth.laps), len(truth.crossings)) == ("laps", 2, 3)


def test_wrong_way_starts_on_the_lane_pointing_back():
    """The same place as without, turned round."""
    right, wrong = (World(small(wrong_way=wrong_way)).state(0) for wrong_way in (False, True))
    assert wrong.track_m == right.track_m
    assert abs(math.remainder(wrong.heading_rad - right.heading_rad, math.tau)) == pytest.approx(math.pi)


def test_only_who_knows_the_truth_is_told_it():
    """A driver that is an entry gets pictures and speed, neither the circuit nor its own pose."""
    told = World(in_the_way())
    driver = ahead()
    driver.knows_truth = False
    driven(told, driver, seconds=0.2)
    briefing = told.brief(driver)
    assert (briefing.circuit, briefing.obstacles) == (None, ())
    assert all(sight.state is None for sight in driver.seen)
    driver.knows_truth = True
    assert told.brief(driver).obstacles == told.task.obstacles


@pytest.mark.parametrize("name", PLACES)
def test_obstacles_leave_a_car_its_way(name):
    """Wherever a seed stands them, each leaves more than the car's width within the lane's tape, and none is near the start."""
    circuit = place(name).circuit
    count = 1 if "table" in name else 4
    for seed in range(5):
        for thing in obstacles_beside(circuit, count=count, seed=seed):
            s = np.arange(0.0, circuit.centreline.length_m, 0.002)
            away = np.linalg.norm(circuit.centreline.at(s) - np.asarray(thing.track_m), axis=1)
            free = away.min() - thing.radius_m + 0.5 * circuit.lane_width_m
            assert free > 0.5 * circuit.lane_width_m + 0.03
            assert min(math.dist(thing.track_m, end) for end in circuit.start_line_m) > 0.3
    with pytest.raises(ValueError, match="room"):
        obstacles_beside(circuit, count=100, seed=1)


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        ({"seed": -1}, "seed"),
        ({"laps": 0}, "laps"),
        ({"place": "moon"}, "moon"),
        ({"fps": 0.0}, "fps"),
        ({"delay_s": -0.1}, "delay_s"),
        ({"size_px": (0, 90)}, "pictures"),
        ({"time_limit_s": 0.0}, "time_limit_s"),
    ],
)
def test_a_task_that_cannot_be_is_refused(wrong, word):
    """Each value out of bounds is named."""
    with pytest.raises(ValueError, match=word):
        LoopTask(**wrong)


def test_a_drivers_time_goes_by_laps_and_length():
    """Without a limit of its own a task gives as long as a slow driver needs."""
    circuit = place("demo").circuit
    assert limit_s(LoopTask(laps=3), circuit) == pytest.approx(15.0 + 4 * circuit.centreline.length_m / 0.35)
    assert limit_s(LoopTask(time_limit_s=7.0), circuit) == 7.0


@pytest.mark.parametrize(("y_m", "at_m", "hidden"), [(0.36, (0.25, 0.09), True), (0.17, (0.22, 0.0), False)])
def test_from_above_an_obstacle_hides_what_is_behind_it(y_m, at_m, hidden):
    """Where car and obstacle overlap in the overhead picture, the one nearer to the camera is drawn over the other."""
    renderer = Renderer(place("demo").circuit, demo_camera((640, 360)), 3)
    renderer.stand(mesh([cylinder((2.0, 0.25, 0.05), 0.03, 0.1, 2, (40.0, 90.0, 235.0), sides=20)]))
    u, v = (round(px) for px in renderer.camera.project(np.array([[2.0, *at_m]]))[0])
    alone = renderer.picture(0, None)[v, u].astype(int)
    with_car = renderer.picture(0, Pose(track_m=(2.0, y_m), heading_rad=0.0, speed_mps=0.0))[v, u].astype(int)
    assert (np.abs(with_car - alone).max() < 12) == hidden
