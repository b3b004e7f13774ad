"""The lens file: one YAML document with a camera's lens, how well it is known, and from what it was made.

Knows YAML and the file's form and version; what the numbers mean is `view.lens`' and `view.lens_fit`'s knowledge. Numbers are
written by their shortest round-trip text, so that the lens loaded equals the lens saved, bit for bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import yaml
from pydantic import Field

from dnb_edge.config.document import CameraPart, LensPart, Part, check_format, read_mapping, validated
from dnb_edge.config.sections import Number
from dnb_edge.errors import InputError
from dnb_edge.view.boards import Board, parse_board
from dnb_edge.view.lens import Lens
from dnb_edge.view.lens_fit import LensFit

FILE_FORMAT = "dnb-edge lens"
FILE_VERSION = 1

_WHAT = "lens file"
_ANEW = "make one with `dnb-edge calibrate lens --out`"
_HEAD = """\
# Made by `dnb-edge calibrate lens`. Pixels are those of pictures of the camera's size below; (0, 0) is the middle of the top
# left pixel; the distortion is in OpenCV's order. Do not change numbers by hand: calibrate again.
"""
_SAME_SHAPE = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class LensFileView:
    """One picture behind the lens."""

    name: str
    rms_px: float
    max_px: float
    bad: bool
    sha256: str | None
    """Of the picture's file; None where it was never in one (live, from a clip)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LensFile:
    """A lens and where it comes from."""

    lens: Lens
    camera_id: str | None
    """The stable identity of the camera (`SourceInfo.camera_id`); None where it was not known."""
    board: Board
    made_at: str
    """ISO 8601 with offset."""
    rms_px: float
    sigmas: Mapping[str, float]
    """Of each of the lens's numbers: fx_px, fy_px, cx_px, cy_px, k1 ..."""
    views: tuple[LensFileView, ...]
    notes: tuple[str, ...] = ()

    def lens_for(self, width_px: int, height_px: int, camera_id: str | None = None) -> Lens:
        """The lens for pictures of this size. Raises `InputError` for another camera (where both are known) and for a size of
        another shape, which is another part of the sensor.
        """
        if camera_id is not None and self.camera_id is not None and camera_id != self.camera_id:
            raise InputError(
                f"this lens is of the camera {self.camera_id}, not of {camera_id}: calibrate that one's lens"
            )
        here, there = width_px / height_px, self.lens.width_px / self.lens.height_px
        if abs(here / there - 1.0) > _SAME_SHAPE:
            raise InputError(
                f"this lens is for pictures of {self.lens.width_px}x{self.lens.height_px}, {width_px}x{height_px} has another "
                "shape and so shows another part of the sensor: calibrate the lens in that size"
            )
        if (width_px, height_px) == (self.lens.width_px, self.lens.height_px):
            return self.lens
        return self.lens.scaled_to(width_px, height_px)


class _View(Part):
    name: str
    rms_px: Number
    max_px: Number
    bad: bool = False
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] | None = None


class _File(Part):
    format: Literal["dnb-edge lens"]
    version: Literal[1]
    made_at: str
    notes: tuple[str, ...] = ()
    camera: CameraPart
    board: str
    rms_px: Number
    lens: LensPart
    sigmas: dict[str, Number]
    views: tuple[_View, ...]


def lens_file_of(
    fit: LensFit, board: Board, *, made_at: str, camera_id: str | None = None, sha256: Mapping[str, str] | None = None
) -> LensFile:
    """What is to be kept of a fit. `sha256`: of the pictures' files, by the views' names."""
    sums = {} if sha256 is None else sha256
    return LensFile(
        lens=fit.lens,
        camera_id=camera_id,
        board=board,
        made_at=made_at,
        rms_px=fit.rms_px,
        sigmas=fit.sigmas,
        views=tuple(
            LensFileView(
                name=view.name, rms_px=view.rms_px, max_px=view.max_px, bad=view.bad, sha256=sums.get(view.name)
            )
            for view in fit.views
        ),
        notes=fit.notes,
    )


def lens_file(kept: LensFile) -> bytes:
    """The lens file's bytes."""
    lens = kept.lens.to_dict()
    size = {key: lens.pop(key) for key in ("width_px", "height_px")}
    document = {
        "format": FILE_FORMAT,
        "version": FILE_VERSION,
        "made_at": kept.made_at,
        "notes": list(kept.notes),
        "camera": {"id": kept.camera_id, **size},
        "board": str(kept.board),
        "rms_px": kept.rms_px,
        "lens": lens,
        "sigmas": dict(kept.sigmas),
        "views": [
            {"name": one.name, "rms_px": one.rms_px, "max_px": one.max_px, "bad": one.bad, "sha256": one.sha256}
            for one in kept.views
        ],
    }
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=128, allow_unicode=True)
    return (_HEAD + text).encode()


def load_lens(path: Path) -> LensFile:
    """The lens in the file `path`. Raises `InputError` naming the file, and the key at fault."""
    data = read_mapping(path, what=_WHAT, remedy=_ANEW)
    check_format(data, path, what=_WHAT, file_format=FILE_FORMAT, version=FILE_VERSION, remedy=_ANEW)
    file = validated(_File, data, path, remedy=_ANEW)
    size = {"width_px": file.camera.width_px, "height_px": file.camera.height_px}
    try:
        return LensFile(
            lens=Lens.from_dict(file.lens.model_dump() | size),
            camera_id=file.camera.id,
            board=parse_board(file.board),
            made_at=file.made_at,
            rms_px=file.rms_px,
            sigmas=file.sigmas,
            views=tuple(LensFileView(**one.model_dump()) for one in file.views),
            notes=file.notes,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
