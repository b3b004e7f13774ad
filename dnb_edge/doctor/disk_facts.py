"""Facts of the disk that recordings go to: room, speed, kind, who may write, what lies there.

Knows files, mounts and our recordings' names. What it writes to measure is a file of its own, which it removes.
"""

from __future__ import annotations

import os
import re
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from dnb_edge.config.devices import RecordConfig
from dnb_edge.doctor.access import SERVICE_USER
from dnb_edge.doctor.disk_rules import Holder, Mount, Recordings, Space, Writing
from dnb_edge.doctor.verdict import CannotTell
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.record.retention import DAMAGED_SUFFIX, stored_runs
from dnb_edge.record.room import room_of
from dnb_edge.record.scan import MAGIC

CHUNK_BYTES = 256 * 1024
"""As the recording's own chunks."""
CHUNKS = 32
SYNCS = 20
_FRAME_BYTES = 150_000.0
"""Of a picture, where no frame says better."""


def find_space(directory: Path, record: RecordConfig, *, frame_bytes: float | None) -> Space:
    """The room where recordings go. Raises `OSError` where there is no such directory."""
    room = room_of(_nearest(directory))
    rate = 1.0 if record.image_fps is None else record.image_fps
    ring_bytes = record.image_ring_mb * 1e6
    return Space(
        directory=directory,
        free_bytes=room.free_bytes,
        keep_free_bytes=room.kept_free(int(record.keep_free_mb * 1e6)),
        # A ring of 0 keeps all pictures in the recording.
        ring_left_bytes=ring_bytes if ring_bytes > 0 else float("inf"),
        pictures_bytes_per_s=rate * (_FRAME_BYTES if frame_bytes is None else frame_bytes),
        deletes_oldest=record.delete_oldest,
    )


def measure_writing(directory: Path, *, chunks: int = CHUNKS, syncs: int = SYNCS) -> Writing:
    """Writes a file there as a recording is written, and removes it. Raises `OSError` where that is not allowed."""
    data = np.random.default_rng(0).bytes(CHUNK_BYTES)
    # Without a name: nothing is left behind whatever happens.
    with tempfile.TemporaryFile(dir=directory, buffering=0) as file:
        descriptor = file.fileno()
        began_s = time.perf_counter()
        for _ in range(chunks):
            file.write(data)
        os.fdatasync(descriptor)
        bytes_per_s = chunks * CHUNK_BYTES / max(time.perf_counter() - began_s, 1e-9)
        taken_s = []
        for _ in range(syncs):
            began_s = time.perf_counter()
            file.write(data[:4096])
            os.fdatasync(descriptor)
            taken_s.append(time.perf_counter() - began_s)
    return Writing(bytes_per_s=bytes_per_s, sync_s=float(np.percentile(taken_s, 95)))


def find_mount(directory: Path, *, mounts: Path) -> Mount:
    """The file system of `directory`, by a table such as /proc/self/mounts (fstab(5)'s form)."""
    place = directory.resolve()
    found: Mount | None = None
    for line in mounts.read_text(encoding="utf-8", errors="replace").splitlines():
        fields = [_plain(field) for field in line.split(" ")]
        if len(fields) < 4 or not place.is_relative_to(fields[1]):
            continue
        # Of mounts on one point the last one counts, of several points the deepest.
        if found is None or len(Path(fields[1]).parts) >= len(Path(found.mount_point).parts):
            found = Mount(
                directory=directory,
                kind=fields[2],
                device=fields[0],
                mount_point=fields[1],
                read_only="ro" in fields[3].split(","),
            )
    if found is None:
        raise CannotTell(f"{mounts} does not tell what {directory} is on")
    return found


def find_holder(directory: Path, *, installed: bool, may: Callable[[Path, str], bool | None]) -> Holder:
    """Who may write to `directory`."""
    there = directory.is_dir()
    return Holder(
        directory=directory,
        is_there=there,
        may_write=there and os.access(directory, os.W_OK | os.X_OK),
        service_may=(may(directory, SERVICE_USER) if there else False) if installed else None,
    )


def find_recordings(directory: Path) -> Recordings:
    """What lies in `directory`. Raises `InputError` where it cannot be read."""
    runs = stored_runs(directory)
    live = [run for run in runs if run.live]
    done = [run for run in runs if not run.live]
    unfinished = [run.name for run in done if any(path.name.endswith(PART_SUFFIX) for path in run.files)]
    set_aside = [run.name for run in done if any(path.name.endswith(DAMAGED_SUFFIX) for path in run.files)]
    broken = [run.name for run in done if run.name not in unfinished and not _ends_well(run.files)]
    bad = {*unfinished, *broken}
    return Recordings(
        directory=directory,
        whole=sum(run.name not in bad for run in done),
        live=len(live),
        unfinished=tuple(unfinished),
        damaged=tuple(dict.fromkeys([*broken, *(name for name in set_aside if name not in unfinished)])),
    )


def _ends_well(files: Iterable[Path]) -> bool:
    """Whether each finished recording begins and ends as one does."""
    for path in files:
        if path.suffix != ".mcap":
            continue
        with path.open("rb") as stream:
            head = stream.read(len(MAGIC))
            size = stream.seek(0, os.SEEK_END)
            stream.seek(max(0, size - len(MAGIC)))
            if head != MAGIC or size < 2 * len(MAGIC) or stream.read() != MAGIC:
                return False
    return True


def _nearest(directory: Path) -> Path:
    """`directory`, or what of it is there."""
    return next(place for place in (directory, *directory.absolute().parents) if place.exists())


def _plain(field: str) -> str:
    """A field of a table of mounts, which writes spaces as \\040."""
    return re.sub(r"\\([0-7]{3})", lambda found: chr(int(found[1], 8)), field)
