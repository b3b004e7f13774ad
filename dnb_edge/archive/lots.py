"""Which recordings places mean: files, directories, patterns, and addresses of other file systems such as `s3://`.

Knows where recordings lie, which of them go on from one another, and how one that lies elsewhere is brought to this machine,
piece by piece. fsspec reads other file systems; it is imported only where an address is given. Knows no lap.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from dnb_edge.errors import InputError
from dnb_edge.record.chain import read_head
from dnb_edge.record.durable import PART_SUFFIX
from dnb_edge.record.edits import edits_path

T = TypeVar("T")

MISSING_EXTRA = "scoring archives needs more packages ({name} is missing): pip install 'dnb-edge[cluster]'"
PIECE_BYTES = 4 * 1024 * 1024
HEAD_BYTES = (1024 * 1024, 16 * 1024 * 1024)
"""So much of a file elsewhere is fetched for its head; where that does not suffice, so much."""
_PATTERN = frozenset("*?[")
_ENDING = ".mcap"


@dataclass(frozen=True, slots=True, kw_only=True)
class Lot:
    """One recording of an archive."""

    name: str
    """As results call it: its path as it was named, or its address."""
    path: str
    """Its absolute path, or its path in `system`."""
    system: Any = None
    """The file system of fsspec that has it; None for a file of this machine, or one that every worker sees at this path."""


def is_elsewhere(place: str) -> bool:
    """Whether a place is an address of another file system."""
    return "://" in place


def is_pattern(place: str) -> bool:
    """Whether a place is a pattern of names, and no file that is called so."""
    return bool(_PATTERN & set(place)) and not Path(place).exists()


def listed(places: Sequence[str]) -> tuple[Lot, ...]:
    """The recordings at `places`, each once, in their order; those of a directory or pattern by name.

    Raises `InputError`, one line, where a place is not there or holds no recording.
    """
    lots: dict[tuple[str, str], Lot] = {}
    for place in places:
        for lot in _at(place):
            lots.setdefault((_system_of(lot), lot.path), lot)
    return tuple(lots.values())


def _at(place: str) -> list[Lot]:
    return guarded(partial(_elsewhere, place), f"{place}: cannot be listed") if is_elsewhere(place) else _here(place)


def guarded(work: Callable[[], T], what: str) -> T:
    """What `work` gives. Whatever it raises, since nobody knows what a file system's library raises, is an `InputError`."""
    with ThreadPoolExecutor(max_workers=1) as pool:
        done = pool.submit(work)
        error = done.exception()
    if isinstance(error, InputError):
        raise error
    if error is not None:
        raise InputError(f"{what}: {one_line(error)}") from error
    return done.result()


