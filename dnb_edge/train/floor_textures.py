"""What floors look like from above: wood, parquet, carpet, concrete, tiles, paper, foam mats, printed banners, asphalt.

Knows texels only, nothing of metres, cameras or lanes. All textures are (512, 512, 3), 0..255, and repeat by reflection.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from dnb_edge.train.clutter_shapes import paint

Rng = np.random.Generator
Picture = NDArray[np.float32]
TEXTURE_PX = 512


def _blotches(rng: Rng, cells: int) -> Picture:
    """Smooth noise, about -1..1, with `cells` bumps across, shape (512, 512)."""
    coarse = rng.standard_normal((cells + 2, cells + 2), dtype=np.float32) * np.float32(0.5)
    return np.asarray(cv2.resize(coarse, (TEXTURE_PX, TEXTURE_PX), interpolation=cv2.INTER_CUBIC), dtype=np.float32)


def _grain(rng: Rng, sigma: float) -> Picture:
    """Fine noise of unit strength before a blur of `sigma`."""
    noise = rng.standard_normal((TEXTURE_PX, TEXTURE_PX), dtype=np.float32)
    return np.asarray(cv2.GaussianBlur(noise, (0, 0), sigma), dtype=np.float32) if sigma > 0.2 else noise


def floor_colour(rng: Rng) -> Picture:
    """A floor's colour (3,): mostly dull, of any brightness."""
    value = float(rng.uniform(25, 235))
    tint = rng.normal(0.0, 0.06, 3) + np.array([-0.05, 0.0, 0.05]) * rng.uniform(-0.5, 2.5)
    return np.asarray(value * (1.0 + tint), dtype=np.float32)


def _vivid(rng: Rng) -> Picture:
    return np.asarray(paint(rng), dtype=np.float32)


def _flat(tone: Picture, colour: Picture) -> Picture:
    return np.asarray(tone[:, :, None] * colour, dtype=np.float32)


def _tone(rng: Rng, strength: float = 0.08) -> Picture:
    """Uneven wear about 1."""
    return np.asarray(
        1.0
        + np.float32(rng.uniform(0.01, strength)) * _blotches(rng, 5)
        + np.float32(rng.uniform(0, 0.04)) * _blotches(rng, 40),
        dtype=np.float32,
    )


def _wood_colour(rng: Rng) -> Picture:
    base = np.array(
        [(70, 120, 165), (110, 160, 195), (40, 65, 95), (140, 165, 180), (60, 95, 150)][int(rng.integers(5))]
    )
    return np.asarray(base * rng.uniform(0.75, 1.2) * (1 + rng.normal(0, 0.03, 3)), dtype=np.float32)


def planks(rng: Rng) -> Picture:
    """Boards or laminate: rows of planks of unlike tone, with fibres and dark joints."""
    tone, plank = _tone(rng), int(rng.integers(18, 72))
    contrast, joint = float(rng.uniform(0.02, 0.16)), float(rng.uniform(0.55, 0.95))
    for row in range(0, TEXTURE_PX, plank):
        start = int(rng.integers(-200, 0))
        while start < TEXTURE_PX:
            end = start + int(rng.integers(110, 400))
            tone[row : row + plank, max(0, start) : max(0, end)] *= np.float32(np.exp(rng.normal(0, contrast)))
            tone[row : row + plank, max(0, end) : max(0, end) + 2] *= np.float32(joint)
            start = end
        tone[row : row + int(rng.integers(1, 3))] *= np.float32(joint)
    fibre = rng.standard_normal((TEXTURE_PX, 14), dtype=np.float32) * np.float32(rng.uniform(0.02, 0.08))
    return _flat(tone + cv2.resize(fibre, (TEXTURE_PX, TEXTURE_PX), interpolation=cv2.INTER_LINEAR), _wood_colour(rng))


