"""A judge's edits laid over laps: pure, reversible, and told where they find nothing."""

from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnb_edge.errors import InputError
from dnb_edge.race.edit import Action, AddedLap, Edit, LapKey, undone
from dnb_edge.race.marshal import added_to, apply, in_sequence
from dnb_edge.values import Crossing, Direction, Lap, Penalty, SectorTime

S = 1_000_000_000
OFF = Penalty(offence="off_track", seconds=2.0, factor=0.9, invalid=True, reason="it left the lane", incident=1)
SLOW = Penalty(offence="too_slow", seconds=1.0, reason="it was slow", incident=2)


def lap(number, start_s, end_s, *, car=1, penalties=(), **changes):
    reasons = tuple(one.reason for one in penalties if one.invalid)
    facts = {
        "number": number,
        "start_t_ns": round(start_s * S),
        "end_t_ns": round(end_s * S),
        "start_s": float(start_s),
        "time_s": float(end_s - start_s),
        "sigma_s": 0.002,
        "valid": not reasons,
        "reasons": reasons,
        "similarity_percent": 95.0,
        "observed_fraction": 1.0,
        "target_id": car,
        "car": car,
        "penalties": penalties,
        "penalty_s": sum(one.seconds for one in penalties),
        "penalty_factor": 0.9 if OFF in penalties else 1.0,
        "official_time_s": end_s - start_s + sum(one.seconds for one in penalties),
    }
    return Lap(**(facts | changes))


LAPS = (lap(1, 1, 11), lap(2, 11, 16, penalties=(OFF, SLOW)), lap(3, 16, 21), lap(4, 21, 31), lap(1, 25, 36, car=2))


def crossing(t_s, line="start", *, car=1, sigma_s=0.003, direction=Direction.FORWARD):
    return Crossing(
        t_ns=round(t_s * S),
        t_s=t_s,
        line=line,
        direction=direction,
        sigma_s=sigma_s,
        track_m=(0.0, 0.0),
        target_id=10 * car,
        estimated=False,
        car=car,
    )


def edit(number, action, *laps, **facts):
    keys = tuple(LapKey.of(one) for one in laps)
    return Edit(
        number=number, time="2026-01-01T00:00:00Z", author="Ada", action=action, reason="seen", laps=keys, **facts
    )


def add(number, start_s, end_s, *, car=1, lap_number=5):
    key = LapKey(car=car, number=lap_number, start_t_ns=round(start_s * S), end_t_ns=round(end_s * S))
    return edit(number, Action.ADD, added=AddedLap(key=key, start_s=start_s, sigma_s=0.05))


def penalty(number, one, **facts):
    return edit(number, Action.PENALTY, one, penalty=Penalty(offence="judge", reason="seen", **facts))


def undo(number, what):
    return edit(number, Action.UNDO, undoes=what)


def test_a_removed_lap_is_kept_apart_with_its_reason():
    """Removing takes a lap out of those that count; it stays, with who did it and why; no number changes hands."""
    after = apply(LAPS, [edit(1, Action.REMOVE, LAPS[2])])
    assert [(one.car, one.number) for one in after.kept] == [(1, 1), (1, 2), (1, 4), (2, 1)]
    (gone,) = after.removed
    assert (gone.lap, gone.edits[-1].author, gone.edits[-1].reason) == (LAPS[2], "Ada", "seen")


def test_merged_laps_are_one_from_the_first_start_to_the_second_end():
    """The sigma comes from the two outer crossings alone, the sectors from the lines between, the rest from both laps."""
    sectors = tuple(SectorTime(number=n, line=f"sector {n}", time_s=None, sigma_s=None) for n in (1, 2))
    sectors += (SectorTime(number=3, line="start", time_s=None, sigma_s=None),)
    first, second = replace(LAPS[1], sectors=sectors), replace(LAPS[2], sectors=sectors, observed_fraction=0.5)
    passes = [
        crossing(11, sigma_s=0.003),
        crossing(13, "sector 1"),
        crossing(14, "sector 1", car=2),
        crossing(16, sigma_s=0.9),
        crossing(18, "sector 2"),
        crossing(18.5, "sector 2"),
        crossing(21, sigma_s=0.004),
    ]
    after = apply((first, second), [edit(1, Action.MERGE, first, second)], passes)
    (one,) = after.laps
    assert one.raw == (first, second)
    assert (one.lap.number, one.lap.start_t_ns, one.lap.end_t_ns, one.lap.time_s) == (2, 11 * S, 21 * S, 10.0)
    assert one.lap.sigma_s == pytest.approx(0.005)
    assert [sector.time_s for sector in one.lap.sectors] == [2.0, 5.0, 3.0]
    assert one.lap.similarity_percent is None
    assert one.lap.observed_fraction == 0.75
    assert (one.lap.valid, one.lap.penalties, one.lap.official_time_s) == (False, (OFF, SLOW), 13.0)


