"""Work shared out among processes: a Dask cluster of this machine's cores, or one that runs already; the same code for both.

Knows Dask, and that workers die. Knows no recording. Dask is of the extra `cluster` and imported only where work is shared out.
"""

from __future__ import annotations

import asyncio
import logging
import math
import os
import re
import signal
import socket
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import resource_tracker
from typing import Any, Generic, TypeVar

from dnb_edge.archive.lots import MISSING_EXTRA, one_line
from dnb_edge.errors import InputError, WorkError

J = TypeVar("J")
R = TypeVar("R")

PATIENCE_S = 5.0
"""So long a scheduler may take to answer, and then to have a worker."""
LONELY_S = 60.0
"""So long a scheduler may be without any worker while there is work."""
DEATHS = 5
"""So many workers may die over one piece of work, where the cluster is our own; a scheduler elsewhere has its own number."""
TRIES = 2
"""So often work that failed is tried again: a file system elsewhere may stumble."""
AHEAD = 8
"""Pieces of work for each worker's thread that are given out at once."""
LEAST_AHEAD = 16
_WAIT_S = 1.0
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(?P<host>[^/:\s]+|\[[0-9a-fA-F:.]+\]):(?P<port>\d{1,5})")


@dataclass(frozen=True, slots=True, kw_only=True)
class Done(Generic[J, R]):
    """One piece of work, as it came out."""

    job: J
    result: R | None
    """None where it failed."""
    error: str | None
    """Why it failed, in a line; None where it did not."""


class Crew:
    """The workers of one cluster."""

    def __init__(self, distributed: Any, client: Any, where: str) -> None:
        self._distributed = distributed
        self._client = client
        self._where = where
        self._threads = 0
        """How many pieces of work are done at once, as of `_counted_s`."""
        self._counted_s = -math.inf
        self._seen_s = time.monotonic()
        """When there was a worker last."""

    def in_order(self, work: Callable[[J], R], jobs: Iterable[J]) -> Iterator[Done[J, R]]:
        """What `work` gives for each job, in the order of the jobs; only some are given out at a time.

        A job whose worker died is done by another one; what `work` raises is in the result, but for `InputError`. Raises
        `WorkError` where the scheduler or all workers are gone. Where whoever asks stops early, the rest is cancelled.
        """
        rest = enumerate(jobs)
        given: dict[Any, tuple[int, J]] = {}
        ready: dict[int, Done[J, R]] = {}
        following, more = 0, True
        try:
            while more or given or ready:
                self._check_alive()
                room = max(LEAST_AHEAD, AHEAD * self._threads) - len(given) - len(ready)
                while more and room > 0:
                    place, job = next(rest, (0, None))
                    more = job is not None
                    if job is not None:
                        given[self._client.submit(work, job, pure=False, retries=TRIES)] = (place, job)
                        room -= 1
                if given:
                    try:
                        ended = self._distributed.wait(list(given), timeout=_WAIT_S, return_when="FIRST_COMPLETED").done
                    except TimeoutError:
                        ended = set()
                    except CancelledError as error:
                        raise self._lost() from error
                    for future in ended:
                        place, job = given.pop(future)
                        ready[place] = self._outcome(future, job)
                while following in ready:
                    yield ready.pop(following)
                    following += 1
        finally:
            # A scheduler that is gone has nothing left to be cancelled.
            with suppress(OSError, CancelledError):
                if given and self._client.status == "running":
                    self._client.cancel(list(given))

    def _outcome(self, future: Any, job: J) -> Done[J, R]:
        try:
            if future.status in ("cancelled", "lost"):
                raise self._lost()
            error = future.exception()
            result = future.result() if error is None else None
        except (OSError, CancelledError) as gone:
            raise self._lost() from gone
        if isinstance(error, InputError):
            raise error
        if isinstance(error, ModuleNotFoundError):
            raise InputError(
                f"{self._where}: its workers lack a package: {error}: install dnb-edge[cluster] on all of them"
            )
        if isinstance(error, self._distributed.KilledWorker):
            text = "every worker that took it up died, for want of memory perhaps"
            return Done(job=job, result=None, error=text)
        return Done(job=job, result=result, error=None if error is None else one_line(error))

    def _check_alive(self) -> None:
        """Counts the workers, once a second. Raises `WorkError` where the scheduler is gone, or has had none for long."""
        if self._client.status != "running":
            raise self._lost()
        now_s = time.monotonic()
        if now_s - self._counted_s < _WAIT_S:
            return
        try:
            self._threads = sum(self._client.nthreads().values())
        except (OSError, CancelledError) as error:
            raise self._lost() from error
        self._counted_s = time.monotonic()
        if self._threads:
            self._seen_s = self._counted_s
        elif self._counted_s - self._seen_s > LONELY_S:
            raise WorkError(f"{self._where}: all its workers are gone for {LONELY_S:.0f} s: the work was given up")

    def _lost(self) -> WorkError:
        return WorkError(f"{self._where}: the scheduler is gone: the work was given up")


