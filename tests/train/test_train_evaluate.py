"""The evaluation command's follower, and its answers to wrong input."""

import pytest

from dnb_edge.errors import InputError
from dnb_edge.train.evaluate import Follower, clip_truth, run
from dnb_edge.values import Detection


def _seen(u: float, *, moving: bool = True, confidence: float = 0.6) -> Detection:
    return Detection(camera_px=(u, 50.0), sigma_px=1.0, length_px=40.0, confidence=confidence, moving=moving)


def test_the_follower_predicts_at_constant_velocity_and_starts_over_after_a_miss():
    """After detections at 10 and 16 the car is expected at 22; after a miss nothing is."""
    follower = Follower()
    assert follower.windows() == ()
    follower.take([_seen(10.0)])
    follower.take([_seen(16.0)])
    assert follower.windows()[0].camera_px == (22.0, 50.0)
    assert follower.take([]) is None
    assert follower.windows() == ()


def test_the_follower_starts_only_on_what_moves():
    """A still thing is never taken up, however sure."""
    follower = Follower()
    assert follower.take([_seen(10.0, moving=False, confidence=0.99)]) is None


@pytest.mark.parametrize("content", [None, "{", "{}", '{"frames": [{"camera": [1]}]}', '{"frames": 3}'])
def test_a_wrong_truth_file_is_named(tmp_path, content):
    """A truth file that is missing or of another form is an InputError with its name."""
    path = tmp_path / "clip.truth.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=r"clip\.truth\.json"):
        clip_truth(path)


def test_a_missing_photo_is_named(tmp_path):
    """A photograph that cannot be read is an InputError with its name."""
    with pytest.raises(InputError, match=r"none\.jpg"):
        run(["--photo", str(tmp_path / "none.jpg")])
