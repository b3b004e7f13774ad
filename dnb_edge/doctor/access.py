"""Who may use a device's node: whoever runs the doctor, and the service.

Knows modes, groups and users. Knows no device.
"""

from __future__ import annotations

import grp
import os
import pwd
import stat
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

SERVICE_USER = "dnb-edge"


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """Whose a node is, and who may use it."""

    path: Path
    group: str
    group_may: bool
    """Whether its group may read and write."""
    may_open: bool
    """Whether whoever runs this may."""
    service_groups: frozenset[str] | None
    """Names of the groups that the service has; None where it has no user here."""


def access_of(path: Path, *, user: str = SERVICE_USER, unit_groups: Sequence[str] = ()) -> Access:
    """The access to the node at `path`; `unit_groups` are those that the service's unit adds. Raises `OSError`."""
    found = path.stat()
    both = stat.S_IRGRP | stat.S_IWGRP
    return Access(
        path=path,
        group=_group_name(found.st_gid),
        group_may=found.st_mode & both == both,
        may_open=os.access(path, os.R_OK | os.W_OK),
        service_groups=_groups_of(user, unit_groups),
    )


def _groups_of(user: str, more: Sequence[str]) -> frozenset[str] | None:
    try:
        entry = pwd.getpwnam(user)
    except KeyError:
        return None
    return frozenset(_group_name(number) for number in os.getgrouplist(user, entry.pw_gid)) | set(more)


def _group_name(number: int) -> str:
    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return str(number)
