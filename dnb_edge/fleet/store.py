"""What the hub has of all boxes, in a SQLite file: each parcel once, however often it comes.

A parcel is stored where it is the next one of its queue, and in one transaction with how far that queue is stored: whoever is
killed at any moment has either both or neither. Knows the file; knows no broker and no clock.
"""

from __future__ import annotations

import contextlib
import json
import sqlite3
import threading
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dnb_edge import wire
from dnb_edge.errors import InputError, WorkError
from dnb_edge.fleet.messages import BoxState, Parcel

MOST_BOXES = 200
LAYOUT = 1

_TABLES = """
CREATE TABLE box (
    name TEXT PRIMARY KEY, state TEXT, state_wall_s REAL, laps INTEGER NOT NULL DEFAULT 0, missing INTEGER NOT NULL DEFAULT 0
) WITHOUT ROWID;
CREATE TABLE queue (box TEXT NOT NULL, name TEXT NOT NULL, stored INTEGER NOT NULL, PRIMARY KEY (box, name)) WITHOUT ROWID;
CREATE TABLE parcel (
    id INTEGER PRIMARY KEY, box TEXT NOT NULL, queue TEXT NOT NULL, number INTEGER NOT NULL, kind TEXT NOT NULL, run TEXT,
    track TEXT, box_wall_s REAL NOT NULL, wall_s REAL NOT NULL, event TEXT NOT NULL, UNIQUE (box, queue, number)
);
CREATE INDEX parcel_kind ON parcel (kind, id);
CREATE INDEX parcel_box ON parcel (box, kind, id);
"""
_COLUMNS = "id, box, run, track, box_wall_s, wall_s, event"


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownBox:
    """What the store has of a box."""

    name: str
    state: BoxState | None
    state_wall_s: float | None
    """When it came, by the hub's clock."""
    laps: int
    missing: int
    """Parcels that this hub never gets: thrown away for want of room, or told to a hub with another store."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One stored event."""

    id: int
    """In the order in which they were stored."""
    box: str
    run: str | None
    track: str | None
    box_wall_s: float
    wall_s: float
    """When it was stored, by the hub's clock."""
    event: dict[str, Any]


