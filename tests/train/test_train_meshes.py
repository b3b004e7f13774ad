"""Meshes: files become soups of the right size, place, direction and colour; broken or absent ones never stop a run."""

import logging
from pathlib import Path

import numpy as np
import pytest

from dnb_edge.errors import InputError, WorkError
from dnb_edge.train.mesh_catalogue import CLUTTER, VEHICLES, Entry, Part
from dnb_edge.train.meshes import (
    TRIANGLES_MAX,
    Mesh,
    attributions,
    load_clutter_meshes,
    load_entry,
    load_vehicle_meshes,
    read_meshes,
    save_meshes,
)

ASSETS = Path(__file__).resolve().parents[2].parent / "shared" / "train-assets"
NOTES = """# vehicles
| folder | shows | repo | source path | commit | licence / attribution | files | KB |
|---|---|---|---|---|---|---|---|
| kenney_racing | toys | a/racing | models/ | abc | CC0 | 9 | 594 |
| gz_suv | suv | b/models | suv/ | abc | CC-BY-3.0 | 5 | 861 |
"""


@pytest.fixture
def trimesh():
    return pytest.importorskip("trimesh", reason="trimesh is part of the train extra only")


def _write_box(trimesh, path: Path, extents, colour=(200, 30, 10, 255), centre=(0.0, 0.0, 0.0)) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    box = trimesh.creation.box(extents=extents)
    box.apply_translation(centre)
    box.visual = trimesh.visual.ColorVisuals(box, face_colors=np.tile(np.uint8(colour), (len(box.faces), 1)))
    box.export(path)


def test_vehicle_is_turned_scaled_and_placed(trimesh, tmp_path):
    """A file with its nose along -y and up along z ends at length 1, on z = 0, with what was at -y at +x."""
    _write_box(trimesh, tmp_path / "vehicles/a/body.stl", (2.0, 4.0, 1.0), centre=(7.0, 5.0, 3.0))
    _write_box(trimesh, tmp_path / "vehicles/a/lamp.stl", (0.2, 0.2, 0.2), centre=(0.0, 0.0, 0.0))
    entry = Entry(
        name="a",
        folder="vehicles/a",
        parts=(
            Part(file="body.stl", colour_bgr=(1.0, 2.0, 3.0)),
            Part(file="lamp.stl", colour_bgr=(9.0, 9.0, 9.0), shift=(7.5, 3.1, 3.4)),
        ),
        nose="-y",
    )
    mesh = load_entry(entry, tmp_path, vehicle=True)
    points = mesh.corners_m.reshape(-1, 3)
    assert points.min(axis=0) == pytest.approx([-0.5, -0.25, 0.0])
    assert points.max(axis=0) == pytest.approx([0.5, 0.25, 0.25])
    lamp = mesh.corners_m[mesh.colours_bgr[:, 0] == 9.0].reshape(-1, 3).mean(axis=0)
    assert lamp == pytest.approx([0.475, 0.125, 0.225])
    assert set(map(tuple, mesh.colours_bgr)) == {(1.0, 2.0, 3.0), (9.0, 9.0, 9.0)}


def test_triangles_keep_facing_outward(trimesh, tmp_path):
    """Turning axes mirrors nothing: the volume that the soup encloses stays positive."""
    _write_box(trimesh, tmp_path / "clutter/a/box.stl", (1.0, 2.0, 3.0))
    for up, nose in (("+z", "-y"), ("+y", "+z"), ("-x", "+y"), ("+y", "-x")):
        mesh = load_entry(
            Entry(name="a", folder="clutter/a", parts=(Part(file="box.stl"),), up=up, nose=nose),
            tmp_path,
            vehicle=False,
        )
        first, second, third = np.moveaxis(mesh.corners_m, 1, 0)
        assert np.einsum("ij,ij->i", first, np.cross(second, third)).sum() > 0.0


def test_clutter_has_its_real_size(trimesh, tmp_path):
    """The longest side is what the table says, whatever the file's units; a glTF's own colours come through."""
    _write_box(trimesh, tmp_path / "clutter/a/box.glb", (100.0, 50.0, 25.0), centre=(500.0, 0.0, 0.0))
    entry = Entry(name="a", folder="clutter/a", parts=(Part(file="box.glb"),), longest_m=0.4)
    mesh = load_entry(entry, tmp_path, vehicle=False)
    points = mesh.corners_m.reshape(-1, 3)
    assert points.min(axis=0) == pytest.approx([-0.2, -0.1, 0.0])
    assert points.max(axis=0) == pytest.approx([0.2, 0.1, 0.1])
    assert mesh.colours_bgr == pytest.approx(np.tile([10.0, 30.0, 200.0], (12, 1)))


