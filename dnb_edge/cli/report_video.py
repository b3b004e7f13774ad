"""The annotated video of a run: its pictures, or those of the clip that it was raced from, with what the race knew at each.

Knows recordings and clips; what is drawn is `report.overlay`, how it is written `report.video`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from dnb_edge.archive.reported import Reported
from dnb_edge.capture.decode import decode_bgr
from dnb_edge.capture.video import VideoSource
from dnb_edge.errors import InputError
from dnb_edge.record.reader import iter_frames
from dnb_edge.report.overlay import Overlay
from dnb_edge.report.video import check_video, paced, picture_rate, write_video
from dnb_edge.values import BgrImage, Clock, Frame

PEEKED = 120
"""Pictures by whose stamps the video's rate is chosen."""

_AROUND_NS = 1_000_000_000
"""So much is shown before and after a chosen lap."""


def make_video(reported: Reported, out: Path, *, clip: Path | None, console: Console) -> int:
    """Writes the video `out`, which appears when it is whole; returns its number of pictures. Progress goes to `console`.

    Of the chosen laps, where there are any. Raises `InputError` where there are no pictures, one line that says what to do.
    """
    check_video(out)
    raced = reported.replayed
    ground = raced.setup.ground
    overlay = Overlay(reported.result, ground, reported.sightings())
    frames = iter_frames(raced.path) if clip is None else _clip_frames(reported, clip)
    wanted = _within(frames, _spans(reported))
    head = list(itertools.islice(wanted, PEEKED))
    if not head:
        raise InputError(_no_pictures(reported, clip))
    fps = picture_rate([frame.t_ns for frame in head])
    every = raced.facts.frames_t_ns
    first_ns, last_ns = head[0].t_ns, max((span[1] for span in _spans(reported)), default=every[-1] if every else 0)
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("Video", total=max(1, last_ns - first_ns))

        def shown() -> Iterator[tuple[int, BgrImage]]:
            for frame in itertools.chain(head, wanted):
                progress.update(task, completed=frame.t_ns - first_ns)
                image = decode_bgr(frame)
                if image is not None:
                    yield frame.t_ns, overlay.draw(image, frame.t_ns)

        return write_video(out, paced(shown(), fps), fps=fps)


def _spans(reported: Reported) -> Sequence[tuple[int, int]]:
    """The times, ns, of the chosen laps with what is shown around them; none where all is wanted."""
    laps = [lap for lap in reported.result.laps if (lap.car, lap.number) in reported.result.chosen]
    return [(lap.start_t_ns - _AROUND_NS, lap.end_t_ns + _AROUND_NS) for lap in laps]


def _within(frames: Iterable[Frame], spans: Sequence[tuple[int, int]]) -> Iterator[Frame]:
    for frame in frames:
        if not spans or any(first <= frame.t_ns <= last for first, last in spans):
            yield frame


def _clip_frames(reported: Reported, clip: Path) -> Iterator[Frame]:
    """The clip's frames, stamped as the recording's. Raises `InputError` where it cannot be what was raced."""
    raced = reported.replayed
    source = raced.header.source
    if source.clock is not Clock.MEDIA:
        raise InputError(
            f"--clip {clip}: {raced.path} was raced from {source.uri}, whose clock no clip has: leave --clip out"
        )
    video = VideoSource(f"file:{clip}", clip)
    try:
        size = (video.info.width_px, video.info.height_px)
        if size != (source.width_px, source.height_px):
            raise InputError(
                f"--clip {clip}: its pictures are {size[0]}x{size[1]}, those of {raced.path} were "
                f"{source.width_px}x{source.height_px}: name the clip that was raced"
            )
        yield from video.frames()
    finally:
        video.close()


def _no_pictures(reported: Reported, clip: Path | None) -> str:
    raced = reported.replayed
    laps = " of the chosen laps" if reported.result.chosen else ""
    if clip is not None:
        return f"--clip {clip}: no pictures{laps} in it"
    if raced.header.source.clock is Clock.MEDIA:
        return (
            f"{raced.path}: has no pictures{laps}: name the clip that was raced, {raced.header.source.uri}, with --clip"
        )
    return f"{raced.path}: has no pictures{laps}, so there is nothing to make a video of: race with record.image_fps"
