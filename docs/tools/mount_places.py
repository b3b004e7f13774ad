"""The part of docs/mount.md that says where each common camera goes over each common track.

Knows `dnb-edge mount plan`'s own planner, the tracks and the cameras that are listed, and Markdown. Knows no geometry.
The page is written by hand; what stands between the two comments is written here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from page_text import made_by

from dnb_edge.mount.cameras import CAMERAS, KnownCamera
from dnb_edge.mount.geometry import MountedCamera, Optics, Stand, TrackArea
from dnb_edge.mount.plan import MountPlan, MountRequest, PlannedCar, Rate, plan_mount
from dnb_edge.mount.suggest import Free, MountLimits, ceiling_needed_m, suggest

PAGE = "docs/mount.md"
_PATH = Path(__file__).resolve().parents[2] / PAGE
_BEGIN, _END = "<!-- places: begin -->", "<!-- places: end -->"

M12 = KnownCamera(title="USB board, M12 lens of 80 degrees", hfov_deg=80.0, width_px=1280, height_px=720, fps=60.0)
PAPER = KnownCamera(title="the paper's, 85 degrees, 4K", hfov_deg=85.0, width_px=3840, height_px=2160, fps=30.0)
SHOWN = {**CAMERAS, "m12-80": M12}
"""The cameras of the tables: `mount plan`'s own, and the board of the complete list of parts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """A track and the room above it."""

    name: str
    title: str
    width_m: float
    """Across the line of sight: the camera stands at a long side."""
    depth_m: float
    highest_m: float
    above: str
    """What heights are measured from."""
    pictured: str
    """The camera of its drawing."""


GROUNDS = (
    Ground(name="table", title="A table of 1.2 x 1.2 m", width_m=1.2, depth_m=1.2, highest_m=1.7, above="the table",
           pictured="m12-80"),
    Ground(name="floor", title="A floor of 2.4 x 3.6 m", width_m=3.6, depth_m=2.4, highest_m=2.5, above="the floor",
           pictured="m12-80"),
    Ground(name="paper", title="The paper's track, 3.81 x 3.81 m", width_m=3.8055, depth_m=3.81, highest_m=2.5,
           above="the floor", pictured="paper"),
)  # fmt: skip
ANYWHERE = Free()
PAPERS = Free(height_m=2.15, pitch_deg=41.0)
"""The paper's place: 2.15 m up, 41 degrees down; the distance is searched."""


@cache
def planned(ground: Ground, camera: KnownCamera, free: Free = ANYWHERE) -> MountPlan | None:
    """The plan of a camera over a track; None where it cannot have the whole of it in its picture."""
    request = MountRequest(
        optics=_optics(camera),
        rate=Rate(fps=camera.fps, exposure_s=0.002, readout_s=None if camera.rolling else 0.0),
        track=TrackArea(width_m=ground.width_m, depth_m=ground.depth_m),
        car=PlannedCar(speed_mps=2.0, length_m=0.25, height_m=0.1),
        free=free,
        limits=MountLimits(max_height_m=ground.highest_m),
    )
    # To say why there is no place takes longer than to see that there is none.
    if not suggest(request.optics, request.track, request.limits, free).fits and free == ANYWHERE:
        return None
    return plan_mount(request)


def straight_down(ground: Ground, camera: KnownCamera) -> tuple[float, float]:
    """Straight above the track's middle: the least height that has all of it and the margin in the picture, metres to a
    centimetre, and how many mm a px covers there."""
    optics, margin = _optics(camera), MountLimits().margin_m
    least = max(
        (0.5 * length + margin) / math.tan(math.radians(0.5 * angle))
        for length, angle in ((ground.width_m, optics.hfov_deg), (ground.depth_m, optics.vfov_deg))
    )
    height = math.ceil(100.0 * least - 1e-9) / 100.0
    stand = Stand(height_m=height, pitch_deg=90.0, distance_m=-0.5 * ground.depth_m)
    middle = MountedCamera(optics=optics, stand=stand).resolution((0.0, 0.5 * ground.depth_m))
    return height, middle.worst_mm


