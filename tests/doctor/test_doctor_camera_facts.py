"""A camera as the doctor finds it, on one that is played below the kernel's calls, and its pictures."""

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from kernel_camera import AUTO_EXPOSURE, EXPOSURE, KernelCamera, webcam_controls

from dnb_edge.config.devices import CaptureConfig
from dnb_edge.doctor.camera_facts import NoCameraHere, camera_uri, look_at_camera
from dnb_edge.doctor.footage import Footage, film
from dnb_edge.doctor.verdict import CannotTell
from dnb_edge.errors import InputError, TemporaryFault
from dnb_edge.values import StampSource

Play = Callable[..., KernelCamera]
SMALL = CaptureConfig(width_px=64, height_px=48, fps=50.0)


def test_a_camera_is_asked_and_left_alone(play_camera: Play) -> None:
    """Formats, exposure and users are found; nothing is set and nothing is started."""
    camera = play_camera(controls=webcam_controls(), sizes={"YUYV": [((64, 48), [30])], "MJPG": [((64, 48), [50])]})
    held = os.open(camera.path, os.O_RDWR | os.O_NOCTTY)
    try:
        look = look_at_camera(f"v4l2:{camera.path}", SMALL, root=Path("/"), unit_groups=())
    finally:
        os.close(held)
    assert (look.is_there, look.unfit, look.card) == (True, None, "Played Camera")
    assert [offer.pixel_format for offer in look.offers if offer.has(64, 48, 50.0)] == ["MJPG"]
    assert look.exposure is not None
    assert (look.exposure.time_us, look.exposure.automatic, look.exposure.slows_down) == (15_600.0, True, True)
    assert any(str(os.getpid()) in user for user in look.users)
    assert look.usb is None
    asked = set(camera.requested)
    assert not asked & {"S_FMT", "S_PARM", "S_EXT_CTRLS", "REQBUFS", "STREAMON"}, asked


def test_an_exposure_of_ours(play_camera: Play) -> None:
    """Manual mode is told from automatic; a camera without controls tells nothing."""
    camera = play_camera(controls=webcam_controls())
    camera.controls[AUTO_EXPOSURE].value, camera.controls[EXPOSURE].value = 1, 40
    exposure = look_at_camera(f"v4l2:{camera.path}", None, root=Path("/"), unit_groups=()).exposure
    assert exposure is not None
    assert (exposure.time_us, exposure.automatic) == (4000.0, False)
    bare = look_at_camera(f"v4l2:{play_camera().path}", None, root=Path("/"), unit_groups=()).exposure
    assert bare is not None
    assert (bare.time_us, bare.automatic, bare.slows_down) == (None, None, None)


def test_what_is_no_camera(play_camera: Play, tmp_path: Path) -> None:
    """Missing, none, and another kind of source are told apart."""
    gone = look_at_camera(f"v4l2:{tmp_path}/video9", None, root=Path("/"), unit_groups=())
    assert not gone.is_there
    plain = tmp_path / "file"
    plain.touch()
    assert "not a capture device" in (look_at_camera(f"v4l2:{plain}", None, root=Path("/"), unit_groups=()).unfit or "")
    with pytest.raises(CannotTell, match="no V4L2 camera"):
        look_at_camera("sim:", None, root=Path("/"), unit_groups=())


def test_the_source_is_the_named_one() -> None:
    """Without a name it is the first camera; a machine without any says so."""
    assert camera_uri("sim:") == "sim:"
    if not list(Path("/dev").glob("video*")):
        with pytest.raises(NoCameraHere, match="no camera is connected"):
            camera_uri(None)


def jpeg(level: int) -> bytes:
    """A small picture of about that level, with a bright half."""
    picture = np.full((48, 64, 3), level, dtype=np.uint8)
    picture[:, 32:] = 250
    return cv2.imencode(".jpg", picture)[1].tobytes()


def drive(camera: KernelCamera, pictures: list[tuple[int, bytes]], *, fps: float = 50.0) -> threading.Thread:
    """Finishes the (sequence, bytes) of `pictures` at their times once the camera streams."""

    def run() -> None:
        while not camera.streaming:
            time.sleep(0.002)
        began_ns = time.monotonic_ns()
        for sequence, data in pictures:
            due_ns = began_ns + round(sequence * 1e9 / fps)
            time.sleep(max(0.0, (due_ns - time.monotonic_ns()) * 1e-9))
            if not camera.streaming:
                return
            camera.finish(data, sequence=sequence, t_us=due_ns // 1000)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread


def shoot(camera: KernelCamera, pictures: list[tuple[int, bytes]], capture: CaptureConfig = SMALL) -> Footage:
    """What the doctor films of them in half a second."""
    thread = drive(camera, pictures)
    try:
        return film(f"v4l2:{camera.path}", capture, seconds=0.5)
    finally:
        camera.streaming = False
        thread.join()


def test_pictures_of_a_camera(play_camera: Play) -> None:
    """Rate by stamps and numbers, the missing ones counted with their reason, what came in the first half second left out."""
    missing, early = {35, 40, 41}, {5, 6, 7}
    numbers = [number for number in range(80) if number not in missing | early]
    footage = shoot(play_camera(), [(number, jpeg(100)) for number in numbers])
    assert footage.fps == pytest.approx(50.0, rel=0.03)
    assert sum(one.frames for one in footage.lost if one.reason == "gap") == 3
    assert footage.stamps == {StampSource.START_OF_FRAME}
    assert footage.delay_s is not None
    assert 0.0 <= footage.delay_s < 0.25
    assert footage.frame_bytes == pytest.approx(len(jpeg(100)))
    assert len(footage.brightness) == footage.frames
    assert footage.brightness[0][1].shape == (12,)
    assert footage.brightness[0][1].mean() == pytest.approx(175.0, abs=4.0)
    assert [still.shape for still in footage.stills] == [(48, 64, 3)] * 5
    assert (footage.info.live, footage.from_service) == (True, False)


def test_raw_pictures_are_not_all_kept(play_camera: Play) -> None:
    """Of uncompressed frames a few are kept whole, the brightness of all."""
    raw = bytes([120, 128] * (64 * 48))
    footage = shoot(play_camera(formats=("YUYV",)), [(number, raw) for number in range(80)])
    assert 1 <= len(footage.stills) <= 5
    assert footage.stills[0].shape == (48, 64, 3)
    assert len(footage.brightness) == footage.frames > 10
    assert footage.frame_bytes is None


def test_a_camera_that_gives_nothing_or_is_busy(play_camera: Play) -> None:
    """Is told as the source tells it; nothing hangs."""
    with pytest.raises(TemporaryFault, match="no whole frame"):
        film(f"v4l2:{play_camera().path}", SMALL, seconds=0.5)
    with pytest.raises(InputError, match="another program"):
        film(f"v4l2:{play_camera(busy_at='S_FMT').path}", SMALL, seconds=0.5)
