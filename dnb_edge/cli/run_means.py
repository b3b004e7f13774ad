"""What a run is made of: the command line's options, the configuration as it is when the run begins, the devices.

Knows which configuration is meant, where it may appear, and which camera where there is none. Knows no order of things: that is
the conductor's.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import ValidationError
from rich.console import Console

from dnb_edge.assembly import check_checkpoint, source_of
from dnb_edge.capture.source import FrameSource
from dnb_edge.capture.v4l2_nodes import first_camera, known_cameras
from dnb_edge.config.devices import CaptureConfig, DisplayConfig
from dnb_edge.config.document import first_fault
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.config.text import plain
from dnb_edge.daemon.appliance import RunOptions, run_appliance
from dnb_edge.daemon.last_good import CONFIG_NAME, LastGood
from dnb_edge.daemon.live_run import LiveRun
from dnb_edge.daemon.sinks import JsonSink, LiveJsonSink
from dnb_edge.display.base import Display
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.display.terminal import BoardConsole, TerminalDisplay
from dnb_edge.display.uri import open_display
from dnb_edge.errors import InputError
from dnb_edge.values import RunSummary

SYSTEM_CONFIG = Path("/etc/dnb-edge/dnb-edge.yaml")
"""Where the service's configuration lies; used where --config is not given and it is there."""

T = TypeVar("T", CaptureConfig, DisplayConfig)

LIVE_SCHEMES = ("v4l2:", "libcamera:")
"""Sources that lose frames where anybody makes them wait."""


@dataclass(slots=True, kw_only=True)
class RunMeans:
    """The options of `dnb-edge run`, and what they mean by now: files are read anew for each run."""

    config_file: Path | None
    setup: Path | None
    source: str | None
    record: Path | None
    laps: int | None
    display: str | None
    entry: str | None
    model: Path | None
    overrides: tuple[str, ...]
    last_good: Path | None
    resume_within_s: float
    as_json: bool
    observations: bool
    notifier: ServiceNotifier
    stuck: bool = False
    """Whether a terminal did not take the last picture of its board."""

    @property
    def files(self) -> tuple[Path, ...]:
        """The configuration's file, or the places where one may appear."""
        named = self.config_file if self.config_file is not None else SYSTEM_CONFIG
        return (named,) if self.setup is None else (named, self.setup / CONFIG_NAME)

    def race(self, live: LiveRun | None, entry: str | None) -> None:
        """One run with its listeners: JSON lines, or the board. `entry` drives, where it is given."""
        config, fault = self._config_or_last_good(entry)
        options = RunOptions(
            source_uri=self._source_uri(config),
            record_directory=self.record,
            display_uri=self.display if self.display is not None else config.display.uri,
            last_good=self.last_good,
            config_fault=fault,
            resume_within_s=self.resume_within_s if live is None or live.resumes else 0.0,
        )
        if live is not None:
            live.starts(options.source_uri)
        if self.as_json:
            with _json_lines(options.source_uri, observations=self.observations) as lines:
                run_appliance(config, options, listeners=[lines], notifier=self.notifier, live=live)
            return
        console = BoardConsole(markup=False)
        with TerminalDisplay(console) as board:
            summary = run_appliance(config, options, displays=[board], notifier=self.notifier, live=live)
        self.stuck |= board.stuck
        if not self.stuck:
            say_summary(console, summary)
        elif live is None:
            self.leave()

    def check(self, entry: str | None) -> None:
        """Raises `InputError` where a run could not begin, as far as the configuration alone tells."""
        self._source_uri(self._config_or_last_good(entry)[0])

    def leave(self) -> None:
        """Ends the process where a terminal is stuck: Python would wait for it for ever. All recordings are finished."""
        if self.stuck:
            os._exit(1)

    def camera_uri(self) -> str:
        """The source to open where there is no run: the named one, else the first camera. Raises `InputError` where there is
        none."""
        named = self.source if self.source is not None else self._capture().source
        return named if named is not None else self._first_camera()

    def _source_uri(self, config: Config) -> str:
        uri = self.source if self.source is not None else config.capture.source
        if uri is None and self.setup is not None:
            # Whoever sets a track up on the pages has named no device, and sees the pictures of this one.
            return self._first_camera()
        if uri is None:
            raise InputError("no source: give --source, or capture.source in the configuration")
        return uri

    def _first_camera(self) -> str:
        camera = first_camera(usb=True)
        if camera is None and importlib.util.find_spec("libcamera") is not None:
            return "libcamera:0"
        camera = camera if camera is not None else first_camera(usb=False)
        if camera is None:
            raise InputError(f"no source is named, and {known_cameras()}: plug one in, or give --source")
        return f"v4l2:{camera}"

    def open_camera(self, uri: str, asked: Mapping[str, Any] | None = None) -> FrameSource:
        """That source, open, a camera with the settings of the configuration, as far as that can be read, and `asked` over
        them. Raises `InputError`."""
        capture = self._capture()
        if asked:
            try:
                capture = CaptureConfig.model_validate({**capture.model_dump(), **asked})
            except ValidationError as error:
                raise InputError(f"the camera's settings: {first_fault(error)}") from error
        return source_of(uri, capture)

    @contextmanager
    def displays(self, *, terminal: bool) -> Iterator[Sequence[Display]]:
        """The displays, where there is no run."""
        with ExitStack() as stack:
            shown: list[Display] = []
            if terminal and not self.as_json:
                shown.append(stack.enter_context(TerminalDisplay(BoardConsole(markup=False))))
            uri = self.display if self.display is not None else _section(self._readable, "display", DisplayConfig).uri
            if uri is not None:
                display = open_display(uri)
                stack.callback(display.close)
                shown.append(display)
            yield shown

    def _config_or_last_good(self, entry: str | None) -> tuple[Config, str | None]:
        """The user's configuration; where it is damaged the last good one, and what is wrong with the user's."""
        shorthands = _shorthands(self.laps, self.model, self.entry if entry is None else entry)
        try:
            config = load_run_config(self.config_file, [*self.overrides, *shorthands], setup=self.setup)
            check_checkpoint(config)
        except InputError as error:
            if self.last_good is None:
                raise
            try:
                return LastGood(self.last_good).load(), str(error)
            except InputError:
                # Of two faults the user can mend the first.
                raise error from None
        return config, None

    @property
    def _readable(self) -> Path | None:
        return next((path for path in self.files if path.exists()), None)

    def _capture(self) -> CaptureConfig:
        return _section(self._readable, "capture", CaptureConfig)


