"""JPEG frames to pictures, and damaged ones to None."""

import cv2
import numpy as np
import pytest

from dnb_edge.capture.decode import decode_bgr
from dnb_edge.values import Frame, StampSource


def picture() -> np.ndarray:
    ramp = np.linspace(0, 255, 70).astype(np.uint8)
    return np.dstack([np.tile(ramp, (50, 1)), np.full((50, 70), 90, np.uint8), np.tile(ramp[::-1], (50, 1))])


def jpeg_frame(data: bytes, width_px: int = 70, height_px: int = 50) -> Frame:
    return Frame(
        sequence=0, t_ns=0, stamp_source=StampSource.ARRIVAL, width_px=width_px, height_px=height_px, jpeg=data
    )


def encoded() -> bytes:
    return cv2.imencode(".jpg", picture())[1].tobytes()


def without_huffman_tables(jpeg: bytes) -> bytes:
    """As many webcams send Motion JPEG: the standard tables are left out."""
    kept, at = bytearray(jpeg[:2]), 2
    while True:
        length = 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
        if jpeg[at + 1] == 0xDA:
            return bytes(kept) + jpeg[at:]
        if jpeg[at + 1] != 0xC4:
            kept += jpeg[at : at + length]
        at += length


@pytest.mark.parametrize("reduce", [1, 2, 4, 8])
def test_pictures_come_out_whole_or_reduced(reduce):
    """A JPEG and a raw frame give the same picture within coding error, at every reduction, sizes rounded up."""
    from_jpeg = decode_bgr(jpeg_frame(encoded()), reduce=reduce)
    raw = Frame(sequence=0, t_ns=0, stamp_source=StampSource.ARRIVAL, width_px=70, height_px=50, bgr=picture())
    from_raw = decode_bgr(raw, reduce=reduce)
    assert from_jpeg is not None
    assert from_raw is not None
    assert from_jpeg.shape == from_raw.shape == (-(-50 // reduce), -(-70 // reduce), 3)
    assert np.abs(from_jpeg.astype(int) - from_raw.astype(int)).mean() < 4


def test_webcam_jpegs_are_understood():
    """Zeros after the end and missing Huffman tables are common in cameras and change nothing."""
    plain = decode_bgr(jpeg_frame(encoded()))
    for data in (encoded() + bytes(100), without_huffman_tables(encoded())):
        assert np.array_equal(decode_bgr(jpeg_frame(data)), plain)


@pytest.mark.parametrize(
    "frame",
    [
        jpeg_frame(encoded()[:-2]),
        jpeg_frame(encoded()[: len(encoded()) // 2]),
        jpeg_frame(b"\xff\xd8"),
        jpeg_frame(b"\xff\xd8" + bytes(200) + b"\xff\xd9"),
        jpeg_frame(b"no picture"),
        jpeg_frame(encoded(), width_px=640),
    ],
    ids=["no end", "half", "nothing but a start", "no data", "no JPEG", "another size"],
)
def test_damaged_jpegs_are_none(frame):
    """A frame that came cut off or garbled is None, so that it can be counted; it is never a half-grey picture."""
    assert decode_bgr(frame) is None


def test_other_reductions_are_refused():
    """A reduction that the decoder does not know is a mistake in the code, not in the frame."""
    with pytest.raises(ValueError, match="reduce"):
        decode_bgr(jpeg_frame(encoded()), reduce=3)
