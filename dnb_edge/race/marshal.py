"""Laps after a judge's edits: what counts, what was taken away, what changed each, and which edits find nothing any more.

Pure: the same laps and edits give the same result, and the laps that the race made are never changed. Knows laps, crossings
and edits; knows no file and no path similarity (a lap that a judge made has none until its path is scored).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from dnb_edge.errors import InputError
from dnb_edge.race.edit import Action, Edit, LapKey, undone
from dnb_edge.race.mended import added_lap, merged_lap, pardoned, priced
from dnb_edge.values import Crossing, Lap

SAME_LAP = 2 / 3
"""Laps that share more of their time than this are the same lap: a line may move by a fifth of a lap, and neither half of a lap
that was cut in two is taken for it. Laps of a car do not overlap, so at most one does."""

MOVED_S = 1e-3
"""Less than this nobody needs to be told that a lap begins or ends elsewhere, seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MarshalledLap:
    """One lap as it counts, and how it became so."""

    lap: Lap
    raw: tuple[Lap, ...]
    """The race's own laps in it: one, two or more where they were merged, none where a judge added it."""
    edits: tuple[Edit, ...] = ()
    """What was decided about it, in order; empty where nothing was."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """Something to say about an edit."""

    edit: Edit
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """A judge ended a car's race."""

    car: int
    t_ns: int
    """The end of its last lap."""
    edit: Edit

    @property
    def reason(self) -> str:
        """Why, with who said so."""
        return f"{self.edit.reason} (judge {self.edit.author})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Marshalled:
    """The laps of a run after the edits."""

    laps: tuple[MarshalledLap, ...]
    """In the order in which they ended. A number never changes hands: it may be missing (removed, merged) or late (added)."""
    removed: tuple[MarshalledLap, ...] = ()
    """Laps that were taken away, as they were before; their last edit is the removal."""
    ended: tuple[Ended, ...] = ()
    """Cars whose race a judge ended, each once."""
    notes: tuple[Edit, ...] = ()
    """Notes about the whole run."""
    undone: tuple[Edit, ...] = ()
    """Edits that were taken back."""
    without_effect: tuple[Told, ...] = ()
    """Edits that find no lap any more, or nothing to do, under these rules and lines, and why."""
    moved: tuple[Told, ...] = ()
    """Edits whose lap begins or ends elsewhere now, by `MOVED_S` or more, than when they were made."""

    @property
    def kept(self) -> tuple[Lap, ...]:
        """The laps that count, without their histories."""
        return tuple(one.lap for one in self.laps)


def in_sequence(marshalled: Marshalled) -> dict[int, tuple[Lap, ...]]:
    """Each car's laps that count, numbered by their place among all that it drove: as rankings want them.

    A lap that was taken away leaves its place empty, so that those before and after it are not in a row.
    """
    placed: dict[int, list[Lap]] = {}
    cars: dict[int, int] = {}
    gone = set(map(id, marshalled.removed))
    for one in sorted((*marshalled.laps, *marshalled.removed), key=_in_order):
        car = one.lap.car
        cars[car] = cars.get(car, 0) + 1
        if id(one) not in gone:
            placed.setdefault(car, []).append(replace(one.lap, number=cars[car]))
    return {car: tuple(laps) for car, laps in placed.items()}


def apply(laps: Sequence[Lap], edits: Sequence[Edit], crossings: Sequence[Crossing] = ()) -> Marshalled:
    """The `laps` that the race made after `edits`, in the order of their numbers.

    `crossings` are the run's: a merged or added lap takes the sigmas of its two ends and its sectors from them where they are.
    """
    gone = undone(edits)
    sheet = _Sheet(laps, edits, crossings)
    for edit in edits:
        if edit.number not in gone:
            fault = _DOERS[edit.action](sheet, edit)
            if fault is not None:
                sheet.without_effect.append(Told(edit=edit, text=fault))
    ended = _ended(sheet.laps)
    removed = (replace(one, lap=_decided(one.lap, one.edits)) for one in sheet.removed)
    return Marshalled(
        laps=tuple(_official(one, ended.get(one.lap.car)) for one in sheet.laps),
        removed=tuple(sorted(removed, key=_in_order)),
        ended=tuple(ended[car] for car in sorted(ended)),
        notes=tuple(sheet.notes),
        undone=tuple(edit for edit in edits if edit.number in gone),
        without_effect=tuple(sheet.without_effect),
        moved=tuple(sheet.moved),
    )