def load_run_config(config_file: Path | None, overrides: Sequence[str], *, setup: Path | None = None) -> Config:
    """The configuration of a run; that of the `setup` directory where there is no other. Raises `InputError` where there is
    none."""
    named = config_file if config_file is not None else SYSTEM_CONFIG
    if setup is not None and not named.exists():
        own = setup / CONFIG_NAME
        if not own.exists():
            raise InputError(
                f"no track is set up yet: go through Set up on the box's pages (dnb-edge web), or write {named}"
            )
        return load_config(own, overrides)
    if config_file is None and not SYSTEM_CONFIG.exists():
        raise InputError("no configuration: give --config FILE (examples are in configs/), or try `dnb-edge demo`")
    return load_config(named, overrides)


def say_summary(console: Console, summary: RunSummary) -> None:
    """The last line of a run for people."""
    console.print(
        f"{summary.laps} laps; the car was found in {summary.detected_frames} of {summary.frames} frames.",
        highlight=False,
    )
    if summary.bad_pictures:
        console.print(
            f"The picture was {', '.join(summary.bad_pictures)}: no car was looked for then.", highlight=False
        )
    if summary.recording is not None:
        console.print(f"Recording: {summary.recording}", highlight=False, soft_wrap=True)


def _section(path: Path | None, name: str, kind: type[T]) -> T:
    """One section of a configuration whose other parts may be wrong; the defaults where it cannot be read itself."""
    try:
        data = None if path is None else plain(path.read_text(encoding="utf-8"))
        return (
            kind.model_validate(data[name], context={"base": path.parent}) if path and data and name in data else kind()
        )
    except (OSError, UnicodeDecodeError, yaml.YAMLError, ValidationError, TypeError):
        return kind()


def _json_lines(source_uri: str, *, observations: bool) -> LiveJsonSink | nullcontext[JsonSink]:
    if source_uri.startswith(LIVE_SCHEMES):
        return LiveJsonSink(sys.stdout.fileno(), observations=observations)
    return nullcontext(JsonSink(sys.stdout, observations=observations))


def _shorthands(laps: int | None, model: Path | None, entry: str | None) -> list[str]:
    given = [] if laps is None else [f"race.laps={laps}"]
    if model is not None:
        given.append(f"detector.model={model.resolve()}")
    if entry is not None:
        if not entry.strip():
            raise InputError("--entry: the name is blank: say who or what drives")
        # Quoted, so that a name like 12 stays text; both keys, since either may stand in the file.
        given += [f"{key}={json.dumps(entry, ensure_ascii=False)}" for key in ("name", "entry.name")]
    return given
