"""The page for people whose box does something odd: it has every fault of the ledger, once."""

import re
from collections import Counter
from pathlib import Path

import pytest
from troubleshooting_page import Fault, faults, named, page, symptoms

from dnb_edge.doctor.check import Group
from dnb_edge.doctor.checks import CHECKS

KNOWN = faults()


def test_the_ledger_is_read() -> None:
    """Chapters, names and promises of its tables of faults; the last table is about the whole, not about a fault."""
    assert len(KNOWN) > 50
    assert {fault.chapter for fault in KNOWN} >= {"The camera", "The process", "The pages", "The recording"}
    assert all(fault.promise and "tests/" not in fault.promise for fault in KNOWN)
    text = (Path(__file__).resolve().parents[2] / "docs" / "reliability.md").read_text(encoding="utf-8")
    whole = text.split("\n## The whole\n")[1]
    assert len(KNOWN) == len(re.findall(r"^\| (?!fault|what|-)", text.replace(whole, ""), re.MULTILINE))


def test_every_fault_has_a_symptom_or_a_reason_why_nothing_is_seen() -> None:
    """Who adds a fault to the ledger says in docs/tools/symptoms.yaml how it looks from outside and what to do."""
    found = symptoms()
    told = [begin for chapter in found["chapters"] for row in chapter["rows"] for begin in row["faults"]]
    times = Counter(named(begin, KNOWN).path for begin in [*told, *found["unseen"]])
    assert sorted(times) == sorted(fault.path for fault in KNOWN), (
        "docs/tools/symptoms.yaml and docs/reliability.md differ"
    )
    assert set(times.values()) == {1}
    assert all(found["unseen"].values())


def test_every_symptom_says_what_is_seen_and_what_to_do() -> None:
    """And it stands on the page with the ledger's promise, or without one where no fault is behind it."""
    text = page()
    for chapter in symptoms()["chapters"]:
        assert f"\n## {chapter['title']}\n" in text
        for row in chapter["rows"]:
            assert sorted(row) == ["do", "faults", "see"]
            assert f"\n- **{row['see']}**\n" in text
            assert f"\n  {row['do']}.\n" in text
    assert "*Unplugged*: said within 2 s" in text


def test_every_check_of_the_doctor_stands_in_one_chapter() -> None:
    """Its name, what it looks at and what to do; a new group of checks wants a chapter in docs/tools/symptoms.yaml."""
    groups = [group for chapter in symptoms()["chapters"] for group in chapter["doctor"]]
    assert sorted(groups) == sorted(group.value for group in Group)
    text = page()
    for check in CHECKS:
        assert len(re.findall(rf"^\| `{re.escape(check.name)}` \| \S.* \| \S.* \|$", text, re.MULTILINE)) == 1


@pytest.mark.parametrize(
    ("begin", "found"), [("A / one", "A / one"), ("B /", "B / two"), ("A / one a", "A / one and all")]
)
def test_a_beginning_names_a_fault(begin: str, found: str) -> None:
    """The whole name counts first, then a beginning that fits one."""
    known = [Fault(chapter=one[0], name=one[4:], promise="p") for one in ("A / one", "A / one and all", "B / two")]
    assert named(begin, known).path == found


@pytest.mark.parametrize("begin", ["A /", "C", ""])
def test_a_beginning_that_names_none_or_several_is_refused(begin: str) -> None:
    """A fault that was renamed in the ledger is not left out in silence."""
    known = [Fault(chapter="A", name=name, promise="p") for name in ("one", "two")]
    with pytest.raises(LookupError, match=r"symptoms\.yaml"):
        named(begin, known)
