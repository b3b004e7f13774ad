"""The libcamera source against played bindings; see tests/system/test_libcamera.py for the real ones."""

import gc
import importlib
import subprocess
import sys
import threading
import weakref

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from played_libcamera import Status

from dnb_edge.capture import libcamera, libcamera_setup
from dnb_edge.capture.libcamera_clock import Moment, now, stamp_of
from dnb_edge.capture.libcamera_pictures import PICTURE_FORMATS, fault_of, to_bgr
from dnb_edge.capture.settings import CaptureSettings, changed_controls
from dnb_edge.capture.source import open_source
from dnb_edge.errors import InputError, TemporaryFault, WorkError
from dnb_edge.values import CameraControl, LostFrames, StampSource

SMALL = CaptureSettings(width_px=64, height_px=48, stall_timeout_s=10.0)
EXPOSURE = (("AeEnable", "Bool", 0, 1), ("ExposureTime", "Integer32", 100, 30_000), ("AnalogueGain", "Float", 1.0, 8.0))


def small(**kwargs) -> CaptureSettings:
    return CaptureSettings(**({"width_px": 64, "height_px": 48, "stall_timeout_s": 10.0} | kwargs))


def jpeg(grey: int = 90) -> bytes:
    return cv2.imencode(".jpg", np.full((48, 64, 3), grey, dtype=np.uint8))[1].tobytes()


def test_without_the_bindings_it_is_said_how_to_get_them(monkeypatch):
    """They come from apt and not from PyPI: the line names the package and the flag that lets the environment see it."""
    real = importlib.import_module

    def absent(name, *rest):
        if name == "libcamera":
            raise ModuleNotFoundError("No module named 'libcamera'")
        return real(name, *rest)

    monkeypatch.setattr(importlib, "import_module", absent)
    with pytest.raises(
        InputError, match=r"libcamera:0: .*python3-libcamera.*VENV_FLAGS=--system-site-packages"
    ) as caught:
        open_source("libcamera:0")
    assert "\n" not in str(caught.value)


def test_nothing_else_needs_the_bindings():
    """The room is imported on machines that have no libcamera, and leaves it alone on those that have."""
    program = "import sys, dnb_edge.capture.source; sys.exit('libcamera' in sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


@pytest.mark.parametrize(
    ("uri", "words"), [("libcamera:7", "0 .played-1., 1 .played-2."), ("libcamera:imx", "played-2")]
)
def test_unknown_cameras_are_answered_with_those_there_are(play_libcamera, uri, words):
    """Each camera's number and lasting name."""
    play_libcamera.plug("played-1")
    play_libcamera.plug("played-2")
    with pytest.raises(InputError, match=words):
        open_source(uri)


def test_no_camera_at_all_names_the_group(play_libcamera):
    """A user who may not open the devices sees no camera: libcamera does not say why."""
    with pytest.raises(InputError, match="-aG video"):
        open_source("libcamera:0")


@pytest.mark.parametrize(
    ("played", "settings", "words"),
    [
        ({"refuse_at": "acquire"}, SMALL, "another program"),
        ({"refuse_at": "start"}, SMALL, "no permission"),
        ({"refuse_at": "configure"}, SMALL, "refuses to start"),
        ({"refuse_at": "queue"}, SMALL, "another program"),
        ({"formats": ()}, SMALL, "no video"),
        ({"formats": ("SRGGB10",)}, SMALL, "SRGGB10"),
        ({"formats": ("NV12",)}, small(pixel_format="MJPG"), "NV12, and MJPG is asked"),
        ({}, small(width_px=100), "64x48, 128x96"),
        ({}, small(gain=2.0), "gain: .*no control 'AnalogueGain'.*none"),
        ({"controls": EXPOSURE}, small(exposure_us=40_000), "exposure_us: .*between 100 and 30000, not 40000"),
        ({"controls": EXPOSURE}, small(controls={"Colour": 1}), "'Colour': it has AeEnable"),
    ],
)
def test_cameras_that_cannot_do_as_asked_are_refused(play_libcamera, played, settings, words):
    """One line that names the camera, and the camera is free again."""
    camera = play_libcamera.plug(**played)
    with pytest.raises(InputError, match=words) as caught:
        open_source("libcamera:0", settings)
    assert str(caught.value).startswith("libcamera:0: ")
    assert "\n" not in str(caught.value)
    assert not camera.taken
    assert not camera.running


