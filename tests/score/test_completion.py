"""The paper's completion time and failure, case by case."""

from __future__ import annotations

import pytest

from dnb_edge.score.completion import completion
from dnb_edge.values import Lap


def lap(number: int, time_s: float, *, valid: bool = True, official_s: float | None = None, from_s: float = 0.0) -> Lap:
    return Lap(
        number=number, start_t_ns=round(from_s * 1e9), end_t_ns=round((from_s + time_s) * 1e9), start_s=from_s,
        time_s=time_s, sigma_s=0.004, valid=valid, reasons=() if valid else ("the car left the lane",),
        similarity_percent=None, observed_fraction=1.0, official_time_s=official_s,
    )  # fmt: skip


GOOD, SLOW, BAD = lap(1, 10.0), lap(2, 12.0, from_s=10.0), lap(2, 11.0, valid=False, from_s=10.0)


@pytest.mark.parametrize(
    ("laps", "wanted", "failure_s", "time_s", "lap_time_s", "failures"),
    [
        ((GOOD,), 1, None, 10.0, 10.0, 0),
        ((GOOD, SLOW), None, None, 22.0, 11.0, 0),
        ((GOOD, SLOW), 1, None, 10.0, 10.0, 0),
        ((GOOD, BAD), None, None, None, None, 1),
        ((GOOD, BAD), 1, None, 10.0, 10.0, 0),
        ((GOOD, BAD), 2, 60.0, 81.0, 40.5, 1),
        ((GOOD,), 3, None, None, None, 1),
        ((GOOD,), 3, 60.0, 130.0, 130.0 / 3, 1),
        ((), None, None, None, None, 1),
        ((), 2, 60.0, 120.0, 60.0, 1),
        ((lap(1, 10.0, official_s=15.0),), None, None, 15.0, 15.0, 0),
    ],
)
def test_completion_time_and_failure_as_in_the_paper(
    laps: tuple[Lap, ...], wanted: int | None, failure_s: float | None, time_s: float | None,
    lap_time_s: float | None, failures: int,
) -> None:  # fmt: skip
    """The total time to the last wanted lap; off the track or short of the end it is a failure, or costs its price."""
    result = completion(laps, wanted=wanted, failure_s=failure_s)
    assert result.time_s == pytest.approx(time_s)
    assert result.lap_time_s == pytest.approx(lap_time_s)
    assert len(result.failures) == failures
    assert result.finished == (failures == 0)
    assert (result.sigma_s is None) == (time_s is None)


def test_failures_are_told_as_sentences() -> None:
    """A failed lap is named with its reasons, and so is the end that was not reached."""
    assert completion((GOOD, BAD), wanted=3).failures == (
        "lap 2: the car left the lane",
        "the end was not reached: 2 of 3 laps were completed",
    )


def test_a_crossing_between_two_laps_cancels_in_the_total() -> None:
    """Of laps in a row only the first and the last one's sigma count; of laps apart each one's does."""
    row = [lap(i, 10.0, from_s=10.0 * i) for i in range(5)]
    apart = [lap(i, 10.0, from_s=20.0 * i) for i in range(5)]
    assert completion(row).sigma_s == pytest.approx(0.004 * 2**0.5)
    assert completion(apart).sigma_s == pytest.approx(0.004 * 5**0.5)
    assert completion(row[:1]).sigma_s == pytest.approx(0.004)


@pytest.mark.parametrize(("key", "value"), [("wanted", 0), ("failure_s", -1.0), ("failure_s", float("inf"))])
def test_impossible_settings_are_refused(key: str, value: float) -> None:
    """The error names the setting."""
    with pytest.raises(ValueError, match=key):
        completion((GOOD,), **{key: value})  # type: ignore[arg-type]
