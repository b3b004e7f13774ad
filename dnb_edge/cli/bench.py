"""`dnb-edge bench`: the speed of every stage on this machine, one thread, as medians with the 99th percentile beside them."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, TypeVar

import cv2
import numpy as np
import typer
from rich.console import Console
from rich.progress import track

from dnb_edge.assembly import assemble, make_detector
from dnb_edge.capture.decode import decode_bgr
from dnb_edge.capture.simulated import SimulatedSource, SimulatorOptions
from dnb_edge.cli.bench_score import rescore_times
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.core import Core, CoreSetup
from dnb_edge.detect.centre import CentreDetectorSettings
from dnb_edge.detect.onnx import SIDE_MULTIPLE_PX, CentreNetwork, default_model_path, load_model
from dnb_edge.score.distance import dtw_distance
from dnb_edge.sim.rig import Rig
from dnb_edge.values import BgrImage, Frame, Points, SearchWindow
from dnb_edge.view.drift import DriftWatch
from dnb_edge.view.drift_judge import watched_track

T = TypeVar("T")

FRAME_BYTES = 150_000
"""Size of the JPEG that a 1280x720 webcam sends, about."""

WARM_UP = 30
"""Frames before the clock starts: the car has to be found first."""


RESCORED_LAPS = 30
"""Laps of the recording that is scored again: enough that what is done once a recording weighs little."""

BLOCK = 10
"""Frames after which it is the turn of what is timed beside the appliance's own way."""


def bench(
    frames: Annotated[int, typer.Option(min=100, help="Frames to time.")] = 300,
    dtw_points: Annotated[int, typer.Option(min=10, help="Points of both paths in the DTW comparison.")] = 2000,
    as_json: Annotated[bool, typer.Option("--json", help="JSON on stdout instead of a table.")] = False,
) -> None:
    """Time every stage on rendered frames: JPEG decoding, detector, core, and all of it end to end; scoring a recording again
    (`rescore_hour_s`: processor time for an hour of it); and DTW.

    Machines differ and are shared: compare the ratios, which come from one run.
    """
    cv2.setNumThreads(1)
    console = Console(stderr=True)
    with TemporaryDirectory() as scratch:
        rig = Rig(seed=1, laps=3)
        config = load_config(write_demo_config(Path(scratch), rig))
        jpegs = _jpegs(rig, frames + WARM_UP, console)
        result = _pipeline(config, jpegs, console)
        console.print("Timing a recording that is scored again ...", highlight=False)
        result |= rescore_times(config, Path(scratch), laps=RESCORED_LAPS, jpeg=jpegs[0].jpeg or b"")
    result |= _dtw(dtw_points, console)
    if as_json:
        typer.echo(json.dumps(result))
        return
    for name, value in result.items():
        typer.echo(f"{name:28} {value:12.4g}" if isinstance(value, float) else f"{name:28} {value:>12}")


def _jpegs(rig: Rig, count: int, console: Console) -> list[Frame]:
    """Frames of the rig as JPEGs of about the size that a camera sends."""
    quality = _quality(rig)
    frames = []
    for i in track(range(min(count, rig.frames)), "Rendering", console=console, transient=True):
        frame = rig.frame(i)
        assert frame.bgr is not None
        encoded, jpeg = cv2.imencode(".jpg", frame.bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
        assert encoded
        frames.append(
            Frame(
                sequence=frame.sequence,
                t_ns=frame.t_ns,
                stamp_source=frame.stamp_source,
                width_px=frame.width_px,
                height_px=frame.height_px,
                jpeg=jpeg.tobytes(),
            )
        )
    return frames


def _quality(rig: Rig) -> int:
    image = rig.frame(0).bgr
    assert image is not None

    def size(quality: int) -> int:
        return len(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1])

    return min(range(50, 99, 2), key=lambda quality: abs(size(quality) - FRAME_BYTES))


