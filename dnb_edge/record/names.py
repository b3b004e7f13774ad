"""Names of recordings: `run-<first 8 of the boot id>-<counter>.mcap`, since a Raspberry Pi has no clock of its own.

Knows file names only. The counter goes on from the highest of the same boot, whatever the ending.
"""

from __future__ import annotations

import re
import secrets
from collections.abc import Iterable
from pathlib import Path

from dnb_edge.record.durable import PART_SUFFIX, DurableFile

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


def boot_tag() -> str:
    """Eight hexadecimal digits that stay the same until the next boot; random ones where the kernel names no boot."""
    try:
        return BOOT_ID.read_text(encoding="ascii").strip()[:8]
    except OSError:
        return secrets.token_hex(4)


def create_next(directory: Path, tag: str, *, after: str = "", beside: Iterable[Path] = ()) -> DurableFile:
    """Create the next recording of boot `tag` in `directory`, colliding with none, nor with `after`. Raises OSError.

    Nor with what lies in the directories `beside` it, as far as they are there: runs that go on from one another are kept
    together some day.
    """
    pattern = re.compile(rf"run-{re.escape(tag)}-(\d+)")
    there = [path.name for path in directory.iterdir()]
    elsewhere = [name for place in beside if place != directory for name in _names_in(place)]
    taken = [int(match[1]) for match in map(pattern.match, (after, *there, *elsewhere)) if match]
    number = max(taken, default=0) + 1
    while True:
        try:
            return DurableFile(directory / f"run-{tag}-{number:04d}.mcap")
        except FileExistsError:
            number += 1


def _names_in(directory: Path) -> list[str]:
    """What lies there; nothing where nobody can tell."""
    try:
        return [path.name for path in directory.iterdir()]
    except OSError:
        return []


def recovered_name(damaged: Path) -> Path:
    """A free final name for what is recovered from `damaged`: its own without `.part`, else with `-recovered`."""
    name = damaged.name.removesuffix(PART_SUFFIX)
    wanted = damaged.with_name(name)
    stem, number = wanted.stem, 1
    while wanted.exists():
        wanted = damaged.with_name(f"{stem}-recovered{'' if number == 1 else f'-{number}'}.mcap")
        number += 1
    return wanted


def pictures_directory(recording: Path) -> Path:
    """Where the pictures of `recording` lie that are not in its own file, whether it is finished or not."""
    return recording.with_name(f"{recording.name.removesuffix(PART_SUFFIX).removesuffix('.mcap')}.pictures")


def pictures_files(recording: Path) -> list[Path]:
    """The files in `pictures_directory`, oldest first; none where there is no such directory."""
    place = pictures_directory(recording)
    found = [*place.glob("*.mcap"), *place.glob(f"*.mcap{PART_SUFFIX}")] if place.is_dir() else []
    return sorted(found)
