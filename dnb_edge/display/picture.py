"""The terminal board's picture and its printed lines, as pure functions of a `BoardState`.

Fits 80 x 24 with three rows to spare for printed lines; large digits can be read from two metres. Knows rich's
renderables; knows no console, no thread and no clock.
"""

from __future__ import annotations

from dataclasses import dataclass

from rich import box
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from dnb_edge import values
from dnb_edge.display.car_board import Phase
from dnb_edge.display.standings_table import LEAST_CARS, standings_table
from dnb_edge.display.state import BoardState, news_since

MAX_WIDTH = 100
ROWS_BESIDE_LAPS = 16
"""Rows of the picture without its table rows, and three for printed lines."""
WARNINGS_SHOWN = 2
HEADLINE_CHARS = 7
"""Large characters for which a board of 80 columns has room; a lap of 1,000 s loses decimals."""

# Five rows of three pixels a glyph, `#` lit.
_FONT = {
    "0": ("###", "# #", "# #", "# #", "###"),
    "1": (" # ", "## ", " # ", " # ", "###"),
    "2": ("###", "  #", "###", "#  ", "###"),
    "3": ("###", "  #", "###", "  #", "###"),
    "4": ("# #", "# #", "###", "  #", "  #"),
    "5": ("###", "#  ", "###", "  #", "###"),
    "6": ("###", "#  ", "###", "# #", "###"),
    "7": ("###", "  #", "  #", "  #", "  #"),
    "8": ("###", "# #", "###", "# #", "###"),
    "9": ("###", "# #", "###", "  #", "###"),
    ".": (" ", " ", " ", " ", "#"),
    "-": ("   ", "   ", "###", "   ", "   "),
}


@dataclass(frozen=True, slots=True)
class LargeDigits:
    """`text` of digits, dots and hyphens, five rows high, as a rich renderable."""

    text: str
    style: str

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Five lines; blocks where the console has them, number signs where it is ASCII only."""
        pixel = "##" if options.ascii_only else "██"
        for row in range(5):
            line = " ".join(_FONT[char][row] for char in self.text)
            yield Text(line.replace(" ", "  ").replace("#", pixel), style=self.style, no_wrap=True, overflow="crop")


@dataclass(frozen=True, slots=True)
class _Board:
    state: BoardState

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        rows = max(2, min(8, console.height - ROWS_BESIDE_LAPS))
        state = self.state
        yield Panel(
            Group(_headline(state), _notice(state), _table(state, rows), Text(), _health(state)),
            title=_title(state),
            title_align="left",
            subtitle=f"dnb-edge{_saved(state)}",
            subtitle_align="right",
            border_style=_flash_style(state) if state.flashing else "blue",
            box=box.HEAVY if state.flashing else box.ROUNDED,
            width=min(MAX_WIDTH, options.max_width),
        )


def picture(state: BoardState) -> RenderableType:
    """The whole board."""
    return _Board(state)


def headline_text(state: BoardState) -> str:
    """What stands in large digits: the countdown; the running lap in tenths; the last lap while flashing and after the run."""
    if state.counting_down and state.race is not None:
        return "--.-" if state.race.countdown_s is None else f"{state.race.countdown_s:.0f}"
    if state.last_lap is not None and (state.flashing or state.phase is Phase.FINISHED):
        return f"{state.last_lap.time_s:.3f}"[:HEADLINE_CHARS]
    return "--.-" if state.running_s is None else f"{state.running_s:.1f}"


def seconds(time_s: float, sigma_s: float) -> str:
    """A time with its uncertainty, such as `12.483 s +- 2 ms`."""
    return f"{time_s:.3f} s +- {max(1, round(sigma_s * 1000))} ms"


def lap_line(lap: values.Lap) -> str:
    """The line printed for a complete lap, such as `lap 2  12.483 s +- 2 ms  similarity 95.8 %`."""
    parts = [f"lap {lap.number}", seconds(lap.time_s, lap.sigma_s)]
    if lap.penalty_s > 0:
        parts.append(f"+{lap.penalty_s:.3f} s penalty")
    if lap.similarity_percent is not None:
        parts.append(f"similarity {lap.similarity_percent:.1f} %")
    if not lap.valid:
        parts.append("NOT VALID: " + "; ".join(lap.reasons))
    if lap.suspect:
        parts.append("SUSPECT: " + "; ".join(lap.suspect))
    return "  ".join(parts)


def printed_lines(earlier: BoardState | None, later: BoardState) -> list[str]:
    """What has happened between two boards, a line each: phases, laps and new warnings."""
    several = len(later.cars) > 1
    lines = [_news_line(one, later if several else None) for one in news_since(earlier, later)]
    if earlier is None or earlier.phase is not later.phase:
        who = _who(later, later.shown.car) if several else "the car"
        lines.append(f"{who} crosses the start line, lap 1 begins" if later.lap_number == 1 else later.state_line)
    if later.race is not None and (earlier is None or earlier.race != later.race) and later.race.text:
        lines.append(later.race.text)
    known = () if earlier is None or earlier.health is None else earlier.health.warnings
    warnings = () if later.health is None else later.health.warnings
    notes = () if later.health is None else later.health.notes
    noted = () if earlier is None or earlier.health is None else earlier.health.notes
    noticed = None if earlier is None else earlier.notice
    return [
        *lines,
        *([] if later.notice in {None, noticed} else [f"notice: {later.notice}"]),
        *(f"warning: {warning}" for warning in warnings if warning not in known),
        *(f"note: {note}" for note in notes if note not in noted),
    ]


def _news_line(news: values.Lap | values.Incident, among: BoardState | None) -> str:
    """With the car that it is of, where it is one `among` several."""
    line = lap_line(news) if isinstance(news, values.Lap) else news.text
    return line if among is None else f"{_who(among, news.car)}  {line}"


def _who(state: BoardState, car: int) -> str:
    """The car's number, and its name where standings have told one."""
    number = f"car {car}"
    rows = () if state.standings is None else state.standings.rows
    name = next((row.name for row in rows if row.car == car), number)
    return number if name == number else f"{number} {name}"


