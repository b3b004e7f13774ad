"""`dnb-edge truth` as a shell runs it: a small campaign, one that is interrupted and goes on, and wrong wishes."""

import json
import signal
import subprocess
import time
from pathlib import Path

import pytest
from edge_command import COMMAND, PATIENCE_S, edge, environment

SMALL = ("truth", "--laps", "50", "--rendered", "0", "--only", "30fps-1mps", "--only", "parked-before", "--jobs", "1")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The certificate's folder after an undisturbed campaign."""
    out = tmp_path_factory.mktemp("whole") / "truth"
    ran = edge(*SMALL, "--json", "--out", out)
    assert ran.code == 0, ran.err
    assert json.loads(ran.out) == json.loads((out / "certificate.json").read_text())
    return out


def test_a_small_campaign(whole: Path) -> None:
    """It writes a certificate with its figures, limits and counts, and a page that shows them."""
    made = json.loads((whole / "certificate.json").read_text())
    assert {"version", "seed", "model_sha256", "code_sha256", "limits", "counts", "scenarios", "holds"} <= set(made)
    (scenario,) = made["scenarios"]
    assert scenario["figures"]["laps"] == scenario["figures"]["told"] == 50
    assert made["counts"][0]["told"] == [3]
    page = (whole / "certificate.html").read_text()
    assert page.startswith("<!doctype html>")
    assert "30 fps, 1 m/s" in page


def test_an_interrupted_campaign_goes_on(whole: Path, tmp_path: Path) -> None:
    """Ctrl-C leaves whole files and exit code 130; the same command goes on and ends in the same certificate."""
    out = tmp_path / "truth"
    # A shell's background job ignores Ctrl-C; the command must not inherit that from whoever runs the tests.
    heard = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        campaign = subprocess.Popen(
            [*COMMAND, *SMALL, "--out", str(out)], stderr=subprocess.PIPE, text=True, env=environment()
        )
    finally:
        signal.signal(signal.SIGINT, heard)
    until = time.monotonic() + PATIENCE_S
    while not list(out.glob("drives/[!.]*.json")) and campaign.poll() is None and time.monotonic() < until:
        time.sleep(0.02)
    campaign.send_signal(signal.SIGINT)
    _, said = campaign.communicate(timeout=PATIENCE_S)
    assert campaign.returncode == 130, said
    assert "goes on" in said
    assert not (out / "certificate.json").exists()
    finished = sorted(out.glob("drives/[!.]*.json"))
    before = {path: (path.stat().st_mtime_ns, json.loads(path.read_text())) for path in finished}
    assert 1 <= len(before) < 3
    ran = edge(*SMALL, "--out", out)
    assert ran.code == 0, ran.err
    assert {path: (path.stat().st_mtime_ns, json.loads(path.read_text())) for path in finished} == before
    for name in ("certificate.json", "certificate.html"):
        assert (out / name).read_bytes() == (whole / name).read_bytes()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--only", "nonsense"), "nonsense"),
        (("--rendered", "0", "--only", "hand", "--out", "/dev/null/x"), "/dev/null"),
    ],
)
def test_wrong_wishes_are_one_line(arguments: tuple[str, ...], words: str) -> None:
    """What cannot be done is named in one line, with exit code 2."""
    ran = edge("truth", *arguments)
    assert ran.code == 2
    assert words in ran.complaint()


def test_a_missed_limit_is_an_exit_code(whole: Path) -> None:
    """A certificate with a missed limit is written all the same, and the command says so by exit code 1."""
    for path in (whole / "drives").glob("30fps-1mps-*.json"):
        data = json.loads(path.read_text())
        for lap in data["result"]["laps"]:
            lap["error_s"] += 0.02
        path.write_text(json.dumps(data))
    ran = edge(*SMALL, "--out", whole)
    assert ran.code == 1
    assert "limits are missed" in ran.err
    assert "MISSED 30fps-1mps: p95_ms" in ran.err
    assert json.loads((whole / "certificate.json").read_text())["holds"] is False
