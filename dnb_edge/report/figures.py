"""All figures of a run's report, by name, with what is to be said of them: the page shows them, and a folder takes them.

Knows a `RunResult` and who draws what. Names stay the same from version to version. Knows no page.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from dnb_edge.errors import InputError
from dnb_edge.report import plots
from dnb_edge.report.along import LapAlong, drawn_laps, laps_along, laps_at
from dnb_edge.report.along_plots import along_picture, compared
from dnb_edge.report.coloured import (
    LossMap,
    Shade,
    lateral_picture,
    lateral_shade,
    loss_map,
    loss_picture,
    speed_picture,
    speed_shade,
)
from dnb_edge.report.files import write_whole
from dnb_edge.report.health_plots import health_picture
from dnb_edge.report.lap_style import lap_name, time_words
from dnb_edge.report.picture import PictureFormat
from dnb_edge.report.run import RunResult
from dnb_edge.score.profile import LapTrace

MOST_PAIRS = 8
"""So many laps are shown coloured by speed and by lateral error."""


class Section(StrEnum):
    """Where on the page a figure stands: the section's heading."""

    PATH = "Driven path"
    COLOURED = "Speed and lateral error on the track"
    LOST = "Where time is lost"
    ALONG = "Along the route"
    TIMES = "Lap times"
    HEALTH = "Health"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportFigure:
    """One figure, drawn when it is asked for."""

    name: str
    """Of its file, without ending."""
    section: Section
    alt: str
    """What it shows, for who cannot see it."""
    caption: str
    draw: Callable[[PictureFormat], bytes]
    half: bool = False
    """Whether it stands beside another."""


def report_figures(result: RunResult) -> Iterator[ReportFigure]:
    """The figures of `result` that have something to show, in the order of the page."""
    drawn = laps_along(result)
    yield _paths(result, drawn)
    yield from _off(result)
    yield from _pairs(result, drawn)
    yield from _lost(result, drawn)
    yield from _along(result, drawn)
    yield _times(result, drawn)
    health = result.health
    if health is not None:
        yield ReportFigure(
            name="health",
            section=Section.HEALTH,
            alt="Frames lost, frame rate, latency, temperature and room on the disk over the run",
            caption="Each step is the worst of its time; bars are all frames lost in it, by reason. Red: no frame came. "
            "Grey behind the temperature: throttled.",
            draw=lambda kind: health_picture(health, picture_format=kind),
        )


