"""`dnb-edge print`: what the kit needs on paper, to scale, each sheet with a bar to check the print by."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dnb_edge.cli.prints_out import (
    CHECK,
    Dictionary,
    OutOption,
    PaperOption,
    area_of,
    marker_side,
    numbers_of,
    write_pages,
)
from dnb_edge.cli.prints_track import track
from dnb_edge.report.files import write_whole

app = typer.Typer(help="Print markers, calibration boards and tracks, to scale.", no_args_is_help=True)


@app.callback()
def prints() -> None:
    """Print markers, calibration boards and tracks, to scale."""


@app.command("markers")
def markers(
    *,
    ids: Annotated[str, typer.Option(help="Numbers of the markers: 1,2,5-8.")] = "1-6",
    size_mm: Annotated[float, typer.Option(help="Side of the black square, mm.")] = 70.0,
    dictionary: Dictionary = "4X4_50",
    paper: PaperOption = "a4",
    out: OutOption = Path("markers.pdf"),
) -> None:
    """Roof markers: which car it is, where it is and where its nose points.

    dnb-edge print markers --ids 7,12 --size-mm 70 --out markers.pdf
    """  # fmt: skip
    from dnb_edge.prints.paper import parse_paper  # noqa: PLC0415 Matplotlib is slow to import
    from dnb_edge.prints.roof import RoofSettings, roof_pages  # noqa: PLC0415 as above

    settings = RoofSettings(
        family=dictionary, numbers=numbers_of(ids), size_mm=marker_side("--size-mm", size_mm), paper=parse_paper(paper)
    )
    written = write_pages(out, roof_pages(settings), title="Roof markers")
    listed = ", ".join(map(str, settings.numbers))
    typer.echo(f"{written}: roof markers {listed} of {dictionary}, {size_mm:g} mm. {CHECK}")
    typer.echo(
        f"In the configuration: detector: {{kind: markers, markers: {{dictionary: {dictionary}, marker_size_m: "
        f"{size_mm / 1000.0:g}, marker_height_m: (measure it), ids: [{listed}]}}}}"
    )


@app.command("floor")
def floor(
    *,
    count: Annotated[int, typer.Option(min=4, max=50, help="How many sheets.")] = 6,
    first_id: Annotated[int, typer.Option(min=0, help="Number of the first of them.")] = 0,
    size_mm: Annotated[float, typer.Option(help="Side of the black square, mm.")] = 150.0,
    area: Annotated[
        str, typer.Option(help="Floor between the outermost markers' middles, m: WIDTHxDEPTH; for the layout.")
    ] = "2.0x1.5",
    dictionary: Dictionary = "4X4_50",
    paper: PaperOption = "a4",
    out: OutOption = Path("floor.pdf"),
) -> None:
    """Floor markers, by which `calibrate markers` finds the camera's place, and a layout of them for --area.

    The layout need not be used: lying anywhere, the markers make axes of their own.
    """
    from dnb_edge.prints.floor import FloorSettings, floor_pages, placed, plan_page, plan_size_m  # noqa: PLC0415 slow
    from dnb_edge.prints.layout import layout_text  # noqa: PLC0415 as above
    from dnb_edge.prints.paper import parse_paper  # noqa: PLC0415 as above
    from dnb_edge.track.scale import TwinScale  # noqa: PLC0415 as above

    area_m = area_of(area)
    settings = FloorSettings(
        family=dictionary,
        numbers=tuple(range(first_id, first_id + count)),
        size_mm=marker_side("--size-mm", size_mm),
        paper=parse_paper(paper),
    )
    places = placed(settings.numbers, area_m)
    pages = [*floor_pages(settings), plan_page(settings, places, area_m)]
    written = write_pages(out, pages, title="Floor markers")
    layout = out.with_suffix(".layout.yaml")
    scale = TwinScale(metres_per_px=0.002, height_px=plan_size_m(area_m)[1] / 0.002)
    says = (
        f"Places of the floor markers in {out.name}: as its last sheet draws them, measured with a tape.",
        (
            f"dnb-edge calibrate markers --source v4l2:/dev/video0 --size-mm {size_mm:g} --family {dictionary} "
            f"--layout {layout.name} --out view.yaml"
        ),
    )
    write_whole(layout, layout_text(places, scale, sigma_mm=5.0, says=says).encode())
    typer.echo(
        f"{written}: floor markers {first_id} to {first_id + count - 1} of {dictionary}, {size_mm:g} mm. {CHECK}"
    )
    typer.echo(f"{layout}: their places as the last sheet draws them (lying anywhere else, they need no layout).")


@app.command("board")
def board(
    *,
    described: Annotated[
        str, typer.Option("--board", help="chessboard:7x10:15mm (inner corners) or charuco:5x7:30mm:22mm (squares).")
    ] = "charuco:5x7:30mm:22mm",
    paper: PaperOption = "a4",
    out: OutOption = Path("board.pdf"),
) -> None:
    """A calibration board, for `calibrate lens`."""
    from dnb_edge.prints.board import board_page  # noqa: PLC0415 Matplotlib is slow to import
    from dnb_edge.prints.paper import parse_paper  # noqa: PLC0415 as above
    from dnb_edge.view.boards import parse_board  # noqa: PLC0415 as above

    wanted = parse_board(described)
    written = write_pages(out, [board_page(wanted, parse_paper(paper))], title=f"Calibration board {wanted}")
    typer.echo(f"{written}: {wanted}. {CHECK} Glue it to something flat and stiff.")
    typer.echo(f"dnb-edge calibrate lens --source v4l2:/dev/video0 --board {wanted} --out lens.yaml")


app.command("track")(track)
