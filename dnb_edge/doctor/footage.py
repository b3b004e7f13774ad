"""Some seconds of a source's pictures: when each came, which are missing, and what they look like.

Knows sources and frames. Decodes nothing while it films, since whoever is slow there loses frames; judges nothing.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnb_edge.assembly import source_of
from dnb_edge.capture.decode import decode_bgr
from dnb_edge.config.devices import CaptureConfig
from dnb_edge.doctor.verdict import CannotTell
from dnb_edge.values import BgrImage, Frame, LostFrames, SourceInfo, StampSource
from dnb_edge.view.drift_patches import grey

WARM_UP_S = 0.5
"""Of a camera's first pictures nothing is told: it is still finding its exposure."""
SMALLER = 4
"""Pictures in which brightness is followed are so many times smaller."""
STILLS = 5
_PATIENCE = 4.0
"""A source may take so many times as long as it should by the stamps of its frames."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Footage:
    """What a source gave in some seconds."""

    info: SourceInfo
    from_service: bool
    """True where the running service has the camera and told this."""
    fps: float | None
    """Frames per second that the camera really makes, lost ones counted; None for fewer than three frames."""
    frames: int
    """How many came, and so many did not: `lost`."""
    lost: tuple[LostFrames, ...] | None
    """None where nobody tells."""
    stamps: frozenset[StampSource]
    """What the frames' stamps stand for; empty where nobody tells."""
    delay_s: float | None
    """Median time from a frame's stamp to its arrival; None where nobody tells."""
    frame_bytes: float | None
    """Mean size of a frame as the camera sent it; None for what was never sent."""
    brightness: tuple[tuple[int, NDArray[np.float64]], ...]
    """(stamp in ns, mean brightness 0..255 of each row of the picture made `SMALLER`, (rows,)) of each frame."""
    stills: tuple[BgrImage, ...]
    """At most `STILLS` whole pictures, spread over the time, (h, w, 3)."""


def film(uri: str, capture: CaptureConfig | None, *, seconds: float) -> Footage:
    """Opens the source, watches it for `seconds` of its own stamps and gives it back.

    Raises `InputError` where it cannot be opened, `TemporaryFault` where it goes away, `CannotTell` where it gives nothing.
    """
    with closing(source_of(uri, capture)) as source:
        warm_up_s = WARM_UP_S if source.info.live else 0.0
        taken: list[Frame] = []
        smaller: list[BgrImage | None] = []
        began_ns: int | None = None
        before: dict[str, int] = {}
        deadline_s = time.monotonic() + _PATIENCE * (seconds + warm_up_s)
        for frame in source.frames():
            began_ns = frame.t_ns if began_ns is None else began_ns
            if frame.t_ns - began_ns < warm_up_s * 1e9:
                before = _counts(source.lost)
                continue
            # Of raw pictures few are kept whole: a second of them fills a small board's memory.
            is_raw = frame.bgr is not None
            smaller.append(decode_bgr(frame, reduce=SMALLER) if is_raw else None)
            taken.append(frame if not is_raw or _is_still(len(taken), seconds, source.info) else _emptied(frame))
            if frame.t_ns - began_ns >= (seconds + warm_up_s) * 1e9 or time.monotonic() > deadline_s:
                break
        lost = _difference(_counts(source.lost), before)
        return made_of(source.info, taken, smaller, lost=lost)


def made_of(
    info: SourceInfo, frames: Sequence[Frame], smaller: Sequence[BgrImage | None], *, lost: tuple[LostFrames, ...]
) -> Footage:
    """The footage of these frames; `smaller` holds the small pictures that are already made, one a frame."""
    if not frames:
        raise CannotTell(f"{info.uri} gave no picture")
    first, last = frames[0], frames[-1]
    span_s = (last.t_ns - first.t_ns) * 1e-9
    delays_s = [(frame.arrived_ns - frame.t_ns) * 1e-9 for frame in frames if frame.arrived_ns is not None]
    sizes = [len(frame.jpeg) for frame in frames if frame.jpeg is not None]
    rows = []
    for frame, made in zip(frames, smaller, strict=True):
        small = decode_bgr(frame, reduce=SMALLER) if made is None else made
        if small is not None:
            rows.append((frame.t_ns, grey(small).mean(axis=1, dtype=np.float64)))
    return Footage(
        info=info,
        from_service=False,
        fps=(last.sequence - first.sequence) / span_s if len(frames) > 2 and span_s > 0 else None,
        frames=len(frames),
        lost=lost,
        stamps=frozenset(frame.stamp_source for frame in frames),
        delay_s=float(np.median(delays_s)) if delays_s else None,
        frame_bytes=float(np.mean(sizes)) if sizes else None,
        brightness=tuple(rows),
        stills=stills_of(frames),
    )


def stills_of(frames: Sequence[Frame]) -> tuple[BgrImage, ...]:
    """At most `STILLS` of the frames, decoded, spread over all of them."""
    whole = [frame for frame in frames if frame.jpeg is not None or (frame.bgr is not None and frame.bgr.size > 3)]
    places = np.linspace(0, len(whole) - 1, min(STILLS, len(whole))).astype(int).tolist()
    found = (decode_bgr(whole[place]) for place in dict.fromkeys(places))
    return tuple(picture for picture in found if picture is not None)


def _is_still(number: int, seconds: float, info: SourceInfo) -> bool:
    """Whether the raw frame of that number is one of the few to keep."""
    expected = max(1, round((info.nominal_fps or 30.0) * seconds))
    return number % max(1, expected // STILLS) == 0


def _emptied(frame: Frame) -> Frame:
    """The frame without its pixels."""
    nothing = np.zeros((1, 1, 3), dtype=np.uint8)
    return Frame(
        sequence=frame.sequence, t_ns=frame.t_ns, stamp_source=frame.stamp_source, width_px=1, height_px=1, bgr=nothing,
        arrived_ns=frame.arrived_ns,
    )  # fmt: skip


def _counts(lost: Iterable[LostFrames]) -> dict[str, int]:
    return {one.reason: one.frames for one in lost}


def _difference(now: dict[str, int], before: dict[str, int]) -> tuple[LostFrames, ...]:
    more = {reason: count - before.get(reason, 0) for reason, count in now.items()}
    return tuple(LostFrames(reason=reason, frames=count) for reason, count in more.items() if count > 0)
