"""`dnb-edge display`: a lap display without the display, drawn by the code that a real one runs."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.live import Live

from dnb_edge.cli.display_flash import flash
from dnb_edge.display.panel import face
from dnb_edge.display.panel.state import Panel
from dnb_edge.display.simulator import Surface, in_terminal, png
from dnb_edge.display.simulator_line import Line, input_line, own_line, port_line
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole

app = typer.Typer(help="Try out a lap display, and put its software on a real one.", invoke_without_command=True)

AFTER_S = 0.5
"""From the last line to the picture that is written: what flashes at a crossing is over."""

app.command("flash")(flash)


@app.callback()
def display(
    context: typer.Context,
    *,
    simulate: Annotated[bool, typer.Option("--simulate", help="Draw the display in this terminal.")] = False,
    layout: Annotated[str, typer.Option(help=f"Which panel: {', '.join(face.LAYOUTS)}.")] = "matrix-64x32",
    port: Annotated[
        str | None,
        typer.Option(help="Read a serial port or a file of lines; - reads standard input. Default: a line of its own."),
    ] = None,
    link: Annotated[
        Path | None, typer.Option(help="A name for the line of its own, so that a configuration can hold it.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option("--png", help="Write the picture half a second after the last line here, at the end.")
    ] = None,
    by_hand: Annotated[
        bool, typer.Option("--by-hand", help="Take lines without a checksum, too, for typing them.")
    ] = False,
) -> None:
    """Draw what a display would show, pixel by pixel, until Ctrl-C or the input's end.

    dnb-edge display --simulate --layout oled-128x64

    It says which port to give to `dnb-edge run --display`. The same code runs on the display's microcontroller.
    """
    if context.invoked_subcommand is not None:
        return
    if not simulate:
        typer.echo(context.get_help())
        return
    if layout not in face.LAYOUTS:
        raise InputError(f"--layout {layout}: must be one of {', '.join(face.LAYOUTS)}")
    if picture is not None and picture.suffix.lower() != ".png":
        raise InputError(f"--png {picture}: the name must end in .png")
    if link is not None and port is not None:
        raise InputError("--link: names a line of its own: leave --port out")
    surface, panel = face.surface(layout), Panel(not by_hand)
    console = Console()
    with _line(port, link) as line:
        if port is None:
            console.print(f"Now, in another terminal: dnb-edge run --display serial:{line.name}", highlight=False)
        fed_ms = _follow(line, panel, surface, console)
    if picture is not None:
        face.draw(panel, surface, fed_ms + int(1000 * AFTER_S))
        write_whole(picture, png(surface))
    if not console.is_terminal:
        console.print(f"{panel.lines} lines obeyed, {panel.dropped} thrown away", highlight=False)


def _line(port: str | None, link: Path | None) -> AbstractContextManager[Line]:
    if port is None:
        return own_line(link)
    return input_line() if port == "-" else port_line(Path(port))


def _follow(line: Line, panel: Panel, surface: Surface, console: Console) -> int:
    """Draws until the line ends or Ctrl-C is pressed; returns when the last bytes came, milliseconds."""
    began_s = time.monotonic()
    fed_ms = 0
    colour = console.color_system is not None and not console.no_color
    # Where the console is no terminal nobody looks.
    with Live(console=console, auto_refresh=False) as live:
        try:
            due_ms, now_ms = 0, 0
            while (data := line.read((due_ms - now_ms) * 1e-3)) is not None:
                now_ms = int(1000.0 * (time.monotonic() - began_s))
                if data:
                    fed_ms = now_ms
                if panel.feed(data, now_ms) or now_ms >= due_ms:
                    if console.is_terminal:
                        face.draw(panel, surface, now_ms)
                        live.update(in_terminal(surface, colour=colour), refresh=True)
                    due_ms = face.next_change(panel, surface, now_ms)
        except KeyboardInterrupt:
            pass
    return fed_ms
