"""Whether the display's section of a configuration names a display that there is."""

from __future__ import annotations

from dnb_edge.config.devices import DisplayConfig
from dnb_edge.display.uri import check_uri
from dnb_edge.errors import InputError


def check_display(wanted: DisplayConfig) -> None:
    """Raises `InputError` where the display's URI is none, as far as that shows without looking for the device."""
    if wanted.uri is None:
        return
    try:
        check_uri(wanted.uri)
    except InputError as error:
        raise InputError(f"display.uri: {error}") from error
