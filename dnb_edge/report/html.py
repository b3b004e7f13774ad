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
from dnb_edge.report.along import best_laps
from dnb_edge.report.figures import ReportFigure, Section, report_figures
from dnb_edge.report.files import write_whole
from dnb_edge.report.health_section import health_section
from dnb_edge.report.lap_style import lap_name
from dnb_edge.report.lap_table import lap_table
from dnb_edge.report.markup import NONE, PLUS_MINUS, data_uri, number, plain_table, text
from dnb_edge.report.race import race_sections
from dnb_edge.report.run import RunResult
from dnb_edge.report.table import entry_rows
from dnb_edge.report.vehicle import vehicle_section

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
    header = f"<h1>{text(result.entry)}</h1>\n{facts_list(result)}\n{warnings_list(result.warnings)}"
    body = [
        f"<section>\n<h2>Laps</h2>\n{lap_table(result)}\n</section>",
        race_sections(result),
        _pictures(result),
        vehicle_section(result.vehicles),
        f"<section>\n<h2>Transformation error</h2>\n{_calibration(result.calibration)}\n</section>",
        f"<section>\n<h2>How this was made</h2>\n{details(result)}\n</section>",
    ]
    return page(title=f"{result.entry}: dnb-edge report", header=header, body="\n".join(filter(None, body)))


def page(*, title: str, header: str, body: str) -> str:
    """A whole page with this `title`, which is text; `header` and `body` are HTML."""
    template = resources.files("dnb_edge.report").joinpath("page.html").read_text(encoding="utf-8")
    return Template(template).substitute(title=text(title), header=header, body=body)


def _pictures(result: RunResult) -> str:
    """The sections with pictures; those without anything to show are left out."""
    parts: dict[Section, list[str]] = {section: [] for section in Section}
    for figure in report_figures(result):
        parts[figure.section].append(figure_html(figure))
    health = parts.pop(Section.HEALTH)
    sections = [
        f"<section>\n<h2>{text(name)}</h2>\n{laid_out(shown)}\n</section>" for name, shown in parts.items() if shown
    ]
    return "\n".join([*sections, health_section(result.health, "\n".join(health))])


def laid_out(figures: Sequence[str]) -> str:
    """Figures one below the other, halves side by side where the page is wide enough."""
    return f'<div class="figures">\n{"".join(figures)}</div>'


def figure_html(figure: ReportFigure) -> str:
    """The figure with its caption."""
    said = f"<figcaption>{text(figure.caption)}</figcaption>\n" if figure.caption else ""
    kind = ' class="half"' if figure.half else ""
    picture = data_uri(figure.draw("png"))
    return f'<figure{kind}>\n<img alt="{text(figure.alt)}" src="{picture}">\n{said}</figure>\n'


def facts_list(result: RunResult) -> str:
    """Who drove, on what, by which rules, and what the laps come to."""
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
    if result.began is not None:
        facts.append(("Began", result.began))
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


def warnings_list(warnings: Sequence[str]) -> str:
    """What a reader must know; empty where there is nothing."""
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


def details(result: RunResult) -> str:
    """Digests, hashes, versions and the configuration, folded away."""
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
