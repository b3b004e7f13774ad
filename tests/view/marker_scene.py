"""Pictures of printed sheets on a floor through a known camera, drawn without anything that the solver is made of.

The camera is the one of the training scenes (`train.camera.View`), light is added up linearly over many samples a pixel, then
comes the lens's blur, a camera's tone curve, noise and JPEG. The floor frame is track m with its origin below the camera and
y along the way it looks.
"""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from dnb_edge.train.camera import View, overhead_view
from dnb_edge.view.lens import Lens, LensModel

QUIET_M = 0.03
"""White paper round the black square."""

_SAMPLES = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """One sheet on the floor: its marker's middle, and where its upper edge points (anticlockwise from y)."""

    number: int
    x_m: float
    y_m: float
    turned_rad: float
    size_m: float = 0.15

    def corners_m(self):
        """(4, 2) floor m, clockwise from the top left as printed."""
        half = self.size_m / 2.0
        flat = np.array([[-half, half], [half, half], [half, -half], [-half, -half]])
        c, s = math.cos(self.turned_rad), math.sin(self.turned_rad)
        return flat @ np.array([[c, s], [-s, c]]) + (self.x_m, self.y_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """What the camera makes of the light."""

    blur_px: float = 0.6
    noise: float = 2.0
    jpeg: int = 90
    tone: bool = True
    """sRGB's curve, as cameras have one; or plain linear light."""
    uneven: float = 0.4
    white: float = 0.75
    black: float = 0.05


def camera(
    *,
    height_m,
    pitch_deg,
    roll_deg=0.0,
    hfov_deg=70.0,
    size_px=(1280, 720),
    radial=(0.0, 0.0),
    off_centre_px=(0.0, 0.0),
) -> View:
    """The camera, above the floor's origin, looking along y."""
    view = overhead_view(
        width_px=size_px[0], height_px=size_px[1], camera_height_m=height_m, pitch_rad=math.radians(pitch_deg),
        field_of_view_rad=math.radians(hfov_deg), roll_rad=math.radians(roll_deg), radial=radial,
    )  # fmt: skip
    return replace(
        view, principal_px=(view.principal_px[0] + off_centre_px[0], view.principal_px[1] + off_centre_px[1])
    )


def lens_of(view: View) -> Lens:
    """The camera's lens as a calibration would tell it."""
    k1, k2 = view.radial
    return Lens(
        model=LensModel.PINHOLE, fx_px=view.focal_px, fy_px=view.focal_px, cx_px=view.principal_px[0],
        cy_px=view.principal_px[1], distortion=(k1, k2, 0.0, 0.0), width_px=view.width_px, height_px=view.height_px,
    )  # fmt: skip


def spread_sheets(view: View, count: int, rng: np.random.Generator, *, size_m=0.15, far_m=4.5) -> list[Sheet]:
    """`count` sheets laid over what the camera sees, well apart, each wholly in the picture and at least 24 px wide."""
    sheets: list[Sheet] = []
    for attempt in range(6000):
        margin = 0.05
        u = rng.uniform(margin, 1 - margin) * view.width_px
        v = rng.uniform(margin, 1 - margin) * view.height_px
        x, y, _ = view.floor_point((u, v))
        sheet = Sheet(number=len(sheets), x_m=x, y_m=y, turned_rad=rng.uniform(-math.pi, math.pi), size_m=size_m)
        if not visible(view, sheet) or math.hypot(x, y) > far_m:
            continue
        px = view.project(np.column_stack((sheet.corners_m(), np.zeros(4))))
        sides = np.linalg.norm(px - np.roll(px, 1, axis=0), axis=1)
        apart = 1.5 if attempt < 3000 else 0.0
        clear = all(
            math.hypot(u - other_u, v - other_v) > apart * 0.22 * min(view.width_px, view.height_px)
            and math.hypot(x - s.x_m, y - s.y_m) > 0.35 * size_m / 0.15
            for s in sheets
            for other_u, other_v in view.project(np.array([[s.x_m, s.y_m, 0.0]]))
        )
        if clear and sides.min() > 24:
            sheets.append(sheet)
        if len(sheets) == count:
            return sheets
    raise AssertionError(f"only {len(sheets)} of {count} sheets find room")


def visible(view: View, sheet: Sheet) -> bool:
    """Whether the whole sheet lies in the picture and ahead of the camera."""
    outer = replace(sheet, size_m=sheet.size_m + 2 * QUIET_M).corners_m()
    points = np.column_stack((outer, np.zeros(4)))
    if view.camera_m(points)[:, 2].min() < 0.3:
        return False
    px = view.project(points)
    return bool((px > 3).all() and (px[:, 0] < view.width_px - 4).all() and (px[:, 1] < view.height_px - 4).all())


def draw(view: View, sheets: list[Sheet], rng: np.random.Generator, look: Look | None = None, *, family="4X4_50"):
    """The picture, (h, w, 3) uint8."""
    look = Look() if look is None else look
    light = _floor(view, rng)
    for sheet in sheets:
        _lay(light, view, sheet, look, family)
    v, u = np.mgrid[0 : view.height_px, 0 : view.width_px]
    angle = rng.uniform(0, 2 * math.pi)
    ramp = (u / view.width_px - 0.5) * math.cos(angle) + (v / view.height_px - 0.5) * math.sin(angle)
    light = light * (1.0 + look.uneven * ramp)
    light = np.clip(cv2.GaussianBlur(light, (0, 0), look.blur_px), 0.0, 1.0)
    seen = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055) if look.tone else light
    grey = 255.0 * seen + rng.normal(0.0, look.noise, seen.shape)
    picture = np.repeat(np.clip(np.rint(grey), 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, look.jpeg])
    return cv2.imdecode(data, cv2.IMREAD_COLOR)


