"""The drawings of the guides, by code: `python docs/tools/guides_pictures.py` writes them into docs/pictures/guides.

Knows SVG as text, the shipped Foxglove layout and the published certificate. Knows no plotting library, so that the same
input gives the same bytes on every machine. Photographs of pages are not made here: they are taken by `make screenshots`.
"""

from __future__ import annotations

import base64
import json
import math
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "pictures" / "guides"
LAYOUT = ROOT / "configs" / "foxglove-layout.json"
CERTIFICATE = ROOT / "docs" / "certificates" / "0.1.0.json"
TEACHING = ROOT / "docs" / "teaching.md"
BOARD = ROOT / "docs" / "pictures" / "board.png"

INK, GREY, PALE, BLUE, ORANGE, PURPLE = "#1a1b1f", "#6a6a70", "#d9d7d0", "#0b57a4", "#b35900", "#6a25ab"

STUDENT_4 = 2.776
"""Student's t for 95 % and four degrees of freedom: five laps."""

Point = tuple[float, float]


def _number(value: float) -> str:
    """Two decimals at most, without what they do not need, and no minus before a zero."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _tag(name: str, inside: str | None = None, **attributes: str | float) -> str:
    words = [name]
    for key, value in attributes.items():
        text = value if isinstance(value, str) else _number(value)
        words.append(f'{key.rstrip("_").replace("_", "-")}="{text}"')
    return f"<{' '.join(words)}/>" if inside is None else f"<{' '.join(words)}>{inside}</{name}>"


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _text(
    x: float, y: float, words: str, *, size: float = 15, fill: str = INK, anchor: str = "start", **more: str
) -> str:
    return _tag("text", _escaped(words), x=x, y=y, font_size=size, fill=fill, text_anchor=anchor, **more)


def _line(a: Point, b: Point, stroke: str = INK, width: float = 1.5, **more: str) -> str:
    return _tag("line", x1=a[0], y1=a[1], x2=b[0], y2=b[1], stroke=stroke, stroke_width=width, **more)


def _way(points: Iterable[Point], stroke: str = INK, width: float = 2.0, **more: str) -> str:
    places = " ".join(f"{_number(x)},{_number(y)}" for x, y in points)
    return _tag("polyline", points=places, fill="none", stroke=stroke, stroke_width=width, **more)


def _dot(at: Point, fill: str, radius: float = 5.0, **more: str) -> str:
    return _tag("circle", cx=at[0], cy=at[1], r=radius, fill=fill, **more)


def _picture(width: int, height: int, title: str, parts: Iterable[str]) -> str:
    """A whole SVG file on white."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'font-family="DejaVu Sans, Arial, sans-serif" role="img">'
    )
    ground = _tag("rect", width=width, height=height, fill="#ffffff")
    return "\n".join([head, _tag("title", _escaped(title)), ground, *parts, "</svg>"]) + "\n"


def crossing() -> str:
    """How the instant of a crossing is found between two frames."""
    dots = [(70 + 74 * k, 250 - 25.5 * k - 0.7 * k * k) for k in range(9)]
    wobble = (4, -5, 3, -3, 5, -4, 3, -5, 4)
    seen = [(x, y + dy) for (x, y), dy in zip(dots, wobble, strict=True)]
    line_y = 130.0
    way = [(60 + 6.2 * k, 250 - 25.5 * (6.2 * k - 10) / 74 - 0.7 * ((6.2 * k - 10) / 74) ** 2) for k in range(100)]
    at = min(way, key=lambda point: abs(point[1] - line_y))
    parts = [
        _line((50, 290), (700, 290), GREY),
        _text(700, 312, "time", anchor="end", fill=GREY),
        _text(50, 30, "distance along the lane", fill=GREY),
        _line((50, 40), (50, 290), GREY),
        _line((50, line_y), (700, line_y), INK, 3, stroke_dasharray="9 6"),
        _text(692, line_y - 10, "start line", anchor="end"),
        _way(way, BLUE, 2.5),
        *(_line((x, 286), (x, 294), GREY) for x, _ in seen),
        *(_dot(point, ORANGE) for point in seen),
        _line((at[0], line_y), (at[0], 290), PURPLE, 2, stroke_dasharray="4 4"),
        _tag("rect", x=at[0] - 9, y=278, width=18, height=12, fill=PURPLE, fill_opacity=0.25),
        _dot((at[0], line_y), PURPLE, 6),
        _text(at[0] + 16, 268, "the crossing, ± sigma", fill=PURPLE),
        _text(70, 330, "● the car as each picture shows it, a little off", fill=ORANGE),
        _text(430, 330, "— the way that fits all of them best", fill=BLUE),
    ]
    return _picture(740, 350, "The crossing is found between two pictures", parts)