def test_laps_of_two_cars_are_never_one():
    """Though one begins in the very instant in which the other ends."""
    laps = (lap(1, 0, 1), lap(1, 1, 2, car=2), lap(2, 1, 3))
    after = apply(laps, [edit(1, Action.MERGE, laps[0], laps[1])])
    assert set(after.kept) == set(laps)
    assert [told.text for told in after.without_effect] == ["lap 1 of car 2 does not begin where lap 1 ends"]


def test_without_the_crossings_a_merged_lap_has_the_sigma_of_both():
    """In recordings that lack them: never less than it can be."""
    after = apply(LAPS, [edit(1, Action.MERGE, LAPS[2], LAPS[3])])
    assert next(one for one in after.kept if one.number == 3).sigma_s == pytest.approx(0.002 * 2**0.5)


def test_a_sector_whose_line_was_not_crossed_in_its_turn_has_no_time_in_a_merged_lap():
    """Neither it nor the next gets one, and the others keep theirs."""
    sectors = tuple(SectorTime(number=n, line=line, time_s=1.0, sigma_s=0.1) for n, line in enumerate("abcS", start=1))
    first, second = replace(LAPS[2], sectors=sectors), replace(LAPS[3], sectors=sectors)
    passes = [crossing(16), crossing(20, "a"), crossing(25, "c"), crossing(31)]
    after = apply((first, second), [edit(1, Action.MERGE, first, second)], passes)
    assert [sector.time_s for sector in after.kept[0].sectors] == [4.0, None, None, 6.0]


def test_a_penalty_adds_to_the_time_and_to_what_the_rules_gave():
    """Official time, seconds, factor, validity and reasons are worked out anew from all penalties; the time stays measured."""
    after = apply(LAPS, [penalty(1, LAPS[1], seconds=5.0, factor=0.5), penalty(2, LAPS[3], invalid=True)])
    changed = {one.lap.number: one.lap for one in after.laps if one.edits}
    assert (changed[2].time_s, changed[2].penalty_s, changed[2].official_time_s) == (5.0, 8.0, 13.0)
    assert changed[2].penalty_factor == pytest.approx(0.45)
    assert (changed[4].valid, changed[4].reasons) == (False, ("seen (judge Ada)",))


@pytest.mark.parametrize(
    ("offence", "left", "valid", "official_s"),
    [(None, (), True, 5.0), ("off_track", (SLOW,), True, 6.0), ("too_slow", (OFF,), False, 7.0)],
)
def test_forgiving_takes_away_what_the_rules_gave(offence, left, valid, official_s):
    """All of it, or one offence: its penalty and, with the reason that came of it, that the lap is not valid."""
    after = apply(LAPS, [edit(1, Action.FORGIVE, LAPS[1], offence=offence)])
    one = next(one for one in after.kept if one.number == 2)
    assert (one.penalties, one.valid, one.official_time_s) == (left, valid, official_s)


def test_forgiving_spares_a_judges_penalty():
    """What a judge gave is taken back by undoing that edit, whichever came first."""
    orders = [(penalty(1, LAPS[1], seconds=4.0), edit(2, Action.FORGIVE, LAPS[1]))]
    orders.append((edit(1, Action.FORGIVE, LAPS[1]), penalty(2, LAPS[1], seconds=4.0)))
    for edits in orders:
        one = next(one for one in apply(LAPS, edits).kept if one.number == 2)
        assert (one.valid, one.official_time_s) == (True, 9.0)


def test_forgiving_a_lap_is_of_that_lap_alone():
    """Merged afterwards with one that has penalties, those stay; merged before, all are forgiven; once is enough."""
    first, second = lap(1, 1, 11, penalties=(SLOW,)), lap(2, 11, 16, penalties=(OFF,))
    merge, forgive = edit(2, Action.MERGE, first, second), edit(1, Action.FORGIVE, first)
    (one,) = apply((first, second), [forgive, merge]).kept
    assert (one.penalties, one.reasons, one.official_time_s) == ((OFF,), (OFF.reason,), 17.0)
    merged = lap(1, 1, 16)
    (one,) = apply((first, second), [merge, edit(3, Action.FORGIVE, merged)]).kept
    assert (one.penalties, one.reasons, one.official_time_s) == ((), (), pytest.approx(15.0))
    with pytest.raises(InputError, match="lap 1 has no penalty of the rules, and is valid"):
        added_to((first, second), [forgive], edit(2, Action.FORGIVE, first))