def _title(state: BoardState) -> Text:
    on = any(car.phase is not Phase.FINISHED for car in state.cars)
    told = len(state.cars) > 1 and state.phase is not Phase.WAITING and on
    leads = f"{_who(state, state.shown.car)}, " if told else ""
    title = Text(f" {leads}{state.state_line}{', car not seen' if state.unseen else ''} ", style="bold")
    if state.health is not None and state.health.view_moved_m is not None:
        title.append("CAMERA MOVED ", style="bold red")
    return title


def _notice(state: BoardState) -> Text:
    """What people at the box are to read; an empty line where there is no such thing."""
    return Text() if state.notice is None else Text(f" {state.notice} ", style="bold reverse", no_wrap=True)


def _saved(state: BoardState) -> str:
    """How many laps, of all cars, are on a disk; nothing where none is recorded."""
    saved = None if state.health is None else state.health.saved_laps
    return "" if saved is None else f", {saved} {'lap' if saved == 1 else 'laps'} saved"


def _headline(state: BoardState) -> RenderableType:
    facts = Table.grid(padding=(0, 1))
    for width in (5, 10, 7):
        facts.add_column(min_width=width)
    for name, lap in (("last", state.last_lap), ("best", state.best_lap)):
        style = "bold green" if name == "best" else "bold"
        facts.add_row(
            Text(name, style="dim"),
            Text("-" if lap is None else f"{lap.time_s:.3f} s", style=style, justify="right"),
            Text("" if lap is None else f"lap {lap.number}", style="dim"),
        )
        facts.add_row(*_comparison(state) if name == "last" else _so_far(state))
    last = state.last_lap
    score = "-" if last is None or last.similarity_percent is None else f"{last.similarity_percent:.1f} %"
    facts.add_row(Text("score", style="dim"), Text(score, style="bold", justify="right"))
    grid = Table.grid(expand=True, padding=(0, 1))
    grid.add_column(ratio=1)
    grid.add_column(justify="right")
    style = _flash_style(state) if state.flashing or state.phase is Phase.FINISHED else "bold cyan"
    grid.add_row(LargeDigits(headline_text(state), style), facts)
    return grid


