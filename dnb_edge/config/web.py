"""The part of the configuration that is about the web pages, and reading it alone: they are there to mend the rest.

Knows each key's type, default and meaning. Knows no server.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, Field, ValidationError

from dnb_edge.config.faults import explain
from dnb_edge.config.sections import STRICT, Number, Text, Whole
from dnb_edge.config.text import KeyPath, configuration_text, parse_lines
from dnb_edge.errors import InputError


class FoxgloveConfig(BaseModel):
    """The live server for Foxglove, which `dnb-edge foxglove` runs; nothing of it is on without that."""

    model_config = STRICT

    host: Text = "127.0.0.1"
    """The address to listen at; 0.0.0.0 shows the camera to all in the network, without a code. --host wins."""
    port: Annotated[Whole, Field(ge=1, le=65535)] = 8765
    """The port; the command line's --port wins."""
    pictures_per_s: Annotated[Number, Field(gt=0, le=60)] = 5.0
    """Camera pictures a second at most, while somebody looks at them."""


class WebConfig(BaseModel):
    """The web pages, which `dnb-edge web` serves."""

    model_config = STRICT

    host: Text = "::"
    """The address to listen at; :: for all, 0.0.0.0 for IPv4 alone, 127.0.0.1 for this machine alone. --host wins."""
    port: Annotated[Whole, Field(ge=1, le=65535)] = 8080
    """The port; the command line's --port wins."""
    names: tuple[Text, ...] = ()
    """Names by which browsers may call the box, besides its own, that with .local, localhost and its addresses."""
    most_downloads: Annotated[Whole, Field(ge=1, le=64)] = 8
    """Recordings that are taken at once; others are told to come again."""
    download_mb_per_s: Annotated[Number, Field(gt=0, le=10_000)] = 24.0
    """Of all downloads together, megabytes a second: the race writes to the same disk."""
    foxglove: FoxgloveConfig = FoxgloveConfig()
    """The live server for Foxglove."""


class _WebOnly(BaseModel):
    web: WebConfig = WebConfig()


def load_web(path: Path) -> WebConfig:
    """The section `web` of the configuration file at `path`, whatever else it holds.

    Raises `InputError` for a missing or unreadable file, bad YAML, and an unknown or ill-typed key of the section.
    """
    data, lines = parse_lines(path, configuration_text(path), what="the configuration")

    def where(key: KeyPath, _unknown: bool) -> str:
        found = next((lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in lines), None)
        return str(path) if found is None else f"{path}, line {found}"

    try:
        return _WebOnly.model_validate({"web": data["web"]} if "web" in data else {}).web
    except ValidationError as error:
        raise InputError(explain(error, _WebOnly, where, root="the configuration")) from error
