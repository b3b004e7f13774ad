"""Pictures of the kit's pages: each shows what the product draws now."""

import cv2
import kit_pictures
import numpy as np
import pytest


@pytest.mark.parametrize("name", kit_pictures.PICTURES)
def test_a_picture_is_as_it_is_drawn_now(name):
    """Drawn anew, each committed picture has its size and looks the same, but for shades of text on another machine."""
    kept = cv2.imdecode(np.frombuffer((kit_pictures.FOLDER / name).read_bytes(), np.uint8), cv2.IMREAD_COLOR)
    drawn = cv2.imdecode(np.frombuffer(kit_pictures.PICTURES[name](), np.uint8), cv2.IMREAD_COLOR)
    assert kept.shape == drawn.shape, f"{name} is stale: python docs/tools/kit_pictures.py"
    apart = np.abs(kept.astype(int) - drawn.astype(int)).max(axis=2)
    assert (apart > 64).mean() < 0.001, f"{name} is stale: python docs/tools/kit_pictures.py"


def test_no_other_picture_is_there():
    """A picture that is no longer drawn is taken away."""
    assert {path.name for path in kit_pictures.FOLDER.iterdir()} == set(kit_pictures.PICTURES)
