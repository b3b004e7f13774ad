"""How the appliance did over a run, made small: a race of a second and one of a week fill the same few hundred slots.

Knows `Health` events and the frames' stamps. A slot keeps the worst of what it stands for, so that nothing bad disappears where
time is drawn together. Knows no picture and no page. Times are seconds from the run's first frame.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

from dnb_edge.values import Health

N = TypeVar("N", int, float)

MOST_SLOTS = 480
"""More than a picture has room for are drawn together, two by two."""

MOST_WARNINGS = 40
"""Different warnings that are told; those beyond are counted."""

MOST_INTERRUPTIONS = 100
"""The longest ones are told one by one; those beyond are counted."""

_NUMBER = re.compile(r"\d+(?:[.,]\d+)*")


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthSlot:
    """The worst of a stretch of time; None where no `Health` in it told that."""

    start_s: float
    end_s: float
    frames: int
    """Raced in it."""
    lost: Mapping[str, int]
    """Frames lost in it, by reason."""
    lost_share: float
    """The greatest share that was lost between one `Health` and the next, 0..1."""
    fps: float | None
    """The lowest."""
    latency_ms: float | None
    """The highest median of a period."""
    queued_frames: int | None
    disk_free_bytes: int | None
    """The lowest."""
    temperature_c: float | None
    throttled: bool
    memory_bytes: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Warned:
    """A warning, however often it was told; its numbers may have changed meanwhile."""

    text: str
    """As it was told first."""
    last_text: str
    first_s: float
    last_s: float
    told: int
    """In how many `Health` events."""
    spells: int
    """How many times it came up again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interruption:
    """A time in which no frame came."""

    start_s: float
    end_s: float

    @property
    def lasted_s(self) -> float:
        """How long."""
        return self.end_s - self.start_s


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthHistory:
    """A run's health."""

    slots: tuple[HealthSlot, ...]
    """In order, without overlap; a slot without any `Health` is left out."""
    slot_s: float
    """Length of a slot."""
    end_s: float
    """When the last `Health` was told."""
    warnings: tuple[Warned, ...]
    """By the time of their first telling."""
    more_warnings: int = 0
    """Different warnings that were told besides."""
    interruptions: tuple[Interruption, ...] = ()
    """In order: the longest ones."""
    more_interruptions: int = 0
    interrupted_s: float = 0.0
    """All interruptions together."""
    latency_p95_ms: float | None = None
    latency_p99_ms: float | None = None
    """Both over the whole run, as told last."""

    @property
    def frames(self) -> int:
        """Raced in all."""
        return sum(slot.frames for slot in self.slots)

    @property
    def lost(self) -> dict[str, int]:
        """Frames lost in all, by reason, the most frequent first."""
        total: Counter[str] = Counter()
        for slot in self.slots:
            total.update(slot.lost)
        return dict(total.most_common())


@dataclass(slots=True)
class _Slot:
    """A slot that is being filled."""

    frames: int = 0
    lost: Counter[str] = field(default_factory=Counter)
    lost_share: float = 0.0
    fps: float | None = None
    latency_ms: float | None = None
    queued_frames: int | None = None
    disk_free_bytes: int | None = None
    temperature_c: float | None = None
    throttled: bool = False
    memory_bytes: int | None = None

    def take(self, other: _Slot) -> None:
        """Takes in what another slot tells."""
        self.frames += other.frames
        self.lost.update(other.lost)
        self.lost_share = max(self.lost_share, other.lost_share)
        self.throttled = self.throttled or other.throttled
        self.fps = _of_both(min, self.fps, other.fps)
        self.latency_ms = _of_both(max, self.latency_ms, other.latency_ms)
        self.queued_frames = _of_both(max, self.queued_frames, other.queued_frames)
        self.disk_free_bytes = _of_both(min, self.disk_free_bytes, other.disk_free_bytes)
        self.temperature_c = _of_both(max, self.temperature_c, other.temperature_c)
        self.memory_bytes = _of_both(max, self.memory_bytes, other.memory_bytes)


@dataclass(slots=True)
class _Warning:
    text: str
    last_text: str
    first_s: float
    last_s: float
    told: int = 1
    spells: int = 1