def _comparison(state: BoardState) -> tuple[Text, ...]:
    """The running lap against the best one at the same place; nothing before there is one."""
    running = state.shown.running
    if running is None or running.delta_s is None:
        return ()
    style = "green" if running.delta_s < 0 else "yellow"
    return Text("delta", style="dim"), Text(f"{running.delta_s:+.2f} s", style=style, justify="right")


def _so_far(state: BoardState) -> tuple[Text, ...]:
    """The path similarity of the running lap so far."""
    running = state.shown.running
    if running is None or running.similarity_percent is None:
        return ()
    return Text("now", style="dim"), Text(f"{running.similarity_percent:.1f} %", justify="right")


def _flash_style(state: BoardState) -> str:
    return "bold red" if state.last_lap is not None and not state.last_lap.valid else "bold green"


def _table(state: BoardState, rows: int) -> RenderableType:
    """The laps of the only car, or the standings of several."""
    if state.standings is not None and len(state.standings.rows) >= LEAST_CARS:
        return standings_table(state.standings, rows)
    return _lap_table(state, rows)


def _lap_table(state: BoardState, rows: int) -> RenderableType:
    table = Table(box=None, expand=True, padding=(0, 1), header_style="dim")
    table.add_column("lap", justify="right", width=4)
    table.add_column("time", justify="right", width=10)
    table.add_column("+-", justify="right", width=8)
    table.add_column("similarity", justify="right", width=11)
    table.add_column("", ratio=1, no_wrap=True, overflow="ellipsis")
    shown = state.laps[-rows:]
    for lap in shown:
        best = state.best_lap is not None and lap.number == state.best_lap.number
        score = "-" if lap.similarity_percent is None else f"{lap.similarity_percent:.1f} %"
        # Text, never markup: a reason may hold brackets.
        suspect = [f"suspect: {text}" for text in lap.suspect]
        penalty = [f"+{lap.penalty_s:.1f} s"] if lap.penalty_s > 0 else []
        remark = Text("; ".join([*suspect, *penalty, *(["best"] if best else lap.reasons)]))
        sigma = f"{max(1, round(lap.sigma_s * 1000))} ms"
        style = "red" if not lap.valid or lap.suspect else "bold green" if best else ""
        table.add_row(str(lap.number), f"{lap.time_s:.3f} s", sigma, score, remark, style=style)
    for _ in range(rows - len(shown)):
        table.add_row()
    return table


_RECORDING = {"none": "no recording", "failed": "recording failed"}
_RECORDING_STYLE = {"failed": "bold red"}


def _health(state: BoardState) -> RenderableType:
    health = state.health
    if health is None:
        return Text("no health report yet", style="dim")
    facts = Text(style="dim", no_wrap=True, overflow="ellipsis")
    facts.append("- fps" if health.fps is None else f"{health.fps:.1f} fps")
    facts.append(f"   car in {health.detected_frames} of {health.frames} frames")
    facts.append("   ")
    facts.append(f"display {health.display}", style="bold red" if health.display == "offline" else "dim")
    facts.append("   ")
    facts.append(
        _RECORDING.get(health.recording, health.recording), style=_RECORDING_STYLE.get(health.recording, "dim")
    )
    warnings = [
        Text(f"! {warning}", style=_warning_style(health, warning), no_wrap=True, overflow="ellipsis")
        for warning in health.warnings[:WARNINGS_SHOWN]
    ]
    free = WARNINGS_SHOWN - len(warnings)
    notes = [Text(f"? {note}", no_wrap=True, overflow="ellipsis") for note in health.notes[:free]]
    return Group(facts, *warnings, *notes)


def _warning_style(health: values.Health, warning: str) -> str:
    """Red for what makes laps suspect, yellow for the rest."""
    return "bold red" if health.view_moved_m is not None and warning.startswith("camera ") else "yellow"
