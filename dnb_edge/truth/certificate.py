"""The certificate: a campaign's figures, each held against its limit, as one JSON object.

Knows figures, limits and what they mean together; knows no process and no page. The same results give the same certificate,
whatever machine they came from: it holds no date, no duration and no host.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from dnb_edge import __version__
from dnb_edge.record.header import software_versions
from dnb_edge.truth.campaign import Plan, chosen_of, code_sha256, model_sha256, scenario_laps
from dnb_edge.truth.counts import CountCase
from dnb_edge.truth.figures import LEVELS, scenario_figures
from dnb_edge.truth.scenarios import DRIVERS, HALL, HALL_WIDE, Scenario

FORMAT = 1

FULL_LAPS = 1000
"""Laps of a fast scenario with the share 1, for a certificate."""
FULL_RENDERED_LAPS = 200
"""The same of a rendered one."""
FULL_TRIALS = 5

_STATISTICS = (
    "An error is what was told less what was true. Neighbouring laps share a crossing, so their errors are correlated, and "
    "within one drive the errors of the laps sum to the last crossing's error less the first one's: laps are not taken for "
    "independent, drives are. Intervals come from the spread between drives (cluster sample), those of shares by Wilson's "
    "formula. A bias that all crossings share cancels in laps: it is told apart, as the crossings' bias."
)

Results = Mapping[str, Sequence[dict[str, Any]]]


def certificate(plan: Plan, results: Results) -> dict[str, Any]:
    """The certificate of a campaign's `results`, plain JSON types."""
    scenarios, cases = chosen_of(plan)
    shown = [_scenario(scenario, results[scenario.name]) for scenario in scenarios]
    counts = [_count(case, results[case.name]) for case in cases]
    full = Plan(seed=plan.seed, laps=FULL_LAPS, rendered_laps=FULL_RENDERED_LAPS, trials=FULL_TRIALS)
    figures = {one["name"]: one["figures"] for one in shown}
    judged = [row for scenario in scenarios for row in _judged(scenario, figures[scenario.name], full)]
    judged += _rates(scenarios, results, full) + _drivers(figures) + _hand_over(scenarios, figures, full)
    held = [row["holds"] for row in (*judged, *counts)]
    return {
        "certificate": "dnb-edge accuracy",
        "format": FORMAT,
        "version": __version__,
        "seed": plan.seed,
        "laps": plan.laps,
        "rendered_laps": plan.rendered_laps,
        "trials": plan.trials,
        "only": list(plan.only),
        "model_sha256": model_sha256(),
        "code_sha256": code_sha256(),
        "versions": {name: text for name, text in software_versions().items() if name != "machine"},
        "statistics": _STATISTICS,
        "reliability_levels": list(LEVELS),
        "holds": all(held),
        "missed_limits": held.count(False),
        "enough_laps": all(row["enough_laps"] for row in judged),
        "limits": judged,
        "counts": counts,
        "scenarios": shown,
    }


def _scenario(scenario: Scenario, drives: Sequence[dict[str, Any]]) -> dict[str, Any]:
    return {
        "name": scenario.name,
        "title": scenario.title,
        "kind": scenario.kind,
        "place": scenario.place,
        "fps": scenario.fps,
        "speed_mps": [
            min(style.lowest_mps * style.pace[0] for style in scenario.styles),
            max(style.top_mps * style.pace[1] for style in scenario.styles),
        ],
        "sweep": scenario.sweep,
        "figures": scenario_figures(drives, fps=scenario.fps),
    }


def _count(case: CountCase, trials: Sequence[dict[str, Any]]) -> dict[str, Any]:
    told = [trial["told"] for trial in trials]
    return {
        "name": case.name,
        "title": case.title,
        "expected": case.laps,
        "told": told,
        "expected_valid": case.valid,
        "told_valid": [trial["told_valid"] for trial in trials],
        "reasons": sorted({reason for trial in trials for reason in trial["reasons"]}),
        "holds": all(laps == case.laps for laps in told) and all(trial["same"] for trial in trials),
    }


def _judged(scenario: Scenario, figures: Mapping[str, Any], full: Plan) -> list[dict[str, Any]]:
    """Each limit of a scenario with what came of it. A figure that could not be had does not hold.

    Of fewer laps than a certificate needs the coverage itself says little: it holds unless its interval lies outside them.
    """
    rows = []
    for limit in scenario.limits:
        row = _row(
            name=scenario.name,
            title=scenario.title,
            kind=scenario.kind,
            figure=limit.figure,
            bounds=(limit.least, limit.most),
            value=figures[limit.figure],
            laps=figures["laps"],
            wanted_laps=scenario_laps(scenario, full),
        )
        if limit.figure == "coverage_percent" and limit.least is not None and not row["enough_laps"]:
            low, high = figures["coverage_low_percent"], figures["coverage_high_percent"]
            row["holds"] = low is not None and low <= limit.most and high >= limit.least
        rows.append(row)
    return rows


