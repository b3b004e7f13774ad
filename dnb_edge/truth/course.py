"""A place as the appliance knows it: the files that a user would make of it, and the rooms that are built from them.

Knows the configuration that belongs to a place; builds through `assembly`, so that what is measured is what a user gets. Knows
no drive and no figures.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from dnb_edge.assembly import assemble, make_detector
from dnb_edge.config.load import check_config
from dnb_edge.config.schema import Config
from dnb_edge.core import CoreSetup
from dnb_edge.detect.protocol import Detector
from dnb_edge.sim.files import DemoFiles, course_files
from dnb_edge.sim.places import Place, place
from dnb_edge.values import Clock, SourceInfo


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """A place, and the appliance's set-up for it."""

    place: Place
    config: Config
    setup: CoreSetup

    def detector(self, camera: int = 0) -> Detector:
        """A detector that has seen nothing yet, as the appliance would use it for that camera here."""
        return make_detector(self.config, self.setup.views[camera].ground)


@lru_cache(maxsize=16)
def course(
    name: str, stamp_sigma_s: float = 0.0, *, lasting_share: float | None = None, clicked_px: float = 0.0
) -> Course:
    """The course at the place of that name, whose source stamps frames with that sigma. Takes about a second, once.

    `lasting_share` is `crossing.lasting_share`; None is the appliance's own, which is right for its detector. The keypoints
    were clicked with an error of `clicked_px`, one standard deviation, in each camera's picture.
    """
    here = place(name)
    (config, setup), *others = [
        _assembled(here, number, stamp_sigma_s, lasting_share, clicked_px) for number in range(len(here.cameras))
    ]
    further = tuple(view for _, other in others for view in other.views)
    return Course(place=here, config=config, setup=replace(setup, further=further))


def _assembled(
    here: Place, number: int, stamp_sigma_s: float, lasting_share: float | None, clicked_px: float
) -> tuple[Config, CoreSetup]:
    """What a user would set up for the place's camera of that number."""
    camera = here.cameras[number]
    info = SourceInfo(
        uri="sim:",
        width_px=camera.width_px,
        height_px=camera.height_px,
        nominal_fps=None,
        clock=Clock.SIMULATED,
        live=False,
    )
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        files = course_files(folder, here.circuit, camera)
        if clicked_px > 0.0:
            exact_px = np.load(files.camera_keypoints)
            random = np.random.default_rng([number, 71])
            np.save(files.camera_keypoints, exact_px + random.normal(0.0, clicked_px, exact_px.shape))
        config = check_config(
            _plain(here, files, stamp_sigma_s, lasting_share), base=folder, origin=f"the simulated place {here.name}"
        )
        return config, assemble(config, info).setup


def _plain(here: Place, files: DemoFiles, stamp_sigma_s: float, lasting_share: float | None) -> dict[str, Any]:
    return {
        "name": "simulated car",
        "track": {
            "name": here.circuit.name,
            "image": files.twin.name,
            "lane_hsv": list(files.lane_hsv),
            "metres_per_px": files.metres_per_px,
            "start_line_px": [list(point) for point in files.start_line_px],
        },
        "view": {
            "keypoints_camera": files.camera_keypoints.name,
            "keypoints_twin": files.twin_keypoints.name,
            "image_size_px": list(files.keypoints_image_size_px),
            "max_mean_error_m": 0.02,
        },
        "crossing": {"stamp_sigma_s": stamp_sigma_s}
        | ({} if lasting_share is None else {"lasting_share": lasting_share}),
        "score": {"metric": "dtw", "clamp_m": 0.5, "baseline_m": 0.5},
    }
