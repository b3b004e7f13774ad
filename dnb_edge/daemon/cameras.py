"""The cameras of one run: all of them open, on one clock, as one stream of frames.

Knows configurations and sources. Knows no race.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial

from dnb_edge.assembly import source_of
from dnb_edge.capture.source import FrameSource
from dnb_edge.config.schema import Config
from dnb_edge.daemon.camera import SameCamera
from dnb_edge.daemon.feed import FrameFeed
from dnb_edge.daemon.several import Feed, SeveralFeeds
from dnb_edge.errors import InputError
from dnb_edge.values import SourceInfo


def further_sources(config: Config, first: SourceInfo) -> list[FrameSource]:
    """The configuration's further cameras, open. Raises `InputError` naming the one that is not there, or that has another
    clock than the first: nothing is left open then."""
    opened: list[FrameSource] = []
    with ExitStack() as undo:
        for number, camera in enumerate(config.further_cameras):
            uri = camera.capture.source
            assert uri is not None, "the configuration was checked"
            try:
                source = source_of(uri, camera.capture)
            except InputError as error:
                raise InputError(f"further_cameras.{number}: {error}") from error
            undo.callback(source.close)
            if (source.info.clock, source.info.live) != (first.clock, first.live):
                raise InputError(
                    f"further_cameras.{number}: {uri} is stamped by another clock than {first.uri}: cameras of one track "
                    "are all live, or all files that begin at the same moment, or all simulated"
                )
            opened.append(source)
        undo.pop_all()
    return opened


def feed_of(sources: Sequence[FrameSource], config: Config) -> Feed:
    """The cameras' frames in the order of their stamps; each camera is opened again by itself where it goes away."""
    asked = (config.capture, *(camera.capture for camera in config.further_cameras))
    feeds = [
        FrameFeed(source, SameCamera(source.info, partial(source_of, asked=capture)))
        for source, capture in zip(sources, asked, strict=True)
    ]
    return feeds[0] if len(feeds) == 1 else SeveralFeeds(feeds, live=sources[0].info.live)
