"""`dnb-edge calibrate lens`: a camera's lens from views of a printed board."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from dnb_edge.cli.calibration_out import check_calibration_path
from dnb_edge.cli.lens_views import Views, views_from_source, views_in_folder
from dnb_edge.config.lens_file import lens_file, lens_file_of
from dnb_edge.config.load import load_config
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.view.boards import BOARD_FORMS, Board, parse_board
from dnb_edge.view.lens import LensModel
from dnb_edge.view.lens_fit import FEWEST_VIEWS, LensFit, fit_lens, lens_names


def lens(
    *,
    board: Annotated[str, typer.Option(help=f"The board: {BOARD_FORMS}.")],
    images: Annotated[Path | None, typer.Option(help="A folder of photographs of the board, by this camera.")] = None,
    source: Annotated[
        str | None, typer.Option(help="Or a source that shows it: v4l2:/dev/video0, file:clip.mp4 ...")
    ] = None,
    model: Annotated[
        LensModel, typer.Option(help="fisheye for lenses wider than about 110 degrees.")
    ] = LensModel.PINHOLE,
    coefficients: Annotated[
        int | None, typer.Option(help="Distortion coefficients of a pinhole: 4, 5 or 8. Default: 5.")
    ] = None,
    leave_out: Annotated[
        list[str] | None, typer.Option(help="A photograph to leave out, by its name in the folder; repeat it.")
    ] = None,
    views: Annotated[int, typer.Option(min=FEWEST_VIEWS, help="With --source: how many views to take.")] = 20,
    save_views: Annotated[
        Path | None, typer.Option(help="With --source: keep the views' pictures in this folder.")
    ] = None,
    config_file: Annotated[
        Path | None,
        typer.Option("--config", "-c", help="With --source: the configuration, for the camera's size and rate."),
    ] = None,
    camera_id: Annotated[
        str | None, typer.Option(help="The camera's identity for the lens file. Default: the source's.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write the lens file (YAML) here.")] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Write a picture of coverage and errors (.png or .svg) here.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    print_to: Annotated[
        Path | None, typer.Option("--print", help="Only write the board to this PDF file, to be printed.")
    ] = None,
    paper: Annotated[str, typer.Option(help="With --print: a4 or letter.")] = "a4",
) -> None:
    """Calibrate the lens from 15 or more views of a board: all over the picture, tilted to all sides.

    With a camera as the source, hold the board still for a moment in each place; Ctrl-C ends early.
    """
    described = parse_board(board)
    if print_to is not None:
        _print_board(print_to, described, paper)
        return
    _check(images, source, model, coefficients)
    _check_outputs(out, plot)
    if source is None and (save_views is not None or config_file is not None):
        raise InputError("--save-views and --config: they go with --source")
    if source is not None and leave_out:
        raise InputError("--leave-out: goes with --images")
    console = Console(stderr=True)
    if images is not None:
        found = views_in_folder(images, described, leave_out or [], console)
    else:
        assert source is not None
        config = None if config_file is None else load_config(config_file)
        found = views_from_source(source, described, wanted=views, config=config, save_to=save_views, console=console)
    fit = fit_lens(described, found.views, size_px=found.size_px, model=model, coefficients=coefficients)
    if out is not None:
        kept = lens_file_of(
            fit,
            described,
            made_at=datetime.now(UTC).astimezone().isoformat(timespec="seconds"),
            camera_id=camera_id if camera_id is not None else found.camera_id,
            sha256=found.sha256,
        )
        write_whole(out, lens_file(kept))
    if plot is not None:
        _draw(plot, fit)
    if as_json:
        typer.echo(json.dumps(_facts(fit, found, described)))
    else:
        _print(fit, found, out)


def _check(images: Path | None, source: str | None, model: LensModel, coefficients: int | None) -> None:
    if (images is None) == (source is None):
        raise InputError("calibrate lens: give --images FOLDER or --source URI, one of them")
    if coefficients is not None and (model is not LensModel.PINHOLE or coefficients not in (4, 5, 8)):
        raise InputError(f"--coefficients {coefficients}: a pinhole has 4, 5 or 8, a fisheye always 4")


def _check_outputs(out: Path | None, plot: Path | None) -> None:
    """Before the work: nobody holds a board twice."""
    if out is not None:
        check_calibration_path(out)
    if plot is not None and plot.suffix.lower() not in (".png", ".svg"):
        raise InputError(f"--plot {plot}: the name must end in .png or .svg")
    if plot is not None and not plot.parent.is_dir():
        raise InputError(f"--plot {plot}: there is no directory {plot.parent}: make it first")


def _print_board(path: Path, board: Board, paper: str) -> None:
    from dnb_edge.prints.board import board_page  # noqa: PLC0415 Matplotlib is slow to import
    from dnb_edge.prints.paper import parse_paper, pdf_of  # noqa: PLC0415 as above

    if path.suffix.lower() != ".pdf":
        raise InputError(f"--print {path}: the name must end in .pdf")
    write_whole(path, pdf_of([board_page(board, parse_paper(paper))], title=f"Calibration board {board}"))
    typer.echo(f"{path}: print at 100 %, measure its bar of 100 mm, and calibrate with --board {board}", err=True)


def _draw(plot: Path, fit: LensFit) -> None:
    from dnb_edge.report.lens import lens_picture  # noqa: PLC0415 Matplotlib is slow to import

    form: Literal["png", "svg"] = "svg" if plot.suffix.lower() == ".svg" else "png"
    write_whole(plot, lens_picture(fit, picture_format=form))


def _facts(fit: LensFit, found: Views, board: Board) -> dict[str, Any]:
    return {
        "rms_px": fit.rms_px,
        "camera_matrix": fit.lens.matrix.tolist(),
        "distortion": list(fit.lens.distortion),
        "model": fit.lens.model.value,
        "width_px": fit.lens.width_px,
        "height_px": fit.lens.height_px,
        "board": str(board),
        "camera_id": found.camera_id,
        "sigmas": fit.sigmas,
        "views": [
            {
                "name": view.name,
                "corners": len(view.camera_px),
                "rms_px": view.rms_px,
                "max_px": view.max_px,
                "tilt_deg": view.tilt_deg,
                "distance_m": view.distance_m,
                "bad": view.bad,
            }
            for view in fit.views
        ],
        "bad_views": list(fit.bad_views),
        "rms_without_bad_px": fit.rms_without_bad_px,
        "looked_at": found.looked_at,
        "without_board": list(found.without_board),
        "coverage": {"counts": fit.coverage.counts.tolist(), "share": fit.coverage.share},
        "tilt_spread_deg": fit.tilt_spread_deg,
        "notes": list(fit.notes),
    }


def _print(fit: LensFit, found: Views, out: Path | None) -> None:
    console = Console()
    table = Table("view", "corners", "RMS, px", "greatest, px", "tilt", "", box=None)
    for view in fit.views:
        said = "[red]disagrees with the others[/red]" if view.bad else ""
        tilt = f"{view.tilt_deg:.0f}°"
        table.add_row(
            escape(view.name), str(len(view.camera_px)), f"{view.rms_px:.2f}", f"{view.max_px:.2f}", tilt, said
        )
    console.print(table)
    for name in found.without_board:
        console.print(f"{name}: the board was not found in it", markup=False, highlight=False, soft_wrap=True)
    console.print()
    numbers = Table("lens", "", "sigma", box=None)
    lens_numbers = (fit.lens.fx_px, fit.lens.fy_px, fit.lens.cx_px, fit.lens.cy_px, *fit.lens.distortion)
    for name, number in zip(lens_names(fit.lens.model), lens_numbers, strict=False):
        digits, sigma = 2 if name.endswith("_px") else 5, fit.sigmas.get(name)
        numbers.add_row(name, f"{number:.{digits}f}", "not fitted" if sigma is None else f"{sigma:.{digits}f}")
    console.print(numbers)
    console.print()
    console.print("views with the board in each part of the picture:")
    for row in fit.coverage.counts.tolist():
        console.print("  " + "".join(f"{count:5d}" for count in row), highlight=False)
    console.print()
    size = f"{fit.lens.width_px}x{fit.lens.height_px}"
    console.print(
        f"{fit.lens.model.value} lens, {size}, RMS {fit.rms_px:.3f} px over {len(fit.views)} views", highlight=False
    )
    for note in fit.notes:
        console.print(f"- {note}", markup=False, highlight=False, soft_wrap=True)
    if out is not None:
        console.print(f"Lens file: {out}", markup=False, highlight=False, soft_wrap=True)