class Store:
    """The file at `path`, made where there is none. Its methods may be called from several threads."""

    def __init__(self, path: Path) -> None:
        """Raises `InputError` where the file is none of ours, or cannot be made."""
        self._path = path
        self._lock = threading.Lock()
        self.passed_over = 0
        """Parcels that had come before, or before which others were still to come, since it was opened."""
        try:
            self._base = sqlite3.connect(path, timeout=2.0, isolation_level=None, check_same_thread=False)
        except sqlite3.Error as error:
            raise InputError(f"--store {path}: cannot be opened: {error}") from error
        try:
            self._open()
        except (sqlite3.Error, ValueError) as error:
            self._base.close()
            raise InputError(f"--store {path}: no store of a hub, or damaged, or in use: {error}") from error

    def close(self) -> None:
        """Ends it. Safe to repeat."""
        with self._lock:
            self._base.close()

    def take(self, parcels: Iterable[tuple[str, Parcel]], *, wall_s: float) -> dict[tuple[str, str], int]:
        """Stores what is new of `parcels`, each with its box, all at once; how far each of their queues is stored now.

        A parcel that has come before is passed over, and so is one before which others are still to come. Those of more
        boxes than `MOST_BOXES` are. Raises `WorkError` where nothing can be written.
        """
        stored: dict[tuple[str, str], int] = {}
        with self._lock, self._written():
            for box, parcel in parcels:
                place = (box, parcel.queue)
                if place not in stored:
                    if not self._admit(box):
                        continue
                    stored[place] = self._stored(*place)
                missed = parcel.first - 1 - stored[place]
                if missed > 0:
                    stored[place] = parcel.first - 1
                    self._base.execute("UPDATE box SET missing = missing + ? WHERE name = ?", (missed, box))
                if parcel.number == stored[place] + 1:
                    self._insert(box, parcel, wall_s)
                    stored[place] = parcel.number
                else:
                    self.passed_over += 1
            for (box, queue), number in stored.items():
                self._base.execute("INSERT OR REPLACE INTO queue VALUES (?, ?, ?)", (box, queue, number))
        return stored

    def show(self, states: Mapping[str, BoxState], *, wall_s: float) -> None:
        """Keeps the last state of each box. Raises `WorkError`."""
        with self._lock, self._written():
            for box, state in states.items():
                if self._admit(box):
                    self._base.execute(
                        "UPDATE box SET state = ?, state_wall_s = ? WHERE name = ?",
                        (json.dumps(wire.to_dict(state), allow_nan=False), wall_s, box),
                    )

    def queues(self) -> dict[tuple[str, str], int]:
        """How far each queue of each box is stored."""
        rows = self._read("SELECT box, name, stored FROM queue")
        return {(box, name): stored for box, name, stored in rows}

    def boxes(self) -> list[KnownBox]:
        """All boxes, by name."""
        rows = self._read("SELECT name, state, state_wall_s, laps, missing FROM box ORDER BY name")
        return [
            KnownBox(
                name=name,
                state=None if state is None else wire.from_json(BoxState, state.encode()),
                state_wall_s=wall_s,
                missing=missing,
                laps=laps,
            )
            for name, state, wall_s, laps, missing in rows
        ]

    def latest(self, *, kind: str, most: int, box: str | None = None, before: int | None = None) -> list[Row]:
        """The newest events of a kind, newest first; `before`: those stored before the event of that id."""
        where = "kind = :kind" + _of(box) + (" AND id < :id" if before is not None else "")
        values = {"kind": kind, "box": box, "id": before, "most": most}
        return self._rows(f"{where} ORDER BY id DESC LIMIT :most", values)

    def since(self, after: int, *, most: int, box: str | None = None) -> list[Row]:
        """Events of all kinds behind the event of that id, oldest first."""
        return self._rows(f"id > :id{_of(box)} ORDER BY id LIMIT :most", {"box": box, "id": after, "most": most})

    def _open(self) -> None:
        (layout,) = self._base.execute("PRAGMA user_version").fetchone()
        (tables,) = self._base.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if layout != (LAYOUT if tables else 0):
            raise ValueError(f"its layout is {layout}, not {LAYOUT}")
        # Not before: it writes into the file.
        self._base.execute("PRAGMA journal_mode = WAL")
        self._base.execute("PRAGMA synchronous = FULL")
        if not tables:
            self._base.executescript(f"BEGIN; {_TABLES} PRAGMA user_version = {LAYOUT}; COMMIT;")

    def _admit(self, box: str) -> bool:
        """Whether the box is known, or may be from now on."""
        if self._base.execute("SELECT 1 FROM box WHERE name = ?", (box,)).fetchone() is not None:
            return True
        (count,) = self._base.execute("SELECT count(*) FROM box").fetchone()
        if count >= MOST_BOXES:
            return False
        self._base.execute("INSERT INTO box (name) VALUES (?)", (box,))
        return True

    def _stored(self, box: str, queue: str) -> int:
        found = self._base.execute("SELECT stored FROM queue WHERE box = ? AND name = ?", (box, queue)).fetchone()
        return 0 if found is None else int(found[0])

    def _insert(self, box: str, parcel: Parcel, wall_s: float) -> None:
        kind = str(parcel.event.get("event"))
        if kind == "lap":
            self._base.execute("UPDATE box SET laps = laps + 1 WHERE name = ?", (box,))
        self._base.execute(
            "INSERT INTO parcel (box, queue, number, kind, run, track, box_wall_s, wall_s, event)"
            " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                box,
                parcel.queue,
                parcel.number,
                kind,
                parcel.run,
                parcel.track,
                parcel.wall_s,
                wall_s,
                json.dumps(parcel.event, allow_nan=False),
            ),
        )

    def _rows(self, where: str, values: dict[str, Any]) -> list[Row]:
        rows = self._read(f"SELECT {_COLUMNS} FROM parcel WHERE {where}", values)  # noqa: S608 both are ours
        return [
            Row(id=id_, box=box, run=run, track=track, box_wall_s=box_wall_s, wall_s=wall_s, event=json.loads(event))
            for id_, box, run, track, box_wall_s, wall_s, event in rows
        ]

    def _read(self, query: str, values: dict[str, Any] | None = None) -> list[Any]:
        with self._lock:
            try:
                return self._base.execute(query, values or {}).fetchall()
            except sqlite3.Error as error:
                raise WorkError(f"{self._path}: cannot be read: {error}") from error

    @contextlib.contextmanager
    def _written(self) -> Any:
        """All of it or nothing, and on the disk."""
        try:
            self._base.execute("BEGIN IMMEDIATE")
            yield
            self._base.execute("COMMIT")
        except sqlite3.Error as error:
            # A disk that fails may fail here, too; what was not committed is gone in any case.
            with contextlib.suppress(sqlite3.Error):
                self._base.rollback()
            raise WorkError(f"{self._path}: the store cannot be written: {error}") from error


def _of(box: str | None) -> str:
    """The condition that a parcel is the box's, where one is asked for: without it the index of all boxes serves."""
    return "" if box is None else " AND box = :box"
