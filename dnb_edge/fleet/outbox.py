"""What a box has to tell the hub, on its own disk until the hub has stored it.

A SQLite file: what was told on the live socket and how far it was heard are written in one transaction, synced, so that a
power cut neither loses an event nor tells it twice. Knows the file; knows no broker and no clock.
"""

from __future__ import annotations

import contextlib
import json
import secrets
import sqlite3
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dnb_edge.errors import InputError, WorkError
from dnb_edge.fleet.messages import Parcel

MOST_PARCELS = 100_000
"""Some 100 MB; beyond it the oldest give way, a hundredth of them at a time."""
MOST_KEYS = 20_000
LAYOUT = 1

_TABLES = """
CREATE TABLE meta (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE parcel (number INTEGER PRIMARY KEY, body TEXT NOT NULL);
CREATE TABLE told (key TEXT PRIMARY KEY, number INTEGER NOT NULL) WITHOUT ROWID;
CREATE INDEX told_number ON told (number);
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """How far the live socket was heard: what it is asked for next."""

    epoch: str | None = None
    sequence: int = 0


class Outbox:
    """The queue at `path`, made where there is none. Its methods may be called from several threads."""

    def __init__(self, path: Path, *, most: int = MOST_PARCELS) -> None:
        """Raises `InputError` where the file is none of ours, cannot be made, or is another process's just now."""
        self._path = path
        self._most = most
        self._lock = threading.Lock()
        self._closed = False
        try:
            self._base = sqlite3.connect(path, timeout=0.2, isolation_level=None, check_same_thread=False)
        except sqlite3.Error as error:
            raise InputError(f"--queue {path}: cannot be opened: {error}") from error
        try:
            self._open()
        except sqlite3.OperationalError as error:
            self._base.close()
            why = "another process has it: one `fleet publish` a queue" if "locked" in str(error) else str(error)
            raise InputError(f"--queue {path}: {why}") from error
        except (sqlite3.Error, ValueError, KeyError) as error:
            self._base.close()
            raise InputError(f"--queue {path}: no queue of dnb-edge, or damaged: move it away: {error}") from error

    def close(self) -> None:
        """Ends it. Safe to repeat; nothing is added any more."""
        with self._lock:
            self._closed = True
            self._base.close()

    def add(
        self, event: dict[str, Any], heard: Heard, *, run: str | None, track: str | None, wall_s: float, key: str | None
    ) -> bool:
        """Queues `event`, and keeps how far was `heard`. False where the same was told before under this `key`.

        Raises `WorkError` where it cannot be written.
        """
        body = json.dumps({"run": run, "track": track, "wall_s": wall_s, "event": event}, allow_nan=False)
        with self._lock:
            if self._closed:
                return False
            try:
                self._base.execute("BEGIN IMMEDIATE")
                added = self._add(body, key)
                self._set("epoch", "" if heard.epoch is None else heard.epoch)
                self._set("sequence", str(heard.sequence))
                self._base.execute("COMMIT")
            except sqlite3.Error as error:
                raise self._failed(error) from error
            if added:
                self.last += 1
                self.waiting += 1
                self._throw_away()
            self.heard = heard
        return added

    def after(self, number: int, *, most: int) -> list[Parcel]:
        """The oldest `most` parcels behind `number`. Raises `WorkError`."""
        with self._lock:
            try:
                rows = self._base.execute(
                    "SELECT number, body FROM parcel WHERE number > ? ORDER BY number LIMIT ?", (number, most)
                ).fetchall()
            except sqlite3.Error as error:
                raise self._failed(error) from error
            first = self.last - self.waiting + 1
        return [Parcel(queue=self.name, number=number, first=first, **json.loads(body)) for number, body in rows]

    def stored(self, number: int) -> None:
        """The hub has all up to `number`. Raises `InputError` where it has more than there ever were."""
        if number > self.last:
            raise InputError(
                f"--queue {self._path}: older than what the hub has of it: a copy? Move it away, and another one is made"
            )
        with self._lock:
            try:
                self._base.execute("DELETE FROM parcel WHERE number <= ?", (number,))
                self.waiting = self._count()
            except sqlite3.Error as error:
                raise self._failed(error) from error

    def _open(self) -> None:
        # One process at a time: the numbers are its own.
        self._base.execute("PRAGMA locking_mode = EXCLUSIVE")
        (layout,) = self._base.execute("PRAGMA user_version").fetchone()
        (tables,) = self._base.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if layout != (LAYOUT if tables else 0):
            raise ValueError(f"its layout is {layout}, not {LAYOUT}")
        # Not before: it writes into the file.
        self._base.execute("PRAGMA journal_mode = WAL")
        self._base.execute("PRAGMA synchronous = FULL")
        if not tables:
            values = {"name": secrets.token_hex(8), "epoch": "", "sequence": "0", "last": "0", "thrown_away": "0"}
            rows = ", ".join(f"('{name}', '{value}')" for name, value in values.items())
            self._base.executescript(
                f"BEGIN; {_TABLES} INSERT INTO meta VALUES {rows}; PRAGMA user_version = {LAYOUT}; COMMIT;"  # noqa: S608 our own
            )
        meta = dict(self._base.execute("SELECT name, value FROM meta").fetchall())
        self.name: str = meta["name"]
        """Random, another one for each file."""
        self.last = int(meta["last"])
        """Number of the newest parcel that there ever was."""
        self.heard = Heard(epoch=meta["epoch"] or None, sequence=int(meta["sequence"]))
        self.thrown_away = int(meta["thrown_away"])
        self.waiting = self._count()
        """Parcels that the hub has not stored yet."""

    def _add(self, body: str, key: str | None) -> bool:
        if key is not None:
            known = self._base.execute("SELECT 1 FROM told WHERE key = ?", (key,)).fetchone()
            if known is not None:
                return False
            self._base.execute("INSERT INTO told VALUES (?, ?)", (key, self.last + 1))
            self._base.execute("DELETE FROM told WHERE number <= ?", (self.last + 1 - MOST_KEYS,))
        self._base.execute("INSERT INTO parcel VALUES (?, ?)", (self.last + 1, body))
        self._set("last", str(self.last + 1))
        return True

    def _throw_away(self) -> None:
        """Makes room where there are too many."""
        if self.waiting <= self._most:
            return
        gone = max(1, self._most // 100)
        try:
            self._base.execute("BEGIN IMMEDIATE")
            self._base.execute("DELETE FROM parcel WHERE number <= ?", (self.last - self.waiting + gone,))
            self._set("thrown_away", str(self.thrown_away + gone))
            self._base.execute("COMMIT")
        except sqlite3.Error as error:
            raise self._failed(error) from error
        self.thrown_away += gone
        self.waiting -= gone

    def _set(self, name: str, value: str) -> None:
        self._base.execute("UPDATE meta SET value = ? WHERE name = ?", (value, name))

    def _count(self) -> int:
        (count,) = self._base.execute("SELECT count(*) FROM parcel").fetchone()
        return int(count)

    def _failed(self, error: sqlite3.Error) -> WorkError:
        # A disk that fails may fail here, too; what was not committed is gone in any case.
        with contextlib.suppress(sqlite3.Error):
            self._base.rollback()
        return WorkError(f"{self._path}: the queue cannot be written: {error}")