def test_a_lap_not_valid_without_a_penalty_can_be_forgiven():
    """In recordings from before there were penalties, too: the reasons go."""
    old = replace(LAPS[0], valid=False, reasons=("the car was lost",), official_time_s=None)
    (one,) = apply([old], [edit(1, Action.FORGIVE, old)]).kept
    assert (one.valid, one.reasons, one.official_time_s) == (True, (), 10.0)


def test_a_judge_ends_a_cars_race():
    """After `dnf` that car's later laps do not count, and say so; the others' do."""
    after = apply(LAPS, [penalty(1, LAPS[1], dnf=True)])
    assert {(one.car, one.number): one.valid for one in after.kept} == {
        (1, 1): True,
        (1, 2): False,
        (1, 3): False,
        (1, 4): False,
        (2, 1): True,
    }
    assert "race ended" in after.kept[2].reasons[-1]


def test_an_added_lap_stands_at_its_time_with_a_new_number():
    """It counts, is not scored, and belongs to the target that crossed nearest to its end."""
    laps = (LAPS[0], LAPS[3])
    after = apply(laps, [add(1, 11.0, 21.0)], [crossing(21), crossing(11), crossing(20.5, car=2)])
    assert [one.number for one in after.kept] == [1, 5, 4]
    one = after.laps[1]
    assert (one.raw, one.lap.time_s, one.lap.sigma_s, one.lap.valid, one.lap.target_id) == ((), 10.0, 0.05, True, 10)


def test_an_added_lap_has_the_sectors_of_the_lines_crossed_in_it():
    """Between crossings, as any lap; an end that a judge gave in seconds leaves its sector without a time."""
    ends = [SectorTime(number=n, line=line, time_s=None, sigma_s=None) for n, line in ((1, "half"), (2, "start"))]
    laps = (replace(LAPS[0], sectors=tuple(ends)),)
    passes = [crossing(11), crossing(14, "half"), replace(crossing(21), estimated=True)]
    whole, by_hand = (apply(laps, [add(1, 11.0, end_s)], passes).kept[1] for end_s in (21.0, 20.5))
    assert [(one.number, one.line, one.time_s) for one in whole.sectors] == [(1, "half", 3.0), (2, "start", 7.0)]
    assert [one.time_s for one in by_hand.sectors] == [3.0, None]
    assert (whole.estimated, by_hand.estimated) == (True, False)


def test_an_added_lap_gives_way_to_a_lap_of_the_same_number():
    """Under other rules the race may make more laps: theirs is the number, and both are in the result."""
    more = lap(5, 40, 50)
    after = apply((*LAPS, more), [add(3, 60.0, 70.0)])
    assert [one.number for one in after.kept if one.car == 1] == [1, 2, 3, 4, 5, 8]
    after = apply(LAPS, [add(1, 40.0, 50.0), add(2, 60.0, 70.0)])
    assert [one.number for one in after.kept if one.car == 1] == [1, 2, 3, 4, 5, 7]


def test_edits_find_their_lap_by_its_time():
    """With other lines the lap is shifted and may have another number; most of its time is still in it, which is told."""
    shifted = (lap(1, 2, 11.5), lap(2, 11.5, 16.5), lap(7, 16.5, 21.5))
    after = apply(shifted, [penalty(1, LAPS[2], seconds=1.0)])
    assert [(one.lap.number, bool(one.edits)) for one in after.laps] == [(1, False), (2, False), (7, True)]
    assert "+0.500 s" in after.moved[0].text
    assert after.without_effect == ()


@pytest.mark.parametrize("laps", [(), (lap(3, 16, 31),), (lap(3, 16, 21, car=2),)])
def test_an_edit_whose_lap_is_gone_is_told(laps):
    """Not there, grown to twice its length, another car's: the edit changes nothing and is told, never dropped."""
    after = apply(laps, [edit(1, Action.REMOVE, LAPS[2])])
    assert after.kept == laps
    assert [told.edit.number for told in after.without_effect] == [1]
    assert "no such lap" in after.without_effect[0].text


def test_an_undo_can_be_undone():
    """Undoing an undo makes the edit hold again."""
    edits = [edit(1, Action.REMOVE, LAPS[0]), undo(2, 1), undo(3, 2)]
    assert undone(edits) == {2}
    assert undone(edits[:2]) == {1}
    assert apply(LAPS, edits).kept == apply(LAPS, edits[:1]).kept


