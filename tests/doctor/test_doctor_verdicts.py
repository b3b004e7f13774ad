"""What a verdict must have, and what becomes of a check that cannot be made."""

import errno
import re
from dataclasses import replace
from pathlib import Path

import pytest

from dnb_edge.doctor.box import Box, Where
from dnb_edge.doctor.check import Check, Group
from dnb_edge.doctor.checks import CHECKS, chosen
from dnb_edge.doctor.verdict import CannotTell, Status, Verdict, ok
from dnb_edge.errors import InputError, TemporaryFault


@pytest.mark.parametrize(
    ("status", "fix"), [(Status.WARN, None), (Status.FAIL, None), (Status.OK, "mend it"), (Status.SKIP, "mend it")]
)
def test_a_fault_has_a_fix_and_nothing_else_has(status: Status, fix: str | None) -> None:
    """Who is told of a fault is told what to type; who is told that all is well is told nothing to type."""
    with pytest.raises(ValueError, match="fix"):
        Verdict(status=status, found="something", fix=fix)


def raising(error: Exception) -> Check[None]:
    """A check whose facts cannot be had."""

    def gather(_: Box) -> None:
        raise error

    return Check(
        name="a", group=Group.DISK, looks_at="", amiss="", remedy="", gather=gather, judge=lambda _: ok("never")
    )  # fmt: skip


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (CannotTell("no camera"), "no camera"),
        (InputError("demo.yaml: wrong"), "demo.yaml: wrong"),
        (TemporaryFault("/dev/video0: gone"), "/dev/video0: gone"),
        (OSError(errno.EACCES, "Permission denied", "/sys/x"), "/sys/x: you may not look there: run this with sudo"),
        (OSError(errno.EIO, "Input/output error", "/sys/x"), "/sys/x: Input/output error"),
        (OSError("odd"), "odd"),
        (KeyError("thing"), "please report it: KeyError: 'thing'"),
    ],
)
def test_facts_that_cannot_be_had_are_told_and_stop_nobody(error: Exception, told: str) -> None:
    """A check that cannot be made says why, whatever was raised; even where it is a mistake of ours."""
    verdict = raising(error).make(Box(Where()))
    assert verdict.status is Status.SKIP
    assert verdict.found.endswith(told)


def test_a_rule_that_fails_is_told_too() -> None:
    """A mistake in a rule costs its own line alone."""
    check = replace(raising(CannotTell("")), gather=lambda _: 0.0, judge=lambda seconds: ok(f"{1 / seconds}"))
    assert "ZeroDivisionError" in check.make(Box(Where())).found


def test_what_is_found_is_found_once_and_so_is_why_it_cannot_be() -> None:
    """Twenty checks want the same pictures: the camera is opened once, also where that fails."""
    box, calls = Box(Where()), []

    def fails() -> int:
        calls.append("fails")
        raise InputError("no")

    for _ in range(2):
        with pytest.raises(InputError, match="no"):
            box.once("a", fails)
        assert box.once("b", lambda: len(calls)) == 1
    assert calls == ["fails"]


def test_there_are_checks_enough_and_each_explains_itself() -> None:
    """Names are unique and can be typed; each check says what it looks at, when it complains, and what to do."""
    names = [check.name for check in CHECKS]
    assert len(names) >= 20
    assert len(set(names)) == len(names)
    for check in CHECKS:
        assert re.fullmatch(r"[a-z]+(-[a-z]+)*", check.name)
        assert min(map(len, (check.looks_at, check.amiss, check.remedy))) > 5
    order = [list(Group).index(check.group) for check in CHECKS]
    assert order == sorted(order)


@pytest.mark.parametrize(
    ("names", "count"),
    [(None, len(CHECKS)), ([], len(CHECKS)), (["rate"], 1), (["rate", "gaps", "rate"], 2), (["Disk"], 5)],
)
def test_some_checks_or_a_group(names: list[str] | None, count: int) -> None:
    """By name or by group; all of them for none."""
    assert len(chosen(names)) == count


def test_an_unknown_check_is_refused_with_those_like_it() -> None:
    """Whoever misspells is told what there is."""
    with pytest.raises(InputError, match=r"did you mean .*sharpness"):
        chosen(["sharpnes"])


def test_the_configuration_of_the_set_up_pages_counts_where_there_is_no_other(tmp_path: Path) -> None:
    """As for the service: the system's own first, then what was set up."""
    where = Where(config=tmp_path / "etc.yaml", setup=tmp_path / "setup")
    assert Box(where).config_file is None
    where.setup.mkdir()
    (where.setup / "dnb-edge.yaml").touch()
    assert Box(where).config_file == where.setup / "dnb-edge.yaml"
    where.config.touch()
    assert Box(where).config_file == where.config
