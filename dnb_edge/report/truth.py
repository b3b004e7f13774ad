"""The accuracy certificate as a page: one HTML file that holds everything it shows and asks no other machine for anything.

Knows the certificate as the plain JSON object that `dnb-edge truth` writes; knows no drive and measures nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from string import Template
from typing import Any

from dnb_edge.report.markup import NONE, PLUS_MINUS, data_uri, number, plain_table, text
from dnb_edge.report.truth_plots import errors_picture, memory_picture, sweep_picture, trust_picture

_SVG = "image/svg+xml"

_FIGURES: dict[str, tuple[str, str]] = {
    "bias_ms": ("bias of laps", "ms"),
    "crossing_bias_ms": ("bias of crossings", "ms"),
    "p95_ms": ("lap error, 95 of 100 below", "ms"),
    "p95_ratio": ("lap error, 95 of 100 below, against one camera's", "times"),
    "coverage_percent": ("laps whose stated 95 % interval holds the truth", "%"),
    "missed": ("laps missed", ""),
    "phantom": ("laps told that were none", ""),
    "score_max_points": ("greatest error of a lap's score", "points"),
    "score_difference_points": ("greatest difference of a lap's score", "points"),
    "similarity_order_gap_percent": ("gap between neighbours' similarity intervals", "points"),
    "time_order_gap_s": ("gap between neighbours' time intervals", "s"),
}
"""Words and unit of each figure that has a limit."""

_COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("laps", "Laps", "{:d}"),
    ("missed", "Missed", "{:d}"),
    ("phantom", "Phantom", "{:d}"),
    ("bias_ms", "Bias (ms)", "{:+.2f}"),
    ("p50_ms", "p50 (ms)", "{:.2f}"),
    ("p95_ms", "p95 (ms)", "{:.2f}"),
    ("max_ms", "Greatest (ms)", "{:.2f}"),
    ("stated_sigma_ms", "Stated sigma (ms)", "{:.2f}"),
    ("z_rms", "Error / sigma, rms", "{:.2f}"),
    ("coverage_percent", "Coverage (%)", "{:.1f}"),
    ("crossing_bias_ms", "Crossings' bias (ms)", "{:+.2f}"),
    ("position_p50_mm", "Ground point p50 (mm)", "{:.1f}"),
    ("position_p95_mm", "p95 (mm)", "{:.1f}"),
    ("score_bias_points", "Score bias (points)", "{:+.2f}"),
    ("score_max_points", "Score, greatest error", "{:.2f}"),
)


def render_certificate(certificate: Mapping[str, Any]) -> str:
    """The whole page, the same text for the same certificate."""
    template = resources.files("dnb_edge.report").joinpath("truth.html").read_text(encoding="utf-8")
    scenarios: Sequence[Mapping[str, Any]] = certificate["scenarios"]
    main = [scenario for scenario in scenarios if not scenario["sweep"]]
    told = "; ".join(
        f"{scenario['name']}: p95 {number(scenario['figures']['p95_ms'], '{:.2f}')} ms" for scenario in main
    )
    return Template(template).substitute(
        title=text(f"dnb-edge {certificate['version']}: accuracy certificate"),
        verdict=_verdict(certificate),
        facts=_definitions(
            (
                ("Version", f"dnb-edge {certificate['version']}"),
                ("Laps", _laps(certificate)),
                ("Seed", certificate["seed"]),
                ("Detector's model", f"SHA-256 {certificate['model_sha256']}"),
            )
        ),
        limits=_limits(certificate["limits"]),
        counts=_counts(certificate["counts"]),
        scenarios=_scenarios(scenarios),
        errors_alt=text(f"Histograms of lap errors. {told}"),
        errors_picture=data_uri(errors_picture(main), _SVG),
        trust_picture=data_uri(trust_picture(scenarios, certificate["reliability_levels"]), _SVG),
        sweep=_sweep([scenario for scenario in scenarios if scenario["sweep"]]),
        detector=_detector([scenario for scenario in scenarios if scenario["figures"]["detector"] is not None]),
        statistics=text(certificate["statistics"]),
        made=_definitions(
            (("Code", f"SHA-256 {certificate['code_sha256']}"), *sorted(certificate["versions"].items()))
        ),
    )


def _verdict(certificate: Mapping[str, Any]) -> str:
    judged = len(certificate["limits"]) + len(certificate["counts"])
    missed = certificate["missed_limits"]
    words = f"All {judged} limits hold." if not missed else f"{missed} of {judged} limits are missed."
    if not certificate["enough_laps"]:
        words += " Fewer laps were driven than a certificate needs: a first look only."
    return f'<p class="{"bad" if missed else "good"}">{text(words)}</p>'


def _laps(certificate: Mapping[str, Any]) -> str:
    driven = {"fast": 0, "rendered": 0}
    for scenario in certificate["scenarios"]:
        driven[scenario["kind"]] += scenario["figures"]["laps"]
    return f"{driven['fast']} with drawn detections, {driven['rendered']} with rendered frames through the shipped detector"


def _definitions(facts: Iterable[tuple[str, object]]) -> str:
    return "<dl>\n" + "".join(f"<dt>{text(name)}</dt><dd>{text(fact)}</dd>\n" for name, fact in facts) + "</dl>"


def _limits(limits: Sequence[Mapping[str, Any]]) -> str:
    if not limits:
        return "<p>None of the scenarios that were driven has a limit.</p>"
    rows = "".join(_limit_row(row) for row in limits)
    head = "".join(f'<th scope="col">{name}</th>' for name in ("Value", "Limit", "Laps", "Verdict"))
    return (
        '<div class="scroll"><table>\n<thead><tr><th scope="col" class="text">Scenario</th>'
        f'<th scope="col" class="text">Figure</th>{head}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table></div>'
    )


def _limit_row(row: Mapping[str, Any]) -> str:
    words, unit = _FIGURES[row["figure"]]
    least, most = row["least"], row["most"]
    if least is not None and most is not None:
        bounds = f"{least:g} to {most:g}"
    else:
        bounds = f"at most {most:g}" if most is not None else f"above {least:g}"
    verdict = ("holds" if row["holds"] else "missed") + (
        "" if row["enough_laps"] else f" ({row['wanted_laps']} laps wanted)"
    )
    cells = (
        f'<td class="text">{text(row["title"])}</td>',
        f'<td class="text">{text(words)}</td>',
        f"<td>{text(number(row['value'], '{:.4g}'))} {text(unit)}</td>",
        f"<td>{text(bounds)} {text(unit)}</td>",
        f"<td>{row['laps']}</td>",
        f'<td class="{"good" if row["holds"] else "bad"}">{text(verdict)}</td>',
    )
    return f"<tr>{''.join(cells)}</tr>\n"


def _counts(counts: Sequence[Mapping[str, Any]]) -> str:
    if not counts:
        return "<p>None were driven.</p>"
    rows = "".join(
        f'<tr><th scope="row" class="text">{text(count["title"])}</th><td>{count["expected"]}</td>'
        f"<td>{text(', '.join(map(str, count['told'])))}</td><td>{count['expected_valid']}</td>"
        f"<td>{text(', '.join(map(str, count['told_valid'])))}</td>"
        f'<td class="text">{text("; ".join(count["reasons"]))}</td>'
        f'<td class="{"good" if count["holds"] else "bad"}">{"holds" if count["holds"] else "missed"}</td></tr>\n'
        for count in counts
    )
    names = ("Laps driven", "Told, each trial", "Of them right", "Told valid")
    head = "".join(f'<th scope="col">{name}</th>' for name in names)
    return (
        f'<div class="scroll"><table>\n<thead><tr><th scope="col" class="text">Case</th>{head}<th scope="col" class="text">'
        f'Reasons told</th><th scope="col">Verdict</th></tr></thead>\n<tbody>\n{rows}</tbody>\n</table></div>'
    )


def _scenarios(scenarios: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        (
            scenario["title"],
            scenario["kind"],
            *(_cell(scenario["figures"], name, form) for name, _, form in _COLUMNS),
        )
        for scenario in scenarios
    ]
    return plain_table("", ("Scenario", "Way", *(words for _, words, _ in _COLUMNS)), rows)


def _cell(figures: Mapping[str, Any], name: str, form: str) -> str:
    cell = number(figures[name], form)
    if name == "coverage_percent" and figures[name] is not None:
        cell += f" ({figures['coverage_low_percent']:.1f} to {figures['coverage_high_percent']:.1f})"
    if name in ("bias_ms", "crossing_bias_ms") and figures[name] is not None:
        cell += f" {PLUS_MINUS} {figures[name.removesuffix('_ms') + '_half_width_ms']:.2f}"
    return cell


def _sweep(scenarios: Sequence[Mapping[str, Any]]) -> str:
    if not scenarios:
        return ""
    told = "; ".join(f"{one['title']}: p95 {number(one['figures']['p95_ms'], '{:.2f}')} ms" for one in scenarios)
    return (
        f"<section>\n<h2>Speed and rate</h2>\n<figure>\n"
        f'<img alt="{text("Lap error over speed, a line a rate. " + told)}" '
        f'src="{data_uri(sweep_picture(scenarios), _SVG)}">\n</figure>\n</section>'
    )


def _detector(scenarios: Sequence[Mapping[str, Any]]) -> str:
    """What the real detector's errors are like, where frames were rendered."""
    if not scenarios:
        return ""
    rows = []
    for scenario in scenarios:
        for axis in ("along", "across"):
            one = scenario["figures"]["detector"][axis]
            rows.append(
                (
                    f"{scenario['name']}, {axis} the way",
                    number(one["error_rms_mm"], "{:.2f}"),
                    number(one["mean_mm"], "{:+.2f}"),
                    number(one["z_rms"], "{:.2f}"),
                    number(one["repeated_share"], "{:.2f}"),
                    number(one["window_variance_ratio"], "{:.1f}"),
                    number(one["autocorrelation"][1], "{:.2f}", none=NONE),
                )
            )
    headings = (
        "Errors of the ground point", "rms (mm)", "mean (mm)", "error / stated sigma, rms",
        "share that repeats each lap at the same place", "variance of a fit window's mean, over independent errors'",
        "correlation with the next frame's",
    )  # fmt: skip
    table = plain_table("", headings, rows)
    picture = data_uri(memory_picture(scenarios), _SVG)
    return (
        f"<section>\n<h2>The detector's errors</h2>\n{table}\n<figure>\n"
        f'<img alt="Autocorrelation of the detector\'s errors over frames." src="{picture}">\n</figure>\n</section>'
    )
