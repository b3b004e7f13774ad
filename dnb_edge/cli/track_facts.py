"""What `track build` and `track show` say about a route: its JSON object, its sentence, its table."""

from __future__ import annotations

from typing import Any

import numpy as np

from dnb_edge.config.track_file import TrackFile
from dnb_edge.track.centreline import Centreline
from dnb_edge.track.model import Track, crossings_of
from dnb_edge.track.route import Route
from dnb_edge.track.scale import TwinScale


def facts(route: Route, scale: TwinScale | None, centreline: Centreline) -> dict[str, Any]:
    """The contract's members and more; metres are None without a scale. `centreline` is the route's, in metres or, without
    a scale, in px.
    """
    width_px = float(np.median(route.half_left_px + route.half_right_px))
    metres_per_px = None if scale is None else scale.metres_per_px
    radius = centreline.min_radius_m

    def metres(length_px: float | None) -> float | None:
        return None if metres_per_px is None or length_px is None else length_px * metres_per_px

    radius_px = radius if metres_per_px is None or radius is None else radius / metres_per_px
    return {
        "length_px": route.length_px,
        "length_m": metres(route.length_px),
        "closed": route.closed,
        "points": len(route.points_px),
        "lane_width_px": width_px,
        "lane_width_m": metres(width_px),
        "metres_per_px": metres_per_px,
        "min_radius_px": radius_px,
        "min_radius_m": metres(radius_px),
    }


def sentence(name: str, found: dict[str, Any]) -> str:
    """The facts in a line."""
    length, width = f"{found['length_px']:.0f} px", f"{found['lane_width_px']:.0f} px"
    if found["length_m"] is not None:
        length, width = f"{length} ({found['length_m']:.3f} m)", f"{width} ({found['lane_width_m']:.3f} m)"
    kind = "a closed route" if found["closed"] else "a route from point to point"
    return f"{name}: {kind} of {length}, {found['points']} points, lane {width} wide"


def table(file: TrackFile) -> str:
    """The track in lines of words and numbers: length, sharpest bend, widths, lines with their place along the route."""
    track = file.track
    route = track.centreline
    radius_m = route.min_radius_m
    kind = "closed" if route.closed else "from point to point"
    rows = [
        ("route", f"{kind}, {route.length_m:.3f} m, {len(route.points_m)} points"),
        ("tightest bend", "none" if radius_m is None else f"radius {radius_m:.3f} m"),
        ("lane to the left", _spread(route.half_left_m)),
        ("lane to the right", _spread(route.half_right_m)),
        ("scale", f"{track.scale.metres_per_px * 1e3:.4g} mm per twin px"),
        *_line_rows(track),
    ]
    if file.made_of.picture is not None:
        rows.append(("made of", f"{file.made_of.picture}, SHA-256 {file.made_of.sha256}"))
    if file.made_of.waypoints_px:
        rows.append(("waypoints", " ".join(f"{u:g},{v:g}" for u, v in file.made_of.waypoints_px) + " twin px"))
    width = max(len(title) for title, _ in rows)
    return "\n".join(f"  {title:<{width}}  {text}" for title, text in rows)


def _spread(half_m: np.ndarray) -> str:
    return f"{np.median(half_m):.3f} m, {half_m.min():.3f} to {half_m.max():.3f} m"


def _line_rows(track: Track) -> list[tuple[str, str]]:
    rows = []
    for line in track.lines:
        s_m = ", ".join(f"s {s:.3f} m" for s, _ in crossings_of(track.centreline, line))
        (u0, v0), (u1, v1) = track.scale.to_twin_px(np.array([line.start_m, line.end_m])).tolist()
        rows.append((f"line {line.name}", f"{s_m}; {u0:.0f},{v0:.0f} to {u1:.0f},{v1:.0f} twin px"))
    return rows
