"""A picture that carries a note on how to turn it is the camera's all the same: what is compared with frames is not turned."""

import json
from pathlib import Path

import cv2
import numpy as np
from edge_command import edge

from dnb_edge.cli.marker_pictures import picture_from_file
from dnb_edge.cli.photograph import read_photograph
from dnb_edge.cli.track_from import load_photos
from dnb_edge.sim.renderer import Renderer
from dnb_edge.sim.rig import Rig

UPSIDE_DOWN = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x03\0" + bytes(6)


def upside_down(rig: Rig, path: Path) -> Path:
    """The empty room as a JPEG whose EXIF says that it is to be turned by 180 degrees, which it is not."""
    data = cv2.imencode(".jpg", Renderer(rig.circuit, rig.camera, 1).picture(0, None))[1].tobytes()
    path.write_bytes(data[:2] + b"\xff\xe1" + (len(UPSIDE_DOWN) + 2).to_bytes(2, "big") + UPSIDE_DOWN + data[2:])
    return path


def test_photographs_of_the_track_are_taken_as_the_sensor_saw_them(rig: Rig, tmp_path: Path) -> None:
    """Markers' and tracks' photographs likewise: no reader turns what the map was not made on."""
    turned = read_photograph(upside_down(rig, tmp_path / "then.jpg"))
    for read in (picture_from_file(tmp_path / "then.jpg").pictures[0], load_photos([tmp_path / "then.jpg"])[0][1]):
        assert np.array_equal(read, turned)
    upright = Renderer(rig.circuit, rig.camera, 1).picture(0, None).astype(float)
    assert np.abs(turned - upright).mean() < 5.0


def test_check_compares_pictures_as_the_sensor_saw_them(pristine: Path, rig: Rig, tmp_path: Path) -> None:
    """A JPEG whose EXIF says "upside down" is decoded as the frames are: the camera is in its place."""
    reference = upside_down(rig, tmp_path / "then.jpg")
    ran = edge(
        "calibrate", "check", "--config", pristine / "demo.yaml", "--reference", reference, "--source", "sim:", "--json"
    )
    assert ran.code == 0, ran.err
    assert json.loads(ran.out)["verdict"] == "in_place"
