"""ONNX models as drivers: what fits drives, what does not is refused with the shapes it has and the shapes wanted."""

import pytest
from nut_driving import BRIEFING, sight
from nut_models import BYTES, write_model

from dnb_edge.errors import InputError
from dnb_edge.nut.model import open_onnx_driver
from dnb_edge.sim.control import DriverFailed

# The picture's mean red is 51 / 255 = 0.2, its mean green 0.4.


@pytest.mark.parametrize(
    ("ends", "steering", "throttle"),
    [
        ({}, 0.2, 0.4),
        ({"shape": (1, 12, 16, 3), "nhwc": True}, 0.2, 0.4),
        ({"shape": (1, 3, 6, 8)}, 0.2, 0.4),
        ({"shape": (1, 3, 48, 64)}, 0.2, 0.4),
        ({"shape": ("n", 3, "h", "w")}, 0.2, 0.4),
        ({"shape": (1, 3, "h", 20)}, 0.2, 0.4),
        ({"kind": BYTES, "weights": ((0.01, 0), (0, 0.005), (0, 0))}, 0.51, 0.51),
        ({"speed": (1, 1)}, 0.45, 0.65),
        ({"speed": ("n", 1)}, 0.45, 0.65),
        ({"weights": ((-99, 0), (0, 99), (0, 0))}, -1.0, 1.0),
    ],
    ids=["nchw", "nhwc", "smaller", "larger", "open", "half-open", "bytes", "speed", "open-speed", "clipped"],
)
def test_a_model_that_fits_drives(tmp_path, ends, steering, throttle):
    """Whatever its layout, size and type, it gets the picture in red, green, blue and its answer is clipped to [-1, 1]."""
    driver = open_onnx_driver(write_model(tmp_path / "my-net.onnx", **ends))
    assert (driver.name, driver.knows_truth) == ("my-net", False)
    driver.start(BRIEFING)
    control = driver.drive(sight())
    driver.close()
    assert (control.steering, control.throttle) == pytest.approx((steering, throttle), abs=1e-5)


@pytest.mark.parametrize(
    ("ends", "has", "wanted"),
    [
        (
            {"shape": (1, 4, 12, 16), "weights": ((1.0, 0.0),) * 4},
            "image float32 (1, 4, 12, 16)",
            "(1, 3, height, width)",
        ),
        ({"shape": (1, 1, 12, 16), "weights": ((1.0, 0.0),)}, "image float32 (1, 1, 12, 16)", "(1, 3, height, width)"),
        ({"shape": (2, 3, 12, 16), "out_shape": (2, 2)}, "image float32 (2, 3, 12, 16)", "(1, 3, height, width)"),
        ({"kind": 11}, "image float64 (1, 3, 12, 16)", "float32 or uint8"),
        ({"speed": (1, 2)}, "speed float32 (1, 2)", "speed float32 (1, 1)"),
        ({"speed": (1, 1), "more_inputs": ((1, 1),)}, "more0 float32 (1, 1)", "at most a speed"),
        ({"weights": ((1.0,),) * 3}, "control float32 (1, 1)", "float32 (1, 2): steering, throttle"),
        ({"weights": ((1.0, 0.0, 0.0),) * 3}, "control float32 (1, 3)", "float32 (1, 2): steering, throttle"),
    ],
    ids=["four-channels", "grey", "batch", "double", "wide-speed", "third-input", "one-output", "three-outputs"],
)
def test_a_model_that_does_not_fit_is_refused(tmp_path, ends, has, wanted):
    """The line names the file, the shapes it has and the shapes wanted."""
    path = write_model(tmp_path / "net.onnx", **ends)
    with pytest.raises(InputError) as refusal:
        open_onnx_driver(path)
    said = str(refusal.value)
    assert said.startswith(f"{path}: ")
    assert has in said
    assert wanted in said
    assert "\n" not in said


@pytest.mark.parametrize("content", [None, b"", b"no model"], ids=["missing", "empty", "rubbish"])
def test_a_file_that_is_no_model_is_refused(tmp_path, content):
    """One line that names the file."""
    path = tmp_path / "net.onnx"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"net\.onnx: ") as refusal:
        open_onnx_driver(path)
    assert "\n" not in str(refusal.value)


def test_what_is_no_number_ends_the_run(tmp_path):
    """A network that answers NaN has failed; nothing is steered by it."""
    driver = open_onnx_driver(write_model(tmp_path / "net.onnx", weights=((-1, 0), (0, 1), (0, 0)), log=True))
    driver.start(BRIEFING)
    with pytest.raises(DriverFailed, match=r"net: the network answered steering nan, .* 1\.000 s"):
        driver.drive(sight())


def test_a_model_that_fails_on_its_picture_ends_the_run_at_its_start(tmp_path):
    """A picture that its open channels allow and its graph does not is told before anything drives."""
    path = write_model(tmp_path / "net.onnx", weights=((1.0, 0.0),) * 4, shape=("n", "c", "h", 3), nhwc=False)
    driver = open_onnx_driver(path)
    with pytest.raises(DriverFailed, match=r"net: .*the network failed on image"):
        driver.start(BRIEFING)
