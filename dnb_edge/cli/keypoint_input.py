"""What `calibrate keypoints` works on, from options and configuration: pairs, scale, track, size of picture, lens."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from dnb_edge.assembly import load_pairs, make_track
from dnb_edge.cli.calibration_out import input_file
from dnb_edge.config.keypoints import load_yaml_pairs
from dnb_edge.config.lens_file import LensFile, load_lens
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.errors import InputError
from dnb_edge.track.model import Track
from dnb_edge.track.scale import TwinScale
from dnb_edge.track.twin import load_twin
from dnb_edge.values import BgrImage
from dnb_edge.view.calibration import InputFile
from dnb_edge.view.keypoints import KeypointPairs, load_npy_pairs
from dnb_edge.view.lens import Lens

_BEYOND_TWIN = 0.25
"""A place beside the drawing may well be measured: by so much of its width or height."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line says, unchecked."""

    camera: Path | None = None
    twin: Path | None = None
    pairs: Path | None = None
    config: Path | None = None
    overrides: Sequence[str] = ()
    without: Sequence[str] = ()
    metres_per_px: float | None = None
    image_size: str | None = None
    lens: Path | None = None
    twin_image: Path | None = None
    picture: Path | None = None
    camera_id: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What there is to work with."""

    pairs: KeypointPairs
    """Without those that were left out by hand."""
    metres_per_px: float | None
    """Of the twin; None where nothing says."""
    twin_height_px: float | None
    """None where nothing says."""
    size_px: tuple[int, int] | None
    """Of the picture on which the points were clicked; None where nothing says."""
    track: Track | None
    lens: Lens | None
    """For pictures of `size_px`."""
    camera_id: str | None
    """Of the lens's file."""
    twin: BgrImage | None
    picture: BgrImage | None
    inputs: tuple[InputFile, ...]

    @property
    def scale(self) -> TwinScale:
        """The twin's scale, with what is not known made up: 1 m a px, and just high enough. No file may hold that."""
        lowest = float(self.pairs.twin_array()[:, 1].max())
        return TwinScale(
            metres_per_px=1.0 if self.metres_per_px is None else self.metres_per_px,
            height_px=max(1.0, lowest + 1.0) if self.twin_height_px is None else self.twin_height_px,
        )

    @property
    def unit(self) -> str:
        """Of sigmas as they are told: mm, or twin px where the scale is not known."""
        return "twin px" if self.metres_per_px is None else "mm"

    @property
    def per_metre(self) -> float:
        """How many of `unit` make one metre of `scale`."""
        return 1.0 if self.metres_per_px is None else 1000.0

    def say(self, length_m: float) -> str:
        """A length of `scale` in words."""
        value = length_m * self.per_metre
        return f"{value:.{1 if value < 10 else 0}f} {self.unit}"

    @property
    def likely_size_px(self) -> tuple[int, int]:
        """`size_px`, or where it is not known one into which the points fit, about their middle: enough for numbers."""
        if self.size_px is not None:
            return self.size_px
        low, high = self.pairs.camera_array().min(axis=0), self.pairs.camera_array().max(axis=0)
        across, down = (high + np.maximum(low, 0.0)).tolist()
        return max(2, math.ceil(across) + 1), max(2, math.ceil(down) + 1)


def gather(options: Options) -> Given:
    """Reads everything. Raises `InputError` naming the option, file or key at fault."""
    if options.metres_per_px is not None and not (math.isfinite(options.metres_per_px) and options.metres_per_px > 0):
        raise InputError(f"--metres-per-px {options.metres_per_px:g}: must be a positive number")
    if options.overrides and options.config is None:
        raise InputError("--set: sets keys of --config: give that, too")
    config = None if options.config is None else load_config(options.config, list(options.overrides))
    pairs, files = _pairs(options, config)
    if options.without:
        pairs = pairs.without(options.without)
    picture = None if options.picture is None else _picture(options.picture)
    kept = None if options.lens is None else load_lens(options.lens)
    size_px = _size(options, config, pairs, picture, None if kept is None else kept.lens)
    track = None if config is None else make_track(config.track)
    twin_path = options.twin_image
    if twin_path is None and config is not None:
        twin_path = config.track.image
    twin = None if twin_path is None else load_twin(twin_path)
    if twin is not None:
        _check_on_twin(pairs, twin, str(twin_path))
    files += [path for path in (options.lens, twin_path) if path is not None]
    return Given(
        pairs=pairs,
        metres_per_px=_metres_per_px(options, track),
        twin_height_px=_twin_height_px(options, track, twin),
        size_px=size_px,
        track=track,
        lens=None if kept is None or size_px is None else _fitting(kept, size_px, options),
        camera_id=None if kept is None else kept.camera_id,
        twin=twin,
        picture=picture,
        inputs=tuple(input_file(path) for path in files),
    )