def _row(
    *,
    name: str,
    title: str,
    kind: str,
    figure: str,
    bounds: tuple[float | None, float | None],
    value: float | None,
    laps: int,
    wanted_laps: int,
) -> dict[str, Any]:
    least, most = bounds
    holds = value is not None and (least is None or value >= least) and (most is None or abs(value) <= most)
    return {
        "scenario": name,
        "title": title,
        "kind": kind,
        "figure": figure,
        "least": least,
        "most": most,
        "value": value,
        "holds": holds,
        "laps": laps,
        "wanted_laps": wanted_laps,
        "enough_laps": laps >= wanted_laps,
    }


_DRIVER_LAPS = 100
"""Laps of each of the paper's drivers, for a certificate."""

_PAIRED = (("score-15fps", "score-60fps"), ("score-30fps", "score-60fps"), ("score-drops", "score-30fps"))


def _rates(scenarios: Sequence[Scenario], results: Results, full: Plan) -> list[dict[str, Any]]:
    """The same laps at two rates, or with drops: the greatest difference of a lap's score."""
    by_name = {scenario.name: scenario for scenario in scenarios}
    rows = []
    for one, other in _PAIRED:
        if one not in by_name or other not in by_name:
            continue
        pairs = [
            abs(a["similarity_percent"] - b["similarity_percent"])
            for mine, theirs in zip(results[one], results[other], strict=True)
            for a, b in zip(mine["laps"], theirs["laps"], strict=True)
            if a["told"] and b["told"]
        ]
        rows.append(
            _row(
                name=one,
                title=f"{by_name[one].title}, against the same laps: {by_name[other].title}",
                kind="fast",
                figure="score_difference_points",
                bounds=(None, 0.5),
                value=max(pairs, default=None),
                laps=len(pairs),
                wanted_laps=scenario_laps(by_name[one], full),
            )
        )
    return rows


def _hand_over(
    scenarios: Sequence[Scenario], figures: Mapping[str, Mapping[str, Any]], full: Plan
) -> list[dict[str, Any]]:
    """What two cameras cost: the 95th percentile of the laps' errors, in that of the same laps under one camera."""
    rows = []
    for scenario in scenarios:
        other = scenario.name.replace(HALL, HALL_WIDE, 1)
        if scenario.place != HALL or other not in figures:
            continue
        two, one = figures[scenario.name]["p95_ms"], figures[other]["p95_ms"]
        rows.append(
            _row(
                name=scenario.name,
                title=f"{scenario.title}: error against the same laps under one camera",
                kind=scenario.kind,
                figure="p95_ratio",
                bounds=(None, 1.5),
                value=two / one if two is not None and one else None,
                laps=figures[scenario.name]["laps"],
                wanted_laps=scenario_laps(scenario, full),
            )
        )
    return rows


def _drivers(figures: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The paper's four drivers: similarity and time fall from the first to the last, by more than their intervals reach.

    Of fewer laps than a certificate needs their means must do: the intervals of a few drives reach far.
    """
    if any(name not in figures for name in DRIVERS):
        return []
    rows = []
    for figure, mean, half in (
        ("similarity_order_gap_percent", "similarity_percent", "similarity_half_width_percent"),
        ("time_order_gap_s", "lap_s", "lap_half_width_s"),
    ):
        four = [(figures[name][mean], figures[name][half]) for name in DRIVERS]
        known = all(one is not None for one, _ in four)
        gaps = [(one - its) - (other + others) for (one, its), (other, others) in pairwise(four)] if known else []
        laps = min(figures[name]["laps"] for name in DRIVERS)
        enough = laps >= _DRIVER_LAPS
        in_order = known and all(one > other for (one, _), (other, _) in pairwise(four))
        rows.append(
            {
                "scenario": " ".join(DRIVERS),
                "title": "the paper's four drivers keep their order; least gap between two neighbours' 95 % intervals",
                "kind": "fast",
                "figure": figure,
                "least": 0.0,
                "most": None,
                "value": min(gaps, default=None),
                "holds": bool(gaps) and min(gaps) > 0.0 if enough else in_order,
                "laps": laps,
                "wanted_laps": _DRIVER_LAPS,
                "enough_laps": enough,
            }
        )
    return rows
