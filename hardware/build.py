"""Everything that `python -m hardware` writes, as bytes under names; and what is wrong with it.

Knows folders and files: `stl/`, `step/`, `drawings/`, `pictures/`, `parts.md`. Each file is made on its own, so that two
processes can share the work; the modeller keeps no state between them but finished parts.
"""

import io
import re
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from build123d import export_step

from hardware import kit, meshes, pictures
from hardware.drawing.sheet import Sheet, drawing
from hardware.printed import Printed, mass_g

SHOWN = ("drawings", "pictures")
"""The folders whose files docs/ shows, from docs/pictures/hardware; and the table of docs/printing.md."""
_STEP_DATE = "2026-11-23T00:00:00"
TABLE_FILE = "parts.md"


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """What came of one part or picture: files under their paths, faults in words, and the part's row in the table."""

    files: dict[str, bytes]
    faults: tuple[str, ...] = ()
    row: str = ""


def everything(names: tuple[str, ...] = (), *, step: bool = True, processes: int = 2) -> Made:
    """All files of the kit, or of the named parts and pictures alone (then without the table).

    Raises KeyError with the first name that there is none of.
    """
    known = [part.name for part in kit.parts()] + [picture.name for picture in pictures.pictures()]
    for name in names:
        if name not in known:
            raise KeyError(name)
    wanted = [name for name in known if not names or name in names]
    with ProcessPoolExecutor(max_workers=processes) as pool:
        made = list(pool.map(one, wanted, [step] * len(wanted)))
    files = {path: data for each in made for path, data in each.files.items()}
    if not names:
        files[TABLE_FILE] = table([each.row for each in made if each.row]).encode()
    return Made(files=files, faults=tuple(fault for each in made for fault in each.faults))


def one(name: str, step: bool) -> Made:
    """The files of one part or picture."""
    for picture in pictures.pictures():
        if picture.name == name:
            return Made(files={f"pictures/{name}.svg": picture.draw().encode()})
    part = next(part for part in kit.parts() if part.name == name)
    return _printed(part, step=step)


def table(rows: list[str]) -> str:
    """The table of parts for docs/printing.md."""
    head = (
        "| part | for | how many | size on the bed, mm | filament, about | walls | infill | lies on |\n"
        "|---|---|---|---|---|---|---|---|\n"
    )
    return head + "\n".join(rows) + "\n"


def _printed(part: Printed, *, step: bool) -> Made:
    shape, on_bed = part.make(), part.on_bed()
    corners = meshes.triangles(on_bed)
    sheet = Sheet(
        title=part.title,
        shape=shape,
        dimensions=part.dimensions,
        notes=part.notes,
        colour=part.colour,
        picture=part.picture,
        hidden_lines=part.hidden_lines,
    )
    files = {f"stl/{part.name}.stl": meshes.stl(corners), f"drawings/{part.name}.svg": drawing(sheet).encode()}
    if step:
        files[f"step/{part.name}.step"] = _step(part, on_bed)
    faults = [f"{part.name} {fault}" for fault in meshes.faults(corners)]
    if not shape.is_valid:
        faults.append(f"{part.name} is no valid solid")
    size = corners.max(axis=(0, 1)) - corners.min(axis=(0, 1))
    grams = mass_g(meshes.volume_mm3(corners), part.slicing)
    slicing = part.slicing
    row = (
        f"| [{part.name}](pictures/hardware/{part.name}.svg) | {part.group} | {part.quantity} "
        f"| {size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} | {grams:.0f} g | {slicing.walls} | {slicing.infill_percent} % "
        f"| {slicing.bed_face} |"
    )
    return Made(files=files, faults=tuple(faults), row=row)


def _step(part: Printed, shape: object) -> bytes:
    """STEP without what differs from run to run: the hour, the file's name, and a count of the shapes written so far."""
    out = io.BytesIO()
    export_step(shape, out, timestamp=_STEP_DATE)
    named = re.sub(rb"FILE_NAME\('[^']*'", f"FILE_NAME('{part.name}'".encode(), out.getvalue(), count=1)
    return re.sub(rb"NEXT_ASSEMBLY_USAGE_OCCURRENCE\('\d+'", b"NEXT_ASSEMBLY_USAGE_OCCURRENCE('1'", named)


def shown(made: Made) -> Iterator[tuple[str, bytes]]:
    """The files that docs/pictures/hardware holds, by their names there."""
    for path, data in made.files.items():
        folder, _, name = path.rpartition("/")
        if folder in SHOWN:
            yield name, data


def write(made: Made, folder: Path) -> None:
    """Write all files below a folder."""
    for path, data in made.files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data)
