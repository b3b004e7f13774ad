"""What a display knows: the line protocol's state as it was last told in full, and the moments at which things happened.

`HELLO` forgets, `RUN` draws: a panel always shows whole groups of lines. Knows no pixels. Runs on MicroPython. Times are
milliseconds, those of the display's own clock end in `_at` or are called `t_ms`; that clock never wraps.
"""

from .grammar import parse
from .line import Lines

SILENT_MS = 3000
"""Without a line for so long the appliance is silent."""
CROSS_MS = 400
LAP_MS = 4000
GO_MS = 2000
"""How long a crossing, a complete lap and the start are shown."""
LAPS_KEPT = 8
WARNINGS_KEPT = 4
REASONS_KEPT = 2
PLACES_KEPT = 8
COUNT_ON_MS = 1500
"""Longest that the running time counts on by itself."""
STEP_BACK_MS = 20
_JUMP_MS = 300
"""A running time that is off by more than this is believed at once; anything less is the line's own delay."""


class Lap:
    """A complete lap: milliseconds, tenths of a percent or None, its reasons as texts."""

    def __init__(self, number: int, time_ms: int, sigma_ms: int, valid: bool, similarity: int | None) -> None:
        self.number = number
        self.time_ms = time_ms
        self.sigma_ms = sigma_ms
        self.valid = valid
        self.similarity = similarity
        self.penalty_ms = 0
        self.reasons: tuple[str, ...] = ()

    @property
    def official_ms(self) -> int:
        """The time with its penalties."""
        return self.time_ms + self.penalty_ms

    def but(self, penalty_ms: int, reasons: tuple) -> "Lap":
        """The same lap with other penalties and reasons."""
        lap = Lap(self.number, self.time_ms, self.sigma_ms, self.valid, self.similarity)
        lap.penalty_ms, lap.reasons = penalty_ms, reasons
        return lap


_FIELDS = (
    "car", "name", "word", "lap", "laps_wanted", "race", "race_text", "race_tenths", "race_at", "laps", "best", "delta_ms",
    "similarity", "saved", "fps", "recording", "warnings", "note", "places", "run_lap", "run_ms",
)  # fmt: skip


class Told:
    """What was told since `HELLO`. Values are replaced and never changed, so that a copy may share them."""

    def __init__(self) -> None:
        self.car: int | None = None
        self.name = ""
        self.word = ""
        """WAITING, OUT-LAP, LAP or FINISHED; empty before it is told."""
        self.lap: int | None = None
        self.laps_wanted: int | None = None
        self.race = ""
        """GRID, COUNT or GO; empty where there is no such thing."""
        self.race_text = ""
        self.race_tenths: int | None = None
        self.race_at = 0
        self.laps: tuple[Lap, ...] = ()
        self.best: tuple[int, int] | None = None
        """Number and time of the best lap."""
        self.delta_ms: int | None = None
        self.similarity: int | None = None
        self.saved: int | None = None
        self.fps: int | None = None
        """Tenths of a frame a second; None where no frames come."""
        self.recording = ""
        self.warnings: tuple[str, ...] = ()
        self.note = ""
        self.places: tuple = ()
        """As the grammar reads them, the first place first."""
        self.run_lap: int | None = None
        self.run_ms: int | None = None

    def copy(self) -> "Told":
        """The same."""
        other = Told()
        for name in _FIELDS:
            setattr(other, name, getattr(self, name))
        return other

    def facts(self) -> tuple:
        """Everything that is told, for comparing; laps as tuples, no moments."""
        laps = tuple([(one.number, one.time_ms, one.sigma_ms, one.valid, one.similarity, one.penalty_ms, one.reasons)
                      for one in self.laps])  # fmt: skip
        rest = [getattr(self, name) for name in _FIELDS if name not in ("laps", "race_at")]
        return (laps, tuple(rest))

    @property
    def last(self) -> Lap | None:
        """The latest complete lap; None before one."""
        return self.laps[-1] if self.laps else None

    @property
    def camera_lost(self) -> bool:
        """True where no frames come and a warning says why."""
        return self.recording != "" and not self.fps and bool(self.warnings)


