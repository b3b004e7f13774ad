"""The verbs of the command line, each imported when it is called: nobody waits for the pictures of a report to start a race.

Knows where each verb is. Knows nothing of what they do.
"""

from __future__ import annotations

from difflib import get_close_matches
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperGroup

VERBS = {
    "demo": "demo:demo",
    "run": "run:run",
    "web": "web:web",
    "foxglove": "foxglove:foxglove",
    "vehicle": "vehicle:vehicle",
    "fleet": "fleet:app",
    "score": "score:score",
    "table": "table:table",
    "report": "results:report",
    "bench": "bench:bench",
    "teach": "teach:teach",
    "truth": "truth:truth",
    "track": "track:app",
    "calibrate": "calibrate:app",
    "runs": "runs:app",
    "judge": "judge:app",
    "config": "config:app",
    "model": "model:app",
    "nut": "nut:app",
    "mount": "mount:app",
    "doctor": "doctor:doctor",
    "display": "display:app",
    "print": "prints:app",
}
"""Each verb's module in this room, and its name there: a command, or a Typer app of several. In the order of the help."""


class Verbs(TyperGroup):
    """The group of all verbs."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002 Click asks so
        """The names of the verbs, in the order of the help."""
        return list(VERBS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002 Click asks so
        """The verb, imported now; None where there is none of that name."""
        place = VERBS.get(cmd_name)
        if place is None:
            return None
        module, _, name = place.partition(":")
        found = getattr(import_module(f"dnb_edge.cli.{module}"), name)
        whole = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        if isinstance(found, typer.Typer):
            whole.add_typer(found, name=cmd_name)
        else:
            whole.command(cmd_name)(found)
            # A second command makes Typer build a group, from which the wanted one is taken by its name.
            whole.command("another")(_nothing)
        return typer.main.get_group(whole).commands[cmd_name]

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """As Click's, with a suggestion where a verb is misspelt."""
        if args and args[0] not in VERBS and not args[0].startswith("-"):
            near = get_close_matches(args[0], VERBS)
            hint = f" Did you mean {', '.join(map(repr, near))}?" if near else ""
            ctx.fail(f"No such command {args[0]!r}.{hint}")
        return super().resolve_command(ctx, args)


def _nothing() -> None:
    pass
