"""`dnb-edge calibrate`: its verbs, one file each."""

from __future__ import annotations

import typer

from dnb_edge.cli.calibrate_check import check
from dnb_edge.cli.calibrate_keypoints import keypoints
from dnb_edge.cli.calibrate_lens import lens
from dnb_edge.cli.calibrate_markers import markers
from dnb_edge.cli.calibrate_refine import refine

app = typer.Typer(help="Tie the camera's picture to the twin, and say how well.", no_args_is_help=True)
app.command("keypoints")(keypoints)
app.command("lens")(lens)
app.command("markers")(markers)
app.command("refine")(refine)
app.command("check")(check)


@app.callback()
def calibrate() -> None:
    """Tie the camera's picture to the twin, and say how well."""
