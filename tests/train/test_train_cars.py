"""The cars to train on: how they stand, that they are as long as asked, and that a seed names one car."""

import itertools

import numpy as np
import pytest

from dnb_edge.errors import InputError
from dnb_edge.train.cars import any_car, car_kinds, stood
from dnb_edge.train.solids import box, loft, prism, rod, rounded_section

SEEDS = range(12)


def _corners(solids):
    return np.concatenate([solid.vertices_m for solid in solids])


@pytest.mark.parametrize("kind", car_kinds)
def test_each_kind_stands_on_the_floor_about_its_footprint(kind):
    """Every kind stands on z = 0, the middle of what touches the floor is the origin, and it is as long as asked."""
    for seed in SEEDS:
        corners = _corners(car_kinds[kind](np.random.default_rng(seed), 0.3))
        assert np.isfinite(corners).all()
        assert corners[:, 2].min() == pytest.approx(0.0, abs=1e-9)
        contacts = corners[corners[:, 2] < 0.0036]
        assert (contacts[:, :2].min(axis=0) + contacts[:, :2].max(axis=0)) / 2 == pytest.approx([0, 0], abs=0.009)
        assert np.ptp(contacts[:, 0]) > 0.25 * 0.3, "it stands on more than one axle"
        assert np.ptp(contacts[:, 1]) > 0.2 * 0.3
        assert np.ptp(corners[:, 0]) == pytest.approx(0.3, rel=1e-9)


@pytest.mark.parametrize("kind", car_kinds)
def test_each_kind_has_the_build_of_a_car(kind):
    """No kind is wider than long by more than a third, taller than long, or far off its footprint."""
    for seed in SEEDS:
        corners = _corners(car_kinds[kind](np.random.default_rng(seed), 1.0))
        assert 0.35 < np.ptp(corners[:, 1]) < 1.33
        assert 0.15 < corners[:, 2].max() < 1.25
        assert abs(corners[:, 0].max() + corners[:, 0].min()) / 2 < 0.13
        assert abs(corners[:, 1].max() + corners[:, 1].min()) / 2 < 0.08


@pytest.mark.parametrize("kind", car_kinds)
def test_a_seed_names_one_car(kind):
    """The same seed draws the same car, corner for corner and colour for colour; another seed draws another."""
    one, two, other = (car_kinds[kind](np.random.default_rng(seed), 0.2) for seed in (3, 3, 4))
    assert len(one) == len(two)
    for a, b in zip(one, two, strict=True):
        assert np.array_equal(a.vertices_m, b.vertices_m)
        assert (a.faces, a.colour, a.face_colours) == (b.faces, b.colour, b.face_colours)
    assert len(one) != len(other) or not np.array_equal(_corners(one), _corners(other))


@pytest.mark.parametrize("kind", car_kinds)
def test_each_face_has_a_colour_that_a_picture_can_hold(kind):
    """Every solid names a colour for each of its faces or for all, within 0..255."""
    for seed in SEEDS:
        for solid in car_kinds[kind](np.random.default_rng(seed), 0.2):
            colours = (solid.colour,) if solid.face_colours is None else solid.face_colours
            assert solid.face_colours is None or len(colours) == len(solid.faces)
            assert all(0 <= value <= 255 for colour in colours for value in colour)


def test_any_car_keeps_to_the_kinds_named():
    """A held-out set gets only its kinds: each car drawn is one that the named maker draws."""
    drawn = any_car(np.random.default_rng(8), 0.25, kinds=("kart",))
    rng = np.random.default_rng(8)
    rng.choice(1, p=[1.0])
    expected = car_kinds["kart"](rng, 0.25)
    assert np.array_equal(_corners(drawn), _corners(expected))


@pytest.mark.parametrize("kinds", [("lorry",), ("kart", "hovercraft"), ()])
def test_an_unknown_kind_is_refused(kinds):
    """A kind that is not drawn, or none at all, is bad input that names the kinds there are."""
    with pytest.raises(InputError, match="bare_chassis"):
        any_car(np.random.default_rng(0), 0.3, kinds=kinds)


def test_stood_scales_lowers_and_centres():
    """A plate off its place lands with its underside's middle at the origin and the length asked."""
    corners = _corners(stood([box((3.0, 1.0, 5.0), (2.0, 1.0, 0.5), (0, 0, 0))], 0.4))
    assert corners.min(axis=0) == pytest.approx([-0.2, -0.1, 0.0])
    assert corners.max(axis=0) == pytest.approx([0.2, 0.1, 0.1])


@pytest.mark.parametrize(
    "solid",
    [
        box((0, 0, 0), (1, 1, 1), (0, 0, 0)),
        *(prism((0, 0, 0), 1.0, 1.0, (0, 0, 0), axis=axis, top_scale=0.7) for axis in "xyz"),
        *(rod(np.zeros(3), np.array(end, dtype=float), 0.1, (0, 0, 0)) for end in ((1, 2, 3), (0, 0, 1), (-1, 0.5, 0))),
        *loft(
            [(x, rounded_section(w, 0.0, h)) for x, w, h in ((0, 1, 1), (1, 1.2, 1.5), (2, 0.5, 0.5))], ((0, 0, 0),) * 6
        ),
    ],
)
def test_faces_look_outward(solid):
    """Each face's corners run counter-clockwise seen from outside, or it would be drawn inside out."""
    centre = solid.vertices_m.mean(axis=0)
    for face in solid.faces:
        a, b, c = solid.vertices_m[list(face[:3])]
        assert np.dot(np.cross(b - a, c - a), a - centre) > 0


def test_a_loft_colours_its_sides_and_tops():
    """The roof of each stretch takes its own colour, the flanks and the ends theirs."""
    colours = tuple((float(i), 0.0, 0.0) for i in range(6))
    sections = [(float(x), rounded_section(1.0, 0.0, 1.0)) for x in range(3)]
    tops = ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    parts = loft(sections, colours, top_colours=tops, end_colours=((7.0,) * 3, (8.0,) * 3))
    for part, top, (low, high) in zip(parts, tops, itertools.pairwise((0.0, 1.0, 2.0)), strict=True):
        assert part.face_colours == (*colours[:3], top, *colours[4:], (7.0,) * 3, (8.0,) * 3)
        assert part.vertices_m[list(part.faces[3]), 2] == pytest.approx([1.0] * 4)
        assert part.vertices_m[list(part.faces[-1]), 0] == pytest.approx([high] * 6)
        assert part.vertices_m[list(part.faces[-2]), 0] == pytest.approx([low] * 6)
