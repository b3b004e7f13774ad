"""The layout file of floor markers: what it means, and one line for each mistake."""

import pytest

from dnb_edge.config.marker_layout import load_marker_layout
from dnb_edge.errors import InputError

WHOLE = """\
twin: {metres_per_px: 0.002, height_px: 1500}
sigma_mm: 4
markers:
  - {number: 0, track_m: [0.5, 0.4]}
  - {number: 3, track_m: [2.5, 0.4], point: top left}
  - {number: 4, twin_px: [800, 500]}
"""


def written(tmp_path, text):
    path = tmp_path / "layout.yaml"
    path.write_text(text)
    return path


def test_a_layout_is_read(tmp_path):
    """Metres and twin px, middles and corners, sigma and scale arrive as track m."""
    layout = load_marker_layout(written(tmp_path, WHOLE))
    assert layout.scale.metres_per_px == 0.002
    first, second, third = layout.points
    assert (first.number, first.local, first.at_m, first.sigma_m) == (0, (0.0, 0.0), (0.5, 0.4), 0.004)
    assert (second.number, second.local) == (3, (-0.5, 0.5))
    assert third.at_m == pytest.approx((1.6, 2.0))
    assert load_marker_layout(written(tmp_path, WHOLE.partition("\n")[2].replace("twin_px", "track_m"))).scale is None


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("number: 3", "number: three", "markers.1.number"),
        ("point: top left", "point: middle left", "markers.1.point"),
        ("point: top left", "corner: 1", "markers.1.corner: unknown key"),
        ("sigma_mm: 4", "sigma_mm: 0", "sigma_mm"),
        ("twin: {metres_per_px: 0.002, height_px: 1500}\n", "", "marker 4 is in twin_px: add twin"),
        (", twin_px: [800, 500]", "", "marker 4 needs one of track_m and twin_px"),
        ("{number: 3, track_m: [2.5, 0.4], point: top left}", "{number: 0, track_m: [2.5, 0.4]}", "given twice"),
        ("[0.5, 0.4]", "[0.5]", "markers.0.track_m"),
        ("[0.5, 0.4]", "[0.5, .nan]", "markers.0.track_m"),
        ("markers:", "marker:", "unknown key|is missing"),
        ("{number: 0,", "{number: 0;", "not valid YAML|number"),
    ],
)
def test_mistakes_are_named(tmp_path, old, new, said):
    """Each mistake is one line with the file and the key at fault."""
    text = WHOLE.replace(old, new)
    with pytest.raises(InputError, match=said) as refused:
        load_marker_layout(written(tmp_path, text))
    assert "layout.yaml" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"- 1\n", "not a marker layout"),
        (b"\xff\xfe", "not even text"),
        (b"markers: []\n", "two markers must be measured"),
    ],
)
def test_other_files_are_refused(tmp_path, data, said):
    """What is no layout at all is told with the form that it should have."""
    path = tmp_path / "layout.yaml"
    path.write_bytes(data)
    with pytest.raises(InputError, match=said):
        load_marker_layout(path)
    with pytest.raises(InputError, match="cannot read the marker layout"):
        load_marker_layout(tmp_path / "none.yaml")
