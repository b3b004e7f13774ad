"""Who is who after a meeting: cars that came near one another keep their names only once their looks agree.

Motion alone decides who is who from frame to frame. Where two cars with other looks have been within a car's length, or
shared one detection, that may be wrong: both are in doubt, what is seen of them is held back, and a few separate sightings
later their looks decide, exchanging names where that fits better. Cars that look alike are never in doubt: for them motion
has the last word. Knows targets and looks; knows no frame and no track.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

from dnb_edge.motion.appearance import Sighting
from dnb_edge.motion.assignment import assign
from dnb_edge.motion.target import LIVE, Doubt, Followed, renamed

NEAR_LENGTHS = 1.0
"""Distance of two cars, in lengths of the longer, within which motion may confuse them."""

VOTES = 3
"""Separate sightings of every car in question before colours decide."""

MARGIN = 6.0
"""Difference in squared spreads by which one way of naming them must fit better than any other."""

DOUBT_S = 1.5
"""Time after a meeting after which motion decides where looks have not."""

HELD_S = 3.0
"""Longest time for which observations are held back."""


def are_near(a: Followed, b: Followed) -> bool:
    """Whether two targets are within a car's length of one another."""
    apart_m = math.dist(a.estimate.track_m, b.estimate.track_m)
    return apart_m <= NEAR_LENGTHS * max(a.length_m, b.length_m)


def named(targets: Sequence[Followed], own: Mapping[int, Sighting], t_ns: int) -> list[Followed]:
    """The targets after a frame in which target `i` of them had its own sighting `own[i]`: doubts opened, fed, decided."""
    alone = sum(target.state in LIVE for target in targets) < 2
    if alone and not any(target.doubt is not None or target.returned for target in targets):
        return list(targets)
    doubted = _fed(_opened(targets, own, t_ns), own)
    for group in {target.doubt.group for target in doubted if target.doubt is not None}:
        members = [i for i, target in enumerate(doubted) if target.target_id in group and target.state in LIVE]
        for i, target in zip(members, _decided([doubted[i] for i in members], t_ns), strict=True):
            doubted[i] = target
    return doubted


def _opened(targets: Sequence[Followed], own: Mapping[int, Sighting], t_ns: int) -> list[Followed]:
    """The targets with doubt cast on all that have just met or come back, or of which one shows another's number."""
    opened = list(targets)
    live = [i for i, target in enumerate(targets) if target.state in LIVE]
    for i, k in combinations(live, 2):
        a, b = opened[i], opened[k]
        merged = a.merged_since_t_ns is not None and b.merged_since_t_ns is not None
        met = (merged or are_near(a, b) or a.returned or b.returned) and a.looks.differs_from(b.looks)
        if not met and not _shows(own.get(i), a, b) and not _shows(own.get(k), b, a):
            continue
        group = _group(a) | _group(b)
        for j in live:
            if opened[j].target_id in group:
                opened[j] = _in_doubt(opened[j], group, t_ns)
    return [replace(target, returned=False) if target.returned else target for target in opened]


def _shows(sighting: Sighting | None, target: Followed, other: Followed) -> bool:
    """Whether what was taken for `target` bears the number of `other`."""
    marker_id = None if sighting is None else sighting.marker_id
    return marker_id is not None and marker_id == other.looks.marker and marker_id != target.looks.marker_id


def _group(target: Followed) -> frozenset[int]:
    return frozenset({target.target_id}) if target.doubt is None else target.doubt.group


def _in_doubt(target: Followed, group: frozenset[int], t_ns: int) -> Followed:
    """`target` in doubt with `group`; what was seen of it before it shared a detection no longer counts."""
    if target.doubt is None or target.merged_since_t_ns is not None:
        since_t_ns = t_ns if target.doubt is None else target.doubt.since_t_ns
        return replace(target, doubt=Doubt(group=group, since_t_ns=since_t_ns, met_t_ns=t_ns, unsure_t_ns=t_ns))
    return replace(target, doubt=replace(target.doubt, group=group, met_t_ns=t_ns))


def _fed(targets: Sequence[Followed], own: Mapping[int, Sighting]) -> list[Followed]:
    """The targets with this frame's separate sightings of those in doubt."""
    return [
        replace(target, doubt=target.doubt.after(own[i])) if target.doubt is not None and i in own else target
        for i, target in enumerate(targets)
    ]


def _decided(members: Sequence[Followed], t_ns: int) -> list[Followed]:
    """The members of one group under the names that fit, free of doubt where that is settled; else unchanged."""
    doubts = [target.doubt for target in members]
    present = [doubt for doubt in doubts if doubt is not None]
    if len(present) < len(members) or _expired(present, t_ns):
        return [replace(target, doubt=None) for target in members]
    if len(members) < 2:
        # The other is out of sight: what comes back may be either.
        return list(members)
    if not any(one.looks.marker is not None for one in present) and any(one.votes < VOTES for one in present):
        return list(members)
    costs = [[target.looks.misfit(one.looks) for target in members] for one in present]
    best = assign(costs, 1.0 + sum(map(sum, costs)))
    if _spare(costs, best) < MARGIN:
        return list(members)
    return [_named_after(target, members[best[i]]) for i, target in enumerate(members)]


def _named_after(target: Followed, car: Followed) -> Followed:
    """`target`, known to be `car`, free of doubt. What `car` had seen before names became unsure stays with its name."""
    assert target.doubt is not None, "only what is in doubt is named"
    assert car.doubt is not None, "a car is in doubt with others in doubt"
    own = (observation for observation in car.pending if observation.t_ns < car.doubt.unsure_t_ns)
    now = renamed(target, car.target_id, car.looks)
    since = (observation for observation in now.pending if observation.t_ns >= target.doubt.unsure_t_ns)
    return replace(now, doubt=None, pending=(*own, *since))


def _expired(doubts: Sequence[Doubt], t_ns: int) -> bool:
    return all((t_ns - one.met_t_ns) * 1e-9 > DOUBT_S or (t_ns - one.since_t_ns) * 1e-9 > HELD_S for one in doubts)


def _spare(costs: Sequence[Sequence[float]], best: Mapping[int, int]) -> float:
    """By how much `best` is cheaper than with any two names exchanged."""
    return min(
        costs[i][best[k]] + costs[k][best[i]] - costs[i][best[i]] - costs[k][best[k]]
        for i, k in combinations(range(len(costs)), 2)
    )
