"""What viewers and downloads cost a live race: frames, and the times of laps. A script, not a test.

    python tests/web/flood.py [--seconds 60] [--viewers 50] [--downloads 8] [--size 640x360]

The same race twice, with the real detector on a camera that gives rendered JPEGs at 30 frames a second and waits for nobody:
once alone, once with the pages, so many WebSockets that follow the race and so many endless downloads of a large recording.
Prints JSON.
"""

import argparse
import asyncio
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import websockets
from running_box import Process, RunningBox, wait_until

from dnb_edge.cli.demo import write_demo_config
from dnb_edge.cli.main import main
from dnb_edge.daemon import appliance
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Clock, Frame, LostFrames, SourceInfo, StampSource

RACE_WEIGHT, WEB_WEIGHT, CROWD_WEIGHT = 100, 20, 2
"""Shares of the processors: what the units give, and next to nothing for browsers, which are other machines."""
CONTROL = Path("/sys/fs/cgroup/cpu")


def weigh(name: str, pid: int, weight: int) -> None:
    """Gives the process its share, as systemd does with CPUWeight=; says so where this machine does not let us."""
    group = CONTROL / f"flood-{name}"
    try:
        group.mkdir(exist_ok=True)
        (group / "cpu.shares").write_text(str(1024 * weight // 100))
        for task in Path(f"/proc/{pid}/task").iterdir():
            (group / "tasks").write_text(task.name)
        (group / "cgroup.procs").write_text(str(pid))
    except OSError as error:
        print(f"no share of the processors for {name}: {error}", file=sys.stderr)


class Reel:
    """A live camera over a folder of JPEGs, one for each frame of a drive that began at `since_ns`."""

    lost: tuple[LostFrames, ...] = ()

    def __init__(self, folder: Path, since_ns: int) -> None:
        self._about = json.loads((folder / "about.json").read_text())
        self._folder, self._since_ns = folder, since_ns
        self._closed = threading.Event()
        width, height = self._about["size_px"]
        self.info = SourceInfo(
            uri="reel",
            width_px=width,
            height_px=height,
            nominal_fps=30.0,
            clock=Clock.MONOTONIC,
            live=True,
            camera_id="reel",
        )

    def frames(self) -> Iterator[Frame]:
        """Each at its time; those whose time has passed are lost, as with a camera."""
        for number, after_ns in enumerate(self._about["t_ns"]):
            t_ns = self._since_ns + after_ns
            if self._closed.wait(max(0.0, (t_ns - time.monotonic_ns()) * 1e-9)):
                return
            yield Frame(
                sequence=number,
                t_ns=t_ns,
                stamp_source=StampSource.START_OF_FRAME,
                width_px=self.info.width_px,
                height_px=self.info.height_px,
                jpeg=(self._folder / f"{number}.jpg").read_bytes(),
            )

    def close(self) -> None:
        """Ends `frames`."""
        self._closed.set()


def draw(folder: Path, seconds: float, size_px: tuple[int, int]) -> Path:
    """The drive's pictures and its configuration."""
    rig = Rig(laps=max(2, round(seconds / 6.7)))
    count = min(rig.frames, round(30 * seconds))
    for number in range(count):
        picture = cv2.resize(rig.frame(number).bgr, size_px, interpolation=cv2.INTER_AREA)
        assert cv2.imwrite(str(folder / f"{number}.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 85])
    about = {"size_px": size_px, "t_ns": [rig.t_ns(number) for number in range(count)]}
    (folder / "about.json").write_text(json.dumps(about))
    return write_demo_config(folder, rig)


def race(folder: Path, config: Path, seconds: float, flood: Any = None) -> dict[str, Any]:
    """One race; `flood(box)` is begun once it runs and gives a function that ends it."""
    place = Path(tempfile.mkdtemp(dir=folder))
    box = RunningBox(place, laps=2)
    since_ns = time.monotonic_ns() + 3_000_000_000
    words = [str(folder), str(since_ns), "run", "--config", str(config), "--source", "sim:", "--record", str(box.runs)]
    daemon = Process(
        [*words, "--live", str(box.socket), "--json", "--no-resume"], place / "run.log", program=(__file__,)
    )
    box.daemon = daemon
    weigh("race", daemon.pid, RACE_WEIGHT)
    try:
        end = None
        if flood is not None:
            weigh("web", box.start_web().pid, WEB_WEIGHT)
            end = flood(box)
        wait_until(lambda: not daemon.running, lambda: daemon.said, patience_s=seconds + 60)
        told = {} if end is None else end()
    finally:
        box.close()
    health = daemon.events("health")[-1]
    lost = sum(one["frames"] for one in health["lost"])
    return {
        "frames": health["frames"],
        "lost": lost,
        "lost_percent": round(100 * lost / max(1, lost + health["frames"]), 2),
        "laps_s": [round(lap["time_s"], 4) for lap in daemon.events("lap")],
        "latency_p95_ms": health["latency_p95_ms"],
        **told,
    }


def flooding(viewers: int, downloads: int, large: bytes) -> Any:
    """Begins the flood."""

    def begin(box: RunningBox) -> Any:
        (box.runs / "large.mcap").write_bytes(large)
        crowd = subprocess.Popen(
            [sys.executable, __file__, "crowd", box.url, str(viewers), str(downloads)],
            stdout=subprocess.PIPE,
            text=True,
        )

        def end() -> dict[str, Any]:
            crowd.terminate()
            return dict(json.loads(crowd.communicate()[0]))

        return end

    return begin


async def crowd(url: str, viewers: int, downloads: int) -> None:
    """Follows and downloads until it is told to end, then prints how much."""
    counts = {"events": 0, "laps": 0, "bytes": 0}
    with urllib.request.urlopen(f"{url}/api/v1/runs") as answer:
        runs = json.load(answer)["runs"]
    run = max(runs, key=lambda one: one["size_bytes"])

    async def view() -> None:
        async with websockets.connect(url.replace("http", "ws") + "/api/v1/live", origin=url, max_size=None) as line:
            async for text in line:
                counts["events"] += 1
                counts["laps"] += '"event":"lap"' in str(text).replace(" ", "")

    async def download() -> None:
        host, port = url.removeprefix("http://").split(":")
        while True:
            reader, writer = await asyncio.open_connection(host, int(port))
            path = f"/api/v1/runs/{run['id']}/recording.mcap"
            writer.write(f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: close\r\n\r\n".encode())
            while part := await reader.read(1 << 16):
                counts["bytes"] += len(part)
            writer.close()

    tasks = [asyncio.create_task(view()) for _ in range(viewers)] + [
        asyncio.create_task(download()) for _ in range(downloads)
    ]
    loop = asyncio.get_running_loop()
    ended = asyncio.Event()
    loop.add_signal_handler(15, ended.set)
    await ended.wait()
    failed = sum(task.done() for task in tasks)
    print(json.dumps({**counts, "viewers": viewers, "downloads": downloads, "failed": failed}), flush=True)
    os._exit(0)


def measure() -> None:
    """Both races."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--viewers", type=int, default=50)
    parser.add_argument("--downloads", type=int, default=8)
    parser.add_argument("--size", default="640x360")
    asked = parser.parse_args()
    width, height = map(int, asked.size.split("x"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        config = draw(folder, asked.seconds, (width, height))
        alone = race(folder, config, asked.seconds)
        # A recording of some size, that takes the downloads a while.
        large = next(folder.glob("*/runs/*.mcap")).read_bytes()
        flooded = race(folder, config, asked.seconds, flooding(asked.viewers, asked.downloads, large))
    print(json.dumps({"load": os.getloadavg()[0], "alone": alone, "flooded": flooded}))


if __name__ == "__main__":
    if len(sys.argv) > 1 and sys.argv[1] == "crowd":
        asyncio.run(crowd(sys.argv[2], int(sys.argv[3]), int(sys.argv[4])))
    elif len(sys.argv) > 3 and sys.argv[3] == "run":
        reel = Reel(Path(sys.argv[1]), int(sys.argv[2]))
        appliance.make_source = lambda *_: reel
        del sys.argv[1:3]
        main()
    else:
        measure()
