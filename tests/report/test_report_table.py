"""The result table: whose laps count, what is shown for a failure, and what a spreadsheet or a program gets."""

import csv
import io
import json
import random
from dataclasses import dataclass, replace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rich.cells import cell_len

from dnb_edge.report.inference import Inference, ms_text
from dnb_edge.report.table import ResultTable, RowsBy, Trial, entry_rows, printable, result_table
from dnb_edge.report.table_files import COLUMNS, as_csv, as_json_lines
from dnb_edge.report.table_latex import as_latex, escaped
from dnb_edge.report.table_text import INTERVALS, as_text
from dnb_edge.values import EntryInfo, Lap, Penalty


@dataclass(frozen=True)
class Attempt:
    entry: str
    laps: tuple[Lap, ...]


LAP = Lap(
    number=1,
    start_t_ns=0,
    end_t_ns=1,
    start_s=0.0,
    time_s=67.5,
    sigma_s=0.002,
    valid=True,
    reasons=(),
    similarity_percent=95.78,
    observed_fraction=1.0,
)


def lap(time_s: float, similarity_percent: float | None, *, valid: bool = True) -> Lap:
    return replace(LAP, time_s=time_s, similarity_percent=similarity_percent, valid=valid)


def trial(name: str, *laps: Lap, run: str = "a.mcap", version: str = "", **facts) -> Trial:
    return Trial(entry=EntryInfo(name=name, version=version), laps=laps, run=run, **facts)


def laps_of(*times_s: float, similarity_percent: float = 90.0) -> tuple[Lap, ...]:
    return tuple(lap(time_s, similarity_percent) for time_s in times_s)


PAPER = (
    trial("1", lap(67.5, 95.78)),
    trial("2", lap(53.4, 92.68)),
    trial("3", lap(42.9, 88.62)),
    trial("4", lap(34.7, 84.57)),
)
ALIKE = (
    trial("slow", *laps_of(20.0, 20.1, 19.9)),
    trial("fast", *laps_of(10.0, 10.1, 9.9, 10.05)),
    trial("faster?", *laps_of(10.02, 9.95, 10.08)),
)


def test_the_papers_table_comes_out_as_printed() -> None:
    """Four drivers with one lap each give the paper's Table I, and the table says that one lap compares nobody."""
    assert as_text(result_table(PAPER)).splitlines() == [
        "Entry  Runs    Laps  Success  Path similarity (%)  Completion time (s)     Best lap (s)",
        "-----  ----  ------  -------  -------------------  -------------------  ---------------",
        "1         1  1 of 1     100%                95.78               67.500  67.500 +- 0.002",
        "2         1  1 of 1     100%                92.68               53.400  53.400 +- 0.002",
        "3         1  1 of 1     100%                88.62               42.900  42.900 +- 0.002",
        "4         1  1 of 1     100%                84.57               34.700  34.700 +- 0.002",
        "",
        "One valid lap tells no spread, so not compared by path similarity: 1, 2, 3, 4",
        "One valid lap tells no spread, so not compared by completion time: 1, 2, 3, 4",
    ]


def test_only_valid_laps_count() -> None:
    """Means and the best lap are over valid laps; the number of all laps is kept beside them, and makes the success rate."""
    (row,) = entry_rows([Attempt("a", (lap(10.0, 90.0), lap(12.0, 80.0), lap(1.0, 10.0, valid=False)))])
    assert (row.laps, row.valid_laps, row.finished) == (3, 2, True)
    assert (row.completion_time_s, row.similarity_percent, row.best_lap_s) == (11.0, 85.0, 10.0)
    assert (row.attempted_laps, row.success_rate) == (3, pytest.approx(2 / 3))


def test_runs_of_one_entry_are_taken_together() -> None:
    """Trials of the same entry make one row, whatever lies between them; the second counts as much as the first."""
    rows = entry_rows([Attempt("b", laps_of(10.0, 10.0)), Attempt("a", ()), Attempt("b", laps_of(20.0))])
    assert [(row.entry, row.runs, row.completion_time_s) for row in rows] == [("a", 1, None), ("b", 2, 15.0)]


