"""docs/troubleshooting.md: what people see, what the box does by itself, and what they do.

Knows the tables of docs/reliability.md (faults and promises), docs/tools/symptoms.yaml (how a fault looks from outside) and the
doctor's checks. Knows no fault by itself: what is in none of the three is not on the page.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from page_text import cell, made_by, paragraphs

from dnb_edge.doctor.checks import CHECKS

PAGE = "docs/troubleshooting.md"

_HERE = Path(__file__).parent
LEDGER = _HERE.parent / "reliability.md"
SYMPTOMS = _HERE / "symptoms.yaml"

_ABOUT = """
Find what you see; the box's own words stand `like this`. Below it is what to do; then, in italics, the fault that is behind it,
with what the box does by itself. Each of these promises has a test and a figure: [what can go wrong](reliability.md).

Not here, or not clear? Ask the box: `dnb-edge doctor` makes [its checks](doctor.md) beside a running race and says what to
type. The log: `journalctl -u dnb-edge`, of the pages `journalctl -u dnb-edge-web`.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One row of the ledger."""

    chapter: str
    name: str
    promise: str

    @property
    def path(self) -> str:
        """As docs/tools/symptoms.yaml names it; a beginning that no other fault has is enough."""
        return f"{self.chapter} / {self.name}"


def faults() -> list[Fault]:
    """The rows of all of the ledger's tables that are about faults, in their order."""
    found = []
    for chapter in re.split(r"^## ", LEDGER.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        title, _, rest = chapter.partition("\n")
        if "| fault |" not in rest:
            continue
        for row in re.findall(r"^\| (?!fault |---)(.*) \|$", rest, re.MULTILINE):
            name, promise, *_ = (part.strip() for part in row.split(" | "))
            found.append(Fault(chapter=title.strip(), name=name, promise=promise))
    return found


def symptoms() -> dict[str, Any]:
    """What docs/tools/symptoms.yaml holds: `chapters` with their rows, and `unseen`."""
    return dict(yaml.safe_load(SYMPTOMS.read_text(encoding="utf-8")))


def named(begin: str, known: list[Fault]) -> Fault:
    """The fault whose path begins so, or is that. Raises `LookupError` where none is, or several are."""
    fitting = [fault for fault in known if fault.path == begin] or [
        fault for fault in known if fault.path.startswith(begin)
    ]
    if len(fitting) != 1:
        raise LookupError(f"{SYMPTOMS.name}: {begin!r} names {len(fitting)} faults of {LEDGER.name}: name one")
    return fitting[0]


def page() -> str:
    """The whole page, Markdown. Raises `LookupError` where a symptom's fault is not in the ledger."""
    known = faults()
    lines = ["# Troubleshooting", "", made_by(__file__), "", paragraphs(_ABOUT)]
    for chapter in symptoms()["chapters"]:
        lines += ["", f"## {chapter['title']}"]
        for row in chapter["rows"]:
            told = [fault for fault in (named(begin, known) for begin in row["faults"]) if not _is_said_above(fault)]
            lines += ["", f"- **{row['see']}**", "", f"  {row['do']}.", ""]
            lines += [f"  - *{fault.name}*: {fault.promise}" for fault in told]
        if chapter["doctor"]:
            lines += ["", *_doctor(chapter["doctor"])]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)) + "\n"


def _is_said_above(fault: Fault) -> bool:
    """Whether its row is the one before again, under other circumstances."""
    return fault.name.startswith("The same")


def _doctor(groups: list[str]) -> list[str]:
    """What the doctor's checks of these groups look at, and what to do where one complains."""
    asked = " ".join(f"--only {group.lower()}" for group in groups)
    lines = [f"`dnb-edge doctor {asked}`:", "", "| check | looks at | where it complains |", "|---|---|---|"]
    checks = [check for check in CHECKS if check.group.value in groups]
    return lines + [f"| `{check.name}` | {cell(check.looks_at)} | {cell(check.remedy)} |" for check in checks]
