"""What an archive's results hold: rows of laps and recordings as Parquet, sweeps and their picture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from archive_runs import Car, make_runs, record
from pyarrow import parquet

from dnb_edge.archive import parquet as parquet_room
from dnb_edge.archive.lot_score import LotJob, ScoredRun, Setting, score_lot
from dnb_edge.archive.lots import listed
from dnb_edge.archive.parquet import ResultFiles, check_out, runs_path
from dnb_edge.archive.replayed import replay
from dnb_edge.archive.rescore import Wanted
from dnb_edge.archive.sweep import SweepRow, Tally, as_text, columns, parse_grid, settings
from dnb_edge.errors import InputError
from dnb_edge.report.sweep_plot import sweep_picture
from dnb_edge.values import Lap


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One recording of three laps."""
    return make_runs(tmp_path_factory.mktemp("runs"), 1)[0]


def scored(path: Path, *chosen: Setting, **job) -> tuple[ScoredRun, ...]:
    return score_lot(LotJob(lot=listed([str(path)])[0], settings=chosen or (Setting(),), **job)).runs


def test_a_row_says_what_the_race_says(run: Path) -> None:
    """Every figure of a lap is the replay's own, and the recording's row sums them up."""
    (one,) = scored(run)
    laps = [event for event in replay(run).events if isinstance(event, Lap)]
    assert [(row["time_s"], row["sigma_s"], row["similarity_percent"], row["start_t_ns"]) for row in one.laps] == [
        (lap.time_s, lap.sigma_s, lap.similarity_percent, lap.start_t_ns) for lap in laps
    ]
    assert (one.run["laps"], one.run["valid_laps"], one.run["error"]) == (3, 3, None)
    assert one.run["best_lap_s"] == min(lap.time_s for lap in laps)
    assert one.run["completion_time_s"] == pytest.approx(sum(lap.time_s for lap in laps) / 3)
    assert {row["entry"] for row in one.laps} == {"pilot"}


def test_what_is_wrong_with_a_recording_is_its_row(tmp_path: Path) -> None:
    """Under the name by which it was asked for; a setting that does not fit fails alone."""
    (tmp_path / "bad.mcap").write_bytes(b"nothing")
    (one,) = scored(tmp_path / "bad.mcap")
    assert one.run == {"recording": str(tmp_path / "bad.mcap"), "error": f"{tmp_path / 'bad.mcap'}: not an MCAP file"}
    good = record(tmp_path, "good.mcap", Car((3.0, 3.1)))
    chosen = settings(Wanted(), parse_grid(["race.max_lap_s=1,9"]))
    bad, fine = scored(good, *chosen)
    assert "race.max_lap_s" in bad.run["error"]
    assert (bad.run["race.max_lap_s"], fine.run["race.max_lap_s"], fine.run["error"]) == (1, 9, None)


def test_another_version_of_the_software_computes_nothing(run: Path) -> None:
    """Its numbers might be others."""
    with pytest.raises(InputError, match="install the same on all machines"):
        scored(run, version="0.0")


def write(out: Path, *runs: ScoredRun, grid=None) -> None:
    with ResultFiles(out, columns(grid or {})) as files:
        for one in runs:
            files.add(one)
        files.finish()


def test_results_are_two_files_of_the_same_bytes_each_time(run: Path, tmp_path: Path, monkeypatch) -> None:
    """A row a lap and a row a recording; what they hold comes back as it was, and small groups of rows change no row."""
    (one,) = scored(run)
    for name in ("a", "b"):
        write(tmp_path / f"{name}.parquet", one, one)
    for path in (tmp_path / "a.parquet", runs_path(tmp_path / "a.parquet")):
        assert path.read_bytes() == path.with_name(path.name.replace("a.", "b.")).read_bytes()
    laps, runs = parquet.read_table(tmp_path / "a.parquet"), parquet.read_table(tmp_path / "a.runs.parquet")
    assert laps.to_pylist() == [*one.laps, *one.laps]
    assert runs.to_pylist() == [one.run, one.run]
    assert ((tmp_path / "a.parquet").stat().st_mode & 0o777) == 0o666 & ~parquet_room._umask()
    monkeypatch.setattr(parquet_room, "GROUP_ROWS", 2)
    write(tmp_path / "c.parquet", one, one)
    assert parquet.read_table(tmp_path / "c.parquet").equals(laps)
    assert parquet.ParquetFile(tmp_path / "c.parquet").num_row_groups == 3


def test_where_the_work_ends_early_no_file_is_left(run: Path, tmp_path: Path) -> None:
    """And what was there before stays as it was."""
    out = tmp_path / "out.parquet"
    out.write_bytes(b"before")

    def interrupted() -> None:
        with ResultFiles(out, {}) as files:
            files.add(scored(run)[0])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [path.name for path in tmp_path.iterdir()] == ["out.parquet"]
    assert out.read_bytes() == b"before"


