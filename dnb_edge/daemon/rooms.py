"""What a configuration means for an opened source: the rooms of a race, built, from the last good configuration where need be.

Knows configurations and what is made of them; knows no run and no display.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from dnb_edge.assembly import Assembly, assemble, make_detector
from dnb_edge.config.schema import Config
from dnb_edge.daemon.drift import make_watch
from dnb_edge.daemon.eye import Eye
from dnb_edge.daemon.last_good import LastGood
from dnb_edge.errors import InputError
from dnb_edge.values import SourceInfo

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rooms:
    """What a configuration means for the opened source."""

    config: Config
    assembly: Assembly
    eyes: tuple[Eye, ...]
    """What looks at each camera's pictures, by its number."""
    config_fault: str | None
    """Why `config` is the last good one; None where it is the user's own."""


def rooms_of(config: Config, infos: Sequence[SourceInfo], *, last_good: Path | None, config_fault: str | None) -> Rooms:
    """Builds the rooms, from the configuration kept in `last_good` where the current one, or a file that it names, is damaged.

    `infos` are of the cameras' opened sources; `config_fault` says why `config` is that one already. Raises `InputError`.
    """
    try:
        return _built(config, infos, config_fault)
    except InputError as error:
        if last_good is None or config_fault is not None:
            raise
        try:
            return _built(LastGood(last_good).load(), infos, str(error))
        except InputError:
            # Of two faults the user can mend the first.
            raise error from None


def _built(config: Config, infos: Sequence[SourceInfo], config_fault: str | None) -> Rooms:
    views = (config.view, *(camera.view for camera in config.further_cameras))
    if len(views) != len(infos):
        raise InputError(f"further_cameras: {len(views)} cameras are configured and {len(infos)} are open: start anew")
    assembly = assemble(config, infos[0], infos[1:])
    eyes = tuple(
        Eye(
            detector=make_detector(config, seen.ground),
            live=info.live,
            drift=make_watch(view, seen.ground, assembly.setup.track, info),
        )
        for view, seen, info in zip(views, assembly.setup.views, infos, strict=True)
    )
    return Rooms(config=config, assembly=assembly, eyes=eyes, config_fault=config_fault)


def keeper(rooms: Rooms, directory: Path | None) -> Callable[[], None] | None:
    """What keeps the configuration in `directory` as the last good one, in its own thread; None where it is that already, or
    need not be."""
    if directory is None or rooms.config_fault is not None:
        return None

    def keep() -> None:
        try:
            LastGood(directory).keep(rooms.config)
        except (OSError, InputError) as error:
            log.warning("%s: the configuration cannot be kept as the last good one: %s", directory, error)

    return threading.Thread(target=keep, name="last-good", daemon=True).start
