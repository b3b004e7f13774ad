"""Which of the real meshes are used, from which files, which way up, and where loose parts go: a table checked by eye.

Knows folders, file names, axes, sizes and plausible colours; reads nothing and knows no mesh library.
Numbers are in the units of the files they place; vehicles end at length 1, clutter at `longest_m`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Triple = tuple[float, float, float]

BLACK: Triple = (35.0, 35.0, 38.0)
DARK: Triple = (70.0, 70.0, 72.0)
GREY: Triple = (150.0, 150.0, 150.0)
SILVER: Triple = (190.0, 190.0, 192.0)
YELLOW: Triple = (30.0, 190.0, 230.0)
XP900_FRONT_AXLE = 108.6  # y of the front axle in its file
RED: Triple = (40.0, 40.0, 190.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One file of an entry: scaled, turned about x, then y, then z of the assembly (degrees), then moved."""

    file: str
    scale: float = 1.0
    turn_deg: Triple = (0.0, 0.0, 0.0)
    shift: Triple = (0.0, 0.0, 0.0)
    colour_bgr: Triple | None = None
    """In place of the file's colours; needed where the file has none."""
    geometry: str = ".*"
    """Regular expression: the geometries of the file that belong."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One vehicle or one piece of clutter: parts, the axes that point up and forward, its size and its source."""

    name: str
    folder: str
    parts: tuple[Part, ...]
    up: Axis = "+z"
    nose: Axis = "+x"
    longest_m: float = 1.0
    """Clutter only: the longest side, metres."""
    recolour: bool = False
    """The colours are only plausible, or one flat paint: the generator may replace them."""


def _one(  # a whole vehicle in one file
    name: str, folder: str, file: str, *, up: Axis = "+z", nose: Axis = "+x", recolour: bool = False
) -> Entry:
    return Entry(name=name, folder=f"vehicles/{folder}", parts=(Part(file=file),), up=up, nose=nose, recolour=recolour)


def _wheels(
    file: str, *, x: tuple[float, ...], y: float, z: float, colour_bgr: Triple | None = BLACK, roll_deg: float = 0.0
) -> Iterator[Part]:
    """Four equal wheels at two axles; those on the right are turned half round, so that rims look outward."""
    for axle in x:
        yield Part(file=file, shift=(axle, y, z), turn_deg=(roll_deg, 0.0, 0.0), colour_bgr=colour_bgr)
        yield Part(file=file, shift=(axle, -y, z), turn_deg=(roll_deg, 0.0, 180.0), colour_bgr=colour_bgr)


def _hatchback(colour: str) -> Entry:
    """The painted ones lack the wheels' picture."""
    file = "meshes/hatchback.obj"
    parts = (Part(file=file, geometry="Wheels3", colour_bgr=DARK), Part(file=file, geometry="Hatchback"))
    return Entry(name=f"hatchback_{colour}", folder=f"vehicles/gz_hatchback_{colour}", parts=parts, nose="-y")


def _godot(name: str, geometry: str, wheels_z: tuple[float, ...], lift: float) -> Entry:
    file = "meshes/meshes.glb"
    wheels = tuple(
        Part(file=file, geometry=r"wheel(_\d)?", shift=(side * 0.55, 0.23, z)) for z in wheels_z for side in (-1.0, 1.0)
    )
    body = Part(file=file, geometry=geometry, shift=(0.0, lift, 0.0))
    return Entry(name=name, folder="vehicles/godot_truck_town", parts=(body, *wheels), up="+y", nose="+z")