class HealthFold:
    """Takes in `Health` events one by one, in bounded memory."""

    def __init__(self) -> None:
        """Nothing is known yet."""
        self._slot_s = 1.0
        self._slots: dict[int, _Slot] = {}
        self._end_s = 0.0
        self._frames = 0
        self._lost: dict[str, int] = {}
        self._percentiles: tuple[float | None, float | None] = (None, None)
        self._warnings: dict[str, _Warning] = {}
        self._more: set[str] = set()
        self._standing: frozenset[str] = frozenset()

    def add(self, health: Health) -> None:
        """Takes in the next one."""
        self._end_s = max(self._end_s, health.t_s)
        self._fit(health.t_s)
        lost = {one.reason: one.frames for one in health.lost}
        if not lost and health.dropped_frames:
            # Recordings from before there were reasons.
            lost = {"lost": health.dropped_frames}
        gone = Counter({reason: _since(self._lost.get(reason, 0), count) for reason, count in lost.items()})
        raced = _since(self._frames, health.frames)
        told = _Slot(
            frames=raced,
            lost=+gone,
            lost_share=gone.total() / max(1, raced + gone.total()),
            fps=health.fps,
            latency_ms=health.latency_ms,
            queued_frames=health.queued_frames,
            disk_free_bytes=health.disk_free_bytes,
            temperature_c=health.temperature_c,
            throttled=bool(health.throttled),
            memory_bytes=health.memory_bytes,
        )
        self._slots.setdefault(self._place(health.t_s), _Slot()).take(told)
        self._frames, self._lost = health.frames, lost
        if health.latency_p99_ms is not None:
            self._percentiles = (health.latency_p95_ms, health.latency_p99_ms)
        self._warned(health)

    def history(self, interruptions: Iterable[Interruption] = ()) -> HealthHistory | None:
        """What it came to, with the times in which no frame came; None where no `Health` was told."""
        if not self._slots:
            return None
        every = list(interruptions)
        longest = sorted(every, key=lambda one: one.lasted_s, reverse=True)[:MOST_INTERRUPTIONS]
        return HealthHistory(
            slots=tuple(self._told(place) for place in sorted(self._slots)),
            slot_s=self._slot_s,
            end_s=self._end_s,
            warnings=tuple(
                Warned(
                    text=one.text,
                    last_text=one.last_text,
                    first_s=one.first_s,
                    last_s=one.last_s,
                    told=one.told,
                    spells=one.spells,
                )
                for one in self._warnings.values()
            ),
            more_warnings=len(self._more),
            interruptions=tuple(sorted(longest, key=lambda one: one.start_s)),
            more_interruptions=len(every) - len(longest),
            interrupted_s=sum(one.lasted_s for one in every),
            latency_p95_ms=self._percentiles[0],
            latency_p99_ms=self._percentiles[1],
        )

    def _told(self, place: int) -> HealthSlot:
        slot = self._slots[place]
        return HealthSlot(
            start_s=place * self._slot_s,
            end_s=(place + 1) * self._slot_s,
            frames=slot.frames,
            lost=dict(slot.lost),
            lost_share=slot.lost_share,
            fps=slot.fps,
            latency_ms=slot.latency_ms,
            queued_frames=slot.queued_frames,
            disk_free_bytes=slot.disk_free_bytes,
            temperature_c=slot.temperature_c,
            throttled=slot.throttled,
            memory_bytes=slot.memory_bytes,
        )

    def _place(self, t_s: float) -> int:
        return max(0, int(t_s // self._slot_s))

    def _fit(self, t_s: float) -> None:
        """Makes the slots longer until there is one for `t_s`."""
        while self._place(t_s) >= MOST_SLOTS:
            self._slot_s *= 2.0
            before, self._slots = self._slots, {}
            for place in sorted(before):
                self._slots.setdefault(place // 2, _Slot()).take(before[place])

    def _warned(self, health: Health) -> None:
        kinds = {_NUMBER.sub("#", text): text for text in health.warnings}
        for kind, text in kinds.items():
            known = self._warnings.get(kind)
            if known is not None:
                known.last_text, known.last_s = text, health.t_s
                known.told += 1
                known.spells += kind not in self._standing
            elif len(self._warnings) < MOST_WARNINGS:
                self._warnings[kind] = _Warning(text, text, health.t_s, health.t_s)
            elif len(self._more) < 10 * MOST_WARNINGS:
                self._more.add(kind)
        self._standing = frozenset(kinds)


def interruptions(frames_t_ns: Iterable[int], *, longer_than_s: float) -> list[Interruption]:
    """The times between two frames that are longer than `longer_than_s`; stamps, ns, rising."""
    found: list[Interruption] = []
    first_ns = last_ns = None
    for t_ns in frames_t_ns:
        if first_ns is None or last_ns is None:
            first_ns = t_ns
        elif (t_ns - last_ns) * 1e-9 > longer_than_s:
            found.append(Interruption(start_s=(last_ns - first_ns) * 1e-9, end_s=(t_ns - first_ns) * 1e-9))
        last_ns = t_ns
    return found


def _since(before: int, now: int) -> int:
    """What a counter grew by; it begins anew where a race goes on in another process."""
    return now - before if now >= before else now


def _of_both(pick: Callable[..., N], one: N | None, other: N | None) -> N | None:
    if one is None or other is None:
        return other if one is None else one
    return pick(one, other)
