"""The drift watch of one run: with the picture of the calibration where there is one, else with the run's first seconds.

Knows what the watch needs of the configuration. Knows nothing of patches and motions.
"""

from __future__ import annotations

from dnb_edge.assembly.pictures import calibrated_picture
from dnb_edge.config.schema import ViewConfig
from dnb_edge.track.model import Track
from dnb_edge.values import SourceInfo
from dnb_edge.view.drift import DriftWatch
from dnb_edge.view.drift_judge import watched_track
from dnb_edge.view.ground import GroundMap


def make_watch(view: ViewConfig, ground: GroundMap, track: Track, info: SourceInfo) -> DriftWatch:
    """The watch over one source's pictures. Raises `InputError` where the calibration's picture is missing or another one."""
    watched = watched_track(ground, track.centreline.points_m)
    return DriftWatch(watched, reference=calibrated_picture(view, info))
