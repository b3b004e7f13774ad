"""`dnb-edge calibrate keypoints`: clicked points tie the camera's picture to the twin, and how well they do."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.console import Console

from dnb_edge.cli.calibration_out import check_calibration_path, check_places, save_calibration
from dnb_edge.cli.keypoint_input import Given, Options, gather
from dnb_edge.cli.keypoint_words import facts, print_found
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.view.findings import Found, find
from dnb_edge.view.fit import CLICK_SIGMA_PX, TWIN_SIGMA_PX, KeypointFit


def keypoints(
    *,
    camera: Annotated[Path | None, typer.Option(help="Points in the camera's picture, .npy of shape (n, 2).")] = None,
    twin: Annotated[Path | None, typer.Option(help="The same points on the twin, .npy of shape (n, 2).")] = None,
    pairs_path: Annotated[
        Path | None, typer.Option("--keypoints", help="A YAML file with both, instead of the two.")
    ] = None,
    config_file: Annotated[
        Path | None,
        typer.Option("--config", "-c", help="A run's configuration: its keypoints, twin, scale, track and image size."),
    ] = None,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", help="With --config: set one key, such as data_dir=DIR.")
    ] = None,
    without: Annotated[list[str] | None, typer.Option(help="Leave out the keypoint of this name; repeat it.")] = None,
    metres_per_px: Annotated[float | None, typer.Option(help="The twin's scale, for errors in metres too.")] = None,
    image_size: Annotated[
        str | None, typer.Option(help="WxH of the picture on which the camera's points were clicked, px.")
    ] = None,
    click_sigma_px: Annotated[
        float, typer.Option(help="How far off clicks are, one sigma along either axis, px of that picture.")
    ] = CLICK_SIGMA_PX,
    twin_sigma_px: Annotated[
        float, typer.Option(help="How far off the points on the twin are, the same way, twin px.")
    ] = TWIN_SIGMA_PX,
    lens: Annotated[Path | None, typer.Option(help="The camera's lens, by `calibrate lens`.")] = None,
    camera_id: Annotated[
        str | None, typer.Option(help="The camera's identity, for the calibration file. Default: the lens file's.")
    ] = None,
    twin_image: Annotated[Path | None, typer.Option(help="The twin's picture. Default: the one of --config.")] = None,
    picture: Annotated[
        Path | None, typer.Option(help="The picture clicked on: for the sigma map, and kept with the calibration.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write the calibration file (YAML) here.")] = None,
    sigma_map: Annotated[
        Path | None, typer.Option(help="Write the map of the position's sigma (.png or .svg) here.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Write the plot of error against number of keypoints (.png or .svg) here.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Fit the map from the camera to the twin to clicked points, and say how well it is known.

    Errors in all and by number of keypoints are those of plain least squares, as the paper has them; the calibration file
    gets the most likely map, with its sigma at every point.
    """
    for name, path in (("--plot", plot), ("--sigma-map", sigma_map)):
        if path is not None:
            _check_picture_path(name, path)
    if out is not None:
        check_calibration_path(out)
    check_places(
        {"--out": out, "--sigma-map": sigma_map, "--plot": plot},
        reads=(camera, twin, pairs_path, config_file, lens, twin_image, picture),
    )
    options = Options(
        camera=camera, twin=twin, pairs=pairs_path, config=config_file, overrides=overrides or (), without=without or (),
        metres_per_px=metres_per_px, image_size=image_size, lens=lens, twin_image=twin_image, picture=picture,
        camera_id=camera_id,
    )  # fmt: skip
    given = gather(options)
    _check_enough(given, out, sigma_map)
    found = _found(given, click_sigma_px, twin_sigma_px, without or ())
    if plot is not None:
        _draw_counts(plot, found)
    if sigma_map is not None:
        _draw_map(sigma_map, given, found)
    if out is not None:
        identity = camera_id if camera_id is not None else given.camera_id
        calibration = replace(found.fit.calibration, camera_id=identity, inputs=given.inputs, notes=found.notes)
        save_calibration(out, calibration, given.picture)
    if as_json:
        typer.echo(json.dumps(facts(given, found)))
    else:
        print_found(Console(), given, found, out)


def _check_picture_path(name: str, path: Path) -> None:
    if path.suffix.lower() not in (".png", ".svg"):
        raise InputError(f"{name} {path}: the name must end in .png or .svg")


def _check_enough(given: Given, out: Path | None, sigma_map: Path | None) -> None:
    """Raises `InputError` where what is to be written needs what is not known."""
    wanted = "--out" if out is not None else "--sigma-map" if sigma_map is not None else None
    if wanted is not None and given.size_px is None:
        raise InputError(f"{wanted}: give --image-size WxH, the size of the picture on which the points were clicked")
    if out is not None and given.metres_per_px is None:
        raise InputError("--out: give --metres-per-px, the twin's scale, or the run's --config")
    if out is not None and given.twin_height_px is None:
        raise InputError("--out: give --twin-image, the twin's picture, or the run's --config")
    if given.picture is not None and given.size_px is not None:
        height, width = given.picture.shape[:2]
        if (width, height) != given.size_px:
            raise InputError(
                f"--picture: {width}x{height} px, the points were clicked on one of {given.size_px[0]}x{given.size_px[1]}: "
                "give that picture, or the right --image-size"
            )


def _found(given: Given, click_sigma_px: float, twin_sigma_px: float, without: list[str] | tuple[str, ...]) -> Found:
    for name, sigma_px in (("--click-sigma-px", click_sigma_px), ("--twin-sigma-px", twin_sigma_px)):
        if not 0.0 < sigma_px < 1e4:
            raise InputError(f"{name} {sigma_px:g}: must be a positive number of px")
    found = find(
        given.pairs, given.scale, size_px=given.likely_size_px, say=given.say, lens=given.lens, track=given.track,
        metres_per_px=given.metres_per_px, sigmas_px=(click_sigma_px, twin_sigma_px),
    )  # fmt: skip
    left_out = (f"left out by hand: {', '.join(without)}",) if without else ()
    return replace(found, notes=(*left_out, *_notes(given, found.fit)))


def _notes(given: Given, fit: KeypointFit) -> tuple[str, ...]:
    """The calibration's notes; where the camera stands cannot be told from a picture whose size is made up."""
    notes = fit.calibration.notes
    return notes if given.size_px is not None or fit.calibration.pose is not None else notes[:-1]


def _draw_counts(plot: Path, found: Found) -> None:
    from dnb_edge.report.calibration import error_by_count_picture  # noqa: PLC0415 Matplotlib is slow to import

    write_whole(plot, error_by_count_picture(found.by_count, picture_format=_form(plot)))


def _draw_map(path: Path, given: Given, found: Found) -> None:
    from dnb_edge.report.sigma_map import SigmaMap, sigma_map_picture  # noqa: PLC0415 Matplotlib is slow to import

    fit = found.fit
    wanted = SigmaMap(
        calibration=fit.calibration,
        pairs=given.pairs,
        wrong=(*(outlier.name for outlier in fit.outliers), *fit.suspects),
        track=given.track,
        twin=given.twin,
        picture=given.picture,
        unit=given.unit,
        per_metre=given.per_metre,
    )
    write_whole(path, sigma_map_picture(wanted, picture_format=_form(path)))


def _form(path: Path) -> Literal["png", "svg"]:
    return "svg" if path.suffix.lower() == ".svg" else "png"
