"""The contract that all sources of frames pass, in the guest, with cameras behind real drivers."""

import pytest
from harness.image import SOURCE, TEST_SITE

VIVID = (
    "modprobe vivid n_devs=1 node_types=0x1 input_types=0 num_inputs=1 && udevadm settle && "
    "v4l2-ctl -d /dev/video0 -c timestamp_source=1"
)
"""A camera that the kernel plays, raw only; its stamps lie in the future unless told otherwise."""


def contract(guest, node: str, size: str) -> str:
    """Runs the rows of the contract for the camera at `node`; what pytest said."""
    environment = f"PYTHONPATH={TEST_SITE} DNB_EDGE_TEST_CAMERA={node} DNB_EDGE_TEST_CAMERA_SIZE={size}"
    pytest_words = "-q -p no:cacheprovider -k real_camera tests/capture/test_source_contract.py"
    command = f"/opt/dnb-edge/venv/bin/python -m pytest {pytest_words}"
    return guest.run(f"cd {SOURCE} && {environment} {command}", timeout_s=240.0)


@pytest.mark.parametrize("size", ["640x360", "1280x720"])
def test_a_usb_webcam_passes(guest, webcam, size):
    """MJPEG through uvcvideo."""
    webcam.plug(guest)
    said = contract(guest, webcam.node, size)
    assert " passed" in said
    assert "skipped" not in said


def test_a_raw_camera_passes(guest):
    """YUYV through the kernel's vivid."""
    guest.run(VIVID)
    said = contract(guest, "/dev/video0", "640x360")
    assert " passed" in said
    assert "skipped" not in said
