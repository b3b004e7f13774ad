"""A copy of the last configuration that raced, with the files that it names, for when the current one is damaged.

Knows how a copy is made durable and checked: everything is written beside, synced, renamed; every file's SHA-256 stands in a
manifest, and the manifest's own names the copy. Knows which keys name files. Knows no race.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from dnb_edge.config.calibration_file import load_calibration
from dnb_edge.config.load import load_config
from dnb_edge.config.paths import names_a_file
from dnb_edge.config.schema import Config
from dnb_edge.errors import InputError
from dnb_edge.record.durable import sync_directory

CONFIG_NAME = "dnb-edge.yaml"
MANIFEST_NAME = "manifest.json"
CURRENT_NAME = "current"
"""The file that names the copy to use."""

_DIGITS = 16
_FILES = (
    ("track", "file"),
    ("track", "image"),
    ("view", "calibration"),
    ("view", "keypoints"),
    ("view", "keypoints_camera"),
    ("view", "keypoints_twin"),
    ("detector", "model"),
)
"""Keys of files that decide what a run measures; a network's checkpoint, which is hashed only, is left where it is."""


class LastGood:
    """The copies in one directory, of which one is current."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory

    def keep(self, config: Config) -> None:
        """Makes `config` the current copy, where it is not that already. Raises `OSError` where the disk refuses, `InputError`
        where a file that it names cannot be read any more."""
        files = _contents(config)
        manifest = json.dumps({name: _sha256(data) for name, data in sorted(files.items())}, indent=1).encode()
        name = _sha256(manifest)[:_DIGITS]
        if self._is_whole(name):
            return
        self._directory.mkdir(parents=True, exist_ok=True)
        partial = self._directory / f".new-{os.getpid()}"
        shutil.rmtree(partial, ignore_errors=True)
        _write_tree(partial, files | {MANIFEST_NAME: manifest})
        # A damaged copy of the same name gives way.
        shutil.rmtree(self._directory / name, ignore_errors=True)
        partial.rename(self._directory / name)
        sync_directory(self._directory)
        beside = self._directory / f".{CURRENT_NAME}-{os.getpid()}"
        _write(beside, name.encode())
        beside.replace(self._directory / CURRENT_NAME)
        sync_directory(self._directory)
        for other in self._directory.iterdir():
            if other.is_dir() and other.name != name:
                shutil.rmtree(other, ignore_errors=True)

    def load(self) -> Config:
        """The current copy. Raises `InputError` where there is none, or where a bit of it has changed."""
        try:
            name = (self._directory / CURRENT_NAME).read_text(encoding="ascii").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"{self._directory}: holds no last good configuration") from error
        if not self._is_whole(name):
            raise InputError(f"{self._directory}: the last good configuration is damaged too")
        return load_config(self._directory / name / CONFIG_NAME)

    def _is_whole(self, name: str) -> bool:
        """Whether the copy `name` is there and current, and every byte of it is as it was written."""
        copy = self._directory / name
        try:
            current = (self._directory / CURRENT_NAME).read_text(encoding="ascii").strip()
            manifest = (copy / MANIFEST_NAME).read_bytes()
            if current != name or _sha256(manifest)[:_DIGITS] != name:
                return False
            # Only a manifest that is as it was written is read.
            listed: dict[str, str] = json.loads(manifest)
            return all(_sha256((copy / file).read_bytes()) == digest for file, digest in listed.items())
        except (OSError, UnicodeDecodeError):
            return False


def _contents(config: Config) -> dict[str, bytes]:
    """The copy's files by their names in it: the configuration, naming the others by relative paths, and those."""
    plain: dict[str, Any] = json.loads(config.model_dump_json(exclude_unset=True))
    plain.pop("data_dir", None)
    files: dict[str, bytes] = {}
    for number, (holder, key, path) in enumerate(_named_files(config, plain)):
        folder = f"files/{number}"
        for one in (path, *_companions(key, path)):
            try:
                files[f"{folder}/{one.name}"] = one.read_bytes()
            except OSError as error:
                raise InputError(f"{one}: cannot be read ({error.strerror})") from error
        holder[key] = f"{folder}/{path.name}"
    files[CONFIG_NAME] = yaml.safe_dump(plain, sort_keys=False, allow_unicode=True).encode()
    return files


def _named_files(config: Config, plain: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str, Path]]:
    """Each place in `plain` that names a file: what holds it, its key there, the file."""
    for section, key in _FILES:
        path = getattr(getattr(config, section), key)
        if path is not None:
            yield plain[section], key, path
    if names_a_file(config.rules):
        yield plain, "rules", Path(config.rules)


def _companions(key: str, path: Path) -> list[Path]:
    """What is read beside the file: a model's card, the picture with which a calibration was made."""
    if key == "model":
        card = path.with_suffix(".json")
        return [card] if card.exists() else []
    if key == "calibration":
        reference = load_calibration(path).reference
        return [] if reference is None else [path.parent / reference.name]
    return []


def _write_tree(root: Path, files: dict[str, bytes]) -> None:
    for name, data in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        _write(path, data)
    for directory in (*(one for one in root.rglob("*") if one.is_dir()), root):
        sync_directory(directory)


def _write(path: Path, data: bytes) -> None:
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
