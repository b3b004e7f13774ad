"""The gate before scoring: a homography worse than the limit scores nothing.

Knows an error and a limit. Knows no points and no file.
"""

from __future__ import annotations

from dataclasses import dataclass

from dnb_edge.errors import InputError
from dnb_edge.view.homography import CalibrationError


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorLimit:
    """The greatest mean keypoint error at which laps are scored; a limit left None is not asked for."""

    mean_px: float | None = None
    """Twin px."""
    mean_m: float | None = None
    """Metres on the track."""

    def __post_init__(self) -> None:
        """Raises `InputError` where a limit is not positive."""
        for name in ("mean_px", "mean_m"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise InputError(f"view error limit: {name} must be a positive number, not {value!r}")


def check(error: CalibrationError, limit: ErrorLimit) -> str | None:
    """Why the view is too wrong to score by, as a sentence; None where it is good enough."""
    if limit.mean_px is not None and not error.mean_px <= limit.mean_px:
        return _reason(f"{error.mean_px:.2f} twin px", f"{limit.mean_px:g} twin px")
    if limit.mean_m is None:
        return None
    if error.mean_m is None:
        raise InputError("view error limit: mean_m is set but the twin's scale is not known: set the scale, or mean_px")
    if not error.mean_m <= limit.mean_m:
        return _reason(f"{error.mean_m * 1000:.1f} mm", f"{limit.mean_m * 1000:g} mm")
    return None


def _reason(found: str, allowed: str) -> str:
    return (
        f"not scored: the homography's mean keypoint error is {found}, above the limit of {allowed}: "
        "click the keypoints anew or add more"
    )
