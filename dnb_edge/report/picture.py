"""A figure as a picture file, the same bytes for the same figure: no date, no random identifiers."""

from __future__ import annotations

import io
import warnings
from typing import Literal, TypeAlias

import matplotlib
from matplotlib.figure import Figure

PictureFormat: TypeAlias = Literal["png", "svg"]


def encoded(figure: Figure, picture_format: PictureFormat) -> bytes:
    """The picture file of `figure`, at its own resolution. A letter that the font lacks is a box in it, and no more is said."""
    stream = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "dnb-edge"}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"Glyph \d+ .* missing from font")
        metadata = {"Date": None} if picture_format == "svg" else None
        figure.savefig(stream, format=picture_format, metadata=metadata)
    return stream.getvalue()
