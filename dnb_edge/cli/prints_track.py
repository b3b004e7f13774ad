"""`dnb-edge print track`: a track as sheets to glue together, and the files with which to race on it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import StrEnum
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import cv2
import typer

from dnb_edge.cli.prints_out import CHECK, Dictionary, OutOption, marker_side, write_pages
from dnb_edge.config.track_file import MadeOf, load_track, track_file
from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole
from dnb_edge.sim.circuit import demo_circuit
from dnb_edge.sim.places import figure_eight, hairpin, table_oval
from dnb_edge.track.model import Track

if TYPE_CHECKING:
    from dnb_edge.prints.ground import Ground
    from dnb_edge.prints.paper import Paper
    from dnb_edge.prints.tiles import Tiling

_POSTER = "poster"
_GLUED_MM = 2.0
"""How exactly sheets are glued: sigma of a marker's place."""


class BuiltIn(StrEnum):
    """The tracks that come with the package."""

    OVAL = "oval"
    DEMO = "demo"
    EIGHT = "eight"
    HAIRPIN = "hairpin"


_CIRCUITS = {
    BuiltIn.OVAL: table_oval,
    BuiltIn.DEMO: demo_circuit,
    BuiltIn.EIGHT: figure_eight,
    BuiltIn.HAIRPIN: hairpin,
}


def track(
    track_path: Annotated[
        Path | None, typer.Argument(metavar="[TRACK]", help="A track file of yours; without one, a built-in track.")
    ] = None,
    *,
    circuit: Annotated[
        BuiltIn, typer.Option(help="Built-in: oval 1.2 x 1 m, demo and eight 3 x 2 m, hairpin 5 x 2.5 m.")
    ] = BuiltIn.OVAL,
    paper: Annotated[
        str, typer.Option(help="a4, a3 or letter; poster for one sheet, as a copy shop prints it.")
    ] = "a4",
    overlap_mm: Annotated[float, typer.Option(help="By how much sheets overlap at least, mm.")] = 10.0,
    outline: Annotated[
        bool, typer.Option("--outline", help="Print the lane's dark borders only, to save ink.")
    ] = False,
    markers: Annotated[
        int, typer.Option(min=0, max=20, help="Floor markers to print beside the lane; 0 for none.")
    ] = 6,
    marker_mm: Annotated[float, typer.Option(help="Side of their black squares, mm.")] = 100.0,
    first_id: Annotated[int, typer.Option(min=0, help="Number of the first of them.")] = 40,
    dictionary: Dictionary = "4X4_50",
    out: OutOption = Path("track.pdf"),
) -> None:
    """A track to glue together from sheets, with its track file, its twin and the floor markers that are on it.

    dnb-edge print track --paper a4 --out track.pdf
    """  # fmt: skip
    from dnb_edge.prints.paper import Paper, parse_paper  # noqa: PLC0415 Matplotlib is slow to import
    from dnb_edge.prints.tiles import tilings, whole  # noqa: PLC0415 slow
    from dnb_edge.prints.track import track_pages  # noqa: PLC0415 slow

    if 0 < markers < 4:
        raise InputError(f"--markers {markers}: must be 0, or 4 and more: three are needed, and one may be covered")
    files = _Files(out=out, own=track_path)
    files.check()
    ground, made = _ground(track_path, circuit, dictionary, marker_side("--marker-mm", marker_mm), filled=not outline)
    poster = paper.lower() == _POSTER
    sheet = Paper.A4 if poster else parse_paper(paper)
    plans = (whole(ground.size_mm),) if poster else tilings(ground.size_mm, sheet, overlap_mm=overlap_mm)
    plan = min(plans, key=lambda plan: len(plan.only(ground.needs).tiles))
    if markers:
        ground = _marked(ground, plan, first_id, markers)
    plan = plan.only(ground.needs)
    written = write_pages(out, track_pages(ground, plan, sheet), title=ground.name)
    size = " x ".join(f"{length / 1000.0:.2f}" for length in ground.size_mm)
    typer.echo(f"{written}: {ground.name}, {size} m, {_sheets(len(plan.tiles), poster, sheet)}. {CHECK}")
    _write_files(files, ground, made)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Files:
    """What is written beside the sheets."""

    out: Path
    own: Path | None
    """The user's track file, which stays as it is."""

    @property
    def track(self) -> Path:
        return self.out.with_suffix(".yaml") if self.own is None else self.own

    @property
    def twin(self) -> Path:
        return self.beside("twin.png")

    @property
    def race(self) -> Path:
        return self.beside("race.yaml")

    def beside(self, what: str) -> Path:
        return self.out.with_suffix(f".{what}")

    def check(self) -> None:
        """Raises `InputError` where a track of somebody else's making would be written over."""
        if self.own is not None or not self.track.exists():
            return
        if not self.track.is_file() or f"picture: {json.dumps(self.twin.name)}" not in _text(self.track):
            raise InputError(
                f"--out {self.out}: {self.track} is there, a track that was not made here, and would be lost: name another file"
            )


