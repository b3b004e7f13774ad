"""What the configuration asks of a camera reaches the camera."""

from kernel_camera import AUTO_EXPOSURE, BRIGHTNESS, EXPOSURE, FOCUS, GAIN, POWER_LINE, WHITE_KELVIN, webcam_controls

from dnb_edge.assembly import make_source
from dnb_edge.config.devices import CaptureConfig
from dnb_edge.config.schema import Config


def test_every_key_of_the_section_reaches_the_camera(play_camera):
    """Size, rate, format and each control, from a checked configuration through the assembly to the driver."""
    capture = CaptureConfig(
        width_px=32, height_px=24, fps=15, pixel_format="YUYV", exposure_us=2000, gain=5, white_balance_k=5000, focus=20,
        power_line_hz=50, controls={"brightness": 99},
    )  # fmt: skip
    sizes = {"YUYV": [((32, 24), [30, 15])], "MJPG": [((32, 24), [30, 15])]}
    camera = play_camera(controls=webcam_controls(), sizes=sizes)
    source = make_source(f"v4l2:{camera.path}", Config.model_construct(capture=capture))
    source.close()
    wanted = {EXPOSURE: 20, AUTO_EXPOSURE: 1, GAIN: 5, WHITE_KELVIN: 5000, FOCUS: 20, POWER_LINE: 1, BRIGHTNESS: 99}
    assert {ident: camera.controls[ident].value for ident in wanted} == wanted
    info = source.info
    assert (info.width_px, info.height_px, info.nominal_fps, info.pixel_format) == (32, 24, 15.0, "YUYV")
    assert len(info.controls) == 10
