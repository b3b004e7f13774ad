"""Small recordings for the tests of archives, and a real Dask scheduler with a worker, ended by their process ids."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Car", "Cluster", "cluster_of", "edge", "edge_command", "entry", "make_runs", "record"]

sys.path.insert(0, str(Path(__file__).parents[1] / "cli"))

import edge_command
from edge_command import edge
from table_runs import Car, entry, record

PATIENCE_S = 60.0


def make_runs(directory: Path, count: int) -> list[Path]:
    """So many recordings of three laps each, of two entries in turn; no two are alike."""
    return [
        record(
            directory,
            f"run-{place}.mcap",
            Car((3.0 + place / 50, 3.1, 2.9), off_m=place / 200),
            entry=entry("lane-net" if place % 2 else "pilot"),
        )
        for place in range(count)
    ]


@dataclass(frozen=True)
class Cluster:
    """A scheduler of its own process."""

    address: str
    scheduler: subprocess.Popen[bytes]


@contextmanager
def cluster_of(directory: Path, *, workers: int) -> Iterator[Cluster]:
    """A Dask scheduler on a free port of this machine, with one process of so many workers where that is not 0."""
    began: list[subprocess.Popen[bytes]] = []

    def begin(name: str, *words: str) -> Path:
        log = directory / f"{name}.log"
        with log.open("wb") as stream:
            command = (sys.executable, "-m", "distributed.cli.dask_" + name, *words, "--no-dashboard")
            environment = edge_command.environment() | {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
            began.append(subprocess.Popen(command, stdout=stream, stderr=stream, cwd=directory, env=environment))
        return log

    try:
        log = begin("scheduler", "--host", "127.0.0.1", "--port", "0")
        address = said(log, r"Scheduler at:\s+(tcp://\S+)")
        if workers:
            begin("worker", address, "--nworkers", str(workers), "--nthreads", "1", "--host", "127.0.0.1")
        yield Cluster(address=address, scheduler=began[0])
    finally:
        for process in began:
            process.terminate()
        for process in began:
            try:
                process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def said(log: Path, pattern: str) -> str:
    """What a process said by now, or soon."""
    ends = time.monotonic() + PATIENCE_S
    while (found := re.search(pattern, log.read_text())) is None:
        assert time.monotonic() < ends, log.read_text()
        time.sleep(0.05)
    return found[1]
