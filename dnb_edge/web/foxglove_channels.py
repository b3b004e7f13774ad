"""A live race on the channels of a recording, so that one layout shows files and live races alike.

Knows the live socket's values and the recording's channels; knows no socket, no server and no clock.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

import foxglove
import numpy as np
from foxglove.messages import LogLevel

from dnb_edge import wire
from dnb_edge.live.messages import Phase, Picture, Scenery, State, Told
from dnb_edge.record.channels import (
    EVENT_TOPICS,
    SCENE_TOPIC,
    ImageNote,
    RunChannels,
    TrackScene,
    event_t_ns,
)
from dnb_edge.values import Event, Observation, StampSource

MOST_AGAIN = 100
"""Events of a kind that somebody who comes later is told again, the last ones."""

_KINDS = {name: kind for kind, name in wire.EVENT_NAMES.items()}
_NAMES = {EVENT_TOPICS[kind]: name for kind, name in wire.EVENT_NAMES.items()}


class LiveChannels:
    """All channels of a recording in `context`, fed by what the daemon says. For one thread."""

    def __init__(self, context: foxglove.Context, *, on_new_run: Callable[[], object] = lambda: None) -> None:
        """`on_new_run` is called before anything of another run is sent."""
        self._on_new_run = on_new_run
        self._channels = RunChannels(context, None, images=True)
        self._run: tuple[int, Scenery | None] | None = None
        self._phase: tuple[Phase | None, str | None] | None = None
        self._t_ns: int | None = None
        self._seen: list[Observation] = []
        """Those of the last frame."""

    @property
    def wants_pictures(self) -> bool:
        """Whether anybody looks at them."""
        return self._channels.wants_images

    def state(self, state: State | None) -> None:
        """What the daemon does now; None while it is down."""
        run = self._run if state is None else (state.first_sequence, state.scenery)
        new = run != self._run
        if new:
            self._on_new_run()
        self._tell(state)
        if state is None or not new:
            return
        self._run, self._seen = run, []
        # The stamps of another source have nothing to do with those before.
        self._t_ns = None
        self._channels.begin(None if state.scenery is None else _scene(state.scenery), self._now_ns())
        self._channels.draw_track(self._now_ns())

    def told(self, told: Told) -> None:
        """An event; one of a kind that we do not know is passed over."""
        event = _event(told.event)
        if event is None:
            return
        t_ns = self._stamp(event)
        if isinstance(event, Observation):
            self._annotate(event)
        self._channels.event(event, t_ns)

    def picture(self, picture: Picture) -> None:
        """A camera picture."""
        note = ImageNote(
            sequence=picture.frame,
            t_ns=picture.t_ns,
            stamp_source=StampSource.ARRIVAL,
            width_px=picture.width_px,
            height_px=picture.height_px,
        )
        self._channels.image(note, picture.jpeg)

    def again(self, topic: str, kept: Iterable[Told]) -> None:
        """For somebody who has just begun to look at `topic`: the track, or what was `kept` of the events there."""
        if topic == SCENE_TOPIC:
            self._channels.draw_track(self._now_ns(), again=True)
            return
        name = _NAMES.get(topic)
        mine = [told for told in kept if told.event.get("event") == name]
        for told in mine[-MOST_AGAIN:]:
            event = _event(told.event)
            if event is not None:
                self._channels.exactly(event, event_t_ns(event, self._now_ns()))

    def _tell(self, state: State | None) -> None:
        """A line in the log where the daemon's state is another one than before."""
        phase = (None, None) if state is None else (state.phase, state.reason)
        if phase == self._phase:
            return
        self._phase = phase
        if state is None:
            self._channels.log(
                "the timing service has gone: it comes back by itself", self._now_ns(), level=LogLevel.Warning
            )
            return
        reason = "" if state.reason is None else f": {state.reason}"
        level = LogLevel.Warning if state.phase is Phase.FAULT else LogLevel.Info
        self._channels.log(f"the timing service: {state.phase.value}{reason}", self._now_ns(), level=level)

    def _annotate(self, seen: Observation) -> None:
        """Draws it over the picture, with the others of its frame."""
        if self._seen and self._seen[0].t_ns != seen.t_ns:
            self._seen = []
        self._seen.append(seen)
        self._channels.annotate(seen.t_ns, self._seen)

    def _stamp(self, event: Event) -> int:
        t_ns = event_t_ns(event, self._now_ns())
        self._t_ns = t_ns if self._t_ns is None else max(self._t_ns, t_ns)
        return t_ns

    def _now_ns(self) -> int:
        """The last stamp; before the first the clock of cameras."""
        return time.monotonic_ns() if self._t_ns is None else self._t_ns


def _event(plain: dict[str, Any]) -> Event | None:
    """The event in its JSON object; None where it is of a kind, or has a form, that we do not know."""
    kind = _KINDS.get(str(plain.get("event")))
    if kind is None:
        return None
    try:
        event: Event = wire.from_dict(kind, plain)
    except ValueError:
        # Another version's; what we know of is still worth showing.
        return None
    return event


def _scene(scenery: Scenery) -> TrackScene:
    return TrackScene(
        route_m=np.asarray(scenery.centreline_m, dtype=np.float64),
        closed=scenery.closed,
        lines_m={line.name: (line.start_m, line.end_m) for line in scenery.lines},
    )
