"""Turns a checked configuration and an opened source into the rooms of one run.

The only place that knows both the configuration and the rooms: the daemon and every command that needs a track, a view or
a core build them here, so that all of them build the same.
"""

from dnb_edge.assembly.detectors import check_detector, detector_of, make_detector
from dnb_edge.assembly.displays import check_display
from dnb_edge.assembly.headers import check_checkpoint, make_entry, make_header, plain_config
from dnb_edge.assembly.setups import Assembly, assemble, make_scene
from dnb_edge.assembly.sources import check_source, make_source, source_of
from dnb_edge.assembly.tracks import load_pairs, make_track

__all__ = [
    "Assembly",
    "assemble",
    "check_checkpoint",
    "check_detector",
    "check_display",
    "check_source",
    "detector_of",
    "load_pairs",
    "make_detector",
    "make_entry",
    "make_header",
    "make_scene",
    "make_source",
    "make_track",
    "plain_config",
    "source_of",
]