@pytest.mark.parametrize("laps", [(), (lap(9.0, 50.0, valid=False),)])
def test_without_a_valid_lap_the_entry_did_not_finish(laps: tuple[Lap, ...]) -> None:
    """A failure is DNF in text, empty cells in CSV, null in JSON; never a number."""
    table = result_table([trial("a", *laps)])
    assert as_text(table).splitlines()[-1].split()[-3:] == ["DNF", "DNF", "-"]
    (cells,) = csv.DictReader(io.StringIO(as_csv(table)))
    assert (cells["finished"], cells["similarity_percent"], cells["completion_time_s"]) == ("false", "", "")
    data = json.loads(as_json_lines(table))
    assert (data["finished"], data["similarity_percent"], data["completion_time_s"]) == (False, None, None)
    assert data["indistinguishable_from"] == {"similarity_percent": [], "completion_time_s": [], "success_rate": []}
    assert as_latex(table).count("DNF") == 2


def test_a_finished_entry_without_scores_has_a_time_and_no_similarity() -> None:
    """A run that was not scored (calibration too wrong) is no failure."""
    table = result_table([trial("a", lap(9.0, None))])
    assert as_text(table).splitlines()[-1].split()[6:8] == ["-", "9.000"]


def test_a_car_whose_race_ended_attempted_one_lap_more() -> None:
    """The lap that was never finished counts against the entry; one that ended with the lap's penalty counts once."""
    unfinished = trial("a", *laps_of(10.0), dnf="it stood for 20 s")
    out = Penalty(offence="off_track", dnf=True, reason="left the lane")
    ended = trial("b", lap(10.0, 90.0), replace(lap(11.0, 90.0, valid=False), penalties=(out,)), dnf="left the lane")
    rows = result_table([unfinished, ended]).rows
    assert [(row.attempted_laps, row.success_rate, row.dnf_runs) for row in rows] == [(2, 0.5, 1), (2, 0.5, 1)]


def test_penalties_are_in_the_official_time_and_in_a_column() -> None:
    """Times are official ones where there are any; the column is there only where somebody was penalised."""
    late = Penalty(offence="off_track", seconds=3.0, reason="left the lane")
    fined = replace(lap(10.0, 90.0), penalties=(late,), penalty_s=3.0, official_time_s=13.0)
    table = result_table([trial("a", fined, lap(12.5, 90.0))])
    (row,) = table.rows
    assert (row.completion_time_s, row.best_lap_s, row.penalties, row.penalty_s) == (12.75, 12.5, 1, 3.0)
    assert "Penalties" in as_text(table)
    assert "1 (+3 s)" in as_text(table)
    assert "Penalties" in as_latex(table)
    assert "Penalties" not in as_text(result_table(PAPER)) + as_latex(result_table(PAPER))


def test_a_factor_is_in_the_official_similarity() -> None:
    """As it is in the standings by similarity: a factor costs points wherever entries are compared."""
    cut = replace(lap(10.0, 90.0), penalty_factor=0.5)
    (row,) = entry_rows([Attempt("a", (cut, lap(10.0, 70.0)))])
    assert row.similarity_percent == 57.5


def test_who_cannot_be_told_apart_is_said_in_every_form() -> None:
    """A sentence in text, labels in JSON, letters in CSV and LaTeX: two fast entries are alike, the slow one is not."""
    table = result_table(ALIKE)
    assert [row.entry for row in table.rows] == ["fast", "faster?", "slow"]
    assert [row.completion_time_group for row in table.rows] == ["a", "a", "b"]
    assert [row.indistinguishable_from.completion_time_s for row in table.rows] == [("faster?",), ("fast",), ()]
    text = as_text(table)
    assert "fast and faster? cannot be told apart by completion time (p = 0.94)" in text.splitlines()
    assert "slow cannot be told apart by completion time" not in text
    assert text.splitlines()[-1] == INTERVALS
    assert "fast, faster? and slow cannot be told apart by path similarity (p = 1.00)" in text.splitlines()
    assert r"10.012 \pm 0.085^{\mathrm{a}}" in as_latex(table)
    assert r"20.000 \pm 0.100^{\mathrm{b}}" in as_latex(table)


def test_the_best_has_the_first_letter() -> None:
    """The greatest similarity and the shortest time are in group a, wherever their names stand."""
    good = tuple(lap(20.0 + k / 10, 99.0 - k / 10) for k in range(3))
    bad = tuple(lap(10.0 + k / 10, 80.0 - k / 10) for k in range(3))
    for names in ("ab", "ba"):
        rows = {row.entry: row for row in result_table([trial(names[0], *good), trial(names[1], *bad)]).rows}
        first, second = (rows[name] for name in names)
        assert (first.similarity_group, second.similarity_group) == ("a", "b")
        assert (first.completion_time_group, second.completion_time_group) == ("b", "a")


