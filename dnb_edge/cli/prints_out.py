"""What the commands of `dnb-edge print` share: their options, how numbers are read, how sheets become files."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dnb_edge.errors import InputError
from dnb_edge.report.files import write_whole

if TYPE_CHECKING:
    from dnb_edge.prints.paper import Page

CHECK = "Print at 100 % (not fitted to the page) and measure the bar: 100 mm."
_MOST = 200
_LEAST_MM = 10.0
"""Side of the smallest marker that is printed."""

OutOption = Annotated[Path, typer.Option(help="Write the sheets here: .pdf, or .svg (one file a sheet).")]
PaperOption = Annotated[str, typer.Option(help="a4, a3 or letter.")]
Dictionary = Annotated[
    str, typer.Option("--dictionary", "--family", help="Family of codes: 4X4_50, 5X5_100, APRILTAG_36h11 ...")
]


def write_pages(out: Path, pages: Iterable[Page], *, title: str) -> str:
    """The sheets under `out`, or beside it with their names; says where they are."""
    from dnb_edge.prints.paper import pdf_of, svgs_of  # noqa: PLC0415 Matplotlib is slow to import

    kind = out.suffix.lower()
    if kind not in (".pdf", ".svg"):
        raise InputError(f"--out {out}: the name must end in .pdf or .svg")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: there is no directory {out.parent}: make it first")
    if kind == ".pdf":
        write_whole(out, pdf_of(pages, title=title))
        return str(out)
    made = list(svgs_of(pages))
    if len(made) == 1:
        write_whole(out, made[0][1])
        return str(out)
    names = [out.with_name(f"{out.stem}-{name}{out.suffix}") for name, _ in made]
    for path, (_, data) in zip(names, made, strict=True):
        write_whole(path, data)
    return f"{names[0]} to {names[-1].name} ({len(names)} files)"


def numbers_of(text: str) -> tuple[int, ...]:
    """The numbers that `1,2,5-8` names. Raises `InputError`."""
    found: dict[int, None] = {}
    for word in text.split(","):
        match = re.fullmatch(r"\s*(\d{1,6})(?:-(\d{1,6}))?\s*", word)
        if match is None:
            raise InputError(f"--ids {text}: {word.strip()!r} is no number: write numbers and ranges, such as 1,2,5-8")
        first, last = int(match[1]), int(match[2] or match[1])
        if last < first or last - first >= _MOST:
            raise InputError(f"--ids {text}: {word.strip()}: write the lower number first, and {_MOST} at most")
        found |= dict.fromkeys(range(first, last + 1))
    if len(found) > _MOST:
        raise InputError(f"--ids {text}: {len(found)} markers: {_MOST} at most at a time")
    return tuple(found)


def marker_side(option: str, value: float) -> float:
    """The side of a marker, mm. Raises `InputError` where it is no number, or so small that no camera reads it."""
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"{option} {value:g}: must be a positive number")
    if value < _LEAST_MM:
        raise InputError(f"{option} {value:g}: no camera reads so small a marker: {_LEAST_MM:g} mm is the least")
    return value


def area_of(text: str) -> tuple[float, float]:
    """Width and depth, metres. Raises `InputError`."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?|\.\d+)\s*[xX×]\s*(\d+(?:\.\d+)?|\.\d+)\s*", text)
    if match is None or not all(0.3 <= float(part) <= 50.0 for part in match.groups()):
        raise InputError(f"--area {text}: must be two lengths from 0.3 to 50 m with an x between them, such as 2.0x1.5")
    return float(match[1]), float(match[2])
