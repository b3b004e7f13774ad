"""The ledger of reliability names tests that are there, so that it cannot rot."""

import ast
import re
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
LEDGER = REPOSITORY / "docs" / "reliability.md"
TESTS = sorted(set(re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", LEDGER.read_text(encoding="utf-8"))))


@pytest.mark.parametrize(("file", "function"), TESTS)
def test_every_test_that_the_ledger_names_is_there(file: str, function: str) -> None:
    """A test that was renamed or removed is to be mended in docs/reliability.md, too."""
    path = REPOSITORY / file
    assert path.is_file()
    found = {
        node.name for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.FunctionDef)
    }
    assert not function or function in found


def test_every_fault_has_a_promise_a_test_and_a_figure() -> None:
    """Each row has four cells with something in them, and all but a few name a test."""
    rows = [line for line in LEDGER.read_text(encoding="utf-8").splitlines() if re.match(r"\| (?!fault|what|-)", line)]
    assert len(rows) > 40
    for row in rows:
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        assert len(cells) == 4, row
        assert all(cells), row
    assert sum("tests/" not in row for row in rows) <= 2
