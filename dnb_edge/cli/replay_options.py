"""The option of every verb that lays a judge's edits over a recording."""

from __future__ import annotations

from typing import Annotated

import typer

WithEdits = Annotated[bool, typer.Option("--edits/--no-edits", help="Lay a judge's edits over the laps.")]