def _pipeline(config: Config, frames: list[Frame], console: Console) -> dict[str, Any]:
    """Times of each stage and of the whole way.

    Decoding alone and the whole way go frame by frame in turn, as in the appliance. What is timed beside them has its own turn
    after every `BLOCK` frames, so that the machine's moods hit all alike and yet none finds the others' data in the caches.
    """
    info = SimulatedSource("sim:", SimulatorOptions()).info
    setup = assemble(config, info).setup
    detector, asides, core = make_detector(config, setup.ground), _asides(config), Core(setup)
    drift_s: list[float] = []
    asides["drift"] = _drift_watch(setup, frames, drift_s)
    times: dict[str, list[float]] = {}
    following = 0
    block: list[tuple[BgrImage, int, tuple[SearchWindow, ...]]] = []
    for i, frame in enumerate(track(frames, "Timing", console=console, transient=True)):
        decode_ms, _ = _timed(decode_bgr, frame)
        began = time.perf_counter()
        image = decode_bgr(frame)
        assert image is not None
        windows = core.windows(frame.t_ns)
        before = time.perf_counter()
        found = detector.detect(image, sequence=frame.sequence, t_ns=frame.t_ns, windows=windows)
        after = time.perf_counter()
        core.step(found)
        ended = time.perf_counter()
        block.append((image, i, windows))
        if i >= WARM_UP:
            following += bool(windows)
            for name, seconds in (("window", after - before), ("core", ended - after), ("end_to_end", ended - began)):
                times.setdefault(name, []).append(seconds * 1e3)
            times.setdefault("decode", []).append(decode_ms)
        if len(block) == BLOCK or i + 1 == len(frames):
            for name, work in asides.items():
                samples = [_timed(work, *one)[0] for one in block]
                times.setdefault(name, []).extend(samples if i >= WARM_UP else [])
            block = []
    result: dict[str, Any] = {
        "frame_bytes": round(float(np.mean([len(frame.jpeg or b"") for frame in frames]))),
        "timed_frames": len(times["decode"]),
        "following_frames": following,
    }
    for name, samples_ms in sorted(times.items()):
        result[f"{name}_ms"] = float(np.median(samples_ms))
        result[f"{name}_p99_ms"] = float(np.percentile(samples_ms, 99))
    result["drift_share_of_core"] = sum(drift_s) / ((frames[-1].t_ns - frames[0].t_ns) * 1e-9)
    result["end_to_end_to_decode"] = result["end_to_end_ms"] / result["decode_ms"]
    return result


Aside = Callable[[BgrImage, int, tuple[SearchWindow, ...]], object]
"""What is timed beside the appliance's own way: it gets the picture, its number and the windows of the followed car."""


