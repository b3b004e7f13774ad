"""Common cameras by name: about how wide they see, and at what size and rate.

Knows makers' figures only. An angle is *about* right: it differs from camera to camera by a degree or two, with focus, and
where a driver crops the picture. Measure your own: the width w that fills the picture at the distance a makes 2 atan(w / 2a).

Wide boards that are sold with one of many lenses (ELP's, say) are not here: their angles differ too much. Give `--hfov`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownCamera:
    """One camera in the mode that shows its whole width."""

    title: str
    hfov_deg: float
    """Between the picture's left and right edges, about; not the diagonal that webcams are sold by."""
    width_px: int
    height_px: int
    fps: float
    """The highest rate at that size."""
    rolling: bool = True
    """Whether the rows are read one after the other."""
    says: str = ""
    """Where the figures come from."""


CAMERAS = {
    "pi3": KnownCamera(
        title="Raspberry Pi Camera Module 3",
        hfov_deg=66.0,
        width_px=2304,
        height_px=1296,
        fps=56.0,
        says="maker: 66 degrees across; mode 2304x1296 at 56 fps shows the whole sensor (1536x864 at 120 fps is cropped)",
    ),
    "pi3-wide": KnownCamera(
        title="Raspberry Pi Camera Module 3 Wide",
        hfov_deg=102.0,
        width_px=2304,
        height_px=1296,
        fps=56.0,
        says="maker: 102 degrees across; modes as the Camera Module 3's; calibrate its lens",
    ),
    "pi2": KnownCamera(
        title="Raspberry Pi Camera Module 2",
        hfov_deg=62.2,
        width_px=1640,
        height_px=1232,
        fps=41.0,
        says="maker: 62.2 degrees across; mode 1640x1232 at 41 fps shows the whole sensor (1920x1080 is cropped)",
    ),
    "pi-hq-6mm": KnownCamera(
        title="Raspberry Pi High Quality Camera, 6 mm lens",
        hfov_deg=55.0,
        width_px=2028,
        height_px=1080,
        fps=50.0,
        says="computed: 6.29 mm of sensor (4056 px of 1.55 um) behind 6 mm; mode 2028x1080 at 50 fps has the whole width",
    ),
    "pi-gs-6mm": KnownCamera(
        title="Raspberry Pi Global Shutter Camera, 6 mm lens",
        hfov_deg=45.0,
        width_px=1456,
        height_px=1088,
        fps=60.0,
        rolling=False,
        says="computed: 5.02 mm of sensor (1456 px of 3.45 um) behind 6 mm; 60 fps",
    ),
    "c920": KnownCamera(
        title="Logitech C920",
        hfov_deg=70.0,
        width_px=1920,
        height_px=1080,
        fps=30.0,
        says="computed: the maker's 78 degrees across the diagonal of 16:9; 1080p and 720p at 30 fps",
    ),
    "c270": KnownCamera(
        title="Logitech C270",
        hfov_deg=49.0,
        width_px=1280,
        height_px=720,
        fps=30.0,
        says="computed: the maker's 55 degrees across the diagonal of 16:9 (older sheets say 60: 53 across); 720p at 30 fps",
    ),
}
"""By the name that `--camera` takes."""