def test_texture_is_sampled_where_it_lies(trimesh, tmp_path):
    """A picture named by a wrong path is found by its name, v counts upward, and large triangles are cut to show it."""
    image = pytest.importorskip("PIL.Image")
    pixels = np.zeros((64, 64, 3), dtype=np.uint8)
    pixels[:32] = (255, 0, 0)  # the upper half of the picture is red, the lower blue
    pixels[32:] = (0, 0, 255)
    folder = tmp_path / "clutter" / "a"
    (folder / "meshes").mkdir(parents=True)
    (folder / "textures").mkdir()
    image.fromarray(pixels).save(folder / "textures" / "skin.png")
    (folder / "meshes" / "a.mtl").write_text("newmtl skin\nKd 1 1 1\nmap_Kd C:\\work\\Skin.png\n")
    (folder / "meshes" / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "usemtl skin\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
    )
    mesh = load_entry(Entry(name="a", folder="clutter/a", parts=(Part(file="meshes/a.obj"),)), tmp_path, vehicle=False)
    heights = mesh.corners_m.mean(axis=1)[:, 2]
    assert 500 < len(heights) <= TRIANGLES_MAX
    assert (mesh.colours_bgr[heights > 0.55] == (0.0, 0.0, 255.0)).all()
    assert (mesh.colours_bgr[heights < 0.45] == (255.0, 0.0, 0.0)).all()


def test_a_fine_mesh_is_simplified_and_keeps_its_colours(trimesh, tmp_path):
    """Twenty thousand triangles become at most the limit, in the same place, each part in its own colour."""
    folder = tmp_path / "clutter" / "a"
    folder.mkdir(parents=True)
    trimesh.creation.icosphere(subdivisions=5).export(folder / "ball.stl")
    parts = tuple(
        Part(file="ball.stl", shift=(x, 0.0, 0.0), colour_bgr=colour)
        for x, colour in ((0.0, (250.0, 0.0, 0.0)), (3.0, (0.0, 250.0, 0.0)))
    )
    mesh = load_entry(Entry(name="a", folder="clutter/a", parts=parts, longest_m=5.0), tmp_path, vehicle=False)
    assert 500 < len(mesh.corners_m) <= TRIANGLES_MAX
    left = mesh.corners_m.mean(axis=1)[:, 0] < 0.0
    assert (mesh.colours_bgr[left] == (250.0, 0.0, 0.0)).all()
    assert (mesh.colours_bgr[~left] == (0.0, 250.0, 0.0)).all()
    assert np.ptp(mesh.corners_m.reshape(-1, 3), axis=0) == pytest.approx([5.0, 2.0, 2.0], abs=0.1)


def test_simplified_triangles_take_the_nearest_colour(trimesh, tmp_path):
    """Within one geometry, two colours stay on their own sides when it is simplified."""
    (tmp_path / "clutter" / "a").mkdir(parents=True)
    ball = trimesh.creation.icosphere(subdivisions=5)
    rgba = np.where(ball.triangles_center[:, :1] < 0.0, np.uint8([250, 0, 0, 255]), np.uint8([0, 0, 250, 255]))
    ball.visual = trimesh.visual.ColorVisuals(ball, face_colors=rgba)
    ball.export(tmp_path / "clutter" / "a" / "ball.ply")
    mesh = load_entry(Entry(name="a", folder="clutter/a", parts=(Part(file="ball.ply"),)), tmp_path, vehicle=False)
    side = mesh.corners_m.mean(axis=1)[:, 0]
    assert (mesh.colours_bgr[side < -0.05] == (0.0, 0.0, 250.0)).all()
    assert (mesh.colours_bgr[side > 0.05] == (250.0, 0.0, 0.0)).all()


def test_broken_and_absent_files_are_left_out_with_a_reason(trimesh, tmp_path, caplog):
    """One junk file costs one mesh and one line; the rest load."""
    folder = tmp_path / "vehicles" / "kenney_racing"
    _write_box(trimesh, folder / "vehicle-truck-green.glb", (1.0, 0.5, 2.0))
    (folder / "vehicle-truck-red.glb").write_bytes(b"glTF, but not really")
    with caplog.at_level(logging.WARNING, logger="dnb_edge.train.meshes"):
        meshes = load_vehicle_meshes(tmp_path)
    assert [mesh.name for mesh in meshes] == ["truck_green"]
    lines = [record.getMessage() for record in caplog.records if "truck_red" in record.getMessage()]
    assert len(lines) == 1
    assert "vehicle-truck-red.glb" in lines[0]
    assert "\n" not in lines[0]