def test_streams_with_the_sensors_stamps_and_the_cameras_numbers(play_libcamera):
    """JPEG first, its FourCC and the camera's name told, the first row's stamp, a jump in the numbers a gap, as many buffers
    as asked."""
    camera = play_libcamera.plug()
    source = open_source("libcamera:0", small(buffers=3))
    assert len(camera.queued) == 3
    info = source.info
    assert (info.camera_id, info.driver, info.pixel_format) == ("played-1", "libcamera v0.4.0: Played Camera", "MJPG")
    assert info.nominal_fps is None
    frames = source.frames()
    for sequence in (2, 3, 7, 8, 9, 10):
        camera.finish(jpeg(sequence), sequence=sequence, sensor_ns=1_000 + sequence)
        frame = next(frames)
        assert (frame.sequence, frame.t_ns, frame.jpeg) == (sequence, 1_000 + sequence, jpeg(sequence))
        assert frame.stamp_source is StampSource.START_OF_FRAME
    assert source.lost == (LostFrames(reason="gap", frames=3),)
    source.close()
    assert not camera.taken


def test_the_newest_frame_wins(play_libcamera):
    """After a pause the newest of the waiting frames is given, the others are counted, and every buffer is queued again."""
    camera = play_libcamera.plug()
    source = open_source("libcamera:0", SMALL)
    for sequence in range(3):
        camera.finish(jpeg(sequence), sequence=sequence, sensor_ns=1_000 + sequence)
    assert next(source.frames()).sequence == 2
    assert source.lost == (LostFrames(reason="overtaken", frames=2),)
    assert len(camera.queued) == 4
    source.close()


def test_damaged_and_stale_frames_are_left_out(play_libcamera):
    """Frames that libcamera marks, cut JPEGs and stamps that step back are counted by reason and not given."""
    camera = play_libcamera.plug()
    source = open_source("libcamera:0", SMALL)
    frames = source.frames()
    camera.finish(jpeg(), sequence=1, sensor_ns=5_000)
    next(frames)
    camera.finish(jpeg(), sequence=2, sensor_ns=6_000, status=Status.Error)
    camera.finish(jpeg()[:-9], sequence=3, sensor_ns=7_000)
    camera.finish(jpeg(), sequence=4, sensor_ns=4_000)
    camera.finish(jpeg(), sequence=5, sensor_ns=9_000)
    assert next(frames).sequence == 5
    assert [(lost.reason, lost.frames) for lost in source.lost] == [("damaged", 1), ("short", 1), ("stamp", 1)]
    source.close()


def test_an_unplugged_camera_is_a_temporary_fault_and_keeps_nothing(play_libcamera):
    """It is missed in the list of cameras, and what the bindings hold of it for ever is let go: 200 unpluggings must not
    keep 800 buffers."""
    camera = play_libcamera.plug()
    source = open_source("libcamera:0", SMALL)
    held = [weakref.ref(request) for request in camera.queued]
    camera.unplug()
    with pytest.raises(TemporaryFault, match=r"libcamera:0: the camera is gone"):
        next(source.frames())
    source.close()
    source.close()
    camera.queued.clear()
    gc.collect()
    assert [request() for request in held] == [None] * 4


