"""`dnb-edge runs prune`, `pin` and `unpin`, as a user types them."""

import json
import os
from pathlib import Path

from typer.testing import CliRunner

from dnb_edge.cli.runs import app


def edge(*words: object) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def test_what_is_pinned_stays_and_a_dry_run_says_what_would_go(tmp_path: Path) -> None:
    """A dry run names the oldest run that is not pinned, the real one deletes it, and a second one has nothing to do."""
    for number in (1, 2, 3):
        path = tmp_path / f"run-0badcafe-{number:04d}.mcap"
        path.write_bytes(bytes(1_000_000))
        os.utime(path, (1e9 + number, 1e9 + number))
    first = tmp_path / "run-0badcafe-0001.mcap"
    assert edge("pin", first) == "run-0badcafe-0001.mcap is kept: run-0badcafe-0001.pin\n"
    words = ("prune", tmp_path, "--keep-free-mb", 0, "--max-total-gb", 0.0025)
    told = "run-0badcafe-0002, 1.0 MB: 0.003 GB of recordings, 0.0025 allowed\n"
    assert edge(*words, "--dry-run") == f"would delete {told}"
    assert (tmp_path / "run-0badcafe-0002.mcap").exists()
    line = json.loads(edge(*words, "--json"))
    assert (line["name"], line["deleted"], line["files"]) == ("run-0badcafe-0002", True, ["run-0badcafe-0002.mcap"])
    assert not (tmp_path / "run-0badcafe-0002.mcap").exists()
    assert edge(*words) == "nothing to delete\n"
    assert edge("unpin", first) == "run-0badcafe-0001.mcap may go when room is short\n"
    assert edge("prune", tmp_path, "--keep-free-mb", 0, "--max-total-gb", 0.0015).startswith(
        "deleted run-0badcafe-0001,"
    )
