"""The result table: whose laps count, what is shown for a failure, and what a spreadsheet or a program gets."""

import csv
import io
import json
from dataclasses import dataclass, replace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rich.cells import cell_len

from dnb_edge.report.table import as_csv, as_json_lines, as_text, entry_rows, printable
from dnb_edge.values import Lap


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


PAPER = (
    Attempt("1", (lap(67.5, 95.78),)),
    Attempt("2", (lap(53.4, 92.68),)),
    Attempt("3", (lap(42.9, 88.62),)),
    Attempt("4", (lap(34.7, 84.57),)),
)


def test_the_papers_table_comes_out_as_printed() -> None:
    """Four drivers with one lap each give the paper's Table I."""
    assert as_text(entry_rows(PAPER)).splitlines() == [
        "Entry    Laps  Path similarity (%)  Completion time (s)",
        "-----  ------  -------------------  -------------------",
        "1      1 of 1                95.78               67.500",
        "2      1 of 1                92.68               53.400",
        "3      1 of 1                88.62               42.900",
        "4      1 of 1                84.57               34.700",
    ]


def test_only_valid_laps_count() -> None:
    """Means and the best lap are over valid laps; the number of all laps is kept beside them."""
    (row,) = entry_rows([Attempt("a", (lap(10.0, 90.0), lap(12.0, 80.0), lap(1.0, 10.0, valid=False)))])
    assert (row.laps, row.valid_laps, row.finished) == (3, 2, True)
    assert (row.completion_time_s, row.similarity_percent, row.best_lap_s) == (11.0, 85.0, 10.0)


def test_runs_of_one_entry_are_taken_together_in_order_of_appearance() -> None:
    """Trials of the same entry make one row, whatever lies between them."""
    rows = entry_rows([Attempt("b", (lap(10.0, 90.0),)), Attempt("a", ()), Attempt("b", (lap(20.0, 70.0),))])
    assert [(row.entry, row.runs, row.completion_time_s) for row in rows] == [("b", 2, 15.0), ("a", 1, None)]


@pytest.mark.parametrize("laps", [(), (lap(9.0, 50.0, valid=False),)])
def test_without_a_valid_lap_the_entry_did_not_finish(laps: tuple[Lap, ...]) -> None:
    """A failure is DNF in text, empty cells in CSV, null in JSON; never a number."""
    rows = entry_rows([Attempt("a", laps)])
    assert as_text(rows).splitlines()[-1].split()[-2:] == ["DNF", "DNF"]
    (cells,) = csv.DictReader(io.StringIO(as_csv(rows)))
    assert (cells["finished"], cells["similarity_percent"], cells["completion_time_s"]) == ("false", "", "")
    data = json.loads(as_json_lines(rows))
    assert (data["finished"], data["similarity_percent"], data["completion_time_s"]) == (False, None, None)


def test_a_finished_entry_without_scores_has_a_time_and_no_similarity() -> None:
    """A run that was not scored (calibration too wrong) is no failure."""
    rows = entry_rows([Attempt("a", (lap(9.0, None),))])
    assert as_text(rows).splitlines()[-1].split()[-2:] == ["-", "9.000"]


def test_json_is_one_object_a_line_and_exact() -> None:
    """What a script reads back are the very numbers, not rounded ones."""
    rows = entry_rows([Attempt("a", (lap(1 / 3, 100 / 3),)), Attempt("b", ())])
    objects = [json.loads(line) for line in as_json_lines(rows).splitlines()]
    assert [data["entry"] for data in objects] == ["a", "b"]
    assert (objects[0]["completion_time_s"], objects[0]["similarity_percent"]) == (1 / 3, 100 / 3)


@pytest.mark.parametrize("name", ["=1+1", "+x", "-x", "@SUM(A1)", "\t=1", "\r=1", "  =1", "\n=1"])
def test_a_name_is_never_a_formula_in_a_spreadsheet(name: str) -> None:
    """A cell that a spreadsheet would run is marked as text."""
    (cells,) = csv.DictReader(io.StringIO(as_csv(entry_rows([Attempt(name, ())])), newline=""))
    assert cells["entry"].startswith("'")
    assert cells["entry"].endswith(name.strip())


@given(names=st.lists(st.text(max_size=12), max_size=5, unique=True))
@example(names=["\r", '"', ",", "a\nb"])
def test_csv_has_a_line_an_entry_whatever_the_names(names: list[str]) -> None:
    """Quotes, commas and line feeds in names never shift a cell."""
    rows = list(csv.reader(io.StringIO(as_csv(entry_rows([Attempt(name, ()) for name in names])), newline="")))
    assert [row[0].removeprefix("'") for row in rows[1:]] == [printable(name).removeprefix("'") for name in names]
    assert {len(row) for row in rows} == {8}


def test_text_stays_aligned_with_wide_and_hostile_names() -> None:
    """Double-width letters keep the columns straight, and a name cannot write escape codes to the terminal."""
    rows = entry_rows([Attempt("東京", PAPER[0].laps), Attempt("\x1b[2Jx\ny", PAPER[0].laps)])
    lines = as_text(rows).splitlines()
    assert len(lines) == 4
    assert lines[2].startswith("東京     1 of 1")
    assert len({cell_len(line) for line in lines}) == 1
    assert lines[3].startswith("?[2Jx y")
