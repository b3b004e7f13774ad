"""What a recording says about itself before its first message: the attachment `setup.json`.

Knows the header's JSON form and its version; the meaning of `setup` and `config` belongs to whoever made them.
"""

from __future__ import annotations

import json
import platform
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from dnb_edge import __version__, wire
from dnb_edge.values import EntryInfo, SourceInfo

FORMAT = 1
"""Version of the layout that docs/recording.md describes; readers refuse a higher one."""

SETUP_NAME = "setup.json"
MAX_SETUP_BYTES = 8 * 1024 * 1024
"""A track of 20 000 points takes 2 MB."""
METADATA_NAME = "dnb-edge"
LOSS_METADATA_NAME = "dnb-edge/loss"
RECOVERY_METADATA_NAME = "dnb-edge/recovery"
CONTINUES_METADATA_NAME = "dnb-edge/continues"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunHeader:
    """Everything that is needed to read a recording and to score it again."""

    name: str
    """The entry: what the result table calls this run."""
    setup: dict[str, Any]
    """Plain JSON: all that the pure core was set up with; opaque here."""
    config: dict[str, Any]
    """Plain JSON: the configuration the run was started with."""
    source: SourceInfo
    further_sources: tuple[SourceInfo, ...] = ()
    """The cameras after the first, which `source` is."""
    versions: dict[str, str] = field(default_factory=dict)
    """Versions of the software that took part, by name."""
    wall_offset_ns: int | None = None
    """Unix time minus the source's clock, ns, at the start of the run; None for media and simulated clocks."""
    entry: EntryInfo | None = None
    """The entry with all that is known of it; None in recordings from before there was more than a name. See `driver`."""
    session: str | None = None
    """Name of the session: the runs under one track, calibration and set of rules; None where nobody named one."""
    identity: dict[str, str] = field(default_factory=dict)
    """Digests of `track`, `calibration` and `rules` as the recording software computed them, for people and viewers."""
    resumed_from: str | None = None
    """Name of the finished file of the run that this one goes on with, since that was cut short; None for a new run."""

    @property
    def driver(self) -> EntryInfo:
        """The entry, in any recording."""
        return self.entry if self.entry is not None else EntryInfo(name=self.name)

    def to_json(self) -> str:
        """The attachment's text. Raises ValueError or TypeError where `setup` or `config` are not plain JSON."""
        return json.dumps({"format": FORMAT, **wire.to_dict(self)}, allow_nan=False)

    def metadata(self) -> dict[str, str]:
        """The same in short, as MCAP metadata that any viewer shows."""
        short = {
            "format": str(FORMAT),
            "version": __version__,
            "name": self.name,
            "source": self.source.uri,
            "clock": self.source.clock.value,
        }
        if self.wall_offset_ns is not None:
            short["wall_offset_ns"] = str(self.wall_offset_ns)
        told = {
            "entry_version": self.driver.version,
            "checkpoint_sha256": self.driver.checkpoint_sha256,
            "session": self.session,
            "resumed_from": self.resumed_from,
        } | self.identity
        return short | {name: text for name, text in told.items() if text}


def header_from_json(text: str | bytes) -> RunHeader:
    """The header that `RunHeader.to_json` made `text` from. Raises ValueError with the reason in a few words."""
    if len(text) > MAX_SETUP_BYTES:
        raise ValueError(f"{SETUP_NAME} has {len(text)} bytes, more than the {MAX_SETUP_BYTES} that are read")
    try:
        data = json.loads(text)
    except RecursionError as error:
        raise ValueError(f"{SETUP_NAME} is nested too deeply") from error
    if not isinstance(data, dict):
        raise ValueError(f"{SETUP_NAME} is not an object")  # noqa: TRY004 - one kind of error for one kind of fault
    found = data.get("format")
    if not isinstance(found, int) or found > FORMAT:
        raise ValueError(f"format {found} is not known to dnb-edge {__version__} (it knows {FORMAT}): update dnb-edge")
    try:
        return wire.from_dict(RunHeader, data)
    except ValueError as error:
        raise ValueError(f"{SETUP_NAME} is incomplete: {error}") from error


def software_versions() -> dict[str, str]:
    """Versions of dnb-edge, Python and the libraries whose numbers end up in a recording."""
    versions = {"dnb-edge": __version__, "python": platform.python_version(), "machine": platform.machine()}
    for package in ("foxglove-sdk", "numpy", "onnxruntime", "opencv-python-headless"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    return versions
