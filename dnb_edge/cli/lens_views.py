"""Views of a calibration board for the command line: from photographs in a folder, from a clip, or live from a camera."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
from rich.console import Console
from rich.live import Live
from rich.progress import Progress
from rich.text import Text

from dnb_edge.assembly import make_source
from dnb_edge.capture.decode import decode_bgr
from dnb_edge.cli.model_files import pictures_in
from dnb_edge.config.schema import Config
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.values import Frame
from dnb_edge.view.boards import Board, BoardKind, GreyImage, find_board
from dnb_edge.view.lens_fit import LensView
from dnb_edge.view.lens_views import ViewPicker

_FLAT_DEG = 12.0
_HINT_PICTURES = 3
_JPEG_SUFFIXES = (".jpg", ".jpeg")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Views:
    """What was found, and where."""

    views: tuple[LensView, ...]
    size_px: tuple[int, int]
    looked_at: int
    """Pictures."""
    without_board: tuple[str, ...] = ()
    """Names of photographs that do not show the board."""
    sha256: dict[str, str] = field(default_factory=dict)
    """Of the pictures' files, by name."""
    camera_id: str | None = None


def views_in_folder(folder: Path, board: Board, leave_out: Sequence[str], console: Console) -> Views:
    """The views in the photographs under `folder` that are not named in `leave_out`.

    Raises `InputError` for pictures of different sizes or unreadable ones, and where none shows the board.
    """
    paths = pictures_in(folder)
    names = {path: str(path.relative_to(folder)) for path in paths}
    for name in leave_out:
        if name not in names.values():
            raise InputError(f"--leave-out {name}: there is no such picture in {folder}")
    paths = [path for path in paths if names[path] not in leave_out]
    views, without, sums, size = [], [], {}, None
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        for path in progress.track(paths, description="looking for the board"):
            data = _bytes(path)
            grey = _grey(path, data)
            if size is not None and grey.shape != size[1]:
                raise InputError(
                    f"{path}: {_size(grey.shape)}, but {size[0].name} is {_size(size[1])}: all photographs must be of one size"
                )
            size = size or (path, grey.shape)
            sums[names[path]] = hashlib.sha256(data).hexdigest()
            sight = find_board(board, grey)
            if sight is None:
                without.append(names[path])
            else:
                views.append(LensView(name=names[path], sight=sight))
    if size is None:
        raise InputError(f"{folder}: all pictures are left out: leave some in")
    if not views:
        first = (_grey(path, _bytes(path)) for path in paths[:_HINT_PICTURES])
        raise InputError(_never_found(board, f"any of {len(paths)} pictures in {folder}", first))
    return Views(
        views=tuple(views),
        size_px=(size[1][1], size[1][0]),
        looked_at=len(paths),
        without_board=tuple(without),
        sha256=sums,
    )


def views_from_source(
    uri: str, board: Board, *, wanted: int, config: Config | None, save_to: Path | None, console: Console
) -> Views:
    """The best `wanted` views of a clip, or the first of a camera's that are still and new; Ctrl-C ends the search early.

    Shows the coverage on `console` meanwhile. The views' pictures are kept in the folder `save_to`, where given. Raises
    `InputError` where no picture shows the board.
    """
    if save_to is not None:
        _check_folder(save_to)
    with closing(make_source(uri, config)) as source:
        info = source.info
        size_px = (info.width_px, info.height_px)
        picker = ViewPicker(board, size_px)
        enough = wanted if info.live else None
        capture = _Capture(board=board, picker=picker, wanted=wanted, keep_pictures=save_to is not None)
        shown = Live(console=console, transient=True, refresh_per_second=4, get_renderable=capture.coverage)
        if console.is_terminal:
            with shown:
                capture.run(source.frames(), enough=enough)
        else:
            capture.run(source.frames(), enough=enough)
    if not capture.views:
        raise InputError(_never_picked(board, uri, capture))
    chosen = [capture.views[i] for i in picker.best(wanted)]
    sums = {} if save_to is None else _save(save_to, chosen)
    views = tuple(
        LensView(name=_view_name(i) if save_to is not None else view.view.name, sight=view.view.sight)
        for i, view in enumerate(chosen, start=1)
    )
    return Views(views=views, size_px=size_px, looked_at=capture.looked_at, sha256=sums, camera_id=info.camera_id)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Kept:
    view: LensView
    png: bytes | None