def _ground(own: Path | None, circuit: BuiltIn, family: str, marker_mm: float, *, filled: bool) -> tuple[Ground, Track]:
    from dnb_edge.prints.ground import circuit_size_m, circuit_track, ground_of  # noqa: PLC0415 slow

    if own is not None:
        loaded = load_track(own)
        return ground_of(loaded, size_m=None, family=family, marker_mm=marker_mm, filled=filled), loaded
    drawn = _CIRCUITS[circuit]()
    made = circuit_track(drawn)
    return ground_of(made, size_m=circuit_size_m(drawn), family=family, marker_mm=marker_mm, filled=filled), made


def _marked(ground: Ground, plan: Tiling, first_id: int, count: int) -> Ground:
    from dnb_edge.prints.ground import with_markers  # noqa: PLC0415 slow
    from dnb_edge.view.markers import marker_cells  # noqa: PLC0415 slow

    numbers = tuple(range(first_id, first_id + count))
    cells = [marker_cells(ground.family, number) for number in numbers]
    return with_markers(ground, plan, cells=len(cells[0]), numbers=numbers)


def _sheets(count: int, poster: bool, sheet: Paper) -> str:
    return "one large sheet" if poster else f"{count} sheets of {sheet.value} and a map of them"


def _write_files(files: _Files, ground: Ground, made: Track) -> None:
    """Track file and twin of a built-in track, the markers' layout, a configuration."""
    from dnb_edge.prints.layout import layout_text  # noqa: PLC0415 slow
    from dnb_edge.prints.track import twin_picture  # noqa: PLC0415 slow

    if files.own is None:
        twin = files.twin
        encoded, png = cv2.imencode(".png", twin_picture(ground))
        assert encoded, "OpenCV encodes any 8-bit picture as PNG"
        write_whole(twin, png.tobytes())
        write_whole(files.track, track_file(made, MadeOf(picture=twin.name, sha256=sha256(png.tobytes()).hexdigest())))
        typer.echo(f"{files.track}: the track, {made.centreline.length_m:.3f} m a lap; its twin: {twin}")
    race, view = files.race, files.beside("view.yaml")
    steps = [f"dnb-edge run --config {race.name}"]
    if ground.markers:
        layout = files.beside("layout.yaml")
        steps.insert(0, _calibrate(ground, layout.name, view.name))
        says = (f"Places of the floor markers that are printed on the sheets of {files.out.name}.", steps[0])
        write_whole(layout, layout_text(ground.markers, ground.scale, sigma_mm=_GLUED_MM, says=says).encode())
        typer.echo(f"{layout}: where the {len(ground.markers)} printed floor markers lie on it")
    told, made_now = "a configuration for it", _race(files, view.name, steps)
    if race.exists() and _bare(_text(race)) != _bare(made_now):
        told = "left as it is, since somebody has changed it"
    else:
        write_whole(race, made_now.encode())
    typer.echo(f"{race}: {told}. With the track glued and under the camera, in {race.parent.resolve()}:")
    for step in steps:
        typer.echo(f"  {step}")


def _text(path: Path) -> str:
    """Raises `InputError` where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}): name another file with --out") from error


def _bare(text: str) -> list[str]:
    """The lines that are no comments."""
    return [line for line in text.splitlines() if not line.startswith("#")]


def _calibrate(ground: Ground, layout: str, view: str) -> str:
    numbers = [one.number for one in ground.markers]
    return (
        f"dnb-edge calibrate markers --source v4l2:/dev/video0 --size-mm {ground.marker_mm:g} --family {ground.family} "
        f"--first-id {numbers[0]} --count {len(numbers)} --layout {layout} --out {view}"
    )


def _race(files: _Files, view: str, steps: list[str]) -> str:
    track = files.track
    named = track.name if track.parent.resolve() == files.out.parent.resolve() else str(track.resolve())
    head = "".join(f"#   {step}\n" for step in steps)
    return (
        f"# A race on the printed track of {files.out.name}. In this directory:\n{head}"
        f"version: 1\nname: my car\ntrack: {{file: {json.dumps(named)}}}\nview: {{calibration: {json.dumps(view)}}}\n"
        "capture: {source: v4l2:/dev/video0, width_px: 1280, height_px: 720, fps: 30}\n"
        "record: {directory: runs}\n"
    )
