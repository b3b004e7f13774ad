"""A changed copy is what the standard library's `replace` makes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dnb_edge.motion import kalman
from dnb_edge.motion.copies import changed


def test_a_changed_copy_is_replaces_and_leaves_the_original() -> None:
    """All members are copied, the named ones changed, and the original stays as it was."""
    estimate = kalman.begin(5, (1.0, 2.0), (1e-4, 0.0, 2e-4), 2.0)
    before = repr(estimate)
    assert changed(estimate, t_ns=7, track_m=(3.0, 4.0)) == replace(estimate, t_ns=7, track_m=(3.0, 4.0))
    assert changed(estimate) == estimate
    assert repr(estimate) == before


def test_a_member_that_is_none_is_refused() -> None:
    """A misspelt name is an error, not another attribute."""
    with pytest.raises(KeyError, match="t_nss"):
        changed(kalman.begin(5, (1.0, 2.0), (1e-4, 0.0, 2e-4), 2.0), t_nss=7)