VEHICLES: tuple[Entry, ...] = (
    _one("prius", "gz_prius_hybrid", "meshes/Hybrid.obj", nose="-y"),
    _one("hatchback", "gz_hatchback", "meshes/hatchback.obj", nose="-y"),
    _hatchback("red"),
    _hatchback("blue"),
    _one("suv", "gz_suv", "meshes/suv.obj", nose="+y"),
    _one("pickup", "gz_pickup", "meshes/pickup.dae", nose="+y"),
    _one("polaris_ev", "gz_polaris_ranger_ev", "meshes/polaris.dae", nose="+y"),
    Entry(
        name="polaris_xp900",
        folder="vehicles/gz_polaris_ranger_xp900",
        parts=(
            # The file misplaces its right front wheel: the left one stands in for it.
            Part(file="meshes/polaris.dae", geometry=r"(?!.*(Wheel|Brake)_Front_Right).*"),
            Part(
                file="meshes/polaris.dae",
                geometry=r".*Wheel_Front_Left",
                turn_deg=(0.0, 0.0, 180.0),
                shift=(0.0, XP900_FRONT_AXLE * 2.0, 0.0),
            ),
        ),
        nose="+y",
    ),
    _one("motorcycle", "kenney_racing", "vehicle-motorcycle.glb", up="+y", nose="+z"),
    _one("truck_green", "kenney_racing", "vehicle-truck-green.glb", up="+y", nose="+z"),
    _one("truck_purple", "kenney_racing", "vehicle-truck-purple.glb", up="+y", nose="+z"),
    _one("truck_red", "kenney_racing", "vehicle-truck-red.glb", up="+y", nose="+z"),
    _one("truck_yellow", "kenney_racing", "vehicle-truck-yellow.glb", up="+y", nose="+z"),
    _godot("minivan", r"minivan(_\d)?", (-0.8, 0.8), 0.0),
    _godot("tow_truck", r"tow_truck(_\d)?", (-0.8, 0.8), 0.0),
    _godot("truck_cab", r"truck_cab(_\d)?", (-0.8, 0.8), 0.22),
    Entry(
        name="deepracer",
        folder="vehicles/deepracer",
        parts=(
            Part(file="meshes/deepracer.STL", colour_bgr=DARK),
            *_wheels("meshes/left_rear_wheel.STL", x=(0.0, 0.164), y=0.078, z=0.03),
        ),
        recolour=True,
    ),
    Entry(
        name="deepracer_lidar",
        folder="vehicles/deepracer",
        parts=(
            Part(file="meshes/deepracer_with_lidar.STL", colour_bgr=GREY),
            Part(file="meshes/laser.STL", shift=(0.085, 0.0, 0.17), colour_bgr=BLACK),
            *_wheels("meshes/left_rear_wheel.STL", x=(0.0, 0.164), y=0.078, z=0.03),
        ),
        recolour=True,
    ),
    Entry(
        name="autorally",
        folder="vehicles/autorally",
        parts=(
            Part(file="cad/Vehicle_Texture.dae"),
            *_wheels(
                "cad/autoRallyPlatformRearWheelTextured.dae", x=(0.0,), y=0.19, z=0.0, colour_bgr=None, roll_deg=90.0
            ),
            *_wheels(
                "cad/autoRallyPlatformFrontWheelTextured.dae", x=(0.57,), y=0.19, z=0.0, colour_bgr=None, roll_deg=90.0
            ),
        ),
    ),
    Entry(
        name="husky",
        folder="vehicles/bullet_husky",
        parts=(
            Part(file="meshes/base_link.stl", colour_bgr=DARK),
            Part(file="meshes/top_plate.stl", colour_bgr=YELLOW),
            Part(file="meshes/user_rail.stl", shift=(0.272, 0.0, 0.245), colour_bgr=BLACK),
            Part(file="meshes/bumper.stl", shift=(0.48, 0.0, 0.091), colour_bgr=BLACK),
            Part(file="meshes/bumper.stl", shift=(-0.48, 0.0, 0.091), turn_deg=(0.0, 0.0, 180.0), colour_bgr=BLACK),
            *_wheels("meshes/wheel.stl", x=(-0.256, 0.256), y=0.2854, z=0.03282),
        ),
    ),
    Entry(
        name="pioneer2dx",
        folder="vehicles/gz_pioneer2dx",
        parts=(
            Part(file="meshes/chassis.dae", shift=(0.0, 0.0, 0.16)),
            *_wheels("meshes/wheel.dae", x=(0.1,), y=0.17, z=0.112, colour_bgr=None),
        ),
    ),
    Entry(
        name="pioneer3at",
        folder="vehicles/gz_pioneer3at",
        parts=(
            Part(file="meshes/chassis.dae", shift=(0.0, 0.0, 0.177)),
            *_wheels("meshes/wheel.dae", x=(-0.135, 0.135), y=0.2, z=0.111, colour_bgr=None, roll_deg=90.0),
        ),
    ),
    Entry(
        name="rosbot",
        folder="vehicles/rosbot",
        parts=(
            Part(file="meshes/body.stl", scale=0.001, turn_deg=(90.0, 0.0, 90.0), colour_bgr=RED),
            Part(
                file="meshes/cover.stl",
                scale=0.001,
                turn_deg=(90.0, 0.0, 90.0),
                shift=(0.0, 0.0, 0.06),
                colour_bgr=DARK,
            ),
            *_wheels("meshes/wheel_a.dae", x=(-0.053, 0.053), y=0.096, z=0.0, colour_bgr=BLACK),
        ),
        recolour=True,
    ),
    Entry(
        name="create3",
        folder="vehicles/create3",
        parts=(Part(file="meshes/body_visual.dae"), Part(file="meshes/bumper_visual.dae")),
    ),
)
"""Vehicles: `up` and `nose` name the axes of the (assembled) files that become +z and +x."""


def _gz(name: str, longest_m: float, file: str | None = None, *, recolour: bool = False) -> Entry:
    part = Part(file=file or f"meshes/{name}.dae")
    return Entry(name=name, folder=f"clutter/gz_{name}", parts=(part,), longest_m=longest_m, recolour=recolour)