def test_an_interval_ends_where_nothing_can_be() -> None:
    """No similarity above 100, no negative time, however wide the interval."""
    table = result_table([trial("a", lap(1.0, 99.0), run="1"), trial("a", lap(9.0, 100.0), run="2")])
    (row,) = table.rows
    assert (row.similarity_ci95_high_percent, row.completion_time_ci95_low_s) == (100.0, 0.0)
    assert row.interval_over == "runs"


def test_versions_and_checkpoints_are_entries_of_their_own() -> None:
    """A name that takes part in several versions is told with them, one in several checkpoints of a version with those."""
    net = [
        Trial(entry=EntryInfo(name="net", version=version, checkpoint_sha256=sha), laps=laps_of(10.0))
        for version, sha in (("v10", None), ("v2", "a" * 64), ("v2", "b" * 64))
    ]
    table = result_table([*net, trial("person", *laps_of(11.0))])
    assert [row.label for row in table.rows] == [
        "net v2 [aaaaaaaaaaaaa]", "net v2 [bbbbbbbbbbbbb]", "net v10", "person"
    ]  # fmt: skip
    assert [row.entry for row in table.rows] == ["net", "net", "net", "person"]
    (alone,) = result_table(net[:1]).rows
    assert (alone.label, alone.version) == ("net", "v10")


def test_a_row_a_run() -> None:
    """By run, each recording is a row of its own, named by its file, and its laps are what intervals are taken over."""
    table = result_table(
        [trial("a", *laps_of(10.0, 11.0), run="2.mcap"), trial("a", *laps_of(12.0), run="10.mcap")], RowsBy.RUN
    )
    assert [(row.label, row.run, row.completion_time_s) for row in table.rows] == [
        ("a (2.mcap)", "2.mcap", 10.5),
        ("a (10.mcap)", "10.mcap", 12.0),
    ]
    assert table.rows[0].interval_over == "laps"


def test_a_success_rate_has_its_interval_its_letters_and_its_notes() -> None:
    """Over runs, each as one trial; who fails in five runs of five is told apart from who never does, and the note says whom
    it does not tell apart. Rates that are all the same are no note."""
    good, bad = laps_of(10.0, 11.0), tuple(lap(12.0, 80.0, valid=False) for _ in range(2))
    trials = [trial(name, *laps, run=f"{k}") for name, laps in (("a", good), ("b", bad), ("c", good)) for k in range(6)]
    table = result_table([*trials, trial("c", *bad, run="7")])
    first, second, third = table.rows
    assert (first.success_rate, second.success_rate, third.success_rate) == (1.0, 0.0, pytest.approx(6 / 7))
    assert (first.success_ci95_low, first.success_ci95_high) == (pytest.approx(0.61, abs=0.005), 1.0)
    assert [row.success_group for row in table.rows] == ["a", "b", "a"]
    assert first.indistinguishable_from.success_rate == ("c",)
    assert "a and c cannot be told apart by success rate (p = 0.59)" in table.notes
    assert "100% [61, 100]" in as_text(table)
    assert " & 100 [61, 100] & " in as_latex(table)
    even = result_table([one for one in trials if one.entry.name != "b"])
    assert not [note for note in even.notes if "success" in note]


def test_the_order_and_how_often_it_holds_is_said() -> None:
    """Ranks of each figure with the resamples that kept them: two far apart always, in both orders."""
    runs = [
        trial(name, *laps_of(mean_s + k / 50, similarity_percent=mean_s * 4 + k / 50), run=f"{name}{k}")
        for name, mean_s in (("slow", 20.0), ("fast", 10.0))
        for k in range(5)
    ]
    table = result_table(runs)
    fast, slow = table.rows
    assert (fast.completion_time_rank, slow.completion_time_rank) == (1, 2)
    assert (fast.similarity_rank, slow.similarity_rank) == (2, 1)
    assert (fast.completion_time_rank_low, fast.completion_time_rank_high) == (1, 1)
    assert fast.completion_time_rank_share == 1.0
    assert (fast.success_rank, slow.success_rank) == (1, 1)
    assert "Order by completion time: fast, then slow; holds in 100 % of 2000 resamples" in table.notes
    assert "Order by path similarity: slow, then fast; holds in 100 % of 2000 resamples" in table.notes
    assert not [note for note in table.notes if "Order by success" in note]


