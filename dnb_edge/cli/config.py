"""`dnb-edge config`: what a configuration means, whether it is right, the rule sets, and a JSON Schema for editors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
import yaml

from dnb_edge.assembly import check_detector, check_display, check_source, plain_config
from dnb_edge.cli.run import Override
from dnb_edge.config.load import load_config
from dnb_edge.config.rules import PRESETS, load_rule_set
from dnb_edge.config.schema import Config

app = typer.Typer(help="Show, check and describe configurations.", no_args_is_help=True)

File = Annotated[Path, typer.Argument(help="The configuration file (YAML).")]


@app.command()
def show(file: File, overrides: Override = None) -> None:
    """Print every key that is in force, defaults included."""
    config = load_config(file, overrides or [])
    typer.echo(yaml.safe_dump(plain_config(config), sort_keys=False, allow_unicode=True), nl=False)


@app.command()
def check(file: File, overrides: Override = None) -> None:
    """Say whether the file is right; exit code 2 where it is not. The files that it names are looked at when a run begins."""
    config = load_config(file, overrides or [])
    check_source(config.capture)
    check_detector(config.detector)
    check_display(config.display)
    typer.echo(f"{file}: right")


@app.command()
def rules(
    name: Annotated[
        str | None, typer.Argument(help="A rule set's name, or the path of its file; none: list them.")
    ] = None,
) -> None:
    """List the rule sets that there are, or print one as YAML: copy it, change it, and name its file under `rules`."""
    if name is not None:
        typer.echo(load_rule_set(name).text, nl=False)
        return
    for preset in PRESETS:
        typer.echo(f"{preset:<12} {load_rule_set(preset).about.splitlines()[0]}")


@app.command()
def schema() -> None:
    """Print the JSON Schema of the configuration, for editors that complete and check YAML."""
    typer.echo(json.dumps(Config.model_json_schema(), indent=2))
