"""Meshes, drawings and the command: sound, true to the part, and the same every time."""

import struct
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("build123d", reason="the modeller is not installed: make hardware-check")

from build123d import Box, Pos, export_stl, import_step

from hardware import build, cameras, kit, meshes
from hardware.__main__ import main
from hardware.drawing.dimensions import Hole, Length, flat
from hardware.drawing.picture import Body, View, shaded
from hardware.drawing.sheet import Sheet, drawing
from hardware.mount import joint

FRONT = View(towards_eye=(0, 0, 1), up=(0, 1, 0))


def part(name: str):
    return next(each for each in kit.parts() if each.name == name)


def test_the_same_part_gives_the_same_bytes(tmp_path: Path) -> None:
    """STL, drawing and STEP of a part are the same bytes again, also after other meshes were made of it."""
    first = build.one("rail-jaw", step=True).files
    export_stl(part("rail-jaw").make(), tmp_path / "coarse.stl", tolerance=1.0)
    assert build.one("rail-jaw", step=True).files == first
    assert set(first) == {"stl/rail-jaw.stl", "step/rail-jaw.step", "drawings/rail-jaw.svg"}


def test_step_is_read_back_with_the_volume_of_the_part(tmp_path: Path) -> None:
    """The STEP file holds the part itself, in millimetres."""
    path = tmp_path / "pad.step"
    path.write_bytes(build.one("shelf-pad", step=True).files["step/shelf-pad.step"])
    assert import_step(path).volume == pytest.approx(part("shelf-pad").make().volume, rel=1e-6)


def test_stl_lies_on_the_bed_and_has_the_volume_of_the_part() -> None:
    """The arm's mesh is turned teeth up, stands on z = 0, and encloses the model's volume within half a per cent."""
    corners = meshes.triangles(part("joint-arm").on_bed())
    assert corners[:, :, 2].min() == 0
    assert meshes.volume_mm3(corners) == pytest.approx(joint.arm().volume, rel=5e-3)
    data = meshes.stl(corners)
    assert struct.unpack("<I", data[80:84]) == (len(corners),)
    assert len(data) == 84 + 50 * len(corners)


def test_faults_of_meshes_are_named() -> None:
    """A hole, two pieces, a turned face and a part larger than the bed are each found; a sound box is not."""
    box = meshes.triangles(Box(10, 10, 10))
    assert meshes.faults(box) == []
    assert "is not watertight" in meshes.faults(box[1:])
    assert any("inside out" in fault for fault in meshes.faults(np.concatenate([box[:1, ::-1], box[1:]])))
    two = meshes.triangles(Box(10, 10, 10) + Pos(30, 0, 0) * Box(10, 10, 10))
    assert "falls into 2 pieces" in meshes.faults(two)
    assert any("larger than the bed" in fault for fault in meshes.faults(meshes.triangles(Box(221, 10, 10))))


@pytest.mark.parametrize("item", kit.parts(), ids=lambda item: item.name)
def test_dimensions_end_on_the_part(item) -> None:
    """No dimension is drawn beside the part: both ends lie within its outline's bounds, holes around their centre as well."""
    box = item.make().bounding_box()
    slack_mm = 0.05
    for dimension in item.dimensions:
        points = (dimension.centre,) if isinstance(dimension, Hole) else (dimension.start, dimension.end)
        if isinstance(dimension, Length):
            assert dimension.value_mm > 0
        low, high = flat(dimension.view, tuple(box.min)), flat(dimension.view, tuple(box.max))
        for point in points:
            for value, a, b in zip(flat(dimension.view, point), low, high, strict=True):
                assert min(a, b) - slack_mm <= value <= max(a, b) + slack_mm, dimension


@pytest.mark.parametrize("name", ["base-ceiling", "cradle-c920", "cradle-pi-hq-gs", "pi-tray", "rail-jaw"])
def test_a_hole_in_a_drawing_is_a_hole_in_the_part(name: str) -> None:
    """Where a drawing notes a bore there is none of the part on its axis, and a circle of that diameter in the model."""
    item = part(name)
    shape = item.make()
    radii = {round(edge.radius, 3) for edge in shape.edges() if edge.geom_type.name == "CIRCLE"}
    holes = [
        dimension for dimension in item.dimensions if isinstance(dimension, Hole) and "teeth" not in dimension.note
    ]
    assert holes
    for hole in holes:
        assert round(hole.diameter_mm / 2, 3) in radii
        assert not shape.is_inside(hole.centre)


def test_a_drawing_says_what_was_measured() -> None:
    """A box of 30 x 20 x 10 mm is drawn with these three numbers, in well-formed SVG of A4's size."""
    dimensions = (
        Length(view="front", start=(-15, -10, 0), end=(15, -10, 0)),
        Length(view="front", start=(-15, -10, 0), end=(-15, 10, 0), upright=True),
        Length(view="side", start=(0, 0, -5), end=(0, 0, 5)),
    )
    svg = ET.fromstring(drawing(Sheet(title="Box", shape=Box(30, 20, 10), dimensions=dimensions)))
    assert (svg.get("width"), svg.get("height")) == ("297mm", "210mm")
    words = {element.text for element in svg.iter("{http://www.w3.org/2000/svg}text")}
    assert {"30", "20", "10", "Box"} <= words


def test_what_is_in_front_hides_what_is_behind() -> None:
    """A large plate before a small cube hides it wholly; the same cube in front is seen, whichever is listed first."""
    plate, cube = Box(40, 40, 2), Box(10, 10, 10)
    for z_mm, seen in ((-20.0, False), (20.0, True)):
        bodies = [Body(shape=plate, colour=(200, 0, 0)), Body(shape=cube, colour=(0, 0, 200), offset_mm=(0, 0, z_mm))]
        assert (shaded(bodies, FRONT).spots[1] is not None) is seen
        assert (shaded(bodies[::-1], FRONT).spots[0] is not None) is seen


def test_an_unknown_name_is_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A name that no part has ends with code 2 and one line that says where the names are."""
    assert main(["build", "--out", str(tmp_path), "no-such-part"]) == 2
    assert "python -m hardware list" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_cameras_of_the_issue_have_a_cradle(capsys: pytest.CaptureFixture[str]) -> None:
    """Each camera of the table has a cradle of its name among the parts."""
    assert main(["list"]) == 0
    names = capsys.readouterr().out
    for camera in (*cameras.WEBCAMS, *cameras.BOARDS):
        assert f"cradle-{camera.name} " in names
