"""Every unit that is shipped: understood by systemd without a word, and hardened."""

import re

import pytest
from units import SYSTEMD, analyze, installable, needs_analyze

EXPOSURE_LIMITS = {
    "dnb-edge.service": 2.0,
    "dnb-edge-web.service": 2.0,
    "dnb-edge-foxglove.service": 2.0,
    "dnb-edge-fleet.service": 2.0,
    "dnb-edge-vehicle.service": 2.0,
    "dnb-edge-take-home@.service": 1.0,
}
"""The most of systemd's own exposure level, of 10; a naive unit has 9.2."""

each = pytest.mark.parametrize("name", EXPOSURE_LIMITS)


def test_every_unit_is_judged():
    """None is shipped that the tests below leave out."""
    assert {path.name for path in SYSTEMD.glob("*.service")} == EXPOSURE_LIMITS.keys()


@needs_analyze
@each
def test_systemd_understands_every_line(name, tmp_path):
    """`verify` exits with 0 even for unknown keys, so any word from it is a failure; a misspelt key makes it speak."""
    unit = SYSTEMD / name
    verdict = analyze("verify", installable(unit, tmp_path, instance="sda1"))
    assert (verdict.returncode, verdict.stdout, verdict.stderr) == (0, "", "")
    wrong = analyze("verify", installable(unit, tmp_path, extra="ProtectHoom=yes\n", instance="sda1"))
    assert "ProtectHoom" in wrong.stderr


@needs_analyze
@each
def test_it_is_hardened(name, tmp_path):
    """Its exposure, as systemd sees it, is at most its limit."""
    limit = EXPOSURE_LIMITS[name]
    verdict = analyze(
        "security", "--offline=true", f"--threshold={round(10 * limit)}", installable(SYSTEMD / name, tmp_path)
    )
    assert verdict.returncode == 0, verdict.stdout
    assert float(re.search(r"exposure level for \S+: ([0-9.]+)", verdict.stdout)[1]) <= limit


@needs_analyze
def test_a_naive_unit_would_be_noticed(tmp_path):
    """The threshold can fail."""
    naive = tmp_path / "naive.service"
    naive.write_text("[Service]\nExecStart=/bin/true\n", encoding="utf-8")
    assert analyze("security", "--offline=true", "--threshold=20", naive).returncode != 0
