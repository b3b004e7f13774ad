"""What the system tests share: the guest's image, the guest itself, and a USB webcam played in user space. See ../README.md."""

import sys
from pathlib import Path

# Cars with a marker on the roof are drawn by what tests the detector.
sys.path.append(str(Path(__file__).resolve().parents[2] / "detect"))
