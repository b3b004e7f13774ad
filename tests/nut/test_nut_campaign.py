"""Campaigns of drives: which seeds, what a drive is worth, what is kept of it and when it is done anew."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from nut_results import LAP, RESULT

from dnb_edge.errors import InputError, WorkError
from dnb_edge.nut.campaign import Trial, TrialLap, TrialResult, drive_all, kept, result_text, seeds_of


@pytest.mark.parametrize(
    ("text", "seeds"), [("7", (7,)), ("1-3", (1, 2, 3)), ("1-3, 8,20-21,2", (1, 2, 3, 8, 20, 21)), ("0", (0,))]
)
def test_seeds_are_ranges_each_once(text: str, seeds: tuple[int, ...]) -> None:
    """In their order, whatever is named twice."""
    assert seeds_of(text) == seeds


@pytest.mark.parametrize("text", ["", "a", "3-1", "-3", "1-", "1,,2", "1-200000", "99999999999"])
def test_what_is_no_seed_is_told(text: str) -> None:
    """In one line with how to write it."""
    with pytest.raises(InputError, match=r"^--seeds "):
        seeds_of(text)


@pytest.mark.parametrize(
    ("laps", "score"),
    [
        ((LAP, LAP), 90.0),
        ((LAP,), 45.0),
        ((), 0.0),
        ((LAP, replace(LAP, valid=False)), 45.0),
        ((LAP, replace(LAP, penalty_factor=0.5)), 67.5),
        ((LAP, replace(LAP, similarity_percent=None)), 45.0),
        ((LAP, LAP, LAP), 90.0),
    ],
)
def test_a_drive_is_worth_its_wanted_laps(laps: tuple[TrialLap, ...], score: float) -> None:
    """The mean similarity, each lap times its factor; invalid, undriven and unscored laps count 0, more than wanted nothing."""
    assert replace(RESULT, laps=laps).score == pytest.approx(score)


@pytest.mark.parametrize(
    ("laps", "pace"),
    [
        ((LAP, LAP), 60 / 8.0),
        ((LAP, replace(LAP, official_s=13.0)), 120 / 21.0),
        ((LAP, replace(LAP, valid=False)), 60 / 16.0),
        ((LAP,), 60 / (17.0 - 0.8)),
        ((), 0.0),
    ],
)
def test_pace_counts_valid_laps_and_all_the_time(laps: tuple[TrialLap, ...], pace: float) -> None:
    """Two laps of 8 s in 17 s of which 0.8 s led to the start: what was not completed costs its time, too."""
    assert replace(RESULT, laps=laps).pace == pytest.approx(pace)


def test_the_error_of_a_lap_is_told_minus_true() -> None:
    """In milliseconds; the worst is by size, and unknown ones are left out."""
    early, unknown = replace(LAP, true_s=8.005), replace(LAP, true_s=None)
    assert LAP.error_ms == pytest.approx(2.0)
    assert unknown.error_ms is None
    assert replace(RESULT, laps=(LAP, early, unknown)).worst_error_ms == pytest.approx(5.0)
    assert replace(RESULT, laps=(unknown,)).worst_error_ms is None


def trial(directory: Path, seed: int = 1, *, key: str | None = "k") -> Trial:
    return Trial(
        driver="pure-pursuit", entry="pursuit", task="lane-following", seed=seed, laps=2, directory=str(directory),
        name=f"pursuit-{seed}", key=key,
    )  # fmt: skip


def keep(one: Trial, result: TrialResult) -> None:
    one.recording.write_bytes(b"mcap")
    one.result.write_text(result_text(one, result))


def test_what_was_driven_already_is_kept_bit_for_bit(tmp_path: Path) -> None:
    """Under the same key and with its recording; else it is driven anew."""
    one = trial(tmp_path)
    assert kept(one) is None
    keep(one, RESULT)
    assert kept(one) == RESULT
    assert kept(replace(one, key="other")) is None
    assert kept(replace(one, key=None)) is None
    one.result.write_text("{")
    assert kept(one) is None
    keep(one, RESULT)
    one.recording.unlink()
    assert kept(one) is None


def test_a_campaign_drives_only_what_is_due(tmp_path: Path) -> None:
    """What is kept comes first; every trial comes once."""
    keep(trial(tmp_path, 2), replace(RESULT, seed=2))
    driven = []

    def drive(one: Trial) -> TrialResult:
        driven.append(one.seed)
        return replace(RESULT, seed=one.seed)

    told = [
        (one.seed, result.seed) for one, result in drive_all([trial(tmp_path, k) for k in (1, 2, 3)], drive, jobs=1)
    ]
    assert told == [(2, 2), (1, 1), (3, 3)]
    assert driven == [1, 3]


def test_an_interrupted_drive_ends_the_campaign(tmp_path: Path) -> None:
    """As Ctrl-C does, and no later trial is begun."""
    trials = [trial(tmp_path, k) for k in (1, 2)]
    with pytest.raises(KeyboardInterrupt):
        list(drive_all(trials, lambda one: None, jobs=1))


def dies(one: Trial) -> TrialResult:
    """Ends its process."""
    import os  # noqa: PLC0415

    os._exit(7)


def test_a_process_that_dies_is_told(tmp_path: Path) -> None:
    """The campaign can be gone on with."""
    with pytest.raises(WorkError, match="the same command goes on where it stopped"):
        list(drive_all([trial(tmp_path, k) for k in (1, 2)], dies, jobs=2))


@given(st.lists(st.integers(0, 10_000), min_size=1, max_size=20))
def test_seeds_are_those_that_were_written(numbers: list[int]) -> None:
    """Any list of numbers comes back as the same numbers, each once."""
    assert seeds_of(",".join(map(str, numbers))) == tuple(dict.fromkeys(numbers))
