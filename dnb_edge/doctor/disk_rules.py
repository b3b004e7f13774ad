"""When a disk is fit to record on: facts to verdicts, nothing else.

Knows the limits and what to type. Opens no file.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dnb_edge.doctor.verdict import Verdict, fail, ok, skip, warn
from dnb_edge.machine.state import LOW_BYTES

SHORT_MIN, TOO_SHORT_MIN = 240.0, 30.0
"""A race day lasts some hours."""
SLOW_SYNC_S, TOO_SLOW_SYNC_S = 0.25, 1.5
"""Time that 19 of 20 syncs of a second's recording take: a lap is saved after one of them."""
SLOW_BYTES_PER_S = 4e6
TELEMETRY_BYTES_PER_S = 15_000.0
"""What a camera race records besides pictures, about, bytes a second."""

_GOOD = {"ext4", "ext3", "btrfs", "xfs", "f2fs", "zfs", "bcachefs"}
_IN_MEMORY = {"tmpfs", "ramfs", "overlay", "squashfs", "aufs"}
_WITHOUT_JOURNAL = {"vfat", "exfat", "msdos", "ext2", "ntfs", "ntfs3", "fuseblk"}
_FAR = {"nfs", "nfs4", "cifs", "smb3", "9p", "virtiofs", "fuse.sshfs"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """The room where recordings go, and what a race takes of it."""

    directory: Path
    free_bytes: int
    keep_free_bytes: int
    """What recordings leave free: below it pictures are no longer recorded."""
    ring_left_bytes: float
    """How much the ring of pictures may still grow."""
    pictures_bytes_per_s: float
    deletes_oldest: bool


def minutes_left(space: Space) -> float:
    """For how long all can be recorded until the room to keep free is reached, minutes."""
    room = max(0.0, float(space.free_bytes - space.keep_free_bytes))
    both = TELEMETRY_BYTES_PER_S + space.pictures_bytes_per_s
    # While the ring fills both grow; once it is full only the recording does.
    filling_s = space.ring_left_bytes / space.pictures_bytes_per_s if space.pictures_bytes_per_s > 0 else 0.0
    if both * filling_s >= room:
        return room / both / 60.0
    return (filling_s + (room - both * filling_s) / TELEMETRY_BYTES_PER_S) / 60.0


def judge_space(space: Space) -> Verdict:
    """Whether there is room for a day."""
    minutes = minutes_left(space)
    long = f"{minutes / 60.0:.0f} hours" if minutes >= 120 else f"{minutes:.0f} minutes"
    days = f"{minutes / 1440.0:.0f} days" if minutes >= 2880 else long
    found = f"{space.free_bytes / 1e9:.1f} GB free in {space.directory}, room for {days}"
    fix = (
        f"Type `dnb-edge runs prune {space.directory}` or take recordings home with `dnb-edge runs copy "
        f"{space.directory} --to DIR`."
    )
    if minutes < TOO_SHORT_MIN and not space.deletes_oldest:
        return fail(found, fix)
    if minutes < SHORT_MIN or space.free_bytes < LOW_BYTES:
        gone = "; the oldest recordings will be deleted" if space.deletes_oldest else ""
        return warn(found + gone, fix)
    return ok(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class Writing:
    """How fast a disk takes what is written and synced."""

    bytes_per_s: float
    sync_s: float
    """Time that 19 of 20 small writes with fdatasync stay below."""


def judge_writing(writing: Writing) -> Verdict:
    """Whether the disk keeps up with a recording and saves laps at once."""
    found = f"{writing.bytes_per_s / 1e6:.1f} MB/s written and synced, a small sync takes {1e3 * writing.sync_s:.1f} ms"
    fix = (
        "Take another card (class A2, or an SSD on USB 3) and move recordings there with `record.directory`; "
        "`iotop` shows who else writes."
    )
    if writing.sync_s > TOO_SLOW_SYNC_S:
        return fail(found, fix)
    return warn(found, fix) if writing.sync_s > SLOW_SYNC_S or writing.bytes_per_s < SLOW_BYTES_PER_S else ok(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mount:
    """The file system that a directory is on."""

    directory: Path
    kind: str
    device: str
    mount_point: str
    read_only: bool


def judge_mount(mount: Mount) -> Verdict:
    """Whether recordings outlive a power cut there."""
    found = f"{mount.directory} is on {mount.kind} ({mount.device} at {mount.mount_point})"
    if mount.read_only:
        return fail(
            f"{found}, which is read-only",
            f"Type `sudo mount -o remount,rw {mount.mount_point}`; where that fails the card is worn out: take another.",
        )
    elsewhere = (
        "Name a directory on a disk of its own in `record.directory`, such as a USB stick with ext4 (`lsblk "
        "-f` lists them)."
    )
    if mount.kind in _IN_MEMORY:
        return fail(f"{found}: recordings are gone after a restart", elsewhere)
    if mount.kind in _WITHOUT_JOURNAL:
        return warn(f"{found}, which a power cut may damage", elsewhere)
    if mount.kind in _FAR:
        return warn(f"{found}, on another machine: a broken network holds recordings up", elsewhere)
    return ok(found) if mount.kind in _GOOD else skip(f"{found}: nothing is known of that kind")


@dataclass(frozen=True, slots=True, kw_only=True)
class Holder:
    """Who may write in the recordings' directory."""

    directory: Path
    is_there: bool
    may_write: bool
    """Whether whoever runs this may."""
    service_may: bool | None
    """Whether the service may; None where it is not installed."""


def judge_holder(holder: Holder) -> Verdict:
    """Whether the service may write there."""
    fix = f"Type `sudo install -d -o dnb-edge -g dnb-edge -m 770 {holder.directory}`."
    if not holder.is_there:
        if holder.service_may is None:
            return warn(f"{holder.directory} is not there", f"Type `mkdir -p {holder.directory}`.")
        return fail(f"{holder.directory} is not there", fix)
    if holder.service_may is False:
        return fail(f"the service may not write to {holder.directory}", fix)
    if holder.service_may is None and not holder.may_write:
        return fail(f"you may not write to {holder.directory}", f"Type `sudo chown $USER {holder.directory}`.")
    return ok(f"{holder.directory} can be written to")


@dataclass(frozen=True, slots=True, kw_only=True)
class Recordings:
    """What lies in the recordings' directory."""

    directory: Path
    whole: int
    live: int
    unfinished: tuple[str, ...]
    """Names of those that were cut short."""
    damaged: tuple[str, ...]


def judge_recordings(found: Recordings) -> Verdict:
    """Whether any recording was cut short or is damaged."""
    live = f", {found.live} being recorded" if found.live else ""
    words = f"{found.whole} whole{live}"
    bad = [*found.damaged, *found.unfinished]
    if not bad:
        return ok(words)
    kinds = [
        f"{len(names)} {word}" for names, word in ((found.damaged, "damaged"), (found.unfinished, "cut short")) if names
    ]
    shown = ", ".join(bad[:3]) + (" ..." if len(bad) > 3 else "")
    return warn(
        f"{words}, {' and '.join(kinds)} ({shown})",
        f"Type `dnb-edge runs recover {found.directory}`, which loses nothing that is whole.",
    )