def test_what_came_before_it_went_is_given(play_libcamera):
    """A frame that was finished before the plug was pulled still counts for the race; then the fault is told."""
    camera = play_libcamera.plug()
    source = open_source("libcamera:0", SMALL)
    camera.finish(jpeg(), sequence=0, sensor_ns=1_000)
    camera.unplug()
    frames = source.frames()
    assert next(frames).sequence == 0
    with pytest.raises(TemporaryFault, match="gone"):
        next(frames)
    source.close()


def test_a_camera_plugged_in_again_is_another(play_libcamera):
    """By the same name: the old one gives no frame any more, and must be opened anew."""
    camera = play_libcamera.plug("played-1")
    source = open_source("libcamera:played-1", SMALL)
    camera.unplug()
    again = play_libcamera.plug("played-1")
    with pytest.raises(TemporaryFault, match="gone"):
        next(source.frames())
    source.close()
    source = open_source("libcamera:played-1", SMALL)
    again.finish(jpeg(), sequence=0, sensor_ns=1)
    assert next(source.frames()).sequence == 0
    source.close()


@pytest.fixture
def node(tmp_path, monkeypatch):
    """A camera's device as /sys/dev/char has it, until it is pulled."""
    monkeypatch.setattr(libcamera_setup, "CHAR_DEVICES", tmp_path)
    monkeypatch.setattr(libcamera_setup, "NEWS_S", 0.2)
    device = tmp_path / "81:0"
    device.touch()
    return device


def test_the_program_that_uses_the_camera_is_named(play_libcamera, tmp_path, monkeypatch):
    """As far as the camera has a device of the kernel's: here one that a process of ours holds open."""
    monkeypatch.setattr(libcamera_setup, "CHAR_DEVICES", tmp_path)
    monkeypatch.setattr(libcamera_setup, "DEV", tmp_path)
    held = tmp_path / "video7"
    held.touch()
    node = tmp_path / "81:0"
    node.symlink_to(held)
    play_libcamera.plug(node=node, refuse_at="acquire")
    with held.open() as file, subprocess.Popen(["sleep", "60"], pass_fds=[file.fileno()]) as other:
        with pytest.raises(InputError, match=rf"another program is using the camera \(sleep, process {other.pid}\)"):
            open_source("libcamera:0", SMALL)
        other.kill()


def test_a_pulled_camera_is_not_stopped_before_libcamera_knows(play_libcamera, node):
    """libcamera would end the process. It hears of the plug within the moment that we wait, and then all is given back."""
    camera = play_libcamera.plug(node=node)
    source = open_source("libcamera:0", SMALL)
    held = [weakref.ref(request) for request in camera.queued]
    camera.pull()
    with pytest.raises(TemporaryFault, match="gone"):
        next(source.frames())
    news = threading.Timer(0.05, camera.unplug)
    news.start()
    source.close()
    news.join()
    camera.queued.clear()
    gc.collect()
    assert [request() for request in held] == [None] * 4


def test_where_libcamera_hears_of_no_plugs_another_process_is_asked_for(play_libcamera, node):
    """In a sandbox without netlink it never knows: the camera is left as it is, and the next opening says what to do instead
    of waiting for a camera that cannot come back."""
    camera = play_libcamera.plug(node=node)
    source = open_source("libcamera:0", SMALL)
    camera.pull()
    with pytest.raises(TemporaryFault, match="gone"):
        next(source.frames())
    source.close()
    with pytest.raises(WorkError, match=r"libcamera:0: .*new process.*AF_NETLINK"):
        open_source("libcamera:0", SMALL)
    assert len(camera.queued) == 4


def test_cancelled_buffers_of_a_pulled_camera_do_not_keep_us_busy(play_libcamera, node):
    """Each buffer that is given to it comes back cancelled at once: it is gone, and not a camera that sends rubbish."""
    camera = play_libcamera.plug(node=node)
    source = open_source("libcamera:0", small(stall_timeout_s=60.0))
    camera.pull()
    camera.finish(jpeg(), sequence=0, sensor_ns=1, status=Status.Cancelled)
    with pytest.raises(TemporaryFault, match="gone"):
        next(source.frames())
    camera.unplug()
    source.close()


