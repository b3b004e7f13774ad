"""The board in a terminal: the running lap in large digits, the laps below, and a printed line for every lap.

Where the console is no terminal it prints plain lines only. A thread of its own paints, so that a stopped terminal
(Ctrl-S, a full pipe) never stops the race. Knows rich; knows no race rules.
"""

from __future__ import annotations

import errno
import os
import threading
from typing import NoReturn

from rich.console import Console
from rich.live import Live

from dnb_edge.display.base import ClosesOnExit, DisplayStatus, Mailbox
from dnb_edge.display.picture import picture, printed_lines
from dnb_edge.display.state import BoardState

PERIOD_S = 0.1
"""Shortest time between two pictures, so that tenths of a second run, seconds."""

CLOSE_S = 1.0


class BoardConsole(Console):
    """A console whose reader may go away: rich's own would then put the process's stdout to /dev/null and exit."""

    def on_broken_pipe(self) -> NoReturn:
        """Raise what happened."""
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))


class TerminalDisplay(ClosesOnExit):
    """A `Display` on `console`, by default the process's stderr. Log through the same console: the board stays whole."""

    def __init__(self, console: BoardConsole | None = None) -> None:
        self._console = BoardConsole(stderr=True) if console is None else console
        self._mailbox = Mailbox()
        self._fault: str | None = None
        self._thread = threading.Thread(target=self._paint, name="display-terminal", daemon=True)
        self._thread.start()

    @property
    def status(self) -> DisplayStatus:
        """Online until the console fails or `close` is called."""
        return DisplayStatus.ONLINE if self._thread.is_alive() else DisplayStatus.OFFLINE

    @property
    def fault(self) -> str | None:
        """Why nothing is painted any more."""
        return self._fault

    @property
    def stuck(self) -> bool:
        """True where the board was closed and the terminal still does not take the last picture."""
        return self._mailbox.closed and self._thread.is_alive()

    def post(self, state: BoardState) -> None:
        """Show `state` at the next picture."""
        self._mailbox.put(state)

    def close(self) -> None:
        """Paint the last state and give the terminal back."""
        self._mailbox.close()
        self._thread.join(timeout=CLOSE_S)

    def _paint(self) -> None:
        try:
            if self._console.is_terminal and not self._console.is_dumb_terminal:
                # stdout belongs to --json and must not be drawn into the board.
                with Live(console=self._console, auto_refresh=False, redirect_stdout=False) as live:
                    self._follow(live)
            else:
                self._follow(None)
        except (OSError, ValueError) as error:
            # ValueError is what a closed stream raises; either way there is nobody left to tell but `fault`.
            self._fault = f"the terminal does not take the board: {error}"

    def _follow(self, live: Live | None) -> None:
        shown: BoardState | None = None
        closing = False
        while not closing:
            closing = self._mailbox.closed
            state = self._mailbox.take(pause_s=PERIOD_S, patience_s=1.0)
            if state is None or (state is shown and not closing):
                continue
            for line in printed_lines(shown, state):
                self._console.print(line, markup=False, highlight=False, soft_wrap=True)
            if live is not None:
                live.update(picture(state), refresh=True)
            shown = state
