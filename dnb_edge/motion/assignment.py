"""The cheapest way to give each target at most one observation: exact, for a handful of each.

Shortest augmenting paths with potentials: H. W. Kuhn, "The Hungarian method for the assignment problem", 1955, in the form
of R. Jonker and A. Volgenant, "A shortest augmenting path algorithm for dense and sparse linear assignment problems",
Computing 38, 1987. Knows numbers only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


def assign(costs: Sequence[Sequence[float]], miss_cost: float) -> dict[int, int]:
    """Column for each row of the cheapest assignment; a row that is left out costs `miss_cost` and has no entry.

    `costs` is (rows, columns); `math.inf` forbids a pair. Of equally cheap columns a single row takes the first.
    """
    rows = len(costs)
    columns = len(costs[0]) if rows else 0
    if rows == 1 or columns == 0:
        # One car in sight, or none: the rule, not the exception.
        return _cheapest_of(costs[0], miss_cost) if columns else {}
    forbidden = 1.0 + 2.0 * (rows + 1) * _greatest(costs, miss_cost)
    padded = [[*(min(cost, forbidden) for cost in row), *([miss_cost] * rows)] for row in costs]
    return {
        row: column for row, column in _cheapest(padded).items() if column < columns and costs[row][column] < math.inf
    }


def _cheapest_of(costs: Sequence[float], miss_cost: float) -> dict[int, int]:
    """`assign` for a single row."""
    column = min(range(len(costs)), key=costs.__getitem__)
    return {0: column} if costs[column] <= miss_cost and costs[column] < math.inf else {}


def _greatest(costs: Sequence[Sequence[float]], miss_cost: float) -> float:
    return max([abs(miss_cost), *(abs(cost) for row in costs for cost in row if cost < math.inf)])


def _cheapest(costs: Sequence[Sequence[float]]) -> dict[int, int]:
    """Column for every row, where there are at least as many columns as rows."""
    width = len(costs[0]) if costs else 0
    state = _Prices(rows=[0.0] * len(costs), columns=[0.0] * (width + 1), row_of=[None] * (width + 1))
    for row in range(len(costs)):
        # The column beyond the last holds the row that is to be seated.
        state.row_of[width] = row
        here, came_from = _path_to_free_column(costs, state)
        while here != width:
            state.row_of[here], here = state.row_of[came_from[here]], came_from[here]
    return {row: column for column, row in enumerate(state.row_of[:width]) if row is not None}


@dataclass(slots=True, kw_only=True)
class _Prices:
    """Potentials of rows and columns, and who sits where so far."""

    rows: list[float]
    columns: list[float]
    row_of: list[int | None]


def _path_to_free_column(costs: Sequence[Sequence[float]], state: _Prices) -> tuple[int, list[int]]:
    """The free column at the end of the cheapest alternating path, and for each column the one before it on the way."""
    width = len(state.columns) - 1
    least, came_from, done = [math.inf] * width, [width] * width, [False] * (width + 1)
    here = width
    while (owner := state.row_of[here]) is not None:
        done[here] = True
        for column in (column for column in range(width) if not done[column]):
            reduced = costs[owner][column] - state.rows[owner] - state.columns[column]
            if reduced < least[column]:
                least[column], came_from[column] = reduced, here
        there = min((column for column in range(width) if not done[column]), key=least.__getitem__)
        step = least[there]
        for column in range(width + 1):
            owned = state.row_of[column]
            if done[column] and owned is not None:
                state.rows[owned] += step
                state.columns[column] -= step
            elif column < width:
                least[column] -= step
        here = there
    return here, came_from
