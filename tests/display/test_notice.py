"""A notice, such as the set-up code, on every kind of display; it is no part of the race."""

import io

from display_events import health, lap, race
from rich.console import Console

from dnb_edge.display import messages, protocol
from dnb_edge.display.picture import picture, printed_lines

CODE = "set-up code 4711 0815"


def bodies(told):
    return [message.body() for message in told]


def test_a_serial_display_is_told_at_once_and_with_each_repaint():
    """Before the group's last line; gone with a repaint without it, since no message takes a line back."""
    plain = race(2).after(health(warnings=("dark",)))
    noted = plain.noting(CODE)
    assert bodies(messages.news(plain, noted)) == [f"NOTE {CODE}", *bodies(messages.news(plain, plain))]
    assert bodies(messages.repaint(noted))[-2:] == [f"NOTE {CODE}", *bodies(messages.news(plain, plain))]
    assert bodies(messages.news(noted, plain)) == bodies(messages.repaint(plain))
    assert bodies(messages.news(noted, noted)) == bodies(messages.news(plain, plain))


def test_a_long_notice_fits_into_a_line():
    """As everything that a serial display is told."""
    line = protocol.encode_line(protocol.Note(text="x" * 200))
    assert len(line) <= protocol.MAX_LINE_BYTES


def test_the_terminal_shows_and_prints_it():
    """On the board for as long as it stands, above the laps, and once as a line, for the log; brackets are no markup."""
    state = race(1).noting("code [red]4711")
    shown = io.StringIO()
    Console(file=shown, width=80, height=24).print(picture(state))
    assert "code [red]4711" in shown.getvalue()
    without = io.StringIO()
    Console(file=without, width=80, height=24).print(picture(state.noting(None)))
    assert shown.getvalue().count("\n") == without.getvalue().count("\n")
    assert printed_lines(race(1), state) == ["notice: code [red]4711"]
    assert printed_lines(state, state.after(lap(2, 22.0)))[0].startswith("lap 2")
    assert printed_lines(state, state.noting(None)) == []


def test_a_notice_changes_nothing_of_the_race():
    """Laps, phases and times are those of the board without it, whenever it comes and goes."""
    with_it = race(1).noting(CODE).after(lap(2, 22.0)).at(30.0).noting(None)
    assert with_it == race(1).after(lap(2, 22.0)).at(30.0)