def _floor(view: View, rng: np.random.Generator):
    """A mottled floor, as light."""
    at = view.floor_map()
    texture = np.full((512, 512), 0.25, dtype=np.float32)
    for sigma, amount in ((2, 0.03), (9, 0.05), (40, 0.08)):
        spots = cv2.GaussianBlur(
            rng.normal(size=texture.shape).astype(np.float32), (0, 0), sigma, borderType=cv2.BORDER_REFLECT
        )
        texture += amount * spots / spots.std()
    shrunk = np.mod(at * 160.0, 511.0).astype(np.float32)
    return np.clip(cv2.remap(texture, shrunk[..., 0], shrunk[..., 1], cv2.INTER_LINEAR), 0.02, 0.9)


def _sampled(view: View, low, high):
    """Floor points (n, 2) of `_SAMPLES` squared samples in each pixel from `low` to before `high`, row by row: exact at the
    pixels' corners, linear between."""
    (u0, v0), (u1, v1) = low, high
    grid_u, grid_v = np.meshgrid(np.arange(u0, u1 + 1) - 0.5, np.arange(v0, v1 + 1) - 0.5)
    corners = view.floor_points(np.column_stack((grid_u.ravel(), grid_v.ravel())))
    corners = corners.reshape(v1 - v0 + 1, u1 - u0 + 1, 2)
    inside = ((np.arange(_SAMPLES) + 0.5) / _SAMPLES)[:, None, None, None]
    rows = corners[:-1] * (1 - inside) + corners[1:] * inside
    rows = rows.transpose(1, 0, 2, 3).reshape(-1, u1 - u0 + 1, 2)
    across = inside[:, 0, 0]
    columns = rows[:, :-1, None] * (1 - across) + rows[:, 1:, None] * across
    return columns.reshape(-1, 2)


def _lay(light, view: View, sheet: Sheet, look: Look, family: str):
    """Draws one sheet, `_SAMPLES` squared samples a pixel."""
    outer = replace(sheet, size_m=sheet.size_m + 2 * QUIET_M).corners_m()
    px = view.project(np.column_stack((outer, np.zeros(4))))
    (u0, v0), (u1, v1) = np.floor(px.min(axis=0)).astype(int) - 1, np.ceil(px.max(axis=0)).astype(int) + 2
    u0, v0, u1, v1 = max(u0, 0), max(v0, 0), min(u1, view.width_px), min(v1, view.height_px)
    floor = _sampled(view, (u0, v0), (u1, v1)) - (sheet.x_m, sheet.y_m)
    c, s = math.cos(sheet.turned_rad), math.sin(sheet.turned_rad)
    local = floor @ np.array([[c, -s], [s, c]])
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{family}"))
    count = dictionary.markerSize + 2
    cells = cv2.aruco.generateImageMarker(dictionary, sheet.number, count) > 127
    at = np.floor((local * (1, -1) / sheet.size_m + 0.5) * count).astype(int)
    within = ((at >= 0) & (at < count)).all(axis=1)
    paper = (np.abs(local) < sheet.size_m / 2 + QUIET_M).all(axis=1)
    value = np.full(len(at), look.white)
    clipped = np.clip(at, 0, count - 1)
    value[within] = np.where(cells[clipped[within, 1], clipped[within, 0]], look.white, look.black)

    def pixels(samples):
        return samples.reshape(v1 - v0, _SAMPLES, u1 - u0, _SAMPLES).mean(axis=(1, 3))

    share = pixels(paper.astype(float))
    part = light[v0:v1, u0:u1]
    light[v0:v1, u0:u1] = part * (1 - share) + pixels(np.where(paper, value, 0.0))