@pytest.mark.parametrize("send", [None, Status.Error])
def test_a_camera_without_whole_frames_is_a_temporary_fault(play_libcamera, send):
    """One that is silent, and one that sends rubbish only, do not block the appliance for ever."""
    camera = play_libcamera.plug()
    source = open_source("libcamera:0", small(stall_timeout_s=0.05))
    if send is not None:
        camera.finish(jpeg(), sequence=0, sensor_ns=1, status=send)
    with pytest.raises(TemporaryFault, match="no whole frame"):
        next(source.frames())
    source.close()


def test_close_ends_a_blocked_read(play_libcamera, monkeypatch):
    """Another thread may close while `frames` waits; it then ends at once and without an error."""
    monkeypatch.setattr(libcamera, "_LOOK_S", 60.0)
    play_libcamera.plug()
    source = open_source("libcamera:0", small(stall_timeout_s=60.0))
    taken = []
    reader = threading.Thread(target=lambda: taken.extend(source.frames()), daemon=True)
    reader.start()
    pause = threading.Event()
    for _ in range(10_000):
        if source._lock.locked():
            break
        pause.wait(0.001)
    closer = threading.Thread(target=source.close, daemon=True)
    closer.start()
    closer.join(10)
    reader.join(10)
    assert not closer.is_alive()
    assert not reader.is_alive()
    assert taken == []


CONTROLS = (
    *EXPOSURE, ("AwbEnable", "Bool", 0, 1), ("ColourTemperature", "Integer32", 100, 100_000), ("AfMode", "Integer32", 0, 2),
    ("LensPosition", "Float", 0.0, 32.0), ("AeFlickerMode", "Integer32", 0, 2), ("AeFlickerPeriod", "Integer32", 100, 10**6),
    ("Brightness", "Float", -1.0, 1.0), ("FrameDurationLimits", "Integer64", 16_666, 120_000),
)  # fmt: skip
SPLIT = (*CONTROLS, ("ExposureTimeMode", "Integer32", 0, 1), ("AnalogueGainMode", "Integer32", 0, 1))


@pytest.mark.parametrize(
    ("asked", "has", "set_to"),
    [
        ({}, CONTROLS, {}),
        ({"exposure_us": 2000.4}, CONTROLS, {"AeEnable": False, "ExposureTime": 2000}),
        ({"exposure_us": "auto"}, CONTROLS, {"AeEnable": True}),
        ({"exposure_us": 2000}, SPLIT, {"ExposureTimeMode": 1, "ExposureTime": 2000}),
        ({"exposure_us": "auto"}, SPLIT, {"ExposureTimeMode": 0}),
        ({"gain": 2}, CONTROLS, {"AnalogueGain": 2.0}),
        ({"gain": 2.5}, SPLIT, {"AnalogueGainMode": 1, "AnalogueGain": 2.5}),
        ({"white_balance_k": 4500}, CONTROLS, {"AwbEnable": False, "ColourTemperature": 4500}),
        ({"white_balance_k": "auto"}, CONTROLS, {"AwbEnable": True}),
        ({"focus": 1}, CONTROLS, {"AfMode": 0, "LensPosition": 1.0}),
        ({"focus": "auto"}, CONTROLS, {"AfMode": 2}),
        ({"power_line_hz": 50}, CONTROLS, {"AeFlickerMode": 1, "AeFlickerPeriod": 10_000}),
        ({"power_line_hz": 60}, CONTROLS, {"AeFlickerMode": 1, "AeFlickerPeriod": 8_333}),
        ({"power_line_hz": "off"}, CONTROLS, {"AeFlickerMode": 0}),
        ({"power_line_hz": "auto"}, CONTROLS, {"AeFlickerMode": 2}),
        ({"controls": {"Brightness": -1}}, CONTROLS, {"Brightness": -1.0}),
    ],
)
def test_choices_become_controls(play_libcamera, asked, has, set_to):
    """In libcamera's names and units, at the start and with the first request, since some pipelines heed only one of them;
    exposure and gain by hand as libcamera 0.4 and later versions want it."""
    camera = play_libcamera.plug(controls=has)
    settings = small(**asked, fps=25.0, stall_timeout_s=0.01)
    source = open_source("libcamera:0", settings)
    expected = set_to | {"FrameDurationLimits": (40_000, 40_000)}
    assert camera.started_with == expected
    assert camera.seen_controls == expected
    assert {name: type(value) for name, value in camera.started_with.items()} == {
        name: type(value) for name, value in expected.items()
    }
    assert {control.name: control.asked for control in source.info.controls} == set_to
    assert source.info.nominal_fps == 25.0
    source.close()