def _pairs(options: Options, config: Config | None) -> tuple[KeypointPairs, list[Path]]:
    sides = [path for path in (options.camera, options.twin) if path is not None]
    if options.pairs is not None:
        if sides:
            raise InputError("--keypoints: give it or --camera and --twin, not both")
        return load_yaml_pairs(options.pairs), [options.pairs]
    if len(sides) == 2:
        return load_npy_pairs(sides[0], sides[1]), sides
    if sides or config is None:
        raise InputError(
            "calibrate keypoints: give --camera and --twin (.npy), --keypoints (.yaml), or a run's --config"
        )
    view = config.view
    if view.calibration is not None:
        raise InputError(
            f"{options.config}: view.calibration names a finished calibration and no keypoints: give --keypoints"
        )
    return load_pairs(view), [p for p in (view.keypoints, view.keypoints_camera, view.keypoints_twin) if p is not None]


def _size(
    options: Options, config: Config | None, pairs: KeypointPairs, picture: BgrImage | None, lens: Lens | None
) -> tuple[int, int] | None:
    """By the option, the pairs' file, the configuration, the picture or the lens.

    A configuration's size is that of its own keypoints' picture: it comes first for those, and last but for the guesses for
    pairs given with --keypoints. Raises `InputError` where the option contradicts what is written beside the points.
    """
    stated, said_by = pairs.image_size_px, pairs.source
    own = None if config is None else config.view.image_size_px
    if own is not None and (stated is None or options.pairs is None):
        stated, said_by = own, f"{options.config}, view.image_size_px"
    if options.image_size is not None:
        found = re.fullmatch(r"([1-9]\d{0,4})[x×]([1-9]\d{0,4})", options.image_size.strip().lower())
        if found is None:
            raise InputError(f"--image-size {options.image_size}: must be WIDTHxHEIGHT in px, such as 1280x720")
        size = int(found[1]), int(found[2])
        if stated is not None and stated != size:
            raise InputError(
                f"--image-size {options.image_size}: the points were clicked on {stated[0]}x{stated[1]} px by {said_by}: leave "
                "the option out, or put it right there"
            )
        return size
    if stated is not None:
        return stated
    if picture is not None:
        return picture.shape[1], picture.shape[0]
    return None if lens is None else (lens.width_px, lens.height_px)


def _metres_per_px(options: Options, track: Track | None) -> float | None:
    given, own = options.metres_per_px, None if track is None else track.scale.metres_per_px
    if given is not None and own is not None and not math.isclose(own, given, rel_tol=1e-6):
        raise InputError(f"--metres-per-px {given:g}: the configuration's track has {own:g}: leave it out")
    return given if own is None else own


def _twin_height_px(options: Options, track: Track | None, twin: BgrImage | None) -> float | None:
    own = None if track is None else track.scale.height_px
    if twin is not None and own is not None and twin.shape[0] != own:
        raise InputError(
            f"{options.twin_image}: {twin.shape[0]} px high, the configuration's twin is {own:g}: give the same picture"
        )
    return own if twin is None else float(twin.shape[0])


def _check_on_twin(pairs: KeypointPairs, twin: BgrImage, source: str) -> None:
    """Raises `InputError` for points so far off the twin's picture that they were clicked on another one."""
    height, width = twin.shape[:2]
    size = np.array([width, height], dtype=np.float64)
    middle = size / 2.0
    off = np.abs(pairs.twin_array() - middle) > middle + _BEYOND_TWIN * size
    names = [name for name, beyond in zip(pairs.names, off, strict=True) if beyond.any()]
    if names:
        raise InputError(
            f"{pairs.source}: twin keypoints {', '.join(names)} lie far outside {source} ({width}x{height} px): give the "
            "picture of the twin on which they were clicked, in its size"
        )


def _fitting(kept: LensFile, size_px: tuple[int, int], options: Options) -> Lens:
    """The lens for pictures of that size. Raises `InputError` where it is not that camera's, or of another shape."""
    try:
        return kept.lens_for(*size_px, options.camera_id)
    except InputError as error:
        raise InputError(f"{options.lens}: {error}") from error


def _picture(path: Path) -> BgrImage:
    try:
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise InputError(f"--picture {path}: cannot be read ({error.strerror}): check the path") from error
    image = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    if image is None:
        raise InputError(f"--picture {path}: not a picture: give a JPEG or PNG")
    stored = cv2.imdecode(data, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if stored is None or not np.array_equal(stored, image):
        raise InputError(
            f"--picture {path}: shown turned, by a note in the file (EXIF) that frames do not have: save it upright, without "
            "the note, and click on that picture"
        )
    return image.astype(np.uint8)
