"""The box that is looked at: where its things are, and what several checks want to know of it, found once.

Knows the configuration, the live socket and the order of things: whether a service has the camera decides how its pictures are
had. Knows no verdict.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

from dnb_edge.assembly import Assembly, assemble
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.doctor.camera_facts import CameraLook, camera_uri, look_at_camera
from dnb_edge.doctor.footage import Footage, film
from dnb_edge.doctor.live_facts import Service, ask_service
from dnb_edge.doctor.unit_facts import RACE_UNIT, UnitLook, ask_units
from dnb_edge.doctor.verdict import CannotTell
from dnb_edge.errors import DnbEdgeError
from dnb_edge.values import Clock, SourceInfo

T = TypeVar("T")

CONFIG_NAME = "dnb-edge.yaml"


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """Where the box keeps its things, and how long to look."""

    config: Path = Path("/etc/dnb-edge/dnb-edge.yaml")
    """The configuration; where it is not there that of `setup` counts, as for the service."""
    setup: Path = Path("/var/lib/dnb-edge/setup")
    runs: Path = Path("/var/lib/dnb-edge/runs")
    """Where the service records, unless the configuration says otherwise."""
    socket: Path = Path("/run/dnb-edge/live.sock")
    root: Path = Path("/")
    """What the machine's /sys, /proc, /etc and /dev are below."""
    overrides: tuple[str, ...] = ()
    """Changes of the configuration, `key.path=value`."""
    seconds: float = 2.0
    """For how long the camera is watched."""
    speed_mps: float = 2.0
    """How fast the cars are, for the blur that the exposure makes."""


class Box:
    """One box, for one examination. What is found is found once, and so is why it cannot be."""

    def __init__(self, where: Where, say: Callable[[str], None] = lambda _: None) -> None:
        """`say` hears what takes longer than a moment, before it is done."""
        self.where = where
        self.say = say
        self._found: dict[str, tuple[Any, Exception | None]] = {}

    def once(self, name: str, find: Callable[[], T]) -> T:
        """What `find` finds, found at the first call; raises what it raised."""
        if name not in self._found:
            try:
                self._found[name] = (find(), None)
            except Exception as error:
                self._found[name] = (None, error)
                raise
        value, fault = self._found[name]
        if fault is not None:
            raise fault
        return cast("T", value)

    @property
    def config_file(self) -> Path | None:
        """The configuration that a race would use; None where there is none."""
        places = (self.where.config, self.where.setup / CONFIG_NAME)
        return next((place for place in places if place.exists()), None)

    @property
    def config(self) -> Config:
        """Raises `CannotTell` where there is no configuration, `InputError` where it is wrong."""
        path = self.config_file
        if path is None:
            raise CannotTell("no configuration to look at")
        return self.once("config", lambda: load_config(path, self.where.overrides))

    @property
    def readable_config(self) -> Config | None:
        """The configuration, where there is a right one."""
        try:
            return self.config
        except (CannotTell, DnbEdgeError, OSError):
            # The check of the configuration tells it.
            return None

    @property
    def service(self) -> Service | None:
        """What the running service says, with its pictures; None where none answers."""
        self.say("Listening to the service")
        return self.once("service", lambda: ask_service(self.where.socket, seconds=self.where.seconds))

    @property
    def race_runs(self) -> bool:
        """Whether a service runs, as far as one may know."""
        try:
            return self.service is not None
        except (CannotTell, DnbEdgeError):
            return True

    @property
    def units(self) -> dict[str, UnitLook]:
        """The service manager's units by name. Raises `CannotTell` where there is no service manager."""
        return self.once("units", ask_units)

    @property
    def is_installed(self) -> bool:
        """Whether the appliance is installed as a service here."""
        try:
            return self.units[RACE_UNIT].is_installed
        except CannotTell:
            return False

    @property
    def uri(self) -> str:
        """The source that a race would use. Raises `CannotTell` where there is none."""
        config = self.readable_config
        named = None if config is None else config.capture.source
        return self.once("uri", lambda: camera_uri(named))

    @property
    def camera(self) -> CameraLook:
        """The camera as the kernel shows it. Raises `CannotTell` where the source is none."""
        return self.once("camera", self._look_at_camera)

    def _look_at_camera(self) -> CameraLook:
        config = self.readable_config
        capture = None if config is None else config.capture
        return look_at_camera(self.uri, capture, root=self.where.root, unit_groups=self.unit_groups)

    @property
    def unit_groups(self) -> tuple[str, ...]:
        """Groups that the service's unit gives it besides its user's."""
        try:
            return self.units[RACE_UNIT].groups
        except CannotTell:
            return ()

    @property
    def footage(self) -> Footage:
        """Some seconds of pictures, of the service where it runs. Raises `CannotTell` or `DnbEdgeError`."""

        def shoot() -> Footage:
            service = self.service
            if service is not None:
                return service.footage()
            self.say(f"Watching the camera for {self.where.seconds:g} s")
            config = self.readable_config
            return film(self.uri, None if config is None else config.capture, seconds=self.where.seconds)

        return self.once("footage", shoot)

    @property
    def source_info(self) -> SourceInfo:
        """What the frames are, as far as that is known without them."""
        try:
            footage = self.footage
        except (CannotTell, DnbEdgeError, OSError):
            # The checks of the camera tell it.
            capture = self.config.capture
            return SourceInfo(
                uri="", width_px=capture.width_px, height_px=capture.height_px, nominal_fps=capture.fps,
                clock=Clock.MONOTONIC, live=True,
            )  # fmt: skip
        return footage.info

    @property
    def assembly(self) -> Assembly:
        """Track and view of the configuration. Raises `InputError` where they do not fit together."""
        self.say("Building the track and the view")
        return self.once("assembly", lambda: assemble(self.config, self.source_info))

    @property
    def runs(self) -> Path:
        """Where recordings go."""
        config = self.readable_config
        named = None if config is None else config.record.directory
        # The unit's --record wins over the configuration's.
        return self.where.runs if self.is_installed or named is None else named
