"""The race's numbers on this processor and on a Raspberry Pi's, from the same detections: times within 0.1 ms, or exit code 1.

Not a test of `make test`: it needs what `aarch64_output.py` needs, and uses the same emulated Debian. `make aarch64-check` runs
it. The detections are made here, once, for all: simulated laps at two places, with noise and missing frames; only the core is
compared. Laps, their number, validity and reasons must be equal; similarity within a thousandth of a point.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve()
LIMIT_S = 0.0001
LIMIT_POINTS = 0.001
PLACES = ("demo", "table")


def draw(path: Path, *, laps: int, seed: int) -> None:
    """Writes the setups and the detections of `laps` laps at each place as JSON."""
    import numpy as np  # noqa: PLC0415

    from dnb_edge import wire  # noqa: PLC0415
    from dnb_edge.sim.driver import drive  # noqa: PLC0415
    from dnb_edge.truth.course import course  # noqa: PLC0415
    from dnb_edge.truth.sightings import Sightings, moments, sighted  # noqa: PLC0415

    races = []
    for name in PLACES:
        here = course(name)
        driven = drive(here.place.circuit, laps=laps, seed=seed)
        at = moments(driven, fps=30.0)
        kept = np.random.default_rng(seed).uniform(size=len(at.t_s)) > 0.03
        lap_m = here.place.circuit.centreline.length_m
        found = sighted(driven, here.place.camera, at, Sightings(), lap_m=lap_m, kept=kept, seed=seed)
        races.append({"place": name, "setup": here.setup.to_dict(), "frames": [wire.to_dict(frame) for frame in found]})
    path.write_text(json.dumps(races), encoding="utf-8")


def answer(inputs: Path, out: Path) -> None:
    """Races all of it and writes what the core says of crossings, laps and scores."""
    from dnb_edge import wire  # noqa: PLC0415
    from dnb_edge.core import Core, CoreSetup  # noqa: PLC0415
    from dnb_edge.values import Crossing, FrameDetections, Lap, Score  # noqa: PLC0415

    told = []
    for race in json.loads(inputs.read_text(encoding="utf-8")):
        core = Core(CoreSetup.from_dict(race["setup"]))
        events = [event for frame in race["frames"] for event in core.step(wire.from_dict(FrameDetections, frame))]
        events += core.finish()
        told += [
            {"place": race["place"], "event": type(event).__name__, **wire.to_dict(event)}
            for event in events
            if isinstance(event, Crossing | Lap | Score)
        ]
    out.write_text(json.dumps(told), encoding="utf-8")


def compare(here: Path, there: Path) -> dict[str, Any]:
    """Largest differences; anything that is no measured number and differs is infinitely far."""
    ours, theirs = (json.loads(path.read_text(encoding="utf-8")) for path in (here, there))
    same = [(one["event"], one.get("number"), one.get("valid"), one.get("reasons"), one.get("status")) for one in ours]
    equal = same == [
        (one["event"], one.get("number"), one.get("valid"), one.get("reasons"), one.get("status")) for one in theirs
    ]
    times = ("t_s", "time_s", "sigma_s", "start_s")
    apart_s = max((_apart(a, b, times) for a, b in zip(ours, theirs, strict=False)), default=0.0)
    points = ("similarity_percent",)
    apart_points = max((_apart(a, b, points) for a, b in zip(ours, theirs, strict=False)), default=0.0)
    return {
        "laps": sum(one["event"] == "Lap" for one in ours),
        "equal": equal,
        "largest_time_difference_s": apart_s if equal else float("inf"),
        "largest_similarity_difference": apart_points if equal else float("inf"),
    }


def _apart(one: dict[str, Any], other: dict[str, Any], names: tuple[str, ...]) -> float:
    return max((abs(one[name] - other[name]) for name in names if one.get(name) is not None), default=0.0)


def guest(root: Path, processor: str, inputs: Path) -> Path:
    """What the emulated processor answers; the file with it."""
    from aarch64_output import QEMU, REPOSITORY, SITE  # noqa: PLC0415

    work = root / "compare"
    shutil.rmtree(work, ignore_errors=True)
    shutil.rmtree(root / SITE / "dnb_edge", ignore_errors=True)
    shutil.copytree(REPOSITORY / "dnb_edge", root / SITE / "dnb_edge", ignore=shutil.ignore_patterns("__pycache__"))
    work.mkdir()
    for file in (HERE, inputs):
        shutil.copy(file, work)
    words = ["chroot", str(root), f"/usr/bin/{QEMU.name}", "/usr/bin/python3.11", f"/compare/{HERE.name}"]
    environment = {
        "PYTHONPATH": f"/{SITE}",
        "QEMU_CPU": processor,
        "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
        "HOME": "/",
    }
    words += ["--answer", f"/compare/{inputs.name}", "/compare/there.json"]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"the emulated {processor} failed:\n{done.stderr}")
    return work / "there.json"


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description="Compare the core's numbers on this processor and on aarch64.")
    parser.add_argument("--root", type=Path, default=Path("/var/tmp/dnb-edge-aarch64"), help="the aarch64 Debian")
    parser.add_argument("--laps", type=int, default=10, help="laps at each place")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--answer", type=Path, nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.answer is not None:
        answer(*given.answer)
        return
    if os.geteuid() != 0:
        sys.exit("chroot needs root: sudo make aarch64-check")
    from aarch64_output import PROCESSORS, build  # noqa: PLC0415

    root: Path = given.root.resolve()
    root.parent.mkdir(parents=True, exist_ok=True)
    if not root.exists():
        build(root)
    inputs, here = root.with_name(root.name + ".race.json"), root.with_name(root.name + ".race.here.json")
    draw(inputs, laps=given.laps, seed=given.seed)
    answer(inputs, here)
    differs = False
    for processor in PROCESSORS:
        figures = compare(here, guest(root, processor, inputs))
        differs |= figures["largest_time_difference_s"] > LIMIT_S
        differs |= figures["largest_similarity_difference"] > LIMIT_POINTS
        print(json.dumps({"processor": processor, **figures}), flush=True)
    sys.exit(f"differs by more than {LIMIT_S} s or {LIMIT_POINTS} points" if differs else 0)


if __name__ == "__main__":
    main()
