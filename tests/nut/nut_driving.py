"""What tests show to drivers."""

import numpy as np

from dnb_edge.nut.patience import Patience
from dnb_edge.sim.control import Briefing, Sight

BRIEFING = Briefing(
    seed=7,
    wheelbase_m=0.16,
    steering_lock_rad=0.5,
    top_speed_mps=1.5,
    picture_px=(16, 12),
    period_s=0.033,
    delay_s=0.02,
)
SHORT = Patience(start_s=20.0, answer_s=0.5, end_s=0.3)
LONG = Patience(start_s=20.0, answer_s=20.0, end_s=0.3)


def sight(t_ns=1_000_000_000, *, red=51, green=102, blue=255, speed_mps=0.25, size_px=(16, 12)) -> Sight:
    """A picture of one colour."""
    bgr = np.full((size_px[1], size_px[0], 3), (blue, green, red), dtype=np.uint8)
    bgr.flags.writeable = False
    return Sight(t_ns=t_ns, bgr=bgr, speed_mps=speed_mps)
