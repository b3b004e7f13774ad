"""What the centre detector finds in a still scene: one round of its looks at the same picture.

Knows how the detector spreads its looks over frames (a fine tile a frame, all in turn); nothing of files or labels.
"""

from __future__ import annotations

from dnb_edge.detect.centre import CentreDetector, CentreDetectorSettings
from dnb_edge.detect.looks import tile_looks
from dnb_edge.detect.onnx import CentreNetwork
from dnb_edge.detect.sight import merged
from dnb_edge.values import BgrImage, Detection

FRAME_NS = 33_333_333
"""Time between two looks; any would do."""
MOST_FINDS = 100
"""At most as many cars are told in one picture."""


def frames_of_a_round(width_px: int, height_px: int, settings: CentreDetectorSettings) -> int:
    """Frames in which a detector that follows nothing has looked at every fine tile of a frame of this size."""
    tiles = tile_looks(
        width_px,
        height_px,
        working_width_px=settings.fine_width_px,
        tile_px=settings.tile_px,
        overlap_px=settings.overlap_px,
    )
    return len(tiles)


def look_at_still(
    network: CentreNetwork, image: BgrImage, settings: CentreDetectorSettings | None = None
) -> tuple[Detection, ...]:
    """All that the detector reports in one round over the still picture `image`, (h, w, 3), each place once; surest first.

    A new detector looks, which has no background to compare with, as at a car that stands still from the start: what it would
    tell the core about such a scene, and nothing more.
    """
    known = settings or CentreDetectorSettings()
    detector = CentreDetector(network, known)
    found: list[Detection] = []
    for turn in range(frames_of_a_round(image.shape[1], image.shape[0], known)):
        found.extend(detector.detect(image, sequence=turn, t_ns=turn * FRAME_NS, windows=()).detections)
    return merged(found, MOST_FINDS)
