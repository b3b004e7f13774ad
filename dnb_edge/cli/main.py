"""The command `dnb-edge`: its verbs, and what an error means to the shell.

Exit codes, on which scripts may rely: 0 done, 1 the work failed, 2 the input or the configuration is wrong. Every error
that we foresee is one line on stderr.
"""

from __future__ import annotations

import logging
import os
import sys
from typing import Annotated

import typer

from dnb_edge import __version__
from dnb_edge.cli.verbs import Verbs
from dnb_edge.errors import DnbEdgeError, InputError

LONGEST_LINE = 1000
"""Characters of an error that are told; what is cut out is in the middle, since it begins with a name and ends with advice."""

app = typer.Typer(
    cls=Verbs,
    help="Times and scores small self-driving cars from one overhead camera. Start with `dnb-edge demo`.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"dnb-edge {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Times and scores small self-driving cars from one overhead camera. Start with `dnb-edge demo`."""


def main() -> None:
    """Entry point of the command: runs the verb and exits with its code.

    Typer itself answers wrong options (code 2), Ctrl-C where no verb does (130) and a reader of stdout that went away (1).
    An `OSError` that comes so far is of stdout, on a full disk, say: whoever uses another file says so by itself.
    """
    logging.basicConfig(level=logging.WARNING, format="dnb-edge: %(message)s", stream=sys.stderr)
    try:
        app()
    except DnbEdgeError as error:
        _say(str(error))
        sys.exit(2 if isinstance(error, InputError) else 1)
    except OSError as error:
        _say(f"{error.filename or 'stdout'}: {error.strerror}")
        # What waits to be written cannot be, and would fail once more at the very end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.exit(1)


def _say(text: str) -> None:
    """One line on stderr, whatever the error's text holds: it may quote a value as long as a book."""
    line = " ".join(text.split())
    if len(line) > LONGEST_LINE:
        line = f"{line[: LONGEST_LINE // 2]} ... {line[-LONGEST_LINE // 2 :]}"
    sys.stderr.write(f"dnb-edge: {line}\n")
