"""Long work for the pages, one piece after the other in processes of their own; what came of it is kept for who asks next.

A piece of work is known by its kind and by all that it is made of: asked for twice it is done once. Knows processes and a
folder of results; knows neither recordings nor requests.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dnb_edge import __version__
from dnb_edge.errors import InputError, WorkError
from dnb_edge.web.endpoint import Refused

MOST_WAITING = 8
MOST_S = 1200.0
MOST_KEPT_BYTES = 256 * 1024 * 1024
MOST_REMEMBERED = 256
FAILED_FOR_S = 20.0
"""So long a failure is told to whoever asks, before it is tried again."""
RETRY_AFTER_S = 2.0
_POLL_S = 0.05


@dataclass(slots=True, kw_only=True)
class Job:
    """One piece of work. Written by its thread alone, read by anybody."""

    kind: str
    spec: dict[str, Any]
    file: Path
    """Where its result lies once it is done."""
    text: str = "Waiting"
    share: float | None = None
    """How much of it is done, 0..1, where that is known."""
    told: dict[str, Any] = field(default_factory=dict)
    """What it said at its end."""
    error: Exception | None = None
    ended_s: float | None = None
    """time.monotonic() of its end."""

    @property
    def failed_lately(self) -> bool:
        """Whether it failed so lately that trying again would be no better."""
        return self.error is not None and self.ended_s is not None and time.monotonic() - self.ended_s < FAILED_FOR_S


class Jobs:
    """Does one piece of work at a time."""

    def __init__(self, folder: Path) -> None:
        """`folder` for the results is made when it is first needed."""
        self._folder = folder
        self._lock = threading.Lock()
        self._known: OrderedDict[str, Job] = OrderedDict()
        self._waiting: queue.Queue[Job] = queue.Queue()
        self._thread: threading.Thread | None = None

    def ask(self, kind: str, spec: dict[str, Any], *, stamp: str, suffix: str) -> Job:
        """The work of this kind on `spec`, begun if need be; `stamp` is another text where anything it reads has changed.

        Raises `Refused` (503) where too much is waiting already.
        """
        text = json.dumps([kind, spec, stamp, __version__], sort_keys=True)
        key = hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
        with self._lock:
            job = self._known.get(key)
            if job is not None and (job.ended_s is None or job.failed_lately or (not job.error and _touched(job.file))):
                self._known.move_to_end(key)
                return job
            if self._waiting.qsize() >= MOST_WAITING:
                raise Refused(503, "busy", "Too much is being made already: try again in a minute.", retry_after_s=30.0)
            job = Job(kind=kind, spec=spec, file=self._folder / f"{key}{suffix}")
            self._known[key] = job
            if kind != "copy" and _touched(job.file):
                job.ended_s = time.monotonic()
                return job
            while len(self._known) > MOST_REMEMBERED:
                self._known.popitem(last=False)
            self._waiting.put(job)
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, name="jobs", daemon=True)
                self._thread.start()
            return job

    def _work(self) -> None:
        while True:
            job = self._waiting.get()
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
                _make_room(self._folder)
                _do(job)
            except OSError as error:
                job.error = WorkError(f"the page's folder cannot be used: {error.strerror}")
            except (InputError, WorkError, Refused) as error:
                job.error = error
            job.ended_s = time.monotonic()


async def done(job: Job, *, within_s: float) -> bool:
    """Whether the work is done, after waiting for it a little. Raises its error where it failed."""
    until_s = time.monotonic() + within_s
    while job.ended_s is None and time.monotonic() < until_s:
        await asyncio.sleep(_POLL_S)
    if job.error is not None:
        raise job.error
    return job.ended_s is not None


def _do(job: Job) -> None:
    partial = job.file.with_name(f".{job.file.name}")
    # One thread: the race has the other processors. The parent's end of stdin closes with it, and that ends the work.
    surroundings = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "dnb_edge.archive.job", job.kind, json.dumps(job.spec), str(partial)]
    with subprocess.Popen(  # noqa: S603 our own interpreter and module; the rest is data
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=surroundings
    ) as process:
        watch = threading.Timer(MOST_S, process.kill)
        watch.start()
        try:
            last: dict[str, Any] = {}
            assert process.stdout is not None, "it is a pipe"
            for line in process.stdout:
                last = _said(line) or last
                job.text, job.share = last.get("text", job.text), last.get("share")
            status = process.wait()
        finally:
            watch.cancel()
            process.kill()
    if status == 0 and last.get("done"):
        partial.replace(job.file)
        job.told = last
        return
    partial.unlink(missing_ok=True)
    raise _error(last, status)


def _said(line: bytes) -> dict[str, Any] | None:
    """What a line says; None where something else has written to stdout."""
    try:
        found = json.loads(line)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def _error(last: dict[str, Any], status: int) -> Exception:
    text = last.get("error")
    if text is None:
        return WorkError(f"the work ended too early (status {status}): the recording is too long for the page perhaps")
    match last.get("fault"):
        case "input":
            return InputError(text)
        case "temporary":
            return Refused(409, "not-yet", text, retry_after_s=RETRY_AFTER_S)
        case _:
            return WorkError(text)


def _touched(file: Path) -> bool:
    """Whether the file is there; it counts as new again then."""
    try:
        os.utime(file)
    except FileNotFoundError:
        return False
    return True


def _make_room(folder: Path) -> None:
    """Forgets the results that nobody asked for longest, until they take little enough."""
    found = sorted((entry.stat().st_mtime_ns, entry.stat().st_size, entry.path) for entry in os.scandir(folder))
    total = sum(size for _, size, _ in found)
    for _, size, path in found:
        if total <= MOST_KEPT_BYTES:
            return
        Path(path).unlink(missing_ok=True)
        total -= size