@pytest.mark.parametrize(("fps", "limit_us"), [(100.0, 16_666), (2.0, 120_000)])
def test_the_rate_is_the_nearest_that_the_camera_has(play_libcamera, fps, limit_us):
    """And it is told as the nominal one, and as what was changed."""
    camera = play_libcamera.plug(controls=CONTROLS)
    source = open_source("libcamera:0", small(fps=fps))
    assert camera.started_with == {"FrameDurationLimits": (limit_us, limit_us)}
    assert source.info.nominal_fps == pytest.approx(1e6 / limit_us)
    assert changed_controls(source.info.controls) == (
        f"camera: frame rate is {1e6 / limit_us:.6g}, not {fps:g} as asked",
    )
    source.close()


def test_what_the_camera_really_took_is_told(play_libcamera):
    """By what its first frame says; that frame is not lost to the race, and what it does not say stays unknown."""
    camera = play_libcamera.plug(controls=CONTROLS)
    begin = camera.queue_request

    def queue_and_finish_first(request):
        begin(request)
        if request.cookie == 3 and not camera.done:
            camera.done = True
            camera.finish(jpeg(), sequence=0, sensor_ns=9, metadata={"ExposureTime": 1980, "AnalogueGain": 2.02})

    camera.done, camera.queue_request = False, queue_and_finish_first
    source = open_source("libcamera:0", small(exposure_us=2000, gain=2.0))
    assert source.info.controls == (
        CameraControl(name="AeEnable", asked=False, taken=None),
        CameraControl(name="AnalogueGain", asked=2.0, taken=2.02),
        CameraControl(name="ExposureTime", asked=2000, taken=1980),
    )
    assert len(camera.queued) == 4
    source.close()


@given(st.integers(1, 10**15), st.integers(0, 10**9), st.sampled_from([0, 10**12]))
def test_stamps_come_to_the_monotonic_clock(stamp_ns, age_ns, slept_ns):
    """Whether the driver stamps on CLOCK_MONOTONIC or, as libcamera has it, on CLOCK_BOOTTIME: a machine that has slept
    longer than a frame is old tells the two apart."""
    arrived = Moment(monotonic_ns=stamp_ns + age_ns, slept_ns=slept_ns)
    expected = (stamp_ns, StampSource.START_OF_FRAME)
    assert stamp_of(stamp_ns, 7, arrived) == expected
    assert stamp_of(stamp_ns + slept_ns, 7, arrived) == expected
    assert stamp_of(None, stamp_ns, arrived) == (stamp_ns, StampSource.END_OF_FRAME)
    assert stamp_of(None, 0, arrived) == (stamp_ns + age_ns, StampSource.ARRIVAL)


def test_a_machine_that_never_slept_shifts_no_stamp():
    """The bracketed difference of the clocks is exactly 0 then, or else the whole time slept: no jitter of the readings."""
    slept = [now().slept_ns for _ in range(50)]
    assert max(slept) - min(slept) < 1_000_000
    assert min(slept) == 0 or min(slept) > 1_000_000


COLOURS = ((30, 60, 200), (200, 60, 30), (90, 90, 90))


