"""Sheets as a printer has them: PDF pages rendered by PDFium, another program than the one that drew them."""

from __future__ import annotations

import cv2
import numpy as np
import pypdfium2

PX_PER_MM = 10.0
_POINTS_PER_MM = 72.0 / 25.4


def pages(pdf: bytes, *, px_per_mm: float = PX_PER_MM) -> list[np.ndarray]:
    """Every page as a picture, (height, width, 3), blue first."""
    document = pypdfium2.PdfDocument(pdf)
    try:
        return [
            document[k].render(scale=px_per_mm / _POINTS_PER_MM, draw_annots=False).to_numpy()[..., :3].copy()
            for k in range(len(document))
        ]
    finally:
        document.close()


def page_sizes_mm(pdf: bytes) -> list[tuple[float, float]]:
    """Width and height of every page's box."""
    document = pypdfium2.PdfDocument(pdf)
    try:
        return [tuple(part / _POINTS_PER_MM for part in document[k].get_size()) for k in range(len(document))]
    finally:
        document.close()


def grey(picture: np.ndarray) -> np.ndarray:
    """(height, width), as the eye sees it."""
    return cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)


def bars_mm(pdf: bytes) -> list[float]:
    """Length of each page's check bar: the longest unbroken black run in the sheet's lowest 32 mm, to a dot of 1/20 mm."""
    dots = 20.0
    document = pypdfium2.PdfDocument(pdf)
    try:
        found = []
        for page in document:
            above = max(0.0, page.get_height() - 32.0 * _POINTS_PER_MM)
            foot = page.render(scale=dots / _POINTS_PER_MM, crop=(0, 0, 0, above), grayscale=True).to_numpy()
            found.append(_longest_run(foot.reshape(foot.shape[:2])[::5] < 32) / dots)
        return found
    finally:
        document.close()


def _longest_run(dark: np.ndarray) -> int:
    """Length of the longest run of True along a row of (height, width)."""
    edges = np.diff(np.pad(dark.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    starts, ends = np.nonzero(edges == 1), np.nonzero(edges == -1)
    return int(np.max(ends[1] - starts[1], initial=0))
