"""The track file: one JSON document that holds a whole track, so that a twin need be looked at only once.

Knows the file's form and version. Knows no picture.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from dnb_edge.errors import InputError
from dnb_edge.track.model import Track

FILE_FORMAT = "dnb-edge track"
FILE_VERSION = 1


def track_file(track: Track) -> bytes:
    """The track file's bytes."""
    document = {"format": FILE_FORMAT, "version": FILE_VERSION, "track": track.to_dict()}
    return (json.dumps(document, allow_nan=False) + "\n").encode()


def load_track(path: Path) -> Track:
    """The track in the file `path`. Raises `InputError` where it is missing, damaged or no track file."""
    try:
        document: Any = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot read the track file ({error.strerror}): check the path") from error
    except ValueError as error:
        raise InputError(f"{path}: not a track file: make one with `dnb-edge track build --out`") from error
    if not isinstance(document, dict) or document.get("format") != FILE_FORMAT:
        raise InputError(f"{path}: not a track file: make one with `dnb-edge track build --out`")
    if document.get("version") != FILE_VERSION or not isinstance(document.get("track"), dict):
        raise InputError(f"{path}: a track file of version {document.get('version')!r}, known is {FILE_VERSION}: "
                         "build it anew with `dnb-edge track build`")  # fmt: skip
    try:
        return Track.from_dict(document["track"])
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