def added_to(
    laps: Sequence[Lap], edits: Sequence[Edit], edit: Edit, crossings: Sequence[Crossing] = ()
) -> tuple[Marshalled, Marshalled]:
    """(before, after) one more edit. Raises `InputError` where it makes no sense now, or takes the ground from another."""
    if edit.undoes is not None:
        _check_undo(edits, edit.undoes)
    before, after = apply(laps, edits, crossings), apply(laps, (*edits, edit), crossings)
    known = {told.edit.number for told in before.without_effect}
    for told in after.without_effect:
        if told.edit.number == edit.number:
            raise InputError(f"{edit.action.value} {edit.subject}: {told.text}")
    for told in after.without_effect:
        if told.edit.number not in known:
            other = told.edit
            raise InputError(f"{edit.action.value} {edit.subject}: edit {other.number} ({other.action.value} {other.subject}, "
                             f"{other.author}) rests on it: undo that first")  # fmt: skip
    return before, after


def _check_undo(edits: Sequence[Edit], number: int) -> None:
    if number not in {edit.number for edit in edits}:
        there = f"there are 1 to {edits[-1].number}" if edits else "there is none"
        raise InputError(f"undo edit {number}: there is no such edit, {there}")
    if number in undone(edits):
        raise InputError(f"undo edit {number}: it is undone already")


class _Sheet:
    """The laps while edits are applied to them, one after the other."""

    def __init__(self, laps: Sequence[Lap], edits: Sequence[Edit], crossings: Sequence[Crossing]) -> None:
        self.laps = sorted((MarshalledLap(lap=lap, raw=(lap,)) for lap in laps), key=_in_order)
        self.removed: list[MarshalledLap] = []
        self.notes: list[Edit] = []
        self.without_effect: list[Told] = []
        self.moved: list[Told] = []
        self._raw = laps
        self._crossings = sorted(crossings, key=lambda crossing: crossing.t_ns)
        # Every lap has all sectors, those without a time among them.
        self._sector_ends = [sector.line for lap in laps[:1] for sector in lap.sectors]
        added = [edit.added.key.number for edit in edits if edit.added is not None]
        self._highest = max([*(lap.number for lap in laps), *added], default=0)

    def add(self, edit: Edit) -> str | None:
        """A lap that the race missed; refused over one that counts."""
        assert edit.added is not None, "the edit's own check"
        key = edit.added.key
        for one in self.laps:
            lap = one.lap
            if lap.car == key.car and lap.start_t_ns < key.end_t_ns and key.start_t_ns < lap.end_t_ns:
                return (
                    f"{_name(lap)} is driven in the same time, from {lap.start_s:.3f} to {_end_s(lap):.3f} s: begin "
                    "and end at its passes, or remove it first"
                )
        number = key.number
        others = (*self._raw, *(one.lap for one in (*self.laps, *self.removed)))
        if any((lap.car, lap.number) == (key.car, number) for lap in others):
            number = self._highest + edit.number
        lap = added_lap(edit.added, number, self._crossings, self._sector_ends)
        self._insert(MarshalledLap(lap=lap, raw=(), edits=(edit,)))
        return None

    def remove(self, edit: Edit) -> str | None:
        """A lap that was none; it is kept apart."""
        found = self._find(edit, edit.laps[0])
        if isinstance(found, str):
            return found
        self.laps.remove(found)
        self.removed.append(replace(found, edits=(*found.edits, edit)))
        return None

    def merge(self, edit: Edit) -> str | None:
        """Two laps that meet at one crossing as one."""
        first, second = (self._find(edit, key) for key in edit.laps)
        if isinstance(first, str):
            return first
        if isinstance(second, str):
            return second
        if (first.lap.car, first.lap.end_t_ns) != (second.lap.car, second.lap.start_t_ns):
            return f"{_name(second.lap)} does not begin where lap {first.lap.number} ends"
        self.laps.remove(first)
        self.laps.remove(second)
        self._insert(
            MarshalledLap(
                lap=merged_lap(first.lap, second.lap, self._crossings),
                raw=(*first.raw, *second.raw),
                edits=(*first.edits, *second.edits, edit),
            )
        )
        return None

    def decide(self, edit: Edit) -> str | None:
        """A penalty, a pardon or a note. A judge's penalties are added at the end, so that no pardon takes them away."""
        if not edit.laps:
            self.notes.append(edit)
            return None
        found = self._find(edit, edit.laps[0])
        if isinstance(found, str):
            return found
        lap = found.lap
        if edit.action is Action.FORGIVE:
            if (fault := _not_to_forgive(found, edit)) is not None:
                return fault
            # At once: with what the lap is merged later was not forgiven.
            lap = pardoned(lap, edit.offence)
        self.laps[self.laps.index(found)] = replace(found, lap=lap, edits=(*found.edits, edit))
        return None

    def nothing(self, edit: Edit) -> str | None:  # noqa: ARG002 an undo works through what it takes back
        """Nothing."""
        return None

    def _find(self, edit: Edit, key: LapKey) -> MarshalledLap | str:
        """The lap that is meant, or why there is none."""
        found = [one for one in self.laps if key.likeness(one.lap) > SAME_LAP]
        if not found:
            gone = [one for one in self.removed if key.likeness(one.lap) > SAME_LAP]
            if gone:
                remover = gone[0].edits[-1]
                return f"{_name(gone[0].lap)} is removed (edit {remover.number}, {remover.author}: {remover.reason})"
            return f"there is no such lap any more: none of car {key.car} has most of its time in it"
        lap = found[0].lap
        shifts_s = ((lap.start_t_ns - key.start_t_ns) * 1e-9, (lap.end_t_ns - key.end_t_ns) * 1e-9)
        if max(map(abs, shifts_s)) >= MOVED_S:
            text = f"{_name(lap)} begins {shifts_s[0]:+.3f} s and ends {shifts_s[1]:+.3f} s from where it did"
            self.moved.append(Told(edit=edit, text=text))
        return found[0]

    def _insert(self, one: MarshalledLap) -> None:
        self.laps.append(one)
        self.laps.sort(key=_in_order)