@contextmanager
def crew(scheduler: str | None, workers: int | None = None) -> Iterator[Crew]:
    """The workers at the address `scheduler`, or else `workers` processes of this machine, by default one for each core.

    Raises `InputError`, one line, where Dask is missing, or nobody answers at that address.
    """
    try:
        dask: Any = import_module("dask")
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise InputError(MISSING_EXTRA.format(name=error.name)) from error
    for name in [*logging.root.manager.loggerDict]:
        if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
            # What matters of it is said by us, in one line.
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    with ExitStack() as stack:
        if scheduler is not None:
            yield Crew(distributed, stack.enter_context(_client_of(distributed, scheduler)), scheduler)
            return
        own = {
            "distributed.scheduler.allowed-failures": DEATHS,
            # No recording waits at a worker that another one kills, and is held to have killed it.
            "distributed.scheduler.worker-saturation": 1.0,
        }
        stack.enter_context(dask.config.set(own))
        with _undisturbed():
            cluster = distributed.LocalCluster(
                n_workers=workers or cores(),
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                # Each has its pages whether they are wanted or not: on any free port, for this machine alone.
                dashboard_address="127.0.0.1:0",
                worker_dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
        stack.enter_context(cluster)
        yield Crew(distributed, stack.enter_context(distributed.Client(cluster)), "this machine")


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Keeps Ctrl-C from the threads and processes that begin meanwhile, for good: this process ends them itself."""
    # Where it has to be begun, it lets the signal through again.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _client_of(distributed: Any, scheduler: str) -> Iterator[Any]:
    _check_listening(scheduler)
    try:
        kind = asyncio.run(asyncio.wait_for(_kind_of(distributed, scheduler), PATIENCE_S))
        if kind != "Scheduler":
            raise InputError(
                f"--scheduler {scheduler}: that is a {kind.lower()}, no scheduler: name the scheduler's address"
            )
        client = distributed.Client(scheduler, timeout=PATIENCE_S)
    except TimeoutError as error:
        raise InputError(f"--scheduler {scheduler}: what listens there is no Dask scheduler") from error
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        raise InputError(f"--scheduler {scheduler}: no Dask scheduler there: {one_line(error)}") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE_S)
        except TimeoutError as error:
            raise InputError(
                f"--scheduler {scheduler}: it has no workers: start one with `dask worker {scheduler}`"
            ) from error
        yield client


async def _kind_of(distributed: Any, scheduler: str) -> str:
    """What a server of Dask says that it is. Dask's own client waits without end where it is none."""
    security = distributed.Security().get_connection_args("client")
    async with distributed.rpc(scheduler, connection_args=security, timeout=PATIENCE_S) as server:
        return str((await server.identity())["type"])


def _check_listening(scheduler: str) -> None:
    """Raises `InputError` where nobody listens at an address, at once and not after Dask's many tries."""
    found = _ADDRESS.fullmatch(scheduler)
    if found is None:
        raise InputError(f"--scheduler {scheduler}: must have the form tcp://HOST:PORT (or tls://)")
    try:
        socket.create_connection((found["host"].strip("[]"), int(found["port"])), timeout=PATIENCE_S).close()
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or "nobody answers"
        raise InputError(f"--scheduler {scheduler}: no Dask scheduler there: {reason}") from error


def cores() -> int:
    """Of this machine, as far as this process may use them."""
    return len(os.sched_getaffinity(0))
