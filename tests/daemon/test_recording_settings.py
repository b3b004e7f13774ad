"""What the configuration says about the recording is what the recorder gets."""

from pathlib import Path

import pytest

from dnb_edge.config.devices import RecordConfig
from dnb_edge.daemon.recording import recording_settings

PLACE = Path("/runs")


def test_a_camera_s_race_may_last_for_days() -> None:
    """By default it drops what it must, keeps its pictures in a ring, keeps room free, deletes old runs and starts anyway."""
    settings = recording_settings(RecordConfig(), PLACE, live=True)
    assert (settings.lossless, settings.image_fps, settings.image_ring_bytes) == (False, 1.0, 2_000_000_000)
    assert (settings.keep_free_bytes, settings.max_total_bytes, settings.prune) == (200_000_000, None, True)
    assert (settings.rotate_s, settings.start_anyway, settings.fallback) == (86_400.0, True, ())


def test_a_file_s_race_waits_and_deletes_nothing() -> None:
    """Whatever the configuration says of rings, limits and rotation: that is for races that nobody watches."""
    config = RecordConfig(max_total_gb=1.0, fallback=(Path("/media/stick"),))
    settings = recording_settings(config, PLACE, live=False)
    assert (settings.lossless, settings.image_fps, settings.image_ring_bytes, settings.go_on) == (
        True,
        5.0,
        None,
        False,
    )
    assert (settings.keep_free_bytes, settings.max_total_bytes, settings.prune) == (0, None, False)
    assert (settings.rotate_s, settings.start_anyway, settings.fallback) == (None, False, ())


@pytest.mark.parametrize(("live", "image_fps"), [(True, 3.0), (False, 3.0), (True, 0.0), (False, 0.0)])
def test_what_is_asked_for_is_done(live: bool, image_fps: float) -> None:
    """A rate that is given counts for both; 0 is no pictures; a ring of 0 MB is none."""
    settings = recording_settings(RecordConfig(image_fps=image_fps, image_ring_mb=0, rotate_h=None), PLACE, live=live)
    assert settings.image_fps == (image_fps or None)
    assert settings.image_ring_bytes is None
    assert settings.rotate_s is None
