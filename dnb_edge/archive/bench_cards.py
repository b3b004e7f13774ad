"""Which benchmark's card is of which entry: the inference times that a table shows beside the laps.

Knows cards, entries and where cards lie; knows nothing of how times are taken.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dnb_edge.archive.trials import Raced
from dnb_edge.errors import InputError
from dnb_edge.nut.bench_card import SUFFIX, BenchCard, read_bench_card
from dnb_edge.report.inference import Inference
from dnb_edge.report.table import printable
from dnb_edge.values import EntryInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundCards:
    """Cards with their files, in the order of these."""

    cards: tuple[tuple[Path, BenchCard], ...]
    warnings: tuple[str, ...] = ()


def cards_beside(recordings: Iterable[Path]) -> FoundCards:
    """The cards that lie in the recordings' directories. One that cannot be read is a warning: nobody asked for it."""
    files = sorted({file for path in recordings for file in path.parent.glob(f"*{SUFFIX}")})
    cards, warnings = [], []
    for file in files:
        try:
            cards.append((file, read_bench_card(file)))
        except InputError as error:
            warnings.append(f"{error}: left out")
    return FoundCards(cards=tuple(cards), warnings=tuple(warnings))


def cards_named(paths: Iterable[Path]) -> FoundCards:
    """The cards that `paths` names, each a file or a directory of them. Raises `InputError` where one cannot be read or is not
    there.
    """
    files: list[Path] = []
    for path in paths:
        found = sorted(path.glob(f"*{SUFFIX}")) if path.is_dir() else [path]
        if not found:
            raise InputError(f"--bench {path}: no card (*{SUFFIX}) in this directory: `dnb-edge nut bench` writes them")
        files += found
    return FoundCards(cards=tuple((file, read_bench_card(file)) for file in sorted(set(files))))


def with_cards(runs: Sequence[Raced], found: FoundCards) -> tuple[list[Raced], tuple[str, ...]]:
    """`runs` with each entry's inference as its card has it, and what must be said of that, a sentence each."""
    entries = {(one.name, one.version, one.checkpoint_sha256): one for run in runs for one in _entries(run)}
    warnings = list(found.warnings)
    chosen: dict[tuple[str, str, str | None], BenchCard] = {}
    for key, entry in sorted(entries.items(), key=lambda item: (*item[0][:2], item[0][2] or "")):
        fitting = _fitting(entry, list(entries.values()), found.cards)
        machines = sorted({_machine(card) for _, card in fitting})
        if len(machines) > 1:
            files = " and ".join(str(file) for file, _ in fitting)
            warnings.append(
                f"{files}: {printable(entry.name)} was measured on several machines: name one card with --bench"
            )
        elif fitting:
            chosen[key] = max(fitting, key=lambda pair: (pair[1].measured_at, str(pair[0])))[1]
    machines = sorted({_machine(card) for card in chosen.values()})
    if len(machines) > 1:
        warnings.append(f"inference times are of several machines and not to be compared: {'; '.join(machines)}")
    timed = {key: _inference(card) for key, card in chosen.items()}
    return [_timed(run, timed) for run in runs], tuple(warnings)


def _entries(run: Raced) -> list[EntryInfo]:
    return [trial.entry for trial in run.trials]


def _fitting(
    entry: EntryInfo, entries: Sequence[EntryInfo], cards: Sequence[tuple[Path, BenchCard]]
) -> list[tuple[Path, BenchCard]]:
    """The cards of an entry: those of its very checkpoint; without any, those of its name with the version; without any, those
    of its name alone, if there is one entry of that name and the card is of no other entry's checkpoint.
    """
    of_file = [one for one in cards if one[1].model_sha256 == entry.checkpoint_sha256]
    if of_file:
        return of_file
    taken = {other.checkpoint_sha256 for other in entries}
    left = [one for one in cards if one[1].model_sha256 not in taken]
    if entry.version and (exact := [one for one in left if one[1].entry == f"{entry.name} {entry.version}"]):
        return exact
    if sum(other.name == entry.name for other in entries) > 1:
        return []
    return [one for one in left if one[1].entry == entry.name]


def _machine(card: BenchCard) -> str:
    return f"{printable(card.host.words)}, {card.threads} thread{'s' * (card.threads != 1)}"


def _inference(card: BenchCard) -> Inference:
    return Inference(p50_ms=card.p50_ms, p95_ms=card.p95_ms, p99_ms=card.p99_ms, source=_machine(card))


def _timed(run: Raced, timed: dict[tuple[str, str, str | None], Inference]) -> Raced:
    trials = (
        replace(one, inference=timed.get((one.entry.name, one.entry.version, one.entry.checkpoint_sha256)))
        for one in run.trials
    )
    return replace(run, trials=tuple(trials))
