"""The tables of where cameras go: their places see the track, and the paper's is among them."""

import re

import mount_places
import pytest

from dnb_edge.mount.plan import margin_fits
from dnb_edge.mount.suggest import Free

TEXT = (mount_places._PATH).read_text(encoding="utf-8")


@pytest.mark.parametrize("ground", mount_places.GROUNDS, ids=lambda ground: ground.name)
@pytest.mark.parametrize("name", mount_places.SHOWN)
def test_the_best_place_sees_the_whole_track(ground, name):
    """A place in the table has all of the track in its picture, below the ceiling; where there is none, a height is told."""
    camera = mount_places.SHOWN[name]
    plan = mount_places.planned(ground, camera)
    if plan is None:
        needed = mount_places.height_needed_m(ground, camera)
        assert needed is not None
        assert f"sees track and margin from {needed:.1f} m up" in TEXT
        return
    assert plan.coverage.share == pytest.approx(1.0)
    assert plan.camera.stand.height_m <= ground.highest_m + 1e-9


@pytest.mark.parametrize("ground", mount_places.GROUNDS, ids=lambda ground: ground.name)
def test_straight_down_is_as_the_planner_has_it(ground):
    """The height for a camera that looks straight down is the least from which the planner sees all of the track."""
    camera = mount_places.SHOWN["c920"]
    height_m, mm = mount_places.straight_down(ground, camera)
    above, below = (
        mount_places.planned(ground, camera, Free(height_m=up, pitch_deg=90.0, distance_m=-ground.depth_m / 2))
        for up in (height_m, height_m - 0.02)
    )
    assert margin_fits(above.request, above)
    assert not margin_fits(below.request, below)
    assert above.worst.resolution.worst_mm == pytest.approx(mm)


def test_the_papers_place_is_among_them():
    """2.15 m and 41 degrees: the paper's camera sees its whole track from there."""
    plan = mount_places.planned(mount_places.GROUNDS[-1], mount_places.PAPER, mount_places.PAPERS)
    assert (plan.camera.stand.height_m, plan.camera.stand.pitch_deg) == (2.15, 41.0)
    assert plan.coverage.share == pytest.approx(1.0)
    assert re.search(r"^\| the paper's, 85 degrees, 4K \| 1\.14 m \| 100 % \|", TEXT, re.MULTILINE)