def one_line(error: BaseException) -> str:
    """What an error says, with its kind where it is none of ours."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def _here(place: str) -> list[Lot]:
    if not is_pattern(place):
        return _in_directory(Path(place)) if Path(place).is_dir() else [_lot_here(Path(place))]
    lots: list[Lot] = []
    for path in _matching(Path(place).expanduser()):
        if path.is_dir():
            lots += [_lot_here(one) for one in sorted(path.glob(f"*{_ENDING}"))]
        elif path.name.endswith(_ENDING):
            lots.append(_lot_here(path))
    if not lots:
        raise InputError(f"{place}: no recording ({_ENDING}) has such a name")
    return lots


def _matching(pattern: Path) -> list[Path]:
    """What is called so, by name."""
    plain = next(i for i, part in enumerate(pattern.parts) if _PATTERN & set(part))
    return sorted(Path(*pattern.parts[:plain]).glob(str(Path(*pattern.parts[plain:]))))


def _in_directory(directory: Path) -> list[Lot]:
    found = sorted(directory.glob(f"*{_ENDING}"))
    if not found:
        parts = len(list(directory.glob(f"*{PART_SUFFIX}")))
        hint = f"; {parts} unfinished ones: run `dnb-edge runs recover {directory}`" if parts else ""
        raise InputError(f"{directory}: no recordings ({_ENDING}) in this directory{hint}")
    return [_lot_here(path) for path in found]


def _lot_here(path: Path) -> Lot:
    if not path.is_file():
        raise InputError(f"{path}: there is no such recording")
    return Lot(name=str(path), path=str(path.resolve()))


def _elsewhere(address: str) -> list[Lot]:
    try:
        import fsspec  # noqa: PLC0415 of an extra
    except ImportError as error:
        raise InputError(MISSING_EXTRA.format(name="fsspec")) from error
    try:
        system, path = fsspec.core.url_to_fs(address)
    except ImportError as error:
        raise InputError(f"{address}: {one_line(error)}: install that package on every worker, too") from error
    except ValueError as error:
        raise InputError(f"{address}: {error}") from error
    if _PATTERN & set(path):
        paths = [one for one in system.glob(path) if one.endswith(_ENDING)]
    elif system.isdir(path):
        paths = [one for one in system.ls(path, detail=False) if one.endswith(_ENDING)]
    else:
        paths = [path] if system.exists(path) else []
    if not paths:
        raise InputError(f"{address}: no recordings ({_ENDING}) there")
    return [Lot(name=str(system.unstrip_protocol(one)), path=str(one), system=system) for one in sorted(paths)]


def previous_of(lot: Lot) -> str | None:
    """Name of the file that a recording goes on from; None for a recording's first. Raises `InputError`: it is unreadable."""
    if lot.system is None:
        return read_head(Path(lot.path)).previous
    with TemporaryDirectory(prefix="dnb-edge-") as scratch:
        path = Path(scratch) / _name_of(lot.path)
        for count in HEAD_BYTES[:-1]:
            path.write_bytes(lot.system.cat_file(lot.path, start=0, end=count))
            try:
                return read_head(path).previous
            except InputError:
                continue
        path.write_bytes(lot.system.cat_file(lot.path, start=0, end=HEAD_BYTES[-1]))
        return read_head(path).previous


def last_of_chains(lots: Sequence[Lot], previous: Mapping[int, str | None]) -> tuple[Lot, ...]:
    """The lots without those that another one goes on from, with which it is read.

    `previous` has what `previous_of` says by a lot's place among `lots`; one that is not in it could not be read, and stays, so
    that somebody says why.
    """
    places = {(_system_of(lot), lot.path): place for place, lot in enumerate(lots)}
    gone_on = set()
    for place, name in previous.items():
        lot = lots[place]
        if name is not None:
            before = places.get((_system_of(lot), _beside(lot.path, name)))
            if before is not None and before != place and before in previous:
                gone_on.add(before)
    return tuple(lot for place, lot in enumerate(lots) if place not in gone_on)


@contextmanager
def at_hand(lot: Lot) -> Iterator[Path]:
    """The recording as a file of this machine, with its edits and the files that it goes on from beside it.

    One that lies elsewhere is copied piece by piece into a scratch directory that is gone afterwards.
    """
    if lot.system is None:
        yield Path(lot.path)
        return
    with TemporaryDirectory(prefix="dnb-edge-") as scratch:
        path = _fetched(lot.system, lot.path, Path(scratch))
        beside = _beside(lot.path, edits_path(path).name)
        if lot.system.exists(beside):
            _fetched(lot.system, beside, Path(scratch))
        _fetch_earlier(lot, path)
        yield path


def _fetch_earlier(lot: Lot, path: Path) -> None:
    """Brings the files that the recording at `path` goes on from, as far as they lie beside it."""
    here, seen = path, {path.name}
    while True:
        try:
            name = read_head(here).previous
        except InputError:
            return
        if name is None or name in seen or PurePosixPath(name).name != name:
            return
        seen.add(name)
        there = [
            one for one in (_beside(lot.path, name), _beside(lot.path, name + PART_SUFFIX)) if lot.system.exists(one)
        ]
        if not there:
            return
        here = _fetched(lot.system, there[0], path.parent)


def _fetched(system: Any, path: str, directory: Path) -> Path:
    here = directory / _name_of(path)
    with system.open(path, "rb") as there, here.open("wb") as stream:
        shutil.copyfileobj(there, stream, PIECE_BYTES)
    return here


def _system_of(lot: Lot) -> str:
    return "" if lot.system is None else str(lot.system.protocol)


def _name_of(path: str) -> str:
    return PurePosixPath(path).name


def _beside(path: str, name: str) -> str:
    """The path of a file called `name` in the directory of `path`."""
    directory, slash, _ = path.rpartition("/")
    return f"{directory}{slash}{name}"
