"""The figures of a report by name, the coloured maps among them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.report.along import laps_along
from dnb_edge.report.coloured import lateral_shade, loss_map, speed_shade
from dnb_edge.report.figures import MOST_PAIRS, report_figures, write_figures
from dnb_edge.report.html import render
from dnb_edge.report.run import RunResult
from dnb_edge.score.profile import speeds_mps

NAMES = [
    "path", "lateral-farthest", "speed-car1-best", "lateral-car1-best", "lost-car1", "along", "lap-times",
]  # fmt: skip
"""Of a run of one car: scripts and papers name them."""


def names(result: RunResult) -> list[str]:
    return [figure.name for figure in report_figures(result)]


def test_the_figures_have_names_that_stay(result: Callable[..., RunResult]) -> None:
    """In the order of the page; the page shows exactly them; a run without laps has fewer."""
    run = result()
    assert names(run) == NAMES
    assert render(run).count("<figure") == len(NAMES)
    assert names(result(lap_times_s=())) == ["path", "lap-times"]


def test_a_chosen_lap_is_shown_beside_the_best(result: Callable[..., RunResult]) -> None:
    """By its car and number, before the best ones; the best one itself is not shown twice, and not all of hundreds."""
    run = result(chosen=((1, 3),))
    assert names(run)[2:6] == ["speed-car1-lap3", "lateral-car1-lap3", "speed-car1-best", "lateral-car1-best"]
    assert names(result(chosen=((1, 2),)))[2:4] == ["speed-car1-lap2", "lateral-car1-lap2"]
    many = result(lap_times_s=(4.0,) * 30, chosen=tuple((1, number) for number in range(1, 31)))
    assert sum(name.startswith("speed-") for name in names(many)) == MOST_PAIRS


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_each_figure_is_a_file(kind: str, tmp_path: Path, result: Callable[..., RunResult]) -> None:
    """Each opens as what it is called, and no two are the same; the same result gives the same bytes."""
    run = result()
    paths = list(write_figures(run, tmp_path / "new", kind))
    assert [path.name for path in paths] == [f"{name}.{kind}" for name in NAMES]
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == sorted(path.name for path in paths)
    data = [path.read_bytes() for path in paths]
    assert len(set(data)) == len(data)
    for one in data:
        if kind == "png":
            assert cv2.imdecode(np.frombuffer(one, np.uint8), cv2.IMREAD_COLOR) is not None
        else:
            assert b"<svg" in one
    assert [path.read_bytes() for path in write_figures(run, tmp_path / "new", kind)] == data


def test_a_folder_that_cannot_be_is_refused(tmp_path: Path, result: Callable[..., RunResult]) -> None:
    """A file where the folder should be: one line that names it."""
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="taken: figures cannot be written there"):
        list(write_figures(result(), tmp_path / "taken", "png"))


def slowed(run: RunResult, lap: int, from_share: float, to_share: float, factor: float) -> RunResult:
    """The run with a lap whose car takes `factor` times as long over a part of its instants."""
    t_ns = run.stamps_ns[lap]
    steps = np.diff(t_ns).astype(float)
    share = np.linspace(0.0, 1.0, len(steps))
    steps[(share >= from_share) & (share < to_share)] *= factor
    new = t_ns[0] + np.concatenate(([0], np.cumsum(np.round(steps)))).astype(np.int64)
    laps = list(run.laps)
    end_ns = int(new[-1])
    laps[lap] = replace(laps[lap], end_t_ns=end_ns, time_s=(end_ns - int(new[0])) * 1e-9)
    stamps = list(run.stamps_ns)
    stamps[lap] = new
    return replace(run, laps=tuple(laps), stamps_ns=tuple(stamps))


def test_time_is_lost_where_the_car_was_slow(result: Callable[..., RunResult]) -> None:
    """A lap like the best one but for a slow stretch: most is lost there, and what is lost in all is the difference."""
    run = slowed(result(lap_times_s=(12.0, 12.0)), 1, 0.5, 0.6, 2.0)
    run = replace(run, paths_m=(run.paths_m[0], run.paths_m[0]))
    loss = loss_map(laps_along(run), 1)
    assert loss is not None
    assert (loss.best.lap.number, loss.laps) == (1, 1)
    length_m = loss.ends_m[-1]
    assert 0.5 < loss.ends_m[loss.worst] / length_m < 0.6
    lost_s = float((loss.rate_s_per_m * np.diff(loss.ends_m)).sum())
    assert lost_s == pytest.approx(run.laps[1].time_s - run.laps[0].time_s, abs=0.05)
    assert loss_map(laps_along(run), 2) is None
    assert loss_map(laps_along(result(lap_times_s=(12.0,))), 1) is None


def test_colours_tell_speed_and_error_apart(result: Callable[..., RunResult]) -> None:
    """Slower stamps change the picture of the speed and not that of the error; another path both."""
    run = result(lap_times_s=(12.0,))
    slow = slowed(run, 0, 0.4, 0.6, 3.0)
    off = replace(run, paths_m=(run.paths_m[0] * 1.02,))

    def drawn(one: RunResult) -> dict[str, bytes]:
        return {figure.name: figure.draw("png") for figure in report_figures(one) if figure.half}

    plain, slower, further = drawn(run), drawn(slow), drawn(off)
    assert plain["speed-car1-best"] != slower["speed-car1-best"]
    assert plain["lateral-car1-best"] == slower["lateral-car1-best"]
    assert plain["lateral-car1-best"] != further["lateral-car1-best"]


def test_all_laps_of_a_report_share_their_colours(result: Callable[..., RunResult]) -> None:
    """The same speed is the same colour in each lap's picture: the shades span all shown laps."""
    run = result(chosen=((1, 1), (1, 3)))
    traces = [one.trace for one in laps_along(run) if one.trace is not None]
    whole = speed_shade(traces)
    for trace in traces:
        assert (whole.low <= np.percentile(speeds_mps(trace), (0.5, 99.5))).all()
        assert (whole.high >= np.percentile(speeds_mps(trace), (0.5, 99.5))).all()
    assert lateral_shade(traces).high == pytest.approx(max(float(np.abs(trace.d_m).max()) for trace in traces))
    assert lateral_shade([]).high > 0
    assert speed_shade([]).high > 0
