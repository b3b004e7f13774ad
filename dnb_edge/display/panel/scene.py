"""What matters most on a panel at a moment, whatever its size: the running lap, a new lap, the countdown, silence ...

Knows what was told and the display's clock. Knows no pixels. Runs on MicroPython.
"""

from .state import CROSS_MS, GO_MS, LAP_MS, Lap, Panel

FRAME_MS = 40
"""Pictures change at multiples of this only."""
FACE_MS = 4000
"""How long a face stands between two passes of its messages."""

START, SILENT, COUNT, GO, LAP, RUN, END, GRID, OUT, WAIT = range(10)
"""START: nothing was ever heard. SILENT: nothing for three seconds. LAP: one was just completed. WAIT: there is no car yet."""

_BUSY = (COUNT, GO, LAP)
"""Too short for a message to run through."""
_WORDS = {"FINISHED": END, "OUT-LAP": OUT}


class Scene:
    """What to show of `panel` at `t_ms`, which is brought down to a multiple of `FRAME_MS`."""

    def __init__(self, panel: Panel, t_ms: int) -> None:
        self.t_ms = t_ms - t_ms % FRAME_MS
        self.panel = panel
        self.told = panel.shown
        self.what = self._what()
        self.lap = self.told.last or Lap(0, 0, 0, valid=True, similarity=None)
        """The latest complete lap; zeros before one."""
        self.note = self.told.note.replace("http://", "")
        self.better = self.what == LAP and _is_of(panel.bettered, self.told.last)
        """True where the lap that has just been completed is the best one."""
        self.texts = self._texts()

    def _what(self) -> int:
        panel, told = self.panel, self.told
        if panel.heard_at is None:
            return START
        if panel.silent(self.t_ms):
            return SILENT
        if told.race == "COUNT":
            return COUNT
        if told.race == "GO" and self._since(panel.went_at) < GO_MS:
            return GO
        if panel.lapped is not None and _is_of(panel.lapped, told.last) and self._since(panel.lapped[1]) < LAP_MS:
            return LAP
        if told.run_ms is not None:
            return RUN
        return GRID if told.race == "GRID" else _WORDS.get(told.word, WAIT)

    def _since(self, at_ms: int | None) -> int:
        """Milliseconds since `at_ms`; very many where that never was."""
        return 1 << 29 if at_ms is None else max(0, self.t_ms - at_ms)

    @property
    def crossing(self) -> bool:
        """True for a moment after the car crossed the line."""
        return self._since(self.panel.crossed_at) < CROSS_MS

    @property
    def moves(self) -> bool:
        """False where nothing changes by itself for now."""
        still = (GRID, OUT, WAIT, END) if self.told.best is None else (GRID, OUT, WAIT)
        return self.what not in still or bool(self.texts) or self.crossing

    def blink(self, on_ms: int, off_ms: int) -> bool:
        """True for `on_ms`, false for `off_ms`, and so on."""
        return self.t_ms % (on_ms + off_ms) < on_ms

    def _texts(self) -> list[str]:
        """What people should read, the most urgent first."""
        told = self.told
        if self.what <= SILENT:
            return []
        texts = []
        if self.note:
            texts.append(self.note)
        if told.camera_lost:
            texts.append("CAMERA LOST")
        texts += told.warnings
        if self.what == GRID:
            texts.append(told.race_text)
        if told.last is not None and told.last.reasons:
            texts += ["lap %d: %s" % (told.last.number, reason) for reason in told.last.reasons]
        if told.recording == "FAILED":
            texts.append("NOT RECORDING")
        return texts

    def passing(self, room: int, length: int, step_ms: int) -> int | None:
        """Where a message of `length` begins that runs through `room` from the right; None while the face stands."""
        if self.what in _BUSY or self.crossing or not self.texts:
            return None
        at = self.t_ms % (FACE_MS + (room + length) * step_ms)
        return None if at < FACE_MS else room - (at - FACE_MS) // step_ms

    @property
    def count(self) -> str:
        """The countdown in whole seconds; empty where nobody may know."""
        left = self.panel.race_left_tenths(self.t_ms)
        return "" if left is None else str((left + 9) // 10)

    @property
    def running_ms(self) -> int:
        """The running lap's time."""
        return self.panel.running_ms(self.t_ms) or 0

    @property
    def lap_of(self) -> str:
        """`2/3`, `2`; empty where no lap is running."""
        told = self.told
        if told.lap is None:
            return "" if told.run_lap is None else str(told.run_lap)
        return str(told.lap) if told.laps_wanted is None else "%d/%d" % (told.lap, told.laps_wanted)


def _is_of(moment: tuple[int, int] | None, lap: Lap | None) -> bool:
    """True where the moment is this lap's."""
    return moment is not None and lap is not None and moment[0] == lap.number


def seconds(ms: int, places: int) -> str:
    """`12.483` of 12483 with three places; cut, not rounded, so that a time that runs never jumps ahead."""
    whole, rest = ms // 1000, ms % 1000
    return "%d.%s" % (whole, ("%03d" % rest)[:places]) if places else str(whole)


def first_that_fits(ms: int, places: int, fits) -> str:
    """`ms` in seconds with as many places, at most `places`, as `fits(text)` allows; whole seconds in the worst case."""
    for wanted in range(places, 0, -1):
        text = seconds(ms, wanted)
        if fits(text):
            return text
    return seconds(ms, 0)


def signed(ms: int) -> str:
    """`+0.21`, `-0.21`: hundredths."""
    return ("-" if ms < 0 else "+") + seconds(abs(ms), 2)