class _Capture:
    """Looks at a source's frames for views worth keeping."""

    def __init__(self, *, board: Board, picker: ViewPicker, wanted: int, keep_pictures: bool) -> None:
        self._board, self._picker, self._wanted, self._keep = board, picker, wanted, keep_pictures
        self.views: list[_Kept] = []
        self.looked_at = self.seen = 0
        self.first: list[GreyImage] = []

    def run(self, frames: Iterator[Frame], *, enough: int | None) -> None:
        """Until the frames end, `enough` views are kept or Ctrl-C is pressed."""
        try:
            for frame in frames:
                self._look(frame)
                if enough is not None and len(self.views) >= enough:
                    return
        except KeyboardInterrupt:
            return

    def _look(self, frame: Frame) -> None:
        picture = decode_bgr(frame)
        if picture is None:
            return
        grey = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        self.looked_at += 1
        if len(self.first) < _HINT_PICTURES:
            self.first.append(grey)
        sight = find_board(self._board, grey, quick=True)
        self.seen += sight is not None
        if not self._picker.picks(sight) or sight is None:
            return
        png = cv2.imencode(".png", picture)[1].tobytes() if self._keep else None
        self.views.append(_Kept(view=LensView(name=f"frame {frame.sequence}", sight=sight), png=png))

    def coverage(self) -> Text:
        """How many views there are, where in the picture and how tilted."""
        flat = sum(tilt < _FLAT_DEG for tilt in self._picker.tilts_deg)
        rows = "\n".join("   ".join(f"{count:2d}" for count in row) for row in self._picker.counts.tolist())
        return Text(
            f"{len(self.views)} of {self._wanted} views; {flat} flat, {len(self.views) - flat} tilted; views with the board in "
            f"each part of the picture:\n{rows}\nHold the board still for a moment, then elsewhere or tilted; Ctrl-C ends."
        )


def _never_found(board: Board, where: str, pictures: Iterator[GreyImage]) -> str:
    if board.kind is BoardKind.CHARUCO:
        return (
            f"lens: no ChArUco board {board} in {where}: check the number of squares (not corners), the two sizes and the "
            "markers' dictionary, and that the board is sharp and evenly lit"
        )
    other = _other_size(board, pictures)
    if other is not None:
        counted = f"{other.columns}x{other.rows} inner corners"
        return f"lens: no board {board} in {where}, but one of {counted}: is it --board {other}?"
    return (
        f"lens: no chessboard of {board.columns}x{board.rows} inner corners in {where}: count where four squares meet (8x11 "
        "squares have 7x10), and show the whole board with white round it, sharp and evenly lit"
    )


def _never_picked(board: Board, uri: str, capture: _Capture) -> str:
    if capture.seen:
        return (
            f"lens: the board was seen in {capture.seen} of {capture.looked_at} pictures of {uri}, but never still: hold it "
            "still for a moment in each place"
        )
    return _never_found(board, f"any of {capture.looked_at} pictures of {uri}", iter(capture.first))


def _other_size(board: Board, pictures: Iterator[GreyImage]) -> Board | None:
    """The board that was meant, where squares were counted in place of corners or the like."""
    changes = ((-1, -1), (1, 1), (-1, 0), (0, -1), (1, 0), (0, 1))
    sizes = [(board.columns + across, board.rows + down) for across, down in changes]
    others = [replace(board, columns=columns, rows=rows) for columns, rows in sizes if min(columns, rows) >= 3]
    for grey in pictures:
        for other in others:
            if find_board(other, grey, quick=True) is not None:
                return other
    return None


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot read the picture ({error.strerror}): check the file") from error


def _grey(path: Path, data: bytes) -> GreyImage:
    """As the sensor saw it: a note in the file on how to turn the picture means nothing to the lens."""
    cut_off = path.suffix.lower() in _JPEG_SUFFIXES and b"\xff\xd9" not in data[-4096:]
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    picture = None if not data or cut_off else cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    if picture is None:
        raise InputError(f"{path}: {'cut off' if data and cut_off else 'not a readable picture'}: mend or remove it")
    return np.asarray(picture, dtype=np.uint8)


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]}x{shape[0]}"


def _check_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
        taken = any(folder.iterdir())
    except OSError as error:
        raise InputError(f"--save-views {folder}: cannot be used ({error.strerror}): name a folder") from error
    if taken:
        raise InputError(f"--save-views {folder}: is not empty: name a new folder")


def _view_name(number: int) -> str:
    return f"view-{number:02d}.png"


def _save(folder: Path, kept: Sequence[_Kept]) -> dict[str, str]:
    sums = {}
    for number, one in enumerate(kept, start=1):
        assert one.png is not None
        write_whole(folder / _view_name(number), one.png)
        sums[_view_name(number)] = hashlib.sha256(one.png).hexdigest()
    return sums