def height_needed_m(ground: Ground, camera: KnownCamera) -> float | None:
    """How high a camera must go that cannot have the track in its picture below the room's ceiling."""
    area = TrackArea(width_m=ground.width_m, depth_m=ground.depth_m)
    return ceiling_needed_m(_optics(camera), area, MountLimits(max_height_m=ground.highest_m), Free())


def _optics(camera: KnownCamera) -> Optics:
    return Optics(hfov_deg=camera.hfov_deg, width_px=camera.width_px, height_px=camera.height_px)


def page() -> str:
    """The page with its tables as they are now."""
    text = _PATH.read_text(encoding="utf-8")
    before, _, rest = text.partition(_BEGIN)
    _, _, after = rest.partition(_END)
    return f"{before}{_BEGIN}\n{made_by(__file__)}\n\n{_tables()}\n{_END}{after}"


def _tables() -> str:
    lines: list[str] = []
    for ground in GROUNDS:
        lines += [f"### {ground.title}", "", *_table(ground), "", *_pictures(ground), ""]
    lines += ["### The paper's place", "", *_papers()]
    return "\n".join(lines)


def _table(ground: Ground) -> list[str]:
    where = f"best place up to {ground.highest_m:g} m above {ground.above}: height, pitch, from the near edge"
    lines = [
        f"| camera | {where} | a px at worst | car of 0.25 m there | sigma of a lap | straight down |",
        "|---|---|---|---|---|---|",
    ]
    for name, camera in SHOWN.items():
        height_m, mm = straight_down(ground, camera)
        title = f"`{name}`" if name in CAMERAS else camera.title
        best = _best(ground, camera, planned(ground, camera))
        lines.append(f"| {title} | {best} | {height_m:.2f} m up: {mm:.1f} mm |")
    return lines


def _best(ground: Ground, camera: KnownCamera, plan: MountPlan | None) -> str:
    if plan is None:
        needed = height_needed_m(ground, camera)
        said = "does not see all of it" if needed is None else f"sees track and margin from {needed:.1f} m up"
        return f"{said} | | |"
    return (
        f"{_stand(plan)} | {_worst(plan)} | {plan.worst.car_px:.0f} px | {1414.2 * plan.worst.crossing_sigma_s:.1f} ms"
    )


def _stand(plan: MountPlan) -> str:
    stand = plan.camera.stand
    where = f"{stand.distance_m:.2f} m" if stand.distance_m >= 0 else f"{-stand.distance_m:.2f} m over the track"
    return f"{stand.height_m:.2f} m, {stand.pitch_deg:g}\N{DEGREE SIGN}, {where}"


def _worst(plan: MountPlan) -> str:
    return f"{plan.worst.resolution.worst_mm:.1f} mm"


def _pictures(ground: Ground) -> list[str]:
    camera = PAPER if ground.pictured == "paper" else SHOWN[ground.pictured]
    place = "at the paper's place" if ground.pictured == "paper" else "at its best place"
    return [
        f"![Each camera at its best place over the track, seen from the side](pictures/kit/mount-{ground.name}-cameras.png)",
        "",
        f"![{camera.title}, {place}: side view and top view with all lengths](pictures/kit/mount-{ground.name}.png)",
    ]


def _papers() -> list[str]:
    """The paper's 2.15 m and 41 degrees, for its own camera and for those of the list."""
    ground = GROUNDS[-1]
    lines = [
        "2.15 m up and 41 degrees down, as the paper's text has it, over its own track; the distance is the best one.",
        "",
        "| camera | from the near edge | track in the picture | a px at worst | sigma of a lap | best place below 2.5 m |",
        "|---|---|---|---|---|---|",
    ]
    for camera in (PAPER, *SHOWN.values()):
        plan, best = planned(ground, camera, PAPERS), planned(ground, camera)
        better = "" if best is None else f"{_stand(best)}: {_worst(best)}"
        assert plan is not None, "a place that is given has a plan"
        lines.append(
            f"| {camera.title} | {plan.camera.stand.distance_m:.2f} m | {100.0 * plan.coverage.share:.0f} % | {_worst(plan)} | "
            f"{1414.2 * plan.worst.crossing_sigma_s:.1f} ms | {better} |"
        )
    return lines