class Panel:
    """Feed it what the port gives; `shown` is what to draw."""

    def __init__(self, strict: bool = True) -> None:
        self.shown = Told()
        self.lines = 0
        """Lines that were obeyed."""
        self.heard_at: int | None = None
        """When a right line last came; None before one."""
        self.crossed_at: int | None = None
        self.lapped: tuple[int, int] | None = None
        self.bettered: tuple[int, int] | None = None
        """The lap that was just told, or was the best one as it was told, and when."""
        self.went_at: int | None = None
        """When the race began, where that was seen."""
        self._lines = Lines(strict)
        self._misspelt = 0
        self._next = Told()
        self._repaints = False
        self._new_lap: int | None = None
        self._new_best: int | None = None
        self._base_ms = 0
        """The running time less the display's clock."""
        self._run_at = 0
        self._stands = False

    @property
    def dropped(self) -> int:
        """Lines that were thrown away."""
        return self._lines.dropped + self._misspelt

    def silent(self, t_ms: int) -> bool:
        """True where no right line came for three seconds, or ever."""
        return self.heard_at is None or t_ms - self.heard_at >= SILENT_MS

    def running_ms(self, t_ms: int) -> int | None:
        """The running lap's time, counted on since it was last told; None where no lap is running."""
        told_ms = self.shown.run_ms
        if told_ms is None or self._stands:
            return told_ms
        return max(0, self._base_ms + min(t_ms, self._run_at + COUNT_ON_MS))

    def race_left_tenths(self, t_ms: int) -> int | None:
        """Of the countdown or of the race: tenths of a second left, counted on; None where nobody may know."""
        left = self.shown.race_tenths
        if left is None:
            return None
        # A countdown ends with GO only, so it stands at its last tenth.
        return max(0, left - max(0, min(t_ms - self.shown.race_at, 1000)) // 100)

    def feed(self, data: bytes, t_ms: int) -> bool:
        """Obeys the lines that end within `data`; True where the picture may have changed. Never raises."""
        changed = False
        for body in self._lines.feed(data):
            words = parse(body)
            if words is None:
                self._misspelt += 1
                continue
            # Coming back from silence is a change, too.
            changed |= self.silent(t_ms)
            self.heard_at = t_ms
            self.lines += 1
            changed |= self._obey(words, t_ms)
        return changed

    def _obey(self, words: list, t_ms: int) -> bool:
        kind, said = words[0], words[1:]
        if kind == "HELLO":
            self._next, self._repaints = Told(), True
            self._new_lap = self._new_best = None
        elif kind == "CROSS":
            self.crossed_at = t_ms
        elif kind == "RUN":
            self._run(said, t_ms)
        elif kind in _RULES:
            _RULES[kind](self._next, said)
            self._notice(kind, said, t_ms)
        return kind in ("RUN", "CROSS")

    def _notice(self, kind: str, said: list, t_ms: int) -> None:
        """News that a panel makes more of than what stands."""
        if kind in ("COUNT", "GO"):
            self._next.race_at = t_ms
        last = self.shown.last
        # A repaint whose first line was lost looks like news.
        if kind == "LAP" and not self._repaints and (last is None or last.number != said[0]):
            self._new_lap = said[0]
        if kind == "BEST" and not self._repaints:
            self._new_best = said[0]

    def _run(self, said: list, t_ms: int) -> None:
        lap, told_ms = (None, None) if said[0] == "-" else said
        self._count(lap, told_ms, t_ms)
        if self._next.race == "GO" and self.shown.race == "COUNT":
            self.went_at = t_ms
        self._next.run_lap, self._next.run_ms = lap, told_ms
        self.shown = self._next.copy()
        if self._new_lap is not None:
            self.lapped = (self._new_lap, t_ms)
        if self._new_best is not None:
            self.bettered = (self._new_best, t_ms)
        self._new_lap = self._new_best = None
        self._repaints = False

    def _count(self, lap: int | None, told_ms: int | None, t_ms: int) -> None:
        """Where the running time counts on from: a line that came late makes it neither jump nor run backwards."""
        if told_ms is None:
            return
        same = lap == self.shown.run_lap and self.shown.run_ms is not None
        self._stands = same and told_ms == self.shown.run_ms and (self._stands or t_ms - self._run_at >= 150)
        behind = self._base_ms + t_ms - told_ms
        if not same or self._stands or not 0 <= behind <= _JUMP_MS:
            behind = 0
        # The least delayed line is right; what is too early by it is lost in steps that are shorter than a frame.
        self._base_ms = told_ms - t_ms + behind - min(behind, max(4, min(STEP_BACK_MS, behind // 4)))
        self._run_at = t_ms


def _car(told: Told, said: list) -> None:
    told.car, told.name = said


def _state(told: Told, said: list) -> None:
    told.word = said[0]
    told.lap = said[1] if len(said) > 1 else None
    told.laps_wanted = said[3] if len(said) > 3 else None


def _grid(told: Told, said: list) -> None:
    told.race, told.race_text, told.race_tenths = "GRID", said[0], None


def _start(race: str):
    def obey(told: Told, said: list) -> None:
        told.race, told.race_text, told.race_tenths = race, "", said[0]

    return obey


def _lap(told: Told, said: list) -> None:
    number, time_ms, sigma_ms, verdict, similarity = said
    others = tuple([one for one in told.laps if one.number != number])
    lap = Lap(number, time_ms, sigma_ms, verdict == "OK", similarity)
    told.laps = (others + (lap,))[-LAPS_KEPT:]


def _change(told: Told, number: int, penalty_ms: int, reason: str) -> None:
    """A penalty or a reason of a lap that was told before."""
    told.laps = tuple([
        one if one.number != number
        else one.but(one.penalty_ms + penalty_ms, (one.reasons + ((reason,) if reason else ()))[:REASONS_KEPT])
        for one in told.laps
    ])  # fmt: skip


def _penalty(told: Told, said: list) -> None:
    _change(told, said[0], said[1], "")


def _why(told: Told, said: list) -> None:
    _change(told, said[0], 0, said[1])


def _best(told: Told, said: list) -> None:
    told.best = (said[0], said[1])


def _place(told: Told, said: list) -> None:
    others = [one for one in told.places if one[1] != said[1]]
    told.places = tuple(sorted(others + [tuple(said)], key=lambda one: (one[0][0], one[1])))[:PLACES_KEPT]


def _live(told: Told, said: list) -> None:
    told.delta_ms, told.similarity = said


def _saved(told: Told, said: list) -> None:
    told.saved = said[0]


def _health(told: Told, said: list) -> None:
    told.fps, told.recording, told.warnings = said[1], said[3], ()


def _warn(told: Told, said: list) -> None:
    told.warnings = (told.warnings + (said[1],))[:WARNINGS_KEPT]


def _note(told: Told, said: list) -> None:
    told.note = said[0]


def _pass_over(told: Told, said: list) -> None:
    """Another car's lap: the standings tell what matters of it."""


_RULES = {
    "CAR": _car,
    "STATE": _state,
    "GRID": _grid,
    "COUNT": _start("COUNT"),
    "GO": _start("GO"),
    "LAP": _lap,
    "PENALTY": _penalty,
    "WHY": _why,
    "SUSPECT": _why,
    "BEST": _best,
    "CARLAP": _pass_over,
    "PLACE": _place,
    "LIVE": _live,
    "SAVED": _saved,
    "HEALTH": _health,
    "WARN": _warn,
    "NOTE": _note,
}
