"""All checks, in the order in which they are made and told.

Knows their names and groups, and who means which of them.
"""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any

from dnb_edge.doctor.check import Check
from dnb_edge.doctor.checks_box import BOX_CHECKS
from dnb_edge.doctor.checks_race import RACE_CHECKS
from dnb_edge.errors import InputError

CHECKS: tuple[Check[Any], ...] = (*RACE_CHECKS, *BOX_CHECKS)
"""In the order in which they are told: what the later ones need comes first."""


def chosen(names: list[str] | None) -> tuple[Check[Any], ...]:
    """The checks of these names or groups, in their own order; all of them for none. Raises `InputError` for an unknown one."""
    if not names:
        return CHECKS
    known = {check.name for check in CHECKS} | {check.group.value.lower() for check in CHECKS}
    for name in names:
        if name.lower() not in known:
            near = get_close_matches(name.lower(), sorted(known), n=3)
            hint = f"did you mean {', '.join(near)}? " if near else ""
            raise InputError(f"--only {name}: there is no such check: {hint}`dnb-edge doctor --list` shows them")
    wanted = {name.lower() for name in names}
    return tuple(check for check in CHECKS if check.name in wanted or check.group.value.lower() in wanted)