def parquet(rng: Rng) -> Picture:
    """Basket-weave parquet: squares of staves, each turned against the next."""
    tone, side, staves = _tone(rng), int(rng.choice([64, 96, 128])), int(rng.integers(3, 7))
    for row in range(0, TEXTURE_PX, side):
        for column in range(0, TEXTURE_PX, side):
            part = tone[row : row + side, column : column + side]
            part = part if (row // side + column // side) % 2 else part.T
            for stave in range(staves):
                strip = part[stave * side // staves : (stave + 1) * side // staves]
                strip *= np.float32(np.exp(rng.normal(0, 0.08)))
                strip[:1] *= np.float32(0.75)
    return _flat(tone + np.float32(0.04) * _grain(rng, 1.0), _wood_colour(rng))


def carpet(rng: Rng) -> Picture:
    """Carpet: coarse speckle of two colours, with ribs, or as tiles turned against each other."""
    speckle = _grain(rng, float(rng.uniform(0.4, 1.4)))
    speckle /= np.float32(speckle.std() + 1e-6)
    tone = _tone(rng)
    if rng.random() < 0.4:
        ribs = 1.0 + float(rng.uniform(0.03, 0.15)) * np.sin(np.arange(TEXTURE_PX) * float(rng.uniform(0.5, 2.0)))
        tone *= ribs.astype(np.float32)[:, None]
        if rng.random() < 0.5:
            tone[:256, :256], tone[256:, 256:] = tone[:256, :256].T.copy(), tone[256:, 256:].T.copy()
    base = floor_colour(rng) if rng.random() < 0.6 else _vivid(rng) * np.float32(0.7)
    other = floor_colour(rng) if rng.random() < 0.3 else base * np.float32(rng.uniform(0.6, 1.4))
    share = np.clip(0.5 + 0.35 * speckle, 0, 1)[:, :, None] * np.float32(rng.uniform(0.3, 1.0))
    return np.asarray(tone[:, :, None] * (base + (other - base) * share), dtype=np.float32)


def concrete(rng: Rng) -> Picture:
    """Concrete or screed: clouds, pores, perhaps cracks and stains."""
    tone = _tone(rng, 0.2) + np.float32(rng.uniform(0.01, 0.05)) * _grain(rng, 0.6)
    for _ in range(int(rng.integers(0, 4))):
        walk = np.cumsum(rng.normal(0, 9, (40, 2)) + rng.normal(0, 7, 2), axis=0) + rng.uniform(0, TEXTURE_PX, 2)
        cv2.polylines(
            tone, [np.rint(walk).astype(np.int32)], isClosed=False, color=(float(rng.uniform(0.5, 0.8)),), thickness=1
        )
    for _ in range(int(rng.integers(0, 5))):
        x, y = (int(value) for value in rng.integers(0, TEXTURE_PX, 2))
        cv2.circle(tone, (x, y), int(rng.integers(3, 40)), (float(rng.uniform(0.75, 1.1)),), -1, cv2.LINE_AA)
    return _flat(tone, np.asarray(rng.uniform(70, 205) * (1 + rng.normal(0, 0.025, 3)), dtype=np.float32))


def tiles(rng: Rng) -> Picture:
    """Stone or vinyl tiles with grout, plain or chequered."""
    side, joint = int(rng.integers(40, 200)), int(rng.integers(2, 6))
    tone, other = _tone(rng), float(rng.uniform(0.4, 0.95)) if rng.random() < 0.25 else 1.0
    for row in range(0, TEXTURE_PX, side):
        for column in range(0, TEXTURE_PX, side):
            chequer = other if (row // side + column // side) % 2 else 1.0
            tone[row : row + side, column : column + side] *= np.float32(chequer * np.exp(rng.normal(0, 0.025)))
    out = _flat(tone + np.float32(rng.uniform(0, 0.04)) * _grain(rng, 0.8), floor_colour(rng))
    grout = floor_colour(rng) if rng.random() < 0.3 else out.mean(axis=(0, 1)) * np.float32(rng.uniform(0.5, 1.3))
    for line in range(0, TEXTURE_PX, side):
        out[line : line + joint] = grout
        out[:, line : line + joint] = grout
    return out


def speckled(rng: Rng) -> Picture:
    """Linoleum or terrazzo: chips of other colours on a plain ground; or quite plain."""
    out = _flat(_tone(rng), floor_colour(rng))
    for _ in range(int(rng.choice([0, 60, 300]))):
        x, y = (int(value) for value in rng.integers(0, TEXTURE_PX, 2))
        shade = out[y, x] * np.float32(rng.uniform(0.5, 1.5))
        cv2.circle(out, (x, y), int(rng.integers(1, 5)), (float(shade[0]), float(shade[1]), float(shade[2])), -1)
    return out + np.float32(rng.uniform(0, 4)) * _grain(rng, 0.7)[:, :, None]


def sheets(rng: Rng) -> Picture:
    """Paper or card sheets joined side by side: seams, folds, tape over some seams, slightly unlike whites."""
    wide, tall = int(rng.integers(90, 260)), int(rng.integers(90, 260))
    brown = rng.random() < 0.35
    base = np.array((105, 150, 190) if brown else (228, 232, 233), dtype=np.float32) * np.float32(
        rng.uniform(0.8, 1.08)
    )
    tone = _tone(rng, 0.05)
    if brown:
        tone *= (1.0 + float(rng.uniform(0, 0.03)) * np.sin(np.arange(TEXTURE_PX) * 1.1)).astype(np.float32)
    for row in range(0, TEXTURE_PX, tall):
        for column in range(0, TEXTURE_PX, wide):
            part = tone[row : row + tall, column : column + wide]
            part *= np.float32(np.exp(rng.normal(0, 0.02)))
            part[:1] *= np.float32(0.78)
            part[:, :1] *= np.float32(rng.uniform(0.6, 0.95))
            part[tall // 2 : tall // 2 + 1] *= np.float32(rng.uniform(0.9, 1.03))
    if rng.random() < 0.5:
        gain = float(rng.uniform(0.85, 1.15))
        for column in range(0, TEXTURE_PX, wide):
            tone[:, max(0, column - 6) : column + 6] *= np.float32(gain)
    return _flat(tone, base)


def foam_mats(rng: Rng) -> Picture:
    """Interlocking foam tiles: one to four colours, jigsaw seams, a fine embossed weave."""
    side = int(rng.choice([128, 170, 256]))
    count = int(rng.choice([1, 2, 4], p=[0.45, 0.3, 0.25]))
    colours = [_vivid(rng) if rng.random() < 0.75 else floor_colour(rng) for _ in range(count)]
    tooth = side / float(rng.integers(7, 13))
    columns = np.arange(TEXTURE_PX, dtype=np.float32)[None]
    rows = columns.T
    wave = np.float32(tooth * 0.33)
    shifted_x = columns + wave * np.sign(np.sin(rows * np.float32(np.pi) / np.float32(tooth)))
    shifted_y = rows + wave * np.sign(np.sin(columns * np.float32(np.pi) / np.float32(tooth)))
    index_x, index_y = (shifted_x // side).astype(np.int32), (shifted_y // side).astype(np.int32)
    out = np.stack(colours)[(index_x + (2 if count == 4 else 1) * index_y) % count]
    number = (index_x * 7 + index_y * 13).astype(np.float32)
    seam = (cv2.Laplacian(number, cv2.CV_32F) != 0).astype(np.float32)
    weave = 1.0 + np.float32(rng.uniform(0, 0.06)) * np.sin(rows * 1.6) * np.sin(columns * 1.6)
    gain = (weave * _tone(rng, 0.05) * (1.0 - np.float32(rng.uniform(0.2, 0.6)) * seam)).astype(np.float32)
    return np.asarray(out * gain[:, :, None], dtype=np.float32)


def banner(rng: Rng) -> Picture:
    """A printed mat: grass, roads with dashes, houses, ponds, trees, letters, as town play mats and race banners have."""
    ground = np.array((70, 160, 90), dtype=np.float32) if rng.random() < 0.6 else _vivid(rng)
    out = _flat(_tone(rng, 0.15), ground)
    roads = floor_colour(rng) * np.float32(0.6)
    for _ in range(int(rng.integers(1, 5))):
        walk = np.cumsum(cv2.GaussianBlur(rng.normal(0, 40, (40, 2)), (0, 0), 4.0) + rng.normal(0, 10, 2), axis=0)
        points = [np.rint(walk + rng.uniform(100, 400, 2)).astype(np.int32)]
        thick = int(rng.integers(24, 60))
        for width, colour in (
            (thick + 6, (235.0, 235.0, 235.0)),
            (thick, (float(roads[0]), float(roads[1]), float(roads[2]))),
        ):
            cv2.polylines(out, points, isClosed=False, color=colour, thickness=width, lineType=cv2.LINE_AA)
        for a, b in zip(points[0][:-1:2], points[0][1::2], strict=False):
            cv2.line(out, (int(a[0]), int(a[1])), (int(b[0]), int(b[1])), (235.0, 235.0, 235.0), 2, cv2.LINE_AA)
    for _ in range(int(rng.integers(5, 26))):
        _print_thing(out, rng)
    return out


def _print_thing(out: Picture, rng: Rng) -> None:
    """One printed house, tree, sign or letter, in place."""
    x, y = (int(value) for value in rng.integers(0, TEXTURE_PX, 2))
    size, colour, kind = int(rng.integers(10, 50)), paint(rng), int(rng.integers(4))
    if kind == 0:
        cv2.rectangle(out, (x, y), (x + size, y + size * 2 // 3), colour, -1)
        roof = np.array([(x - 3, y), (x + size + 3, y), (x + size // 2, y - size // 2)], dtype=np.int32)
        cv2.fillPoly(out, [roof], paint(rng))
        cv2.rectangle(out, (x + size // 4, y + size // 5), (x + size // 2, y + size // 2), (235.0, 235.0, 235.0), -1)
    elif kind == 1:
        cv2.circle(out, (x, y), size // 2, (50.0, float(rng.uniform(80, 180)), 50.0), -1, cv2.LINE_AA)
    elif kind == 2:
        cv2.ellipse(out, (x, y), (size, size // 2), float(rng.uniform(0, 180)), 0, 360, colour, -1, cv2.LINE_AA)
    else:
        text = chr(int(rng.integers(65, 91))) * int(rng.integers(1, 3))
        mask = np.zeros(out.shape[:2], dtype=np.uint8)  # putText writes into bytes only
        cv2.putText(mask, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, size / 20, (255.0,), max(1, size // 8))
        out[mask > 0] = colour


def asphalt(rng: Rng) -> Picture:
    """Asphalt, grip mat or rubber granulate: dark, with bright and coloured crumbs."""
    grey = float(rng.uniform(28, 110))
    crumbs = _grain(rng, float(rng.uniform(0.3, 0.9)))
    tone = _tone(rng, 0.1) + np.float32(rng.uniform(0.05, 0.2)) * crumbs
    out = _flat(tone, np.asarray(grey * (1 + rng.normal(0, 0.03, 3)), dtype=np.float32))
    if rng.random() < 0.3:
        out[rng.random((TEXTURE_PX, TEXTURE_PX)) < 0.02] = _vivid(rng)
    return out


_KINDS: tuple[tuple[Callable[[Rng], Picture], float], ...] = (
    (planks, 0.16), (parquet, 0.05), (carpet, 0.15), (concrete, 0.1), (tiles, 0.11), (speckled, 0.14), (sheets, 0.07),
    (foam_mats, 0.09), (banner, 0.06), (asphalt, 0.07),
)  # fmt: skip


def procedural_texture(rng: Rng) -> Picture:
    """A floor of any kind, (512, 512, 3), 0..255."""
    made = _KINDS[int(rng.choice(len(_KINDS), p=[weight for _, weight in _KINDS]))][0](rng)
    return np.asarray(np.clip(made, 0.0, 255.0), dtype=np.float32)