@pytest.mark.parametrize(
    ("name", "text"),
    [("out.csv", "ends in .parquet"), ("no/out.parquet", "no directory"), ("is.parquet", "a directory")],
)
def test_where_nothing_can_be_written_is_told_first(tmp_path: Path, name: str, text: str) -> None:
    """One line that names the option."""
    (tmp_path / "is.parquet").mkdir()
    with pytest.raises(InputError, match=r"^--out .*" + text):
        check_out(tmp_path / name)


GRIDS = [
    (["a=1,2", "b=x,y"], {"a": (1, 2), "b": ("x", "y")}, {"a": (1, 2), "b": ("x", "y")}),
    (["a=null,2.5"], {"a": (None, 2.5)}, {"a": ("null", "2.5")}),
    (["a=true,false"], {"a": (True, False)}, {"a": (True, False)}),
    (["a=true,2"], {"a": (True, 2)}, {"a": ("true", "2")}),
    (
        ["a={seconds: 5},{seconds: 6}"],
        {"a": ({"seconds": 5}, {"seconds": 6})},
        {"a": ('{"seconds": 5}', '{"seconds": 6}')},
    ),
]


@pytest.mark.parametrize(("texts", "values", "told"), GRIDS)
def test_a_grid_has_values_as_yaml_and_columns_of_one_kind(texts, values, told) -> None:
    """Commas within braces part nothing."""
    grid = parse_grid(texts)
    assert dict(grid) == values
    assert dict(columns(grid)) == told


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["race.laps"], "must be KEY=A,B,C"),
        (["=1"], "must be KEY=A,B,C"),
        (["a="], "must be KEY=A,B,C"),
        (["a=[1"], "not valid YAML"),
        (["a=1,2", "a=3"], "given twice"),
        (["a=1,1"], "named twice"),
        ([f"{key}={','.join(map(str, range(11)))}" for key in "abc"], "1331 combinations"),
    ],
)
def test_a_bad_grid_is_one_line(texts: list[str], said: str) -> None:
    """It names the option."""
    with pytest.raises(InputError, match=r"^--grid.*" + said):
        parse_grid(texts)


def test_every_combination_is_raced(run: Path) -> None:
    """The last key goes round fastest; rules are a key; each combination gives what it gives alone."""
    chosen = settings(Wanted(), parse_grid(["rules=practice,deepracer", "score.baseline_m=0.25,0.5"]))
    assert [dict(one.values) for one in chosen] == [
        {"rules": rules, "score.baseline_m": baseline}
        for rules in ("practice", "deepracer")
        for baseline in (0.25, 0.5)
    ]
    found = scored(run, *chosen)
    assert [one.run["rule_set"] for one in found] == ["practice"] * 2 + ["deepracer"] * 2
    alone = Wanted(rules="deepracer", overrides=("score.baseline_m=0.25",))
    again = [event for event in replay(run, changed=alone.change(run)).events if isinstance(event, Lap)]
    assert [row["similarity_percent"] for row in found[2].laps] == [lap.similarity_percent for lap in again]
    both = settings(Wanted(overrides=("race.max_lap_s=1.5",)), parse_grid(["race.min_lap_s=1,1.2"]))
    assert [one.laps[0]["valid"] for one in scored(run, *both)] == [False, False]
    with pytest.raises(InputError, match="rule sets are in --grid already"):
        settings(alone, parse_grid(["rules=practice,deepracer"]))


def test_a_sweep_sums_up_over_recordings(run: Path) -> None:
    """Means are over all valid laps; a recording that failed is not among them."""
    (one,) = scored(run)
    tally = Tally()
    for part in (one, replace(one, run=one.run | {"error": "bad"}), one):
        tally.add(part)
    row = tally.row({"race.min_lap_s": 2})
    assert (row.recordings, row.laps, row.valid_laps, row.success_rate) == (2, 6, 6, 1.0)
    assert row.completion_time_s == pytest.approx(one.run["completion_time_s"])
    lines = as_text([row, Tally().row({"race.min_lap_s": 3})]).splitlines()
    assert len({len(line) for line in lines}) == 1
    assert lines[0].split()[0] == "race.min_lap_s"
    assert lines[3].split()[1:6] == ["0", "0", "of", "0", "-"]


@pytest.mark.parametrize(
    ("keys", "values"), [(("a",), (1, 2.5)), (("$x^2$", "b"), ("x", "y")), (("a", "b", "c"), (True, False))]
)
def test_a_sweep_has_a_picture_whatever_its_keys(keys, values) -> None:
    """Numbers lie to scale, words side by side; combinations without a valid lap leave gaps; words are no formulas."""
    others = ("p",) if len(keys) == 1 else ("p", "q")
    rows = [
        SweepRow(
            values=dict(zip(keys, (value, other, 1), strict=False)),
            recordings=1,
            laps=2,
            valid_laps=1,
            success_rate=None,
            completion_time_s=3.0 if value == values[0] else None,
            similarity_percent=None,
            penalties=0,
            penalty_s=0.0,
        )
        for value in values
        for other in others
    ]
    assert b"<svg" in sweep_picture(rows, picture_format="svg")
