"""The ranking of a campaign: who is first by what, how sure it is, and what it says of those who did not complete."""

import json
import random
from dataclasses import replace

import pytest
from nut_results import LAP, RESULT

from dnb_edge.cli.nut_drive import ranking_line
from dnb_edge.nut.campaign import TrialResult
from dnb_edge.nut.ranking import CampaignRanking, RankBy, ranked


def drives(entry: str, similarity: float, time_s: float, *, seeds: int = 8, spread: float = 1.0) -> list[TrialResult]:
    """Two laps a seed that scatter by `spread` percent and a tenth of that in seconds."""
    chance = random.Random(entry)
    results = []
    for seed in range(seeds):
        laps = tuple(
            replace(
                LAP,
                number=k,
                similarity_percent=similarity + chance.gauss(0, spread),
                official_s=time_s + chance.gauss(0, spread / 10),
            )
            for k in (1, 2)
        )
        results.append(replace(RESULT, entry=entry, driver=entry, seed=seed, laps=laps))
    return results


def test_the_best_score_is_first_and_the_best_pace_too() -> None:
    """Three drivers well apart: places, letters of their own, disjoint intervals, an order that holds in all resamples."""
    results = drives("slow", 97, 10.0) + drives("fast", 92, 7.0) + drives("wild", 80, 8.0)
    by_score = ranked("lane-following", results, RankBy.SCORE)
    assert [(row.place, row.entry, row.letters) for row in by_score.rows] == [
        (1, "slow", "a"), (2, "fast", "b"), (3, "wild", "c"),
    ]  # fmt: skip
    assert (by_score.disjoint, by_score.order_share, by_score.seeds) == (True, 1.0, 8)
    by_pace = ranked("lane-following", results, RankBy.PACE)
    assert [row.entry for row in by_pace.rows] == ["fast", "wild", "slow"]
    assert [row.time_s is not None and round(row.time_s.mean) for row in by_pace.rows] == [7, 8, 10]
    assert [round(row.pace.mean, 1) for row in by_pace.rows] == [8.6, 7.5, 6.0]


def test_drivers_that_are_alike_share_a_letter_and_are_not_disjoint() -> None:
    """A tenth of their spread apart, over eight seeds."""
    made = ranked("t", drives("one", 90.0, 8.0) + drives("other", 90.1, 8.0), RankBy.SCORE)
    assert {row.letters for row in made.rows} == {"a"}
    assert not made.disjoint
    assert made.order_share is not None
    assert made.order_share < 0.99


def test_drivers_are_compared_seed_by_seed() -> None:
    """Seeds differ by ten times as much as the drivers do, alike for both: their intervals overlap, and yet one is better."""
    chance = random.Random(5)
    results = []
    for seed in range(12):
        hard = chance.gauss(0, 5)
        for entry, better in (("good", 0.5), ("plain", 0.0)):
            lap = replace(LAP, similarity_percent=80 + hard + better + chance.gauss(0, 0.1))
            results.append(replace(RESULT, entry=entry, seed=seed, laps=(lap, lap)))
    made = ranked("t", results, RankBy.SCORE)
    assert [(row.entry, row.letters, row.place_share) for row in made.rows] == [("good", "a", 1.0), ("plain", "b", 1.0)]
    assert not made.disjoint
    assert made.order_share == 1.0


def test_who_completed_nothing_is_last_by_pace_and_still_has_a_score() -> None:
    """However fast its laps: its lap time is not told, its half-driven laps are worth half, its failures are counted."""
    lost = [
        replace(one, completed=False, laps=one.laps[:1], failure="gone" if one.seed < 3 else None)
        for one in drives("lost", 98.0, 5.0)
    ]
    made = ranked("t", lost + drives("sound", 90.0, 9.0), RankBy.PACE)
    first, last = made.rows
    assert (first.entry, last.entry, last.time_s, last.place) == ("sound", "lost", None, 2)
    assert (last.completed, last.drives, last.failed, last.laps, last.wanted_laps) == (0, 8, 3, 8, 16)
    assert last.score.mean == pytest.approx(49.0, abs=1.0)


def test_the_order_of_the_results_changes_nothing() -> None:
    """Workers finish as they like."""
    results = drives("one", 90.0, 8.0) + drives("other", 91.0, 8.1) + drives("third", 85.0, 8.1)
    shuffled = random.Random(3).sample(results, len(results))
    assert ranked("t", shuffled, RankBy.SCORE) == ranked("t", results, RankBy.SCORE)


def test_drives_that_are_all_alike_can_be_told_as_json() -> None:
    """A driver that never completes a lap has no spread, and no number that JSON lacks is told of it."""
    hopeless = [replace(one, laps=(), completed=False, to_start_s=None) for one in drives("hopeless", 0, 8)]
    line = ranking_line(ranked("t", hopeless + drives("sound", 90, 8), RankBy.SCORE))
    told = json.loads(json.dumps(line, allow_nan=False))
    assert [row["score"]["mean"] for row in told["rows"]][1] == 0.0


def test_one_seed_has_places_and_no_intervals() -> None:
    """Nothing is known of the spread, and nothing is claimed."""
    made: CampaignRanking = ranked("t", drives("one", 90, 8, seeds=1) + drives("two", 80, 8, seeds=1), RankBy.SCORE)
    assert [(row.entry, row.place) for row in made.rows] == [("one", 1), ("two", 2)]
    assert (made.disjoint, made.order_share) == (False, None)