def test_rankings_get_laps_in_the_order_in_which_they_were_driven():
    """A merged lap takes one place, an added one its own, and a removed one leaves a gap: laps round it are not in a row."""
    edits = [edit(1, Action.MERGE, LAPS[1], LAPS[2]), add(2, 31.0, 41.0), edit(3, Action.REMOVE, LAPS[0])]
    places = in_sequence(apply(LAPS, edits))
    assert {car: [(one.number, one.start_s) for one in laps] for car, laps in places.items()} == {
        1: [(2, 11.0), (3, 21.0), (4, 31.0)],
        2: [(1, 25.0)],
    }


REFUSED = [
    (
        "remove twice",
        [edit(1, Action.REMOVE, LAPS[2])],
        edit(2, Action.REMOVE, LAPS[2]),
        "lap 3 is removed (edit 1, Ada",
    ),
    ("not neighbours", [], edit(1, Action.MERGE, LAPS[0], LAPS[2]), "lap 3 does not begin where lap 1 ends"),
    ("add over a lap", [], add(1, 12.0, 15.0), "lap 2 is driven in the same time"),
    ("nothing to forgive", [], edit(1, Action.FORGIVE, LAPS[0]), "lap 1 has no penalty of the rules, and is valid"),
    (
        "other offence",
        [],
        edit(1, Action.FORGIVE, LAPS[1], offence="lost"),
        "lap 2 has no penalty for lost: it has off_track",
    ),
    ("undo nothing", [], undo(1, 1), "undo edit 1: there is no such edit, there is none"),
    ("undo twice", [edit(1, Action.NOTE), undo(2, 1)], undo(3, 1), "undo edit 1: it is undone already"),
    (
        "undo what another rests on",
        [edit(1, Action.MERGE, LAPS[1], LAPS[2]), penalty(2, lap(2, 11, 21), seconds=1.0)],
        undo(3, 1),
        "edit 2 (penalty lap 2, Ada) rests on it: undo that first",
    ),
    (
        "undo a removal under an added lap",
        [edit(1, Action.REMOVE, LAPS[2]), add(2, 16.0, 20.0)],
        undo(3, 1),
        "edit 2 (add lap 5, Ada) rests on it",
    ),
]


@pytest.mark.parametrize(("before", "more", "text"), [row[1:] for row in REFUSED], ids=[row[0] for row in REFUSED])
def test_an_edit_that_makes_no_sense_is_refused(before, more, text):
    """One line that says why; what was there before is no part of the question."""
    with pytest.raises(InputError) as error:
        added_to(LAPS, before, more)
    assert text in str(error.value)
    assert "\n" not in str(error.value)


def test_laps_come_in_the_order_in_which_they_ended():
    """Whatever order they were given in."""
    assert apply(LAPS[::-1], []).kept == LAPS


def test_the_table_of_before_and_after_is_of_one_edit():
    """`added_to` gives the laps without and with it."""
    before, after = added_to(LAPS, [edit(1, Action.REMOVE, LAPS[0])], edit(2, Action.REMOVE, LAPS[2]))
    assert [len(one.kept) for one in (before, after)] == [4, 3]


MISSHAPEN = [
    {"action": Action.REMOVE},
    {"action": Action.MERGE, "laps": (LapKey.of(LAPS[0]),)},
    {"action": Action.PENALTY, "laps": (LapKey.of(LAPS[0]),)},
    {"action": Action.ADD},
    {"action": Action.UNDO},
    {"action": Action.NOTE, "undoes": 3},
    {"action": Action.NOTE, "offence": "lost"},
    {"action": Action.NOTE, "author": " "},
    {"action": Action.NOTE, "reason": ""},
    {"action": Action.NOTE, "number": 0},
]


@pytest.mark.parametrize("facts", MISSHAPEN)
def test_an_edit_has_what_its_action_needs_and_nothing_else(facts):
    """Anything else raises when it is made."""
    with pytest.raises(ValueError, match="edit"):
        Edit(**({"number": 1, "time": "2026-01-01T00:00:00Z", "author": "Ada", "reason": "seen"} | facts))


@st.composite
def races(draw):
    """Laps of two cars that follow one another, some with penalties."""
    laps = []
    for car in (1, 2):
        at = draw(st.integers(0, 5))
        for number in range(1, draw(st.integers(1, 6)) + 1):
            end = at + draw(st.integers(1, 20))
            laps.append(
                lap(number, at, end, car=car, penalties=draw(st.sampled_from([(), (OFF,), (SLOW,), (OFF, SLOW)])))
            )
            at = end
    return tuple(sorted(laps, key=lambda one: (one.end_t_ns, one.car)))


