"""From the configuration's words to the driver's controls, in an order that works, and back to what the camera took."""

from pathlib import Path

import pytest
from kernel_camera import (
    AUTO_EXPOSURE,
    AUTO_FOCUS,
    AUTO_GAIN,
    AUTO_WHITE,
    BRIGHTNESS,
    DYNAMIC_FRAMERATE,
    EXPOSURE,
    FOCUS,
    GAIN,
    POWER_LINE,
    WHITE_KELVIN,
    PlayedControl,
    webcam_controls,
)
from linuxpy.video import raw

from dnb_edge.capture.settings import CaptureSettings, changed_controls
from dnb_edge.capture.source import open_source
from dnb_edge.errors import InputError
from dnb_edge.values import CameraControl

SIZE = {"width_px": 64, "height_px": 48}
ANALOGUE_GAIN = 0x009E0903


def opened(camera, **asked):
    """What the source at `camera` says of its controls: {name: (asked, taken)}."""
    source = open_source(f"v4l2:{camera.path}", CaptureSettings(**SIZE, **asked))
    source.close()
    return {one.name: (one.asked, one.taken) for one in source.info.controls}


@pytest.mark.parametrize(
    ("asked", "values"),
    [
        ({"exposure_us": 4000}, {AUTO_EXPOSURE: 1, DYNAMIC_FRAMERATE: 0, EXPOSURE: 40}),
        ({"exposure_us": 312.5}, {EXPOSURE: 3}),
        ({"exposure_us": "auto"}, {AUTO_EXPOSURE: 3, DYNAMIC_FRAMERATE: 1}),
        ({"gain": 12.0}, {GAIN: 12}),
        ({"white_balance_k": 4600}, {AUTO_WHITE: 0, WHITE_KELVIN: 4600}),
        ({"white_balance_k": "auto"}, {AUTO_WHITE: 1}),
        ({"focus": 40}, {AUTO_FOCUS: 0, FOCUS: 40}),
        ({"focus": 0}, {AUTO_FOCUS: 0, FOCUS: 0}),
        ({"focus": "auto"}, {AUTO_FOCUS: 1}),
        ({"power_line_hz": "off"}, {POWER_LINE: 0}),
        ({"power_line_hz": 50}, {POWER_LINE: 1}),
        ({"power_line_hz": 60}, {POWER_LINE: 2}),
        ({"controls": {"brightness": 255}}, {BRIGHTNESS: 255}),
        ({"exposure_us": 4000, "controls": {"exposure_time_absolute": 50}}, {AUTO_EXPOSURE: 1, EXPOSURE: 50}),
        ({}, {AUTO_EXPOSURE: 3, AUTO_WHITE: 1, AUTO_FOCUS: 1, POWER_LINE: 2, GAIN: 64}),
    ],
    ids=str,
)
def test_each_key_reaches_its_controls(play_camera, asked, values):
    """The kernel refuses a value while the camera holds it itself, so what is automatic goes off first; exposure counts in
    100 us; the configuration's further controls come last and win; what is not asked for stays."""
    camera = play_camera(controls=webcam_controls())
    told = opened(camera, **asked)
    assert {ident: camera.controls[ident].value for ident in values} == values
    assert all(wanted == taken for wanted, taken in told.values())
    assert bool(told) == bool(asked)


def test_what_the_camera_took_is_told(play_camera):
    """The value read back stands beside the one asked for, in the driver's own names and units; None where it does not tell."""
    controls = webcam_controls()
    for one in controls:
        one.unreadable = one.ident == GAIN
    camera = play_camera(controls=controls)
    assert opened(camera, white_balance_k=4608, gain=7, controls={"brightness": 3}) == {
        "white_balance_automatic": (0, 0),
        "white_balance_temperature": (4608, 4600),
        "gain": (7, None),
        "brightness": (3, 3),
    }


def test_values_are_read_once_the_stream_runs(play_camera):
    """A camera that begins each stream with values of its own is found out."""
    camera = play_camera(controls=webcam_controls())
    started = camera._streamon

    def streamon(fd, kind):
        started(fd, kind)
        camera.controls[EXPOSURE].value = 156

    camera._streamon = streamon
    assert opened(camera, exposure_us=4000)["exposure_time_absolute"] == (40, 156)