def test_runs_of_one_seed_are_compared_with_each_other() -> None:
    """Seeds under which both are slow or fast: told apart by their differences, and a note says that pairs were; not so where
    one of them drove other seeds."""

    def driven(name: str, more_s: float, seeds: str) -> list[Trial]:
        return [trial(name, lap(10.0 + int(seed) + more_s, 90.0), run=f"{name}{seed}", seed=seed) for seed in seeds]

    told = "Runs of one seed are compared with each other"
    paired = result_table([*driven("a", 0.0, "12345"), *driven("b", 0.2, "12345")])
    assert [row.completion_time_group for row in paired.rows] == ["a", "b"]
    assert paired.rows[0].completion_time_rank_share == 1.0
    assert told in paired.notes
    other = result_table([*driven("a", 0.0, "12345"), *driven("b", 0.2, "12346")])
    assert [row.completion_time_group for row in other.rows] == ["a", "a"]
    assert told not in other.notes


def test_reality_and_simulation_are_two_rows() -> None:
    """An entry that drove in both is told apart by its label; where only one world takes part nothing is said of it."""
    both = [trial("net", *laps_of(10.0)), trial("net", *laps_of(9.0), simulated=True)]
    rows = result_table(both).rows
    assert [(row.label, row.simulated, row.completion_time_s) for row in rows] == [
        ("net", False, 10.0),
        ("net (simulated)", True, 9.0),
    ]
    assert result_table(both[1:]).rows[0].label == "net"


def test_collisions_and_inference_have_columns_where_there_are_any() -> None:
    """Counted over all runs; the network's own speed beside its laps, a dash for a person; no column where nobody has any."""
    speed = Inference(p50_ms=6.04, p95_ms=7.96, p99_ms=9.1, source="pi5: Cortex-A76, 4 cores")
    table = result_table(
        [
            trial("net", *laps_of(10.0), run="1", collisions=2, inference=speed),
            trial("net", *laps_of(10.0), run="2", collisions=1, inference=speed),
            trial("pilot", *laps_of(9.0)),
        ]
    )
    net, pilot = table.rows
    assert (net.collisions, pilot.collisions) == (3, 0)
    assert (net.inference_p50_ms, net.inference_p99_ms, net.inference_source) == (6.04, 9.1, speed.source)
    assert pilot.inference_p95_ms is None
    text = as_text(table).splitlines()
    assert text[0].endswith("Collisions  Inference (ms)")
    assert text[2].endswith(" 3     6.04 / 7.96")
    assert text[3].endswith(" 0               -")
    assert as_latex(table).count(" & 7.96 ") == 1
    assert "Inference" not in as_text(result_table(PAPER)) + as_latex(result_table(PAPER))


@pytest.mark.parametrize(("time_ms", "expected"), [(0.04213, "0.0421"), (6.0, "6"), (12.345, "12.3"), (1234.5, "1234")])
def test_a_time_has_three_figures(time_ms: float, expected: str) -> None:
    """A tenth of a millisecond is not nought, and seconds have no exponent."""
    assert ms_text(time_ms) == expected


def test_a_group_has_its_heading_in_every_form() -> None:
    """Above the text, as a comment in LaTeX, in a cell of each row in CSV and JSON."""
    table = result_table([trial("a", *laps_of(9.0))], conditions="track 'x', in simulation")
    assert as_text(table).splitlines()[:2] == ["track 'x', in simulation", ""]
    assert as_latex(table).splitlines()[0] == "% track 'x', in simulation"
    assert json.loads(as_json_lines(table))["conditions"] == "track 'x', in simulation"


LAPS = st.lists(
    st.builds(lap, st.floats(5, 90), st.one_of(st.none(), st.floats(0, 100)), valid=st.booleans()), max_size=4
).map(tuple)
TRIALS = st.lists(
    st.builds(
        lambda name, version, laps: trial(name, *laps, version=version),
        st.sampled_from(["a", "A", "a2", "a10", "b"]),
        st.sampled_from(["", "v2", "v10"]),
        LAPS,
    ),
    max_size=7,
).map(lambda trials: [replace(one, run=f"{k}.mcap") for k, one in enumerate(trials)])


@given(trials=TRIALS, seed=st.integers(0, 99), by=st.sampled_from(RowsBy))
def test_the_order_of_files_changes_nothing(trials: list[Trial], seed: int, by: RowsBy) -> None:
    """Rows, figures, letters and notes are the same bit for bit, in whatever order recordings are named."""
    shuffled = random.Random(seed).sample(trials, len(trials))
    assert result_table(shuffled, by) == result_table(trials, by)


