"""The pure core: detections in, events out. Live, over a file and over a recording it is the same object.

Knows everything from pixels on the track plane to scores, and nothing that can differ between two runs over the same
detections: it reads no clock, opens no file and knows no thread. All that it depends on is in `CoreSetup`, which goes into
the recording, so a recording can be scored again bit for bit.
"""

from __future__ import annotations

from dnb_edge.core.core import Core
from dnb_edge.core.setup import CoreSetup

__all__ = ["Core", "CoreSetup"]
