"""The report of a run: one HTML file that holds everything it shows and asks no other machine for anything.

Knows the page's parts. Whatever came from a user or a file
is escaped in one place (`markup.text`). Knows no recording and no device.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

from dnb_edge.errors import InputError
from dnb_edge.race.standings import official_s
from dnb_edge.report import plots
from dnb_edge.report.along import best_laps, drawn_laps
from dnb_edge.report.along_plots import along_picture, compared
from dnb_edge.report.files import write_whole
from dnb_edge.report.lap_style import lap_name, time_words
from dnb_edge.report.lap_table import lap_table
from dnb_edge.report.markup import NONE, PLUS_MINUS, data_uri, number, plain_table, text
from dnb_edge.report.race import race_sections
from dnb_edge.report.run import RunResult
from dnb_edge.report.table import entry_rows

FILE_NAME = "report.html"

_ERROR_NAMES = (
    ("mean", "Mean over all keypoints"),
    ("sum", "Accumulated over all keypoints"),
    ("max", "Largest"),
    ("leave_one_out_mean", "Mean, each keypoint left out in turn"),
)


def write_report(result: RunResult, directory: Path, *, file_name: str = FILE_NAME) -> Path:
    """Write the report into `directory`, which is made if missing, and return its path.

    The file appears under its name only when it is whole. Raises `InputError` where the folder cannot be written to and
    `WorkError` where writing fails (a full disk).
    """
    path = directory / file_name
    page = render(result).encode()
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{directory}: the report cannot be written there: {error.strerror}") from error
    write_whole(path, page)
    return path


def render(result: RunResult) -> str:
    """The whole page, the same text for the same result."""
    template = resources.files("dnb_edge.report").joinpath("page.html").read_text(encoding="utf-8")
    return Template(template).substitute(
        title=text(f"{result.entry}: dnb-edge report"),
        entry=text(result.entry),
        facts=_facts(result),
        warnings=_warnings(result.warnings),
        laps=lap_table(result),
        race=race_sections(result),
        pictures=_pictures(result),
        calibration=_calibration(result.calibration),
        details=_details(result),
    )


def _pictures(result: RunResult) -> str:
    """The sections with pictures; those without anything to show are left out."""
    several = result.several_cars
    drawn = [result.laps[i] for i in drawn_laps(result.laps)]
    lap_list = ", ".join(f"{lap_name(lap, several=several)} {time_words(lap)}" for lap in drawn) or "no complete lap"
    left_out = _left_out(len(result.laps), len(drawn))
    sectors = len(result.track.sector_lines)
    sector_names = f" S1{f' to S{sectors}' if sectors > 1 else ''}: where sectors end." if sectors else ""
    parts = [
        "<section>\n<h2>Driven path</h2>",
        _figure(
            plots.path_picture(result),
            f"Map of the track with the driven path of each lap: {lap_list}",
            f"The car's ground point on the track, each lap from line to line.{sector_names}{left_out}",
        ),
    ]
    worst, off = plots.farthest_off(result), plots.off_picture(result)
    if worst is not None and off is not None:
        name = lap_name(worst.lap, several=several)
        parts.append(
            _figure(
                off,
                f"Map of the track with the path of {name}, coloured by its distance from the centreline",
                f"Where it was off: {name}, of the drawn laps the one that was farthest from the centreline. "
                "Dotted: not seen.",
            )
        )
    parts.append("</section>")
    along = along_picture(result)
    if along is not None:
        behind = " Below: how far behind its car's best valid lap at the same place." if compared(result) else ""
        parts += [
            "<section>\n<h2>Along the route</h2>",
            _figure(
                along,
                f"Speed, lateral error and time lost of each lap along the route: {lap_list}",
                "Above: speed along the route. Then: how far to the left of the centreline the ground point was; grey lies "
                f"beyond the lane's edges, the ring marks the greatest excursion.{behind} Gaps: not seen.{left_out}",
            ),
            "</section>",
        ]
    bars = _left_out(len(result.laps), len(drawn_laps(result.laps, plots.TIMED_LAPS)))
    times = _figure(plots.lap_times_picture(result), f"Bars of the lap times: {lap_list}", bars)
    return "\n".join([*parts, "<section>\n<h2>Lap times</h2>", times, "</section>"])


def _left_out(laps: int, drawn: int) -> str:
    """What to say where not all laps are drawn."""
    if drawn == laps:
        return ""
    return f" Drawn are {drawn} of {laps} laps, the best ones and the last ones; {laps - drawn} are left out."


def _figure(picture: bytes, alt: str, caption: str) -> str:
    said = f"<figcaption>{text(caption.strip())}</figcaption>\n" if caption else ""
    return f'<figure>\n<img alt="{text(alt)}" src="{data_uri(picture)}">\n{said}</figure>'


def _facts(result: RunResult) -> str:
    facts = [*_driver_facts(result), *_lap_facts(result)]
    if result.frames and result.detected_frames is not None:
        share = 100 * result.detected_frames / result.frames
        facts.append(("Car found", f"in {result.detected_frames} of {result.frames} frames ({share:.1f} %)"))
    if result.recording is not None:
        facts.append(("Recording", result.recording))
    return _definitions(facts)


def _driver_facts(result: RunResult) -> list[tuple[str, str]]:
    """Who drove, on what, and under which rules."""
    facts = []
    driver = result.driver
    if driver is not None:
        told = {"Version": driver.version, "Checkpoint, SHA-256": driver.checkpoint_sha256, "Notes": driver.notes}
        facts += [(name, fact) for name, fact in told.items() if fact]
    if result.session is not None:
        facts.append(("Session", result.session))
    facts += [
        ("Source", result.source_uri),
        ("Track", f"{result.track.name}, route of {result.track.centreline.length_m:.3f} m"),
    ]
    rules = result.rules
    if rules is not None:
        facts.append(("Rules", f"{rules.name}, version {rules.version}, digest {rules.digest}"))
        if rules.changed is not None:
            facts.append(("Changed since the run", rules.changed))
    return facts


def _lap_facts(result: RunResult) -> list[tuple[str, str]]:
    """What the laps come to."""
    (row,) = entry_rows([result])
    facts = [
        ("Laps", f"{row.valid_laps} valid of {row.laps}"),
        ("Path similarity, mean", "DNF" if not row.finished else number(row.similarity_percent, "{:.2f} %")),
        ("Completion time, mean", number(row.completion_time_s, "{:.3f} s", none="DNF")),
    ]
    best = min(
        (result.laps[i] for i in best_laps(result.laps).values()),
        key=lambda lap: (official_s(lap), lap.car),
        default=None,
    )
    if best is not None:
        name = lap_name(best, several=result.several_cars)
        facts.append(("Best lap", f"{name}, {official_s(best):.3f} {PLUS_MINUS} {best.sigma_s:.3f} s"))
    return facts


def _definitions(facts: Iterable[tuple[str, str]]) -> str:
    return "<dl>\n" + "".join(f"<dt>{text(name)}</dt><dd>{text(fact)}</dd>\n" for name, fact in facts) + "</dl>"


def _warnings(warnings: Sequence[str]) -> str:
    if not warnings:
        return ""
    return '<ul class="bad">' + "".join(f"<li>{text(warning)}</li>" for warning in warnings) + "</ul>"


def _calibration(calibration: Mapping[str, Any]) -> str:
    if not calibration:
        return "<p>Not known: this run names no keypoints.</p>"
    rows = [
        (title, number(calibration.get(f"{name}_px"), "{:.2f}"), number(calibration.get(f"{name}_m"), "{:.4f}"))
        for name, title in _ERROR_NAMES
        if f"{name}_px" in calibration
    ]
    if calibration.get("sigma_m") is not None:
        rows.append(("sigma of the map where on the route it is greatest", NONE, f"{calibration['sigma_m']:.4f}"))
    parts = [plain_table("Error of the keypoints under the homography", ("", "twin px", "m"), rows)]
    counts = [
        (str(one["points"]), f"{one['mean_px']:.2f}", f"{one['sum_px']:.2f}") for one in calibration.get("by_count", ())
    ]
    if counts:
        caption = "Error over all keypoints by the number used for the homography"
        parts.append(plain_table(caption, ("Keypoints", "mean (twin px)", "accumulated (twin px)"), counts))
    return "\n".join(parts)


def _details(result: RunResult) -> str:
    parts = []
    for title, facts in (
        ("Digests of the conditions: runs with the same ones can be compared", result.digests),
        ("SHA-256", result.hashes),
        ("Versions", result.versions),
    ):
        if facts:
            parts.append(f"<details><summary>{text(title)}</summary>\n{_definitions(facts.items())}</details>")
    if result.config:
        config = json.dumps(result.config, indent=2, ensure_ascii=False, allow_nan=False)
        parts.append(f"<details><summary>Configuration</summary>\n<pre>{text(config)}</pre></details>")
    return "\n".join(parts) or "<p>Nothing was noted.</p>"