@given(trials=TRIALS)
def test_figures_lie_within_their_intervals(trials: list[Trial]) -> None:
    """Every mean lies in its interval, every row adds up, and being alike is mutual."""
    rows = result_table(trials).rows
    assert sum(row.laps for row in rows) == sum(len(one.laps) for one in trials)
    by_label = {row.label: row for row in rows}
    assert len(by_label) == len(rows)
    for row in rows:
        assert row.valid_laps <= row.laps <= row.attempted_laps
        assert all(row.label in by_label[other].indistinguishable_from.completion_time_s
                   for other in row.indistinguishable_from.completion_time_s)  # fmt: skip
        if row.completion_time_ci95_low_s is not None:
            low_s, mean_s, high_s = (
                row.completion_time_ci95_low_s, row.completion_time_s, row.completion_time_ci95_high_s
            )  # fmt: skip
            assert low_s <= mean_s <= high_s


def test_json_is_one_object_a_line_and_exact() -> None:
    """What a script reads back are the very numbers, not rounded ones."""
    table = result_table([trial("a", lap(1 / 3, 100 / 3)), trial("b")])
    objects = [json.loads(line) for line in as_json_lines(table).splitlines()]
    assert [data["entry"] for data in objects] == ["a", "b"]
    assert (objects[0]["completion_time_s"], objects[0]["similarity_percent"]) == (1 / 3, 100 / 3)
    first = ["entry", "runs", "laps", "valid_laps", "finished", "similarity_percent", "completion_time_s", "best_lap_s"]
    assert list(objects[0])[:8] == first


@pytest.mark.parametrize("name", ["=1+1", "+x", "-x", "@SUM(A1)", "\t=1", "\r=1", "  =1", "\n=1"])
def test_a_name_is_never_a_formula_in_a_spreadsheet(name: str) -> None:
    """A cell that a spreadsheet would run is marked as text."""
    (cells,) = csv.DictReader(io.StringIO(as_csv(result_table([trial(name)])), newline=""))
    assert cells["entry"].startswith("'")
    assert cells["entry"].endswith(name.strip())


@given(names=st.lists(st.text(max_size=12), max_size=5, unique=True))
@example(names=["\r", '"', ",", "a\nb"])
def test_csv_has_a_line_an_entry_whatever_the_names(names: list[str]) -> None:
    """Quotes, commas and line feeds in names never shift a cell."""
    rows = list(csv.reader(io.StringIO(as_csv(result_table(map(trial, names))), newline="")))
    assert sorted(row[0].removeprefix("'") for row in rows[1:]) == sorted(
        printable(name).removeprefix("'") for name in names
    )
    assert {len(row) for row in rows} == {len(COLUMNS)}


def test_text_stays_aligned_with_wide_and_hostile_names() -> None:
    """Double-width letters keep the columns straight, and a name cannot write escape codes to the terminal."""
    table = result_table([trial("東京", *PAPER[0].laps), trial("\x1b[2Jx\ny", *PAPER[0].laps)])
    lines = as_text(table).splitlines()
    assert lines[3].startswith("東京        1  1 of 1")
    assert len({cell_len(line) for line in lines[:4]}) == 1
    assert lines[2].startswith("?[2Jx y")
    assert all(line.isprintable() for line in lines)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("50 % & more_", r"50 \% \& more\_"),
        ("a\\b{c}", r"a\textbackslash{}b\{c\}"),
        ("$x^2~#1", r"\$x\textasciicircum{}2\textasciitilde{}\#1"),
        ("[new]", "{}[new]"),
        ("*", "{}*"),
        ("a\nb", "a b"),
    ],
)
def test_latex_sets_a_name_as_it_is(name: str, expected: str) -> None:
    """Special characters are escaped, and a name cannot be taken for an option of the row before."""
    assert escaped(name) == expected
    assert f"\n{expected} & 1 & " in as_latex(result_table([trial(name, *laps_of(10.0))]))


def test_latex_is_a_booktabs_tabular_with_as_many_cells_in_every_row() -> None:
    """Every row has as many cells as the head and the column types, and columns without any figure are left out."""
    for table, columns in ((result_table(ALIKE), 9), (result_table(PAPER), 7), (ResultTable(rows=(), notes=()), 7)):
        lines = as_latex(table).splitlines()
        (types,) = (line for line in lines if line.startswith(r"\begin{tabular}"))
        assert types == rf"\begin{{tabular}}{{l{'r' * (columns - 1)}}}"
        rows = [line for line in lines if line.endswith(r" \\")]
        assert [row.count(" & ") for row in rows] == [columns - 1] * (len(table.rows) + 1)
        assert [lines.count(rule) for rule in (r"\toprule", r"\midrule", r"\bottomrule", r"\end{tabular}")] == [1] * 4
