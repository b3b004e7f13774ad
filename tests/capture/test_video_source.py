"""Video files: whose stamps they carry, and what is said about files that cannot be used."""

import json
import subprocess
import sys

import pytest
from clips import time_base_hz, with_frame_durations, write_clip

from dnb_edge.capture.source import open_source
from dnb_edge.errors import InputError
from dnb_edge.values import Clock, StampSource

OPEN_EACH = """
import sys
from dnb_edge.capture.source import open_source
from dnb_edge.errors import InputError
for path in sys.argv[1:]:
    try:
        open_source(f"file:{path}")
    except InputError as error:
        print(error)
"""


def test_stamps_are_the_containers_own(tmp_path):
    """In a clip of variable frame rate every stamp is the frame's own presentation time to the nanosecond, from 0."""
    durations = [512, 100, 2000, 301, 77, 512]
    clip = write_clip(tmp_path / "variable.mp4", frames=len(durations))
    with_frame_durations(clip, durations)
    hz = time_base_hz(clip)
    source = open_source(f"file:{clip}")
    stamps = [frame.t_ns for frame in source.frames()]
    source.close()
    assert stamps == [round(sum(durations[:i]) * 1_000_000_000 / hz) for i in range(len(durations))]


def test_fractional_rates_do_not_drift(tmp_path):
    """At 30000/1001 frames a second frame n lies at n * 1001/30000 s: no rounding of the rate, no milliseconds."""
    clip = with_frame_durations(write_clip(tmp_path / "ntsc.mp4", frames=20), [1001] * 20, hz=30_000)
    source = open_source(f"file:{clip}")
    stamps = [frame.t_ns for frame in source.frames()]
    assert source.info.clock is Clock.MEDIA
    source.close()
    assert stamps == [round(n * 1_001_000_000_000 / 30_000) for n in range(20)]


def test_real_clip_has_the_truths_stamps(real_dir):
    """The paper's driven lap: every frame is there and stamped as its truth file says."""
    truth = json.loads((real_dir / "drivenetbench" / "driven-lap.truth.json").read_text())
    source = open_source(f"file:{real_dir / 'drivenetbench' / 'driven-lap.mp4'}")
    frames = [(frame.sequence, frame.t_ns, frame.stamp_source) for frame in source.frames()]
    source.close()
    expected = [(i, round(i * 1_000_000_000 / 30), StampSource.MEDIA) for i in range(len(truth["frames"]))]
    assert frames == expected


@pytest.mark.parametrize("kind", ["mp4", "avi"])
def test_cut_off_clips_are_refused_before_the_first_frame(tmp_path, kind):
    """A clip that lacks its end is refused, even where FFmpeg would play what is left: laps would be missing in silence."""
    clip = write_clip(tmp_path / f"cut.{kind}", fourcc="mp4v" if kind == "mp4" else "MJPG")
    data = clip.read_bytes()
    clip.write_bytes(data[: len(data) * 2 // 3])
    with pytest.raises(InputError, match=r"cut\..* bytes are missing"):
        open_source(f"file:{clip}")


def test_unusable_clips_are_refused_by_name(tmp_path):
    """Missing, empty, a folder, noise, a picture-less container: one line that names the file, and nothing from FFmpeg.

    In a process of its own, since FFmpeg reads its log level once.
    """
    (tmp_path / "empty.mp4").touch()
    (tmp_path / "folder.mp4").mkdir()
    (tmp_path / "noise.mp4").write_bytes(bytes(range(256)) * 8)
    (tmp_path / "text.mp4").write_text("not a video at all\n" * 50)
    (tmp_path / "header.mp4").write_bytes(b"\0\0\0\x18ftypisom\0\0\2\0isomiso2\0\0\0\x08free")
    names = ("missing.mp4", "empty.mp4", "folder.mp4", "noise.mp4", "text.mp4", "header.mp4")
    done = subprocess.run(
        [sys.executable, "-c", OPEN_EACH, *(str(tmp_path / name) for name in names)],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    lines = done.stdout.splitlines()
    assert done.stderr == ""
    assert [line.partition(": ")[0] for line in lines] == [str(tmp_path / name) for name in names]


def test_clips_without_stamps_are_refused(tmp_path):
    """Frames that share one stamp cannot be timed, so the clip is refused rather than timed by its frame rate."""
    clip = with_frame_durations(write_clip(tmp_path / "still.mp4", frames=4), [512, 0, 512, 512])
    source = open_source(f"file:{clip}")
    with pytest.raises(InputError, match=r"still\.mp4"):
        list(source.frames())
    source.close()