def test_no_assets_give_no_meshes(trimesh, tmp_path):
    """A folder that is not there, or empty, is normal."""
    assert load_vehicle_meshes(tmp_path / "none") == []
    assert load_clutter_meshes(tmp_path) == []
    assert attributions(tmp_path / "none") == []


def test_a_missing_file_is_a_work_error(trimesh, tmp_path):
    """The reason names the file."""
    with pytest.raises(WorkError, match=r"suv\.obj"):
        load_entry(next(entry for entry in VEHICLES if entry.name == "suv"), tmp_path, vehicle=True)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_kept_meshes_come_back(tmp_path, count):
    """What is saved is read: names, flags, corners to float32, colours to whole numbers; none is fine too."""
    rng = np.random.default_rng(5)
    meshes = [
        Mesh(
            name=f"m{index}",
            corners_m=rng.random((4 + index, 3, 3)),
            colours_bgr=rng.random((4 + index, 3)) * 255.0,
            recolour=index == 1,
        )
        for index in range(count)
    ]
    back = read_meshes(save_meshes(tmp_path / "meshes.npz", meshes))
    assert [(mesh.name, mesh.recolour) for mesh in back] == [(mesh.name, mesh.recolour) for mesh in meshes]
    for mesh, kept in zip(meshes, back, strict=True):
        assert kept.corners_m == pytest.approx(mesh.corners_m, abs=1e-6)
        assert kept.colours_bgr == pytest.approx(mesh.colours_bgr, abs=0.51)


def test_a_foreign_file_is_refused(tmp_path):
    """Anything but a kept file is an input error that names it."""
    (tmp_path / "junk.npz").write_bytes(b"junk")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    for name in ("junk.npz", "other.npz", "absent.npz"):
        with pytest.raises(InputError, match=name):
            read_meshes(tmp_path / name)


def test_attributions_name_only_what_is_there(tmp_path):
    """A row of the notes counts only where a mesh of the catalogue lies in its folder."""
    (tmp_path / "vehicles" / "kenney_racing").mkdir(parents=True)
    (tmp_path / "vehicles" / "NOTES.md").write_text(NOTES)
    assert attributions(tmp_path) == []
    (tmp_path / "vehicles" / "kenney_racing" / "vehicle-truck-red.glb").write_bytes(b"")
    assert attributions(tmp_path) == [{"folder": "vehicles/kenney_racing", "repo": "a/racing", "licence": "CC0"}]


def test_names_are_unique():
    """A name says which mesh: no two entries share one."""
    names = [entry.name for entry in (*VEHICLES, *CLUTTER)]
    assert len(set(names)) == len(names)


@pytest.mark.skipif(not ASSETS.is_dir(), reason=f"no training assets in {ASSETS}")
@pytest.mark.parametrize("entry", [*VEHICLES, *CLUTTER], ids=lambda entry: entry.name)
def test_every_entry_of_the_catalogue_loads(trimesh, entry):
    """Each real mesh is within the limit, finite, on the ground, of the right size and about its origin."""
    vehicle = entry in VEHICLES
    mesh = load_entry(entry, ASSETS, vehicle=vehicle)
    points = mesh.corners_m.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    assert 0 < len(mesh.corners_m) <= TRIANGLES_MAX
    assert mesh.colours_bgr.shape == (len(mesh.corners_m), 3)
    assert mesh.colours_bgr.min() >= 0.0
    assert mesh.colours_bgr.max() <= 255.0
    assert low[2] == pytest.approx(0.0, abs=0.02)
    if vehicle:
        assert high[0] - low[0] == pytest.approx(1.0, abs=1e-6)
        assert np.abs((low + high)[:2] / 2.0).max() < 0.16
        assert 0.2 < high[1] - low[1] < 1.2
    else:
        assert (high - low).max() == pytest.approx(entry.longest_m)


@pytest.mark.skipif(not ASSETS.is_dir(), reason=f"no training assets in {ASSETS}")
def test_every_folder_used_has_its_licence():
    """Each folder of the catalogue stands in the notes with a licence."""
    named = {row["folder"] for row in attributions(ASSETS) if row["licence"] and row["repo"]}
    assert named == {entry.folder for entry in (*VEHICLES, *CLUTTER)}