def bell() -> str:
    """What one sigma means: 68 and 95 of 100."""
    left, width, ground, height = 40.0, 660.0, 240.0, 190.0

    def at(z: float) -> Point:
        return left + width * (z + 3.3) / 6.6, ground - height * math.exp(-z * z / 2)

    def area(reach: float, opacity: float) -> str:
        steps = [at(-reach + 2 * reach * k / 60) for k in range(61)]
        shape = [(steps[0][0], ground), *steps, (steps[-1][0], ground)]
        places = " ".join(f"{_number(x)},{_number(y)}" for x, y in shape)
        return _tag("polygon", points=places, fill=BLUE, fill_opacity=opacity)

    parts = [area(1.96, 0.15), area(1.0, 0.25), _way((at(-3.3 + 6.6 * k / 120) for k in range(121)), BLUE, 2.5)]
    parts.append(_line((left, ground), (left + width, ground), GREY))
    for z, words in ((-2, "−2 sigma"), (-1, "−1 sigma"), (0, "the time told"), (1, "+1 sigma"), (2, "+2 sigma")):
        parts += [
            _line((at(z)[0], ground), (at(z)[0], ground + 6), GREY),
            _text(at(z)[0], ground + 24, words, anchor="middle"),
        ]
    parts += [
        _text(at(0)[0], 150, "68 of 100", anchor="middle", size=18),
        _text(at(0)[0], 172, "true times lie here", anchor="middle", size=13),
        _text(at(1.5)[0] + 12, 120, "95 of 100", size=18),
        _text(at(1.5)[0] + 12, 140, "lie in both shades", size=13),
    ]
    return _picture(740, 280, "Of 100 true times 68 lie within one sigma, 95 within about two", parts)


def apart() -> str:
    """Two pairs of laps: one that can be told apart and one that cannot."""

    def row(y: float, name: str, time_s: float, reach_s: float, colour: str) -> list[str]:
        x = 130 + (time_s - 12.470) * 14_000
        reach = reach_s * 14_000
        return [
            _text(20, y + 5, name),
            _line((x - reach, y), (x + reach, y), colour, 5, stroke_opacity="0.45"),
            _dot((x, y), colour, 7),
            _text(x, y - 14, f"{time_s:.3f} s", anchor="middle", size=13, fill=colour),
        ]

    reach = 1.96 * 0.002
    parts = [
        _text(20, 28, "4 ms apart: cannot be told apart", size=17),
        *row(70, "Ada", 12.483, reach, BLUE),
        *row(112, "Grace", 12.487, reach, PURPLE),
        _line((20, 140), (720, 140), PALE),
        _text(20, 170, "19 ms apart: Ada was faster", size=17),
        *row(212, "Ada", 12.483, reach, BLUE),
        *row(254, "Alan", 12.502, reach, ORANGE),
        _text(
            720,
            290,
            "bars: 95 % intervals of each lap, 1.96 sigma either way; sigma 2 ms",
            anchor="end",
            size=13,
            fill=GREY,
        ),
    ]
    return _picture(740, 304, "Two laps are told apart where their difference is larger than their uncertainty", parts)


def similarity() -> str:
    """What the path similarity measures: how far the driven path is from the route, on average."""
    way = [(50 + 6.4 * k, 150 - 60 * math.sin(k / 100 * 2 * math.pi)) for k in range(101)]
    normal = [(-dy / math.hypot(dx, dy), dx / math.hypot(dx, dy)) for dx, dy in _steps(way)]
    off = [18 * math.sin(k / 100 * 5.2 * math.pi + 0.6) for k in range(101)]
    path = [(x + d * nx, y + d * ny) for (x, y), (nx, ny), d in zip(way, normal, off, strict=True)]
    edges = [
        [(x + side * nx, y + side * ny) for (x, y), (nx, ny) in zip(way, normal, strict=True)] for side in (-42, 42)
    ]
    parts = [
        *(_way(edge, PALE, 3) for edge in edges),
        *(_line(way[k], path[k], ORANGE, 2) for k in range(2, 100, 5)),
        _way(way, GREY, 2, stroke_dasharray="8 5"),
        _way(path, BLUE, 3),
        _text(50, 285, "- - the route: the middle of the lane", fill=GREY),
        _text(400, 285, "— the way that the car drove", fill=BLUE),
        _text(
            50,
            310,
            "— how far apart they are; the mean of that is d",
            fill=ORANGE,
        ),
    ]
    return _picture(740, 326, "The similarity comes from the mean distance of the driven path from the route", parts)


