"""What tables call those who take part: the name, and what else tells one from another of that name. Knows no lap."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from dnb_edge.values import EntryInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class Entrant:
    """An entry in one world: the same network in reality and in simulation are two."""

    entry: EntryInfo
    simulated: bool

    @property
    def key(self) -> tuple[str, str, str | None, bool]:
        """Alike for those who are one: notes do not tell them apart."""
        return (self.entry.name, self.entry.version, self.entry.checkpoint_sha256, self.simulated)


OrderKey: TypeAlias = tuple[tuple[list[tuple[str, int]], str], ...]


def labels(entrants: Sequence[Entrant]) -> list[str]:
    """The name, with the version where several of one name take part, with the checkpoint where even that does not tell, and
    with the world where both take part."""
    worlds = len({one.simulated for one in entrants}) > 1
    found = []
    for entrant in entrants:
        entry = entrant.entry
        label = entry.name
        of_name = [other.entry for other in entrants if other.entry.name == entry.name]
        if len({other.version for other in of_name}) > 1 and entry.version:
            label += f" {entry.version}"
        if len({other.checkpoint_sha256 for other in of_name if other.version == entry.version}) > 1:
            label += f" [{(entry.checkpoint_sha256 or 'no checkpoint')[:13]}]"
        found.append(f"{label} (simulated)" if worlds and entrant.simulated else label)
    return found


def order_key(*texts: str) -> OrderKey:
    """Sorts `driver 10` behind `driver 2`, and never takes two different texts for one."""
    return tuple((_natural(text), text) for text in texts)


def _natural(text: str) -> list[tuple[str, int]]:
    parts = re.split(r"([0-9]{1,18})", text)
    return [(word.casefold(), int(number)) for word, number in zip(parts[::2], [*parts[1::2], "0"], strict=True)]