def planes_of(name: str, bgr: np.ndarray, pad: int) -> tuple[list[bytes], int]:
    """The picture as a camera lays it out, its rows padded by `pad` bytes of the first plane; and that plane's stride."""
    height, width = bgr.shape[:2]
    i420 = cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_I420)
    chroma = i420[height:].reshape(2, height // 2, width // 2)
    yuyv = np.empty((height, width, 2), dtype=np.uint8)
    yuyv[..., 0] = i420[:height]
    yuyv[:, 0::2, 1], yuyv[:, 1::2, 1] = (np.repeat(plane, 2, axis=0) for plane in chroma)
    full = np.full((height, width, 1), 255, dtype=np.uint8)
    planes = {
        "RGB888": [bgr], "BGR888": [bgr[..., ::-1]], "XRGB8888": [np.dstack([bgr, full])],
        "XBGR8888": [np.dstack([bgr[..., ::-1], full])], "YUYV": [yuyv],
        "NV12": [i420[:height], np.dstack(list(chroma))], "YUV420": [i420[:height], *chroma],
    }[name]  # fmt: skip
    stride = planes[0].reshape(height, -1).shape[1] + pad
    padded = []
    for plane in planes:
        rows = plane.reshape(len(plane), -1)
        own = stride // 2 if name == "YUV420" and len(rows) < height else stride
        padded.append(np.pad(rows, ((0, 0), (0, own - rows.shape[1]))).tobytes())
    return padded, stride


@pytest.mark.parametrize("name", [name for name in PICTURE_FORMATS if name != "MJPEG"])
@pytest.mark.parametrize("pad", [0, 32])
def test_every_format_gives_the_same_picture(name, pad):
    """Rows may be padded; libcamera's RGB888 is blue, green, red in memory; the last row need not be padded; one byte less
    is too short."""
    bgr = np.zeros((8, 12, 3), dtype=np.uint8)
    for i, colour in enumerate(COLOURS):
        bgr[:, 4 * i : 4 * i + 4] = colour
    planes, stride = planes_of(name, bgr, pad)
    assert fault_of(name, planes, 12, 8, stride) is None
    picture = to_bgr(name, planes, 12, 8, stride)
    assert picture.shape == (8, 12, 3)
    assert np.abs(picture.astype(int) - bgr.astype(int)).max() <= (0 if "888" in name else 6)
    own_pad = pad // 2 if name == "YUV420" and len(planes) > 1 else pad
    last = planes[-1][: len(planes[-1]) - own_pad]
    assert np.array_equal(to_bgr(name, [*planes[:-1], last], 12, 8, stride), picture)
    assert fault_of(name, [*planes[:-1], last[:-1]], 12, 8, stride) == "short"
    assert fault_of(name, planes[:-1], 12, 8, stride) == "short"


def test_a_raw_camera_gives_pictures(play_libcamera):
    """As a Raspberry Pi's: planes of one buffer, rows padded, in the format that needs no conversion where it is offered."""
    bgr = np.full((48, 64, 3), (30, 60, 200), dtype=np.uint8)
    planes, stride = planes_of("YUV420", bgr, 64)
    camera = play_libcamera.plug(formats=("YUV420",), plane_sizes=[len(plane) for plane in planes], stride=stride)
    source = open_source("libcamera:0", SMALL)
    assert source.info.pixel_format == "YU12"
    camera.finish(*planes, sequence=0, sensor_ns=1)
    frame = next(source.frames())
    assert frame.jpeg is None
    assert frame.bgr is not None
    assert np.abs(frame.bgr.astype(int) - bgr).max() <= 6
    source.close()
    play_libcamera.plug("pi", formats=("YUV420", "NV12", "RGB888", "YUYV"), plane_sizes=(64 * 48 * 3,), stride=64 * 3)
    source = open_source("libcamera:pi", SMALL)
    assert source.info.pixel_format == "RG24"
    source.close()