_DOERS: dict[Action, Callable[[_Sheet, Edit], str | None]] = {
    Action.ADD: _Sheet.add,
    Action.REMOVE: _Sheet.remove,
    Action.MERGE: _Sheet.merge,
    Action.PENALTY: _Sheet.decide,
    Action.FORGIVE: _Sheet.decide,
    Action.NOTE: _Sheet.decide,
    Action.UNDO: _Sheet.nothing,
}


def _ended(laps: Sequence[MarshalledLap]) -> dict[int, Ended]:
    """By car: the first of its laps with which a judge ended its race."""
    found: dict[int, Ended] = {}
    for one in reversed(laps):
        for edit in one.edits:
            if edit.penalty is not None and edit.penalty.dnf:
                found[one.lap.car] = Ended(car=one.lap.car, t_ns=one.lap.end_t_ns, edit=edit)
    return found


def _official(one: MarshalledLap, ended: Ended | None) -> MarshalledLap:
    """The lap with penalties, validity and official time as the judge's decisions leave them."""
    lap = _decided(one.lap, one.edits)
    if ended is None or lap.start_t_ns < ended.t_ns:
        return replace(one, lap=lap)
    reasons = (*lap.reasons, f"the car's race ended before it: {ended.reason}")
    return MarshalledLap(lap=replace(lap, valid=False, reasons=reasons), raw=one.raw, edits=(*one.edits, ended.edit))


def _decided(lap: Lap, edits: Sequence[Edit]) -> Lap:
    """`lap` after a judge's penalties; itself where there were none."""
    given = [(edit, edit.penalty) for edit in edits if edit.penalty is not None]
    if not given:
        return lap
    reasons = [f"{edit.reason} (judge {edit.author})" for edit, penalty in given if penalty.invalid]
    return priced(lap, (*lap.penalties, *(penalty for _, penalty in given)), (*lap.reasons, *reasons))


def _not_to_forgive(one: MarshalledLap, edit: Edit) -> str | None:
    """Why there is nothing to forgive; None where there is."""
    lap = one.lap
    offences = sorted({penalty.offence for penalty in lap.penalties})
    if edit.offence is None:
        return None if offences or not lap.valid else f"{_name(lap)} has no penalty of the rules, and is valid"
    if edit.offence in offences:
        return None
    there = f"it has {', '.join(offences)}" if offences else "it has none of the rules"
    return f"{_name(lap)} has no penalty for {edit.offence}: {there}"


def _in_order(one: MarshalledLap) -> tuple[int, int]:
    return one.lap.end_t_ns, one.lap.car


def _end_s(lap: Lap) -> float:
    return lap.start_s + lap.time_s


def _name(lap: Lap) -> str:
    return f"lap {lap.number}" if lap.car == 1 else f"lap {lap.number} of car {lap.car}"
