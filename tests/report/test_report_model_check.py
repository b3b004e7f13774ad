"""The sheet of the worst cases."""

import cv2
import numpy as np
import pytest

from dnb_edge.report.model_check import COLUMNS, TILE_PX, BoxMark, Case, FindMark, contact_sheet, encoded_sheet


def case(width: int, height: int, *, found: bool, right: bool) -> Case:
    return Case(
        name="a-very-long-name-of-a-picture-from-somebodys-phone.jpg",
        bgr=np.full((height, width, 3), 200, np.uint8),
        boxes=(BoxMark(box_px=(10.0, 10.0, 40.0, 30.0), found=found),),
        finds=(FindMark(camera_px=(25.0, 20.0), length_px=30.0, confidence=0.5, right=right),),
    )


@pytest.mark.parametrize("count", [0, 1, COLUMNS, COLUMNS + 1])
def test_the_sheet_holds_all_cases(count):
    """Rows of at most COLUMNS tiles, whatever the shapes of the pictures, as a PNG that reads back alike."""
    sizes = [(64, 48), (48, 640), (3000, 200), (1, 1)]
    cases = [case(*sizes[i % 4], found=True, right=True) for i in range(count)]
    sheet = contact_sheet(cases)
    assert sheet.shape[1] >= TILE_PX[0]
    assert sheet.shape[0] >= TILE_PX[1] * -(-count // COLUMNS)
    read = cv2.imdecode(np.frombuffer(encoded_sheet(cases), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(read, sheet)


def test_right_and_wrong_look_different():
    """A missed car and a false find are drawn in colours that a sheet with everything right does not have in its tile."""
    good = contact_sheet([case(420, 420, found=True, right=True)])[60:]
    bad = contact_sheet([case(420, 420, found=False, right=False)])[60:]
    for colour in ((40, 160, 255), (60, 60, 255)):
        assert not (good == colour).all(axis=2).any()
        assert (bad == colour).all(axis=2).any()
