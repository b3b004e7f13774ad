"""What the judge's page can forgive is what the rules can punish."""

from __future__ import annotations

import json
import re
from pathlib import Path

import dnb_edge.web
from dnb_edge.values import IncidentKind


def test_the_page_knows_every_incident() -> None:
    """The list in its script names each kind of incident once: a new kind is missed by nobody."""
    script = (Path(dnb_edge.web.__file__).parent / "static" / "judge_decide.js").read_text()
    found = re.search(r"const KINDS = (\[.*?\]);", script)
    assert found is not None
    kinds = json.loads(found[1])
    assert sorted(kinds) == sorted(kind.value for kind in IncidentKind)