def _steps(points: list[Point]) -> list[Point]:
    """For each point the way from its neighbour before to the one behind."""
    before, behind = [points[0], *points[:-1]], [*points[1:], points[-1]]
    return [(b[0] - a[0], b[1] - a[1]) for a, b in zip(before, behind, strict=True)]


def errors() -> str:
    """The lap errors of the certificate's 1,000 laps at 1 m/s and 30 frames a second, and what the stated sigma promises."""
    scenario = next(one for one in json.loads(CERTIFICATE.read_text())["scenarios"] if one["name"] == "30fps-1mps")
    figures: dict[str, Any] = scenario["figures"]
    counts, reach = figures["histogram"]["counts"], figures["histogram"]["reach_ms"]
    left, width, ground, scale = 60.0, 640.0, 340.0, 3.6
    cell_ms = 2 * reach / len(counts)

    def x(ms: float) -> float:
        return left + width * (ms + reach) / (2 * reach)

    bars = [
        _tag(
            "rect",
            x=x(-reach + k * cell_ms) + 1,
            y=ground - scale * n,
            width=width / len(counts) - 2,
            height=scale * n,
            fill=BLUE,
        )
        for k, n in enumerate(counts)
    ]
    sigma_ms = figures["stated_sigma_ms"]
    top = figures["laps"] * cell_ms / (sigma_ms * math.sqrt(2 * math.pi))
    curve = [
        (x(ms), ground - scale * top * math.exp(-((ms / sigma_ms) ** 2) / 2))
        for ms in (-reach + 2 * reach * k / 120 for k in range(121))
    ]
    ticks = [part for ms in (-1.5, -1, -0.5, 0, 0.5, 1, 1.5) for part in (
        _line((x(ms), ground), (x(ms), ground + 6), GREY),
        _text(x(ms), ground + 24, f"{ms:+g}".replace("-", "−") if ms else "0", anchor="middle", size=13),
    )]  # fmt: skip
    parts = [
        *bars,
        _way(curve, ORANGE, 3),
        _line((left, ground), (left + width, ground), GREY),
        *ticks,
        _text(left + width, ground + 46, "time told less true time, ms", anchor="end", size=13, fill=GREY),
        _text(left, 28, f"{figures['laps']:,} simulated laps whose true times are known", fill=BLUE),
        _text(left, 52, f"— what the stated sigma ({sigma_ms:.2f} ms on average) promises", fill=ORANGE),
        _text(left, 76, f"in the stated 95 % interval: {figures['coverage_percent']:.1f} %", size=13, fill=GREY),
        _text(left, 96, "the outermost bars hold everything beyond", size=13, fill=GREY),
    ]
    return _picture(740, 400, "Errors of 1,000 laps in the accuracy certificate", parts)


def groups() -> str:
    """The five laps of each group of docs/teaching.md, with their mean and its 95 % interval."""
    rows = re.findall(
        r"^\| (\d) \| ([\d., ]+) \| [\d.]+ \| [\d.]+ \| [\d.]+ to", TEACHING.read_text(encoding="utf-8"), re.MULTILINE
    )

    def x(time_s: float) -> float:
        return 110 + (time_s - 5.9) * 400

    parts = [_line((x(t / 10), 40), (x(t / 10), 60 + 34 * len(rows)), PALE) for t in range(60, 75, 2)]
    parts += [
        _text(x(t / 10), 80 + 34 * len(rows), f"{t / 10:.1f} s", anchor="middle", size=13, fill=GREY)
        for t in range(60, 75, 2)
    ]
    for k, (group, times) in enumerate(rows):
        laps, y = [float(one) for one in times.split(", ")], 60 + 34 * k
        mean_s = sum(laps) / len(laps)
        sd_s = math.sqrt(sum((lap - mean_s) ** 2 for lap in laps) / (len(laps) - 1))
        half_s = STUDENT_4 * sd_s / math.sqrt(len(laps))
        parts += [
            _text(20, y + 5, f"group {group}"),
            _line((x(mean_s - half_s), y), (x(mean_s + half_s), y), BLUE, 9, stroke_opacity="0.3"),
            *(_dot((x(lap), y), ORANGE, 4.5) for lap in laps),
            _line((x(mean_s), y - 10), (x(mean_s), y + 10), BLUE, 3),
        ]
    parts.append(_text(110, 26, "● laps   ", fill=ORANGE))
    parts.append(_text(180, 26, "| mean, with its 95 % interval: each overlaps with each", fill=BLUE))
    return _picture(740, 100 + 34 * len(rows), "Five laps of each of eight groups, with mean and interval", parts)


