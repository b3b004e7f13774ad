"""A picture that carries a note on how to turn it is the camera's all the same: what is compared with frames is not turned."""

import json
from pathlib import Path

import cv2
from edge_command import edge

from dnb_edge.sim.renderer import Renderer
from dnb_edge.sim.rig import Rig

UPSIDE_DOWN = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x03\0" + bytes(6)


def test_check_compares_pictures_as_the_sensor_saw_them(pristine: Path, rig: Rig, tmp_path: Path) -> None:
    """A JPEG whose EXIF says "upside down" is decoded as the frames are: the camera is in its place."""
    data = cv2.imencode(".jpg", Renderer(rig.circuit, rig.camera, 1).picture(0, None))[1].tobytes()
    reference = tmp_path / "then.jpg"
    reference.write_bytes(data[:2] + b"\xff\xe1" + (len(UPSIDE_DOWN) + 2).to_bytes(2, "big") + UPSIDE_DOWN + data[2:])
    ran = edge(
        "calibrate", "check", "--config", pristine / "demo.yaml", "--reference", reference, "--source", "sim:", "--json"
    )
    assert ran.code == 0, ran.err
    assert json.loads(ran.out)["verdict"] == "in_place"