@st.composite
def edited(draw, count):
    """(laps, one edit each for up to `count` different laps), none of which touches another's lap."""
    laps = draw(races())
    chosen = draw(st.lists(st.sampled_from(laps), min_size=1, max_size=count, unique_by=LapKey.of))
    edits = []
    for number, one in enumerate(chosen, start=1):
        kinds = [
            edit(number, Action.REMOVE, one),
            edit(number, Action.NOTE, one),
            penalty(number, one, seconds=3.0, factor=0.5, invalid=True),
            edit(number, Action.FORGIVE, one),
            add(number, 1000.0 + 10 * number, 1008.0 + 10 * number, car=one.car, lap_number=20 + number),
        ]
        edits.append(draw(st.sampled_from(kinds)))
    return laps, edits


@given(edited(1))
def test_undoing_an_edit_gives_back_the_laps_that_were_raced(case):
    """apply(raw, [e, undo e]) has exactly the raw laps, none removed, none with a history."""
    laps, (one,) = case
    after = apply(laps, [one, undo(2, 1)])
    assert after.kept == laps
    assert all(got.raw == (was,) and got.edits == () for got, was in zip(after.laps, laps, strict=True))
    assert (after.removed, after.without_effect, after.undone) == ((), (), (one,))


@given(edited(6), st.randoms(use_true_random=False))
def test_edits_of_different_laps_commute(case, random):
    """Whatever order they were made in, the result is the same."""
    laps, edits = case
    shuffled = list(edits)
    random.shuffle(shuffled)
    one, other = apply(laps, edits), apply(laps, shuffled)
    assert (one.laps, one.removed) == (other.laps, other.removed)
    assert {told.edit.number for told in one.without_effect} == {told.edit.number for told in other.without_effect}


@given(edited(6))
def test_every_raw_lap_is_somewhere_afterwards(case):
    """Nothing is dropped: each lap that was raced is in one of the laps that count, or among those removed."""
    laps, edits = case
    after = apply(laps, edits)
    assert sorted(LapKey.of(raw).start_t_ns for one in (*after.laps, *after.removed) for raw in one.raw) == sorted(
        one.start_t_ns for one in laps
    )
    assert all(one.lap.official_time_s == one.lap.time_s + one.lap.penalty_s for one in after.laps)
    assert all(one.lap.valid == (not one.lap.reasons) for one in after.laps)


@st.composite
def any_edits(draw):
    """(laps, edits), the edits made for other laps than those, in no sensible order, undos of whatever number among them."""
    laps, others = draw(races()), draw(races())
    edits = []
    for number in range(1, draw(st.integers(0, 12)) + 1):
        known = draw(st.sampled_from((*laps, *others)))
        later = draw(st.sampled_from((*laps, *others)))
        start_s = draw(st.integers(0, 60))
        kinds = [
            edit(number, Action.REMOVE, known),
            edit(number, Action.MERGE, known, later),
            edit(number, Action.FORGIVE, known, offence=draw(st.sampled_from([None, "off_track", "lost"]))),
            edit(number, Action.NOTE, known),
            penalty(number, known, seconds=1.0, dnf=draw(st.booleans())),
            add(number, start_s, start_s + draw(st.integers(1, 30)), lap_number=draw(st.integers(1, 9))),
            undo(number, draw(st.integers(1, 12))),
        ]
        edits.append(draw(st.sampled_from(kinds)))
    return laps, edits


@given(any_edits())
def test_no_list_of_edits_breaks_anything(case):
    """Whatever the edits were made for: nothing raises, no raw lap is lost, a car's laps never overlap or share a number,
    and an edit shows, is undone, or is told."""
    laps, edits = case
    after = apply(laps, edits)
    raws = sorted((raw.car, raw.start_t_ns) for one in (*after.laps, *after.removed) for raw in one.raw)
    assert raws == sorted((one.car, one.start_t_ns) for one in laps)
    for car in (1, 2):
        mine = [one for one in after.kept if one.car == car]
        assert all(before.end_t_ns <= then.start_t_ns for before, then in pairwise(mine))
        assert len({one.number for one in mine}) == len(mine)
    shown = {one.number for lap in (*after.laps, *after.removed) for one in lap.edits} | {
        one.number for one in after.notes
    }
    told = {one.edit.number for one in after.without_effect} | {one.number for one in after.undone}
    assert {one.number for one in edits if one.action is not Action.UNDO} <= shown | told