def board() -> str:
    """The board with numbers beside what the text explains."""
    picture = base64.b64encode(BOARD.read_bytes()).decode()
    marks: tuple[tuple[float, float, str], ...] = (
        (330, 232, "1"), (478, 262, "2"), (108, 404, "3"), (370, 362, "4"), (600, 362, "5"), (20, 442, "6"),
        (20, 688, "7"), (20, 774, "8"), (926, 372, "9"), (904, 300, "10"), (790, 612, "11"),
    )  # fmt: skip
    parts = [_tag("image", x=0, y=0, width=1280, height=860, href=f"data:image/png;base64,{picture}")]
    for u, v, name in marks:
        parts += [
            _dot((u, v), "#c2185b", 17, stroke="#ffffff", stroke_width="3"),
            _text(u, v + 6.5, name, anchor="middle", size=18, fill="#ffffff", font_weight="bold"),
        ]
    return _picture(1280, 860, "The board, with numbers that the text explains", parts)


def foxglove() -> str:
    """The panels of the shipped Foxglove layout, as they are arranged; a schematic, no picture of Foxglove."""
    layout = json.loads(LAYOUT.read_text())
    parts = list(_panels(layout["layout"], layout["configById"], (10.0, 46.0, 720.0, 404.0)))
    parts.insert(
        0, _text(10, 30, "Schematic of configs/foxglove-layout.json: which panel is where, and what it shows", size=15)
    )
    return _picture(740, 460, "The panels of the shipped Foxglove layout", parts)


def _panels(node: Any, panels: dict[str, Any], box: tuple[float, float, float, float]) -> Iterable[str]:
    x, y, width, height = box
    if isinstance(node, str):
        panel = panels[node]
        yield _tag("rect", x=x + 3, y=y + 3, width=width - 6, height=height - 6, rx=6, fill="#f3f1ec", stroke=GREY)
        yield _text(x + 14, y + 26, panel.get("foxglovePanelTitle", node), size=15, fill=BLUE, font_weight="bold")
        for k, words in enumerate(_shown(panel)):
            yield _text(x + 14, y + 46 + 17 * k, words, size=12)
        return
    share = node.get("splitPercentage", 50) / 100
    if node["direction"] == "row":
        yield from _panels(node["first"], panels, (x, y, width * share, height))
        yield from _panels(node["second"], panels, (x + width * share, y, width * (1 - share), height))
    else:
        yield from _panels(node["first"], panels, (x, y, width, height * share))
        yield from _panels(node["second"], panels, (x, y + height * share, width, height * (1 - share)))


def _shown(panel: dict[str, Any]) -> list[str]:
    """The topics of one panel, as its configuration has them."""
    if "imageMode" in panel:
        mode = panel["imageMode"]
        return [mode["imageTopic"], *mode["annotations"]]
    if "paths" in panel:
        return [path["value"] for path in panel["paths"]]
    if "topics" in panel:
        return list(panel["topics"])
    return [panel[key] for key in ("topicPath", "topicToRender") if key in panel]


PICTURES: dict[str, Callable[[], str]] = {
    "apart.svg": apart,
    "bell.svg": bell,
    "board-explained.svg": board,
    "crossing.svg": crossing,
    "errors.svg": errors,
    "foxglove-layout.svg": foxglove,
    "groups.svg": groups,
    "similarity.svg": similarity,
}
"""Each drawing's file in docs/pictures/guides, and what draws it."""


def main() -> None:
    """Writes all drawings."""
    for name, draw in PICTURES.items():
        (FOLDER / name).write_text(draw(), encoding="utf-8")
        sys.stdout.write(f"{FOLDER / name}\n")


if __name__ == "__main__":
    main()