@pytest.mark.parametrize(
    ("controls", "asked", "values"),
    [
        (
            [PlayedControl(AUTO_EXPOSURE, "Exposure, Auto", 0, most=3, menu={0: "Auto Mode", 2: "Shutter Priority Mode"}),
             PlayedControl(EXPOSURE, "Exposure (Absolute)", 9, 3, 100)],
            {"exposure_us": 5000}, {AUTO_EXPOSURE: 2, EXPOSURE: 50},
        ),
        (
            [PlayedControl(AUTO_EXPOSURE, "Exposure, Auto", 1, most=3, menu={0: "Auto Mode", 1: "Manual Mode"})],
            {"exposure_us": "auto"}, {AUTO_EXPOSURE: 0},
        ),
        ([PlayedControl(EXPOSURE, "Exposure (Absolute)", 9, 3, 100)], {"exposure_us": 500}, {EXPOSURE: 5}),
        (
            [PlayedControl(AUTO_GAIN, "Gain, Automatic", 1), PlayedControl(GAIN, "Gain", 1, held_by=(AUTO_GAIN, 0))],
            {"gain": 9}, {AUTO_GAIN: 0, GAIN: 9},
        ),
        ([PlayedControl(ANALOGUE_GAIN, "Analogue Gain", 1)], {"gain": 9}, {ANALOGUE_GAIN: 9}),
        ([PlayedControl(FOCUS, "Focus (absolute)", 1)], {"focus": 9}, {FOCUS: 9}),
        (
            [PlayedControl(POWER_LINE, "Power Line Frequency", 0, most=3, menu={0: "Disabled", 3: "Auto"})],
            {"power_line_hz": "auto"}, {POWER_LINE: 3},
        ),
    ],
    ids=["iris automatic", "fully automatic", "manual only", "automatic gain", "a sensor's gain", "focus only", "any mains"],
)  # fmt: skip
def test_other_cameras_and_kernels_are_understood(play_camera, controls, asked, values):
    """Controls are found by the kernel's number, whatever their driver calls them, and with the modes that it has."""
    camera = play_camera(controls=controls)
    opened(camera, **asked)
    assert {ident: camera.controls[ident].value for ident in values} == values


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"exposure_us": 250_000}, r"capture\.exposure_us: .*250000 us: it takes 300 to 204700 us"),
        ({"exposure_us": 10}, r"capture\.exposure_us: .* it takes 300 to 204700 us"),
        ({"gain": 300}, r"capture\.gain: .*gain cannot be 300: it takes 0 to 255"),
        ({"gain": 1.5}, r"capture\.gain: .*whole numbers, not 1\.5"),
        ({"white_balance_k": 1000}, r"capture\.white_balance_k: .*2800 to 6500"),
        ({"focus": 251}, r"capture\.focus: .*0 to 250"),
        ({"power_line_hz": "auto"}, r"capture\.power_line_hz: .*0 \(Disabled\), 1 \(50 Hz\), 2 \(60 Hz\)"),
        ({"controls": {"brightness": 256}}, r"capture\.controls\.brightness: .*brightness cannot be 256: .*0 to 255"),
        ({"controls": {"auto_exposure": 2}}, r"capture\.controls\.auto_exposure: .*1 \(Manual Mode\), 3 \(Aperture"),
        ({"controls": {"sharpness": 3}}, r"capture\.controls: the camera has no control 'sharpness': it has auto_exposure, "),
        ({"controls": {"exposure_time_absolute": 9}}, r"capture\.controls\.exposure_time_absolute: .*refuses.*automatic"),
    ],
    ids=str,
)  # fmt: skip
def test_what_the_camera_cannot_take_is_refused(play_camera, asked, words):
    """One line that names the configuration's key and what the camera takes; the device is given back."""
    camera = play_camera(controls=webcam_controls())
    with pytest.raises(InputError, match=words) as caught:
        opened(camera, **asked)
    assert str(caught.value).startswith(f"{camera.path}: capture.")
    assert "\n" not in str(caught.value)
    assert not camera.streaming


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("exposure_us", 4000),
        ("exposure_us", "auto"),
        ("gain", 1),
        ("white_balance_k", 4000),
        ("white_balance_k", "auto"),
        ("focus", 1),
        ("focus", "auto"),
        ("power_line_hz", 50),
    ],
)
def test_a_control_that_the_camera_lacks_is_named(play_camera, key, value):
    """A simple camera: the line names the key asked for and all that there is."""
    camera = play_camera(controls=[PlayedControl(BRIGHTNESS, "Brightness", 9)])
    with pytest.raises(InputError, match=rf"capture\.{key}: the camera has no .*: it has brightness$"):
        opened(camera, **{key: value})
    bare = play_camera()
    with pytest.raises(InputError, match="it has no controls"):
        opened(bare, **{key: value})


def test_buttons_and_compound_controls_do_no_harm(play_camera):
    """A button may be pushed and tells nothing; disabled controls are not there."""
    button = PlayedControl(0x00980920, "Focus Now!", 0, kind=raw.CtrlType.BUTTON)
    off = PlayedControl(0x00980921, "Not Here", 0, flags=0x1)
    assert opened(play_camera(controls=[button, off]), controls={"focus_now": 1}) == {"focus_now": (1, None)}
    with pytest.raises(InputError, match="it has focus_now"):
        opened(play_camera(controls=[button, off]), controls={"not_here": 1})


def test_what_was_changed_is_told_in_words():
    """A line for each control taken otherwise than asked; silence about those that agree or cannot be read."""
    controls = [
        CameraControl(name="gain", asked=3, taken=3),
        CameraControl(name="focus_absolute", asked=3, taken=None),
        CameraControl(name="exposure_time_absolute", asked=41, taken=40),
        CameraControl(name="pixel_clock", asked=148_500_000, taken=148_499_999),
    ]
    assert changed_controls(controls) == (
        "camera: exposure_time_absolute is 40, not 41 as asked",
        "camera: pixel_clock is 148499999, not 148500000 as asked",
    )
    assert changed_controls([]) == ()


@pytest.mark.parametrize(
    ("keeps_fps", "warnings"),
    [
        ((30, 1), ()),
        ((30_000, 1001), ()),
        ((15, 1), ("camera: frame rate is 15, not 30 as asked",)),
        ((59_940, 1000), ("camera: frame rate is 59.94, not 30 as asked",)),
    ],
)
def test_a_rate_that_is_not_as_asked_is_told(play_camera, keeps_fps, warnings):
    """A driver that grants another rate than it offered is told of like a control taken otherwise; 29.97 counts as 30."""
    camera = play_camera(keeps_fps=keeps_fps)
    source = open_source(f"v4l2:{camera.path}", CaptureSettings(**SIZE, fps=30.0))
    source.close()
    assert source.info.nominal_fps == pytest.approx(keeps_fps[0] / keeps_fps[1])
    assert changed_controls(source.info.controls) == warnings


def test_unplugged_while_it_is_set_up(play_camera):
    """A camera that goes away between two controls gives one line, too."""
    camera = play_camera(controls=webcam_controls())
    camera._s_ext_ctrls = lambda fd, controls: camera.vanish()
    with pytest.raises(InputError, match=str(Path(camera.path))):
        opened(camera, gain=3)