def _asides(config: Config) -> dict[str, Aside]:
    """The network alone, over a window and over the whole frame, on one thread and on two; and windows for 4 and for 8 cars."""
    path = config.detector.model or default_model_path()
    sizes = CentreDetectorSettings()
    window_px = (sizes.window_px, sizes.window_px)
    looker = make_detector(config)
    asides: dict[str, Aside] = {
        "full_frame": lambda image, number, _windows: looker.detect(image, sequence=number, t_ns=number, windows=())
    }
    for threads, name in ((1, ""), (2, "_2_threads")):
        network = load_model(path, threads=threads)
        asides[f"window_network{name}"] = _network_alone(network, window_px)
        asides[f"full_network{name}"] = _network_alone(network, (sizes.whole_width_px, sizes.whole_width_px * 9 // 16))
    detector_config = config.detector.model_copy(update={"threads": 2})
    asides["window_2_threads"] = _follower(config.model_copy(update={"detector": detector_config}), cars=1)
    for cars in (4, 8):
        asides[f"windows_{cars}"] = _follower(config, cars=cars)
    return asides


def _drift_watch(setup: CoreSetup, frames: list[Frame], spent_s: list[float]) -> Aside:
    """The drift watch, as it runs beside a race: a little in most frames, nothing in some.

    Its processor time goes to `spent_s`, from the first frame on: what interrupts it is no share of its own.
    """
    watch = DriftWatch(watched_track(setup.ground, setup.track.centreline.points_m))

    def look(image: BgrImage, number: int, _windows: tuple[SearchWindow, ...]) -> bool:
        began = time.thread_time()
        changed = watch.look(image, frames[number].t_ns)
        spent_s.append(time.thread_time() - began)
        return changed

    return look


def _network_alone(network: CentreNetwork, size_px: tuple[int, int]) -> Aside:
    """The network over a picture of `size_px` (width, height), sides rounded up to what it takes."""
    width, height = (-(-side // SIDE_MULTIPLE_PX) * SIDE_MULTIPLE_PX for side in size_px)
    pixels = np.random.default_rng(0).integers(0, 256, (height, width, 4), dtype=np.uint8)
    return lambda _image, _number, _windows: network(pixels)


def _follower(config: Config, *, cars: int) -> Aside:
    """A detector with as many windows a frame, all about the one car, each a little off the others."""
    detector = make_detector(config)

    def look(image: BgrImage, number: int, windows: tuple[SearchWindow, ...]) -> object:
        many = [
            replace(window, target_id=car + 1, camera_px=(window.camera_px[0] + 3 * car, window.camera_px[1] - 3 * car))
            for window in windows[:1]
            for car in range(cars)
        ]
        return detector.detect(image, sequence=number, t_ns=number, windows=many)

    return look


def _dtw(count: int, console: Console) -> dict[str, Any]:
    """Our DTW against the plain double loop over the same formula, once over NumPy arrays and once over lists."""
    turn = np.linspace(0.0, 2 * math.pi, count)
    wobble = np.random.default_rng(1).normal(0.0, 0.01, (count, 2))
    route: Points = np.column_stack([np.cos(turn), np.sin(turn)])
    path = route * 1.02 + wobble
    console.print("Timing DTW against plain loops ...", highlight=False)
    fast_ms = [_timed(lambda: dtw_distance(path, route, 0.5)) for _ in range(7)]
    arrays_ms, by_arrays = _timed(lambda: dtw_loop_over_arrays(path, route, 0.5))
    lists_ms, by_lists = _timed(lambda: dtw_loop_over_lists(path, route, 0.5))
    median_ms = float(np.median([ms for ms, _ in fast_ms]))
    return {
        "dtw_points": count,
        "dtw_ms": median_ms,
        "dtw_array_loop_ms": arrays_ms,
        "dtw_list_loop_ms": lists_ms,
        "dtw_faster_than_array_loop": arrays_ms / median_ms,
        "dtw_faster_than_list_loop": lists_ms / median_ms,
        "dtw_largest_difference": max(abs(fast_ms[0][1] - by_arrays), abs(fast_ms[0][1] - by_lists)),
    }


def dtw_loop_over_arrays(path: Points, reference: Points, clamp: float) -> float:
    """DTW by the plain double loop over NumPy arrays, as benchmarks of driving usually have it; the yardstick."""
    n, m = len(path), len(reference)
    table = np.full((n + 1, m + 1), np.inf)
    table[0, 0] = 0.0
    for i in range(n):
        for j in range(m):
            cost = min(np.linalg.norm(path[i] - reference[j]), clamp)
            table[i + 1, j + 1] = cost + min(table[i, j + 1], table[i + 1, j], table[i, j])
    return float(table[n, m])


def dtw_loop_over_lists(path: Points, reference: Points, clamp: float) -> float:
    """DTW by the plain double loop over Python's own floats: the fastest that the loop can be without NumPy."""
    xs, ys = path.tolist(), reference.tolist()
    above = [0.0] + [math.inf] * len(ys)
    for x, y in xs:
        row = [math.inf]
        for j, (u, v) in enumerate(ys):
            row.append(min(math.hypot(x - u, y - v), clamp) + min(above[j + 1], row[j], above[j]))
        above = row
    return above[-1]


def _timed(work: Callable[..., T], *given: Any) -> tuple[float, T]:
    """(milliseconds, result) of one call."""
    began = time.perf_counter()
    result = work(*given)
    return (time.perf_counter() - began) * 1e3, result
