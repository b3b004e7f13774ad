"""The cameras that there is a cradle for, with the sizes that a cradle needs, in mm and grams.

Knows sizes from the makers' data sheets and drawings (`source`), rounded to what a print can hold. Camera bodies are taken
for boxes: 2 mm of foam on each side takes up what they are not. Knows nothing of optics: those are in docs/mount.md.
"""

from dataclasses import dataclass

from hardware.fasteners import M2, M2_5, Screw


@dataclass(frozen=True, slots=True, kw_only=True)
class Webcam:
    """A camera in a housing without screw holes of its own, held between two jaws."""

    name: str
    title: str
    width_mm: float
    height_mm: float
    depth_mm: float
    """Of the body alone, without clip or foot."""
    foot_mm: float
    """Width of the clip or foot that must find room below the middle of the body."""
    mass_g: float
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A bare camera board on four screws."""

    name: str
    title: str
    width_mm: float
    height_mm: float
    holes_across_mm: float
    holes_up_mm: float
    screw: Screw
    standoff_mm: float
    """Room below the board for parts on its back."""
    thickness_mm: float
    """From the back of the board to the tip of the lens."""
    mass_g: float
    source: str


C920 = Webcam(
    name="c920",
    title="Logitech C920",
    width_mm=94.0,
    height_mm=29.0,
    depth_mm=24.0,
    foot_mm=34.0,
    mass_g=162.0,
    source="maker: 94 mm wide, 162 g with cable; body height and depth measured by users, without the clip",
)
C270 = Webcam(
    name="c270",
    title="Logitech C270",
    width_mm=73.0,
    height_mm=32.0,
    depth_mm=22.0,
    foot_mm=30.0,
    mass_g=75.0,
    source="maker: 72.9 x 31.9 mm, 75 g; depth without the clip from pictures",
)
ELP_38 = Board(
    name="elp-38",
    title="ELP and other 38 x 38 mm USB camera boards",
    width_mm=38.0,
    height_mm=38.0,
    holes_across_mm=34.0,
    holes_up_mm=34.0,
    screw=M2,
    standoff_mm=5.0,
    thickness_mm=30.0,
    mass_g=40.0,
    source="sellers' drawings: 38 x 38 mm, four holes 34 mm apart; measure yours, some have 28 mm",
)
PI_CAMERA = Board(
    name="pi-camera",
    title="Raspberry Pi Camera Module 2 and 3",
    width_mm=25.0,
    height_mm=24.0,
    holes_across_mm=21.0,
    holes_up_mm=12.5,
    screw=M2,
    standoff_mm=5.0,
    thickness_mm=12.5,
    mass_g=4.0,
    source="maker's drawing: 25 x 24 mm, holes 21 x 12.5 mm apart, 2.2 mm wide",
)
PI_HQ_GS = Board(
    name="pi-hq-gs",
    title="Raspberry Pi HQ and Global Shutter Camera",
    width_mm=38.0,
    height_mm=38.0,
    holes_across_mm=30.0,
    holes_up_mm=30.0,
    screw=M2_5,
    standoff_mm=6.0,
    thickness_mm=62.0,
    mass_g=115.0,
    source="maker's drawing: 38 x 38 mm, holes 30 mm apart, 2.5 mm wide; with a 6 mm lens of 53 g",
)

WEBCAMS = (C920, C270)
BOARDS = (ELP_38, PI_CAMERA, PI_HQ_GS)
