"""Keypoint pairs: what is refused, and how."""

import numpy as np
import pytest
from keypoint_samples import TWIN, exact_pairs, seen

from dnb_edge.errors import InputError
from dnb_edge.view.keypoints import KeypointPairs, load_npy_pairs

CAMERA = seen(TWIN)


def changed(array, row, value):
    out = array.copy()
    out[row] = value
    return out


ON_A_LINE = np.array([[10.0 * k, 20.0 * k + 5] for k in range(7)])
ALL_BUT_ONE = changed(ON_A_LINE, 3, (900.0, 10.0))


@pytest.mark.parametrize(
    ("camera", "twin", "pattern"),
    [
        (CAMERA, TWIN[:6], r"k: 7 camera points but 6 twin points"),
        (CAMERA[:3], TWIN[:3], r"k: 3 pairs of keypoints: a homography needs at least 4"),
        (CAMERA[:0], TWIN[:0], r"k: 0 pairs"),
        (changed(CAMERA, 2, CAMERA[5]), TWIN, r"k: camera keypoints 3 and 6 are the same point"),
        (CAMERA, changed(TWIN, 1, TWIN[0]), r"k: twin keypoints 1 and 2 are the same point"),
        (changed(CAMERA, 4, np.nan), TWIN, r"k: camera keypoint 5 is \(nan, nan\)"),
        (CAMERA, changed(TWIN, 0, (np.inf, 0)), r"k: twin keypoint 1 is \(inf, 0.0\)"),
        (ON_A_LINE, TWIN, r"k: camera keypoints lie on one line: choose points spread"),
        (CAMERA, ON_A_LINE, r"k: twin keypoints lie on one line"),
        (CAMERA, ALL_BUT_ONE, r"k: twin keypoints all but one lie on one line"),
    ],
)
def test_pairs_that_fix_no_homography(camera, twin, pattern):
    """Unequal, few, repeated, endless or collinear points: each named with its source and place."""
    with pytest.raises(InputError, match=pattern):
        KeypointPairs.from_arrays(camera, twin, source="k")


def test_two_lines_of_points_do_fix_one():
    """Three on one line and three on another are as good as any."""
    twin = np.array([[0.0, 0], [500, 0], [1000, 0], [0, 1000], [500, 1000], [1000, 1000]])
    assert len(KeypointPairs.from_arrays(seen(twin), twin, source="k")) == 6


def test_names_must_fit():
    """A name for each pair, or numbers from one."""
    with pytest.raises(InputError, match="2 names for 7 pairs"):
        KeypointPairs.from_arrays(CAMERA, TWIN, source="k", names=("a", "b"))
    assert exact_pairs().names == ("1", "2", "3", "4", "5", "6", "7")


def test_whole_and_fractional_arrays_load_alike(tmp_path):
    """The type of the file's numbers does not matter."""
    for kind in ("int64", "float32", "uint16"):
        np.save(tmp_path / "camera.npy", np.rint(CAMERA).astype(kind))
        np.save(tmp_path / "twin.npy", TWIN.astype(kind))
        pairs = load_npy_pairs(tmp_path / "camera.npy", tmp_path / "twin.npy")
        assert np.array_equal(pairs.camera_array(), np.rint(CAMERA))
        assert np.array_equal(pairs.twin_array(), TWIN)


def written(path, content):
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        np.save(path, content)
    return path


def headed(head: bytes) -> bytes:
    """An array of ten numbers whose head says something else."""
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + bytes(80)


@pytest.mark.parametrize(
    ("content", "pattern"),
    [
        (None, "cannot read the keypoints"),
        (b"", r"not a \.npy file"),
        (b"u,v\n1,2\n", r"not a \.npy file"),
        (headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000, 2), }"), r"not a \.npy file"),
        (headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': (" + b"(" * 99), r"not a \.npy file"),
        (headed(b"{'descr': '<f8,,', 'fortran_order': False, 'shape': (5, 2), }"), r"not a \.npy file"),
        (headed(b"{'descr': ,\n'"), r"not a \.npy file"),
        (np.arange(4000.0).reshape(-1, 2), "2000 keypoints: 1000 are enough"),
        (TWIN.ravel(), r"keypoints of shape \(14,\): it must be \(n, 2\)"),
        (np.zeros((4, 3)), r"keypoints of shape \(4, 3\)"),
        (np.array([["a", "b"]] * 4), "holds no array of numbers"),
        (np.array([[object(), 1]] * 4), r"not a \.npy file"),
        (TWIN + 1j, "holds no array of numbers"),
    ],
)
def test_files_that_hold_no_points(tmp_path, content, pattern):
    """Missing, empty, textual, misshapen and pickled files: one line with the file at fault."""
    good = written(tmp_path / "good.npy", TWIN)
    bad = written(tmp_path / "bad.npy", content)
    with pytest.raises(InputError, match=pattern) as caught:
        load_npy_pairs(good, bad)
    assert str(caught.value).startswith(f"{bad}: ")
    assert "\n" not in str(caught.value)


def test_a_truncated_file_is_refused(tmp_path):
    """A file cut short is no file of points."""
    good = written(tmp_path / "good.npy", TWIN)
    bad = tmp_path / "bad.npy"
    bad.write_bytes(good.read_bytes()[:-9])
    with pytest.raises(InputError, match=r"bad\.npy"):
        load_npy_pairs(bad, good)


def test_an_archive_of_arrays_is_refused(tmp_path):
    """numpy.savez is another format: the message says which one is wanted."""
    np.savez(tmp_path / "both.npz", a=TWIN)
    with pytest.raises(InputError, match=r"numpy\.save"):
        load_npy_pairs(tmp_path / "both.npz", tmp_path / "both.npz")