def write_figures(result: RunResult, directory: Path, kind: PictureFormat) -> Iterator[Path]:
    """Writes each figure of `result` into `directory`, which is made if missing, one by one; gives each file's path.

    Raises `InputError` where nothing can be written there and `WorkError` where writing fails (a full disk).
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{directory}: figures cannot be written there: {error.strerror}") from error
    for figure in report_figures(result):
        path = directory / f"{figure.name}.{kind}"
        write_whole(path, figure.draw(kind))
        yield path


def _laps_words(result: RunResult, drawn: Sequence[LapAlong]) -> str:
    several = result.several_cars
    return (
        ", ".join(f"{lap_name(one.lap, several=several)} {time_words(one.lap)}" for one in drawn) or "no complete lap"
    )


def _paths(result: RunResult, drawn: Sequence[LapAlong]) -> ReportFigure:
    sectors = len(result.track.sector_lines)
    names = f" S1{f' to S{sectors}' if sectors > 1 else ''}: where sectors end." if sectors else ""
    return ReportFigure(
        name="path",
        section=Section.PATH,
        alt=f"Map of the track with the driven path of each lap: {_laps_words(result, drawn)}",
        caption=f"The car's ground point on the track, each lap from line to line.{names}{left_out(result, len(drawn))}",
        draw=lambda kind: plots.path_picture(result, picture_format=kind),
    )


def _off(result: RunResult) -> Iterator[ReportFigure]:
    worst = plots.farthest_off(result)
    if worst is None or worst.trace is None:
        return
    name = lap_name(worst.lap, several=result.several_cars)
    trace, shade = worst.trace, lateral_shade([worst.trace])
    yield ReportFigure(
        name="lateral-farthest",
        section=Section.PATH,
        alt=f"Map of the track with the path of {name}, coloured by its distance from the centreline",
        caption=f"Where it was off: {name}, of the drawn laps the one that was farthest from the centreline. "
        "Dotted: not seen.",
        draw=lambda kind: lateral_picture(result, trace, shade, width_in=None, picture_format=kind),
    )


def _pairs(result: RunResult, drawn: Sequence[LapAlong]) -> Iterator[ReportFigure]:
    """The best lap of each car and the laps that somebody chose, coloured by speed and by lateral error, all alike."""
    index = {(lap.car, lap.number): i for i, lap in enumerate(result.laps)}
    chosen = laps_at(result, [index[key] for key in result.chosen if key in index])
    known = {one.index for one in chosen}
    best = [one for one in drawn if one.best and one.index not in known]
    shown = [(one, one.trace) for one in (*chosen, *best) if one.trace is not None][:MOST_PAIRS]
    traces = [trace for _, trace in shown]
    speeds, laterals = speed_shade(traces), lateral_shade(traces)
    for one, trace in shown:
        name = lap_name(one.lap, several=result.several_cars)
        key = f"car{one.lap.car}-best" if one in best else f"car{one.lap.car}-lap{one.lap.number}"
        words = f"{name}, {time_words(one.lap)}{', the best' if one.best else ''}"
        yield _speed(result, trace, speeds, key, words)
        yield _lateral(result, trace, laterals, key, words)


def _speed(result: RunResult, trace: LapTrace, shade: Shade, key: str, words: str) -> ReportFigure:
    return ReportFigure(
        name=f"speed-{key}",
        section=Section.COLOURED,
        alt=f"Map of the track with the path of {words}, coloured by speed",
        caption=f"Speed: {words}.",
        draw=lambda kind: speed_picture(result, trace, shade, picture_format=kind),
        half=True,
    )


def _lateral(result: RunResult, trace: LapTrace, shade: Shade, key: str, words: str) -> ReportFigure:
    return ReportFigure(
        name=f"lateral-{key}",
        section=Section.COLOURED,
        alt=f"Map of the track with the path of {words}, coloured by its distance from the centreline",
        caption=f"Distance from the centreline: {words}.",
        draw=lambda kind: lateral_picture(result, trace, shade, picture_format=kind),
        half=True,
    )


def _lost(result: RunResult, drawn: Sequence[LapAlong]) -> Iterator[ReportFigure]:
    cars = sorted({one.lap.car for one in drawn if one.best})
    losses = [(car, loss) for car in cars if (loss := loss_map(drawn, car)) is not None]
    for car, loss in losses[:MOST_PAIRS]:
        yield _loss(result, car, loss, half=len(losses) > 1)


def _loss(result: RunResult, car: int, loss: LossMap, *, half: bool) -> ReportFigure:
    best = lap_name(loss.best.lap, several=result.several_cars)
    others = "one other lap" if loss.laps == 1 else f"{loss.laps} other laps, on average"
    most_m = 0.5 * (loss.ends_m[loss.worst] + loss.ends_m[loss.worst + 1])
    return ReportFigure(
        name=f"lost-car{car}",
        section=Section.LOST,
        alt=f"Map of the track with the path of {best}, coloured by the time that other laps lose there",
        caption=f"Against {best}, the best: {others}. Orange: time is lost, most of it {most_m:.2f} m along the lap; "
        "violet: it is won.",
        draw=lambda kind: loss_picture(result, loss, picture_format=kind),
        half=half,
    )


def _along(result: RunResult, drawn: Sequence[LapAlong]) -> Iterator[ReportFigure]:
    if all(one.trace is None for one in drawn):
        return
    behind = " Below: how far behind its car's best valid lap at the same place." if compared(result) else ""
    yield ReportFigure(
        name="along",
        section=Section.ALONG,
        alt=f"Speed, lateral error and time lost of each lap along the route: {_laps_words(result, drawn)}",
        caption="Above: speed along the route. Then: how far to the left of the centreline the ground point was; grey lies "
        f"beyond the lane's edges, the ring marks the greatest excursion.{behind} Gaps: not seen."
        f"{left_out(result, len(drawn))}",
        draw=lambda kind: along_picture(result, picture_format=kind) or b"",
    )


def _times(result: RunResult, drawn: Sequence[LapAlong]) -> ReportFigure:
    return ReportFigure(
        name="lap-times",
        section=Section.TIMES,
        alt=f"Bars of the lap times: {_laps_words(result, drawn)}",
        caption=left_out(result, len(drawn_laps(result.laps, plots.TIMED_LAPS))).strip(),
        draw=lambda kind: plots.lap_times_picture(result, picture_format=kind),
    )


def left_out(result: RunResult, drawn: int) -> str:
    """What to say where not all laps are drawn."""
    laps = len(result.laps)
    if drawn == laps:
        return ""
    return f" Drawn are {drawn} of {laps} laps, the best ones and the last ones; {laps - drawn} are left out."