def _aws(name: str, world: str, kind: str, longest_m: float) -> Entry:
    short = f"{name}_01"
    own = kind in {"warehouse", "hospital"}  # those worlds name their files in full
    file = f"aws_robomaker_{kind}_{short}_visual.DAE" if own else f"aws_{short}_visual.DAE"
    part = Part(file=f"aws_robomaker_{kind}_{short}/meshes/{file}")
    return Entry(name=name.lower(), folder=f"clutter/aws_{world}", parts=(part,), longest_m=longest_m)


def _bullet(name: str, file: str, longest_m: float, *, up: Axis = "+z") -> Entry:
    parts = (Part(file=file),)
    return Entry(name=name, folder="clutter/bullet_objects", parts=parts, longest_m=longest_m, up=up, recolour=True)


CLUTTER: tuple[Entry, ...] = (
    _gz("construction_cone", 0.46),
    _gz("construction_barrel", 1.0),
    _gz("cardboard_box", 0.4),
    _gz("table_marble", 1.8, "meshes/table_lightmap.dae"),
    _gz("cafe_table", 0.91),
    _gz("coke_can", 0.123),
    _gz("bowl", 0.196, recolour=True),
    _gz("bin_4_dropping_task", 0.9),
    _gz("plastic_cup", 0.13),
    _gz("hammer", 0.33),
    _gz("monkey_wrench", 0.39),
    _gz("cordless_drill", 0.26),
    _gz("first_2015_trash_can", 0.74, "meshes/trash_can.dae"),
    _gz("euro_pallet", 1.2, "meshes/pallet.dae", recolour=True),
    _gz("saucepan", 0.49),
    _gz("grey_tote", 0.68, "meshes/tote.dae"),
    _gz("cinder_block", 0.435),
    _gz("brick_box_3x1x3", 0.25, "meshes/simple_box.dae", recolour=True),
    _gz("dumpster", 1.67, recolour=True),
    _gz("fire_hydrant", 0.93),
    _gz("mailbox", 1.07, recolour=True),
    _gz("box_target_red", 0.4, "meshes/mesh.dae"),
    _gz("kinect", 0.28),
    _gz("hokuyo", 0.07),
    _gz("asus_xtion_pro_camera", 0.18),
    _gz("round_tin_base", 0.08),
    _gz("jersey_barrier", 1.2),
    _aws("BalconyTable", "house", "residential", 0.56),
    _aws("Ball", "house", "residential", 0.63),
    _aws("ChairA", "house", "residential", 0.91),
    _aws("ChairD", "house", "residential", 0.78),
    _aws("CoffeeTable", "house", "residential", 1.31),
    _aws("DeskPortraitA", "house", "residential", 0.22),
    _aws("Dumbbell", "house", "residential", 1.38),
    _aws("FitnessEquipment", "house", "residential", 1.1),
    _aws("KitchenTable", "house", "residential", 1.8),
    _aws("NightStand", "house", "residential", 0.72),
    _aws("Pillow", "house", "residential", 0.6),
    _aws("ReadingDesk", "house", "residential", 1.14),
    _aws("ShoeRack", "house", "residential", 1.14),
    _aws("SofaB", "house", "residential", 0.9),
    _aws("SofaC", "house", "residential", 2.44),
    _aws("Tablet", "house", "residential", 0.193),
    _aws("TV", "house", "residential", 1.3),
    _aws("TVCabinet", "house", "residential", 1.8),
    _aws("Trash", "house", "residential", 0.343),
    _aws("Vase", "house", "residential", 0.3),
    _aws("Wardrobe", "house", "residential", 2.14),
    _aws("ChairB", "bookstore", "retail", 0.75),
    _aws("DeskA", "bookstore", "retail", 2.4),
    _aws("TabletB", "bookstore", "retail", 0.16),
    _aws("Computer", "hospital", "retail", 0.53),
    _aws("BookshelfB", "hospital", "retail", 2.67),
    _aws("Refrigerator", "hospital", "residential", 1.96),
    _aws("ClutteringA", "hospital", "warehouse", 2.15),
    _aws("ClutteringC", "hospital", "warehouse", 2.05),
    _bullet("rubber_ball", "ball.obj", 0.07),
    _bullet("ring", "torus/torus_only.obj", 0.25, up="+y"),
    _bullet("tray", "tray/tray_textured.obj", 0.4),
    _bullet("toy_cube", "toys/cube.obj", 0.05),
    _bullet("toy_cylinder", "toys/cylinder.obj", 0.06),
    _bullet("toy_prism", "toys/prism.obj", 0.06),
    _bullet("shape_sorter", "toys/shape_sorter.obj", 0.2),
    Entry(
        name="plastic_chair",
        folder="clutter/godot_chair",
        parts=(Part(file="gltf/plastic_monobloc_chair_01_1k.gltf"),),
        up="+y",
        longest_m=0.88,
    ),
)
"""Clutter at real sizes (many of the files are in odd units, so the longest side is given)."""
