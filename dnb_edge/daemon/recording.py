"""What the configuration says about the recording, as the recorder wants it.

Knows that a camera's race may last for days and that nobody watches it, while a file or the simulator can wait for the disk and
deletes nothing. Knows no disk.
"""

from __future__ import annotations

from pathlib import Path

from dnb_edge.config.devices import RecordConfig
from dnb_edge.record.retention import Limits
from dnb_edge.record.writer import RecordingSettings

LIVE_IMAGE_FPS = 1.0
"""Pictures of 200 kB are 17 GB a day then, which a memory card bears for years."""

IMAGE_FPS = 5.0

_MB, _GB = 1e6, 1e9


def recording_settings(config: RecordConfig, directory: Path, *, live: bool) -> RecordingSettings:
    """How to record into `directory`."""
    if not live:
        image_fps = IMAGE_FPS if config.image_fps is None else config.image_fps
        return RecordingSettings(directory=directory, image_fps=image_fps or None, lossless=True, go_on=False)
    image_fps = LIVE_IMAGE_FPS if config.image_fps is None else config.image_fps
    limits = recording_limits(config)
    return RecordingSettings(
        directory=directory,
        image_fps=image_fps or None,
        fallback=config.fallback,
        keep_free_bytes=limits.keep_free_bytes,
        max_total_bytes=limits.max_total_bytes,
        prune=config.delete_oldest,
        image_ring_bytes=round(config.image_ring_mb * _MB) or None,
        rotate_s=None if config.rotate_h is None else config.rotate_h * 3600.0,
        start_anyway=True,
    )


def recording_limits(config: RecordConfig) -> Limits:
    """How much recordings may take."""
    return Limits(
        keep_free_bytes=round(config.keep_free_mb * _MB),
        max_total_bytes=None if config.max_total_gb is None else round(config.max_total_gb * _GB),
    )
