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
from dnb_edge.report import plots
from dnb_edge.report.files import write_whole
from dnb_edge.report.markup import NONE, PLUS_MINUS, data_uri, number, plain_table, text
from dnb_edge.report.race import race_sections
from dnb_edge.report.run import RunResult
from dnb_edge.report.table import entry_rows
from dnb_edge.values import Lap, Score

FILE_NAME = "report.html"

_LAP_HEADINGS = (
    "Lap",
    f"Time {PLUS_MINUS} sigma (s)",
    "Similarity (%)",
    "DTW, mean (m)",
    "Fr\N{LATIN SMALL LETTER E WITH ACUTE}chet (m)",
    "Lateral, mean / max (m)",
    "Car seen (%)",
)

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
    lap_list = ", ".join(f"lap {lap.number} {lap.time_s:.3f} s" for lap in result.laps) or "no complete lap"
    return Template(template).substitute(
        title=text(f"{result.entry}: dnb-edge report"),
        entry=text(result.entry),
        facts=_facts(result),
        warnings=_warnings(result.warnings),
        laps=_lap_table(result),
        race=race_sections(result),
        path_alt=text(f"Map of the track with the driven path of each lap: {lap_list}"),
        path_picture=data_uri(plots.path_picture(result)),
        times_alt=text(f"Bars of the lap times: {lap_list}"),
        times_picture=data_uri(plots.lap_times_picture(result)),
        calibration=_calibration(result.calibration),
        details=_details(result),
    )


def _facts(result: RunResult) -> str:
    (row,) = entry_rows([result])
    best = min((lap for lap in result.laps if lap.valid), key=lambda lap: lap.time_s, default=None)
    facts: list[tuple[str, str]] = [
        ("Source", result.source_uri),
        ("Track", f"{result.track.name}, route of {result.track.centreline.length_m:.3f} m"),
        ("Laps", f"{row.valid_laps} valid of {row.laps}"),
        ("Path similarity, mean", "DNF" if not row.finished else number(row.similarity_percent, "{:.2f} %")),
        ("Completion time, mean", number(row.completion_time_s, "{:.3f} s", none="DNF")),
    ]
    if best is not None:
        facts.append(("Best lap", f"lap {best.number}, {best.time_s:.3f} {PLUS_MINUS} {best.sigma_s:.3f} s"))
    if result.frames and result.detected_frames is not None:
        share = 100 * result.detected_frames / result.frames
        facts.append(("Car found", f"in {result.detected_frames} of {result.frames} frames ({share:.1f} %)"))
    if result.recording is not None:
        facts.append(("Recording", result.recording))
    return _definitions(facts)


def _definitions(facts: Iterable[tuple[str, str]]) -> str:
    return "<dl>\n" + "".join(f"<dt>{text(name)}</dt><dd>{text(fact)}</dd>\n" for name, fact in facts) + "</dl>"


def _warnings(warnings: Sequence[str]) -> str:
    if not warnings:
        return ""
    return '<ul class="bad">' + "".join(f"<li>{text(warning)}</li>" for warning in warnings) + "</ul>"


def _lap_table(result: RunResult) -> str:
    if not result.laps:
        return "<p>No complete lap: the entry did not finish (DNF).</p>"
    head = "".join(f'<th scope="col">{text(heading)}</th>' for heading in _LAP_HEADINGS)
    rows = "".join(_lap_row(lap, result.score_of(lap)) for lap in result.laps)
    return (
        f'<div class="scroll"><table>\n<thead><tr>{head}<th scope="col" class="text">Valid</th></tr></thead>\n'
        f"<tbody>\n{rows}</tbody>\n</table></div>"
    )


def _lap_row(lap: Lap, score: Score | None) -> str:
    cells = [
        f"{lap.time_s:.4f} {PLUS_MINUS} {lap.sigma_s:.4f}",
        number(lap.similarity_percent, "{:.2f}"),
        *_score_cells(score),
        f"{100 * lap.observed_fraction:.1f}",
    ]
    if lap.penalty_s > 0:
        cells[0] += f" (+{lap.penalty_s:.3f})"
    valid = "yes" if lap.valid else "no: " + "; ".join(lap.reasons)
    if lap.suspect:
        valid += ", but suspect: " + "; ".join(lap.suspect)
    kind = "text" if lap.valid and not lap.suspect else "text bad"
    figures = "".join(f"<td>{text(cell)}</td>" for cell in cells)
    return f'<tr><th scope="row">{lap.number}</th>{figures}<td class="{kind}">{text(valid)}</td></tr>\n'


def _score_cells(score: Score | None) -> tuple[str, str, str]:
    if score is None:
        return NONE, NONE, NONE
    lateral = f"{score.lateral_mean_m:.4f} / {score.lateral_max_m:.4f}"
    return f"{score.dtw_mean_m:.4f}", f"{score.frechet_m:.4f}", lateral


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
    for title, facts in (("SHA-256", result.hashes), ("Versions", result.versions)):
        if facts:
            parts.append(f"<details><summary>{text(title)}</summary>\n{_definitions(facts.items())}</details>")
    if result.config:
        config = json.dumps(result.config, indent=2, ensure_ascii=False, allow_nan=False)
        parts.append(f"<details><summary>Configuration</summary>\n<pre>{text(config)}</pre></details>")
    return "\n".join(parts) or "<p>Nothing was noted.</p>"
