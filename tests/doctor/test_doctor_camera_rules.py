"""Facts of a camera to verdicts: a table for each rule."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from dnb_edge.capture.v4l2_offers import Offer, Rates, Size
from dnb_edge.doctor import camera_rules as rules
from dnb_edge.doctor import usb_rules
from dnb_edge.doctor.access import Access
from dnb_edge.doctor.camera_facts import CameraLook, Exposure
from dnb_edge.doctor.usb_facts import UsbLook, UsbNeighbour
from dnb_edge.doctor.verdict import Verdict
from dnb_edge.values import CameraControl, LostFrames, StampSource

NODE = Path("/dev/video0")
LOOK = CameraLook(uri="v4l2:/dev/video0", path=NODE, is_there=True, others="this machine has /dev/video2", card="Acme")
NAME = "usb-Acme_SN7-video-index0"


def check(verdict: Verdict, status: str, said: str) -> None:
    """The verdict's status and words; a fault's fix says something to type or to set."""
    assert verdict.status.value == status, verdict
    assert said in f"{verdict.found} -> {verdict.fix}", verdict
    assert verdict.fix is None or "`" in verdict.fix or "capture." in verdict.fix, verdict


@pytest.mark.parametrize(
    ("look", "status", "said"),
    [
        (LOOK, "ok", "Acme at /dev/video0"),
        (replace(LOOK, is_there=False), "fail", "/dev/video0 is not there: this machine has /dev/video2"),
        (replace(LOOK, unfit="/dev/video0: is not a capture device"), "fail", "is not a capture device"),
        (rules.NoCamera(why="no camera is connected"), "fail", "no camera is connected"),
    ],
)
def test_there(look: CameraLook | rules.NoCamera, status: str, said: str) -> None:
    """A camera that is missing, or is none, is told with those that there are."""
    check(rules.judge_there(look), status, said)


@pytest.mark.parametrize(
    ("look", "status", "said"),
    [
        (replace(LOOK, identity=NAME), "warn", f"capture.source: v4l2:/dev/v4l/by-id/{NAME}"),
        (replace(LOOK, identity="Acme (usb-0000:01)"), "ok", "no serial number"),
        (replace(LOOK, path=Path("/dev/v4l/by-id") / NAME), "ok", "name that stays"),
        (replace(LOOK, path=Path("/dev/dnb-edge-camera"), identity=NAME), "ok", "name that stays"),
        (replace(LOOK, is_there=False), "skip", "not there"),
    ],
)
def test_name(look: CameraLook, status: str, said: str) -> None:
    """/dev/video0 may be another camera tomorrow, where there is a name that may not."""
    check(rules.judge_name(look), status, said)


ACCESS = Access(path=NODE, group="video", group_may=True, may_open=True, service_groups=None)


@pytest.mark.parametrize(
    ("access", "status", "said"),
    [
        (ACCESS, "ok", "group video"),
        (replace(ACCESS, group_may=False), "fail", "chmod g+rw /dev/video0"),
        (replace(ACCESS, service_groups=frozenset({"dnb-edge"})), "fail", "usermod -aG video dnb-edge"),
        (replace(ACCESS, service_groups=frozenset({"video"})), "ok", "group video"),
        (replace(ACCESS, may_open=False), "fail", "usermod -aG video $USER"),
        (replace(ACCESS, may_open=False, service_groups=frozenset({"video"})), "warn", "usermod -aG video $USER"),
    ],
)
def test_access(access: Access, status: str, said: str) -> None:
    """The service's rights decide where there is a service; one's own where there is none."""
    check(rules.judge_access(access, what="camera"), status, said)


USE = rules.Use(users=(), hidden=False, service_pid=None, service_answers=False)


@pytest.mark.parametrize(
    ("use", "status", "said"),
    [
        (USE, "ok", "nobody else has it"),
        (replace(USE, hidden=True), "ok", "without sudo"),
        (replace(USE, users=("obs, process 7",)), "fail", "kill 7"),
        (replace(USE, users=("dnb-edge, process 17",), service_pid=17), "ok", "only dnb-edge"),
        (replace(USE, users=("dnb-edge, process 117",), service_pid=17), "fail", "process 117"),
        (replace(USE, users=("dnb-edge, process 9",), service_answers=True), "ok", "only dnb-edge"),
        (replace(USE, users=("python3, process 9",)), "fail", "kill 9"),
        (replace(USE, users=("dnb-edge, process 17", "cheese, process 8"), service_pid=17), "fail", "kill 8"),
    ],
)
def test_use(use: rules.Use, status: str, said: str) -> None:
    """Only the service may have the camera; whoever else has it is named."""
    check(rules.judge_use(use), status, said)


def offers(*formats: str, fps: int = 30) -> tuple[Offer, ...]:
    size = Size(least_px=(1280, 720), most_px=(1280, 720), rates=Rates(listed=(Fraction(fps),)))
    return tuple(Offer(pixel_format=one, sizes=(size,)) for one in formats)


@pytest.mark.parametrize(
    ("offered", "status", "said"),
    [
        (offers("YUYV", "MJPG"), "ok", "1280x720 at 30 as MJPG"),
        (offers("YUYV"), "warn", "442 Mbit/s"),
        (offers("MJPG", fps=15), "fail", "MJPG 1280x720 at 15 fps"),
        (offers("H264"), "fail", "no format we read"),
        ((), "skip", "could not be asked"),
    ],
)
def test_formats(offered: tuple[Offer, ...], status: str, said: str) -> None:
    """Compressed at the size and rate that are asked for, or else what it has."""
    wanted = rules.Wanted(look=replace(LOOK, offers=offered), width_px=1280, height_px=720, fps=30.0)
    check(rules.judge_formats(wanted), status, said)


def test_frames() -> None:
    """No pictures is a failure with its reason."""
    check(rules.judge_frames(rules.Frames(fault=None, words="pictures of 1280x720")), "ok", "1280x720")
    check(rules.judge_frames(rules.Frames(fault="gave no picture", words="")), "fail", "gave no picture")


@pytest.mark.parametrize(
    ("fps", "live", "status"),
    [(30.0, True, "ok"), (29.2, True, "ok"), (29.0, True, "warn"), (18.1, True, "warn"), (17.9, True, "fail"),
     (None, True, "skip"), (5.0, False, "skip")],
)  # fmt: skip
def test_rate(fps: float | None, live: bool, status: str) -> None:
    """Some cameras make 29.97 of 30; one that makes 29 is slow, one that makes half is useless."""
    check(rules.judge_rate(rules.Rate(fps=fps, asked_fps=30.0, live=live)), status, "")


@pytest.mark.parametrize(
    ("lost", "status", "said"),
    [
        ({}, "ok", "none of 1000"),
        ({"gap": 5}, "ok", "gap 5"),
        ({"gap": 20}, "warn", "port of its own"),
        ({"damaged": 20, "gap": 3}, "warn", "cable"),
        ({"queue": 20}, "warn", "dnb-edge bench"),
        ({"overtaken": 20}, "warn", "`top`"),
        ({"gap": 400}, "fail", "400 of 1400"),
    ],
)
def test_losses(lost: dict[str, int], status: str, said: str) -> None:
    """A few in a thousand are nothing; the greatest reason says what to do."""
    told = tuple(LostFrames(reason=reason, frames=count) for reason, count in lost.items())
    check(rules.judge_losses(rules.Losses(frames=1000, lost=told, live=True)), status, said)


def test_only_changed_controls_are_named() -> None:
    """What was taken as asked needs no hand."""
    told = [CameraControl(name="gain", asked=64.0, taken=80.0), CameraControl(name="focus", asked=5.0, taken=5.0),
            CameraControl(name="power_line_frequency", asked=1.0, taken=None)]  # fmt: skip
    check(rules.judge_controls(told), "warn", "Set gain in `capture`")


def test_losses_of_a_file_are_none() -> None:
    """A file waits for whoever reads it."""
    check(rules.judge_losses(rules.Losses(frames=9, lost=(), live=False)), "skip", "no camera")


@pytest.mark.parametrize(
    ("taken", "status", "said"),
    [
        ((), "ok", "no settings"),
        ((64.0,), "ok", "1 settings"),
        ((80.0,), "warn", "Set gain"),
        ((None,), "ok", "1 settings"),
    ],
)
def test_controls(taken: tuple[float | None, ...], status: str, said: str) -> None:
    """What the camera took otherwise is named; what it does not tell is no fault."""
    asked = [CameraControl(name="gain", asked=64.0, taken=value) for value in taken]
    check(rules.judge_controls(asked), status, said)


START, END, ARRIVAL = StampSource.START_OF_FRAME, StampSource.END_OF_FRAME, StampSource.ARRIVAL


@pytest.mark.parametrize(
    ("kinds", "delay_s", "status", "said"),
    [
        ({START}, 0.04, "ok", "40 ms before"),
        ({END}, None, "ok", "end of frame"),
        ({ARRIVAL}, 0.0, "warn", "uvcvideo"),
        ({START}, 0.3, "fail", "not the machine's"),
        ({START}, -0.5, "fail", "not the machine's"),
        (set(), None, "skip", "the service"),
    ],
)
def test_stamps(kinds: set[StampSource], delay_s: float | None, status: str, said: str) -> None:
    """Stamps are the kernel's and of this machine's clock."""
    check(rules.judge_stamps(rules.Stamps(kinds=frozenset(kinds), delay_s=delay_s)), status, said)


OURS = Exposure(time_us=4000.0, automatic=False, slows_down=False)


@pytest.mark.parametrize(
    ("exposure", "speed_mps", "status", "said"),
    [
        (OURS, 2.0, "ok", "smears over 8 mm"),
        (OURS, 3.0, "warn", "capture.exposure_us: 1700"),
        (replace(OURS, time_us=21_000.0), 2.0, "fail", "smears over 42 mm"),
        (replace(OURS, time_us=34_000.0), 0.1, "fail", "longer than a frame lasts (33.3 ms)"),
        (replace(OURS, automatic=True), 2.0, "warn", "by itself"),
        (replace(OURS, automatic=True, slows_down=True), 2.0, "warn", "fewer frames"),
        (replace(OURS, time_us=None), 2.0, "skip", "does not tell"),
        (replace(OURS, automatic=None), 0.01, "ok", "4.0 ms"),
    ],
)
def test_exposure(exposure: Exposure, speed_mps: float, status: str, said: str) -> None:
    """Ours, shorter than a frame, and short enough that a car does not smear; the advice is not worth a warning itself."""
    check(rules.judge_exposure(rules.Blur(exposure=exposure, fps=30.0, speed_mps=speed_mps)), status, said)


@pytest.mark.parametrize("speed_mps", [0.05, 0.5, 2.0, 8.0, 40.0])
@pytest.mark.parametrize("fps", [5.0, 30.0, 120.0])
def test_the_advised_exposure_is_right(speed_mps: float, fps: float) -> None:
    """Whoever types what is advised gets OK, wherever 100 us are short enough."""
    blur = rules.Blur(exposure=replace(OURS, automatic=True), fps=fps, speed_mps=speed_mps)
    fix = rules.judge_exposure(blur).fix
    assert fix is not None
    advised_us = float(fix.split("exposure_us: ")[1].split("`")[0])
    after = rules.judge_exposure(replace(blur, exposure=replace(OURS, time_us=advised_us)))
    assert after.status.value == "ok", after


USB = UsbLook(product="Acme", speed_mbps=480.0, hubs=(), neighbours=())


@pytest.mark.parametrize(
    ("usb", "status", "said"),
    [(USB, "ok", "480"), (replace(USB, speed_mbps=12.0), "fail", "lsusb -t"), (replace(USB, speed_mbps=5000.0), "ok", "5000"),
     (None, "skip", "not on USB")],
)  # fmt: skip
def test_usb_speed(usb: UsbLook | None, status: str, said: str) -> None:
    """480 Mbit/s or more: a worn cable falls back to 12."""
    check(usb_rules.judge_usb_speed(usb), status, said)


@pytest.mark.parametrize(
    ("usb", "needed_mbps", "status", "said"),
    [
        (USB, 36.0, "ok", "takes 36 of about 190"),
        (USB, None, "ok", "alone"),
        (USB, 442.0, "fail", "capture.pixel_format: MJPG"),
        (replace(USB, speed_mbps=5000.0), 442.0, "ok", "alone"),
        (replace(USB, hubs=("a hub",)), 36.0, "warn", "behind a hub (a hub)"),
        (replace(USB, neighbours=(UsbNeighbour(product="Cam 2", kinds=("camera",)),)), 36.0, "warn", "Cam 2 (camera)"),
        (replace(USB, neighbours=(UsbNeighbour(product="Mic", kinds=("sound",)),)), 36.0, "ok", "alone"),
        (None, 36.0, "skip", "not on USB"),
    ],
)
def test_bus(usb: UsbLook | None, needed_mbps: float | None, status: str, said: str) -> None:
    """The pictures fit, and nobody else streams on the same bus."""
    check(usb_rules.judge_bus(usb_rules.Bus(usb=usb, needed_mbps=needed_mbps)), status, said)
