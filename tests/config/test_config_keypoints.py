"""Keypoints written by hand in YAML."""

import pytest

from dnb_edge.config.keypoints import load_yaml_pairs
from dnb_edge.errors import InputError

GOOD = """\
image_size: [3840, 2160]
pairs:
  - {name: north gate, camera_px: [1158, 1227.5], twin_px: [2324, 999]}
  - {name: 2, camera_px: [2317, 611], twin_px: [678, 1242]}
  - {camera_px: [2157, 1207], twin_px: [1509, 548]}
  - {camera_px: [1720, 378], twin_px: [1015, 2289]}
"""


def load(tmp_path, text):
    path = tmp_path / "keypoints.yaml"
    path.write_text(text)
    return load_yaml_pairs(path)


def test_a_file_as_people_write_it(tmp_path):
    """Names may be words, numbers or left out; the picture's size travels with the points."""
    pairs = load(tmp_path, GOOD)
    assert pairs.names == ("north gate", "2", "3", "4")
    assert pairs.camera_px[0] == (1158.0, 1227.5)
    assert pairs.twin_px[3] == (1015.0, 2289.0)
    assert pairs.image_size_px == (3840, 2160)
    assert load(tmp_path, GOOD.partition("\n")[2]).image_size_px is None


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("", r"keypoints\.yaml: not a file of keypoints: it must hold pairs"),
        ("- 1\n- 2\n", r"not a file of keypoints"),
        ("image_size: [3840, 2160]\n", r"pairs: is missing"),
        ("pairs: [\n", r"keypoints\.yaml, line 2: not a file of keypoints, not valid YAML"),
        (GOOD.replace("twin_px: [678, 1242]", "twin: [678, 1242]"), r"pairs\.1\.twin_px: is missing"),
        (GOOD.replace("[678, 1242]", "[678]"), r"pairs\.1\.twin_px\.1: is missing"),
        (GOOD.replace("[678, 1242]", "[678, here]"), r"pairs\.1\.twin_px\.1: input should be a valid number"),
        (GOOD.replace("[678, 1242]", "[678, .nan]"), r"pairs\.1\.twin_px\.1: input should be a finite number"),
        (GOOD.replace("[3840, 2160]", "[3840, 0]"), r"image_size\.1: input should be greater than 0"),
        (GOOD.replace("north gate", "''"), r"pairs\.0\.name: '' cannot be told in a line"),
        (GOOD.replace("north gate", '"north\\ngate"'), r"pairs\.0\.name: 'north\\ngate' cannot be told in a line"),
        (GOOD + "size: 3\n", r"size: unknown key"),
        (GOOD.replace("[1509, 548]", "[678, 1242]"), r"keypoints\.yaml: twin keypoints 2 and 3 are the same point"),
        ("\n".join(GOOD.splitlines()[:4]), r"keypoints\.yaml: 2 pairs of keypoints"),
    ],
)
def test_mistakes_name_the_file_and_the_place(tmp_path, text, pattern):
    """One line with the file, the key or line at fault, and the form that is wanted."""
    with pytest.raises(InputError, match=pattern) as caught:
        load(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    """A missing file and one that is no text are input errors with the path."""
    with pytest.raises(InputError, match="No such file"):
        load_yaml_pairs(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not even text"):
        load_yaml_pairs(tmp_path / "binary.yaml")
