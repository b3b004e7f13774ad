"""Pictures are found by the files' indexes: the nearest one, in the recording itself or in the ring beside it."""

from __future__ import annotations

from pathlib import Path

import pytest
from judged_runs import Wanderer, record

from dnb_edge.archive.moments import NEAR_NS, picture_near
from dnb_edge.errors import InputError
from dnb_edge.record.names import pictures_directory
from dnb_edge.record.reader import iter_frames

CAR = Wanderer((3.0, 3.1))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording with its pictures in itself."""
    return record(tmp_path_factory.mktemp("plain") / "run.mcap", CAR)


@pytest.fixture(scope="module")
def ringed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One with them beside it."""
    path = record(tmp_path_factory.mktemp("ringed") / "run.mcap", CAR, image_ring_bytes=100_000_000)
    assert list(pictures_directory(path).iterdir())
    return path


@pytest.mark.parametrize("kind", ["plain", "ringed"])
def test_the_nearest_picture_is_found(kind: str, request: pytest.FixtureRequest) -> None:
    """For moments in all of the run: the same as looking through every picture gives."""
    path: Path = request.getfixturevalue(kind)
    frames = list(iter_frames(path))
    assert len(frames) > 20
    for t_ns in range(0, frames[-1].t_ns, 77_777_777):
        wanted = min(frames, key=lambda frame: abs(frame.t_ns - t_ns))
        found = picture_near(path, t_ns)
        assert found is not None
        assert (found.t_ns, found.sequence, found.jpeg) == (wanted.t_ns, wanted.sequence, wanted.jpeg)


def test_a_picture_of_something_else_is_none(plain: Path) -> None:
    """Further from the moment than half a second, on either side."""
    last_ns = list(iter_frames(plain))[-1].t_ns
    assert picture_near(plain, last_ns + NEAR_NS) is not None
    assert picture_near(plain, last_ns + NEAR_NS + 1) is None
    assert picture_near(plain, -NEAR_NS - 1) is None


def test_a_broken_ring_is_told(ringed: Path) -> None:
    """A file whose index lies is an `InputError` in one line with its name, no other error."""
    ring = next(iter(pictures_directory(ringed).iterdir()))
    whole = ring.read_bytes()
    for damage in (whole[:-40], whole[:200], b"no MCAP", whole[:-300] + bytes(300)):
        ring.write_bytes(damage)
        said = _complaint(ringed)
        assert said is None or ring.name in said
        assert said is None or "\n" not in said
    ring.write_bytes(whole)
    assert picture_near(ringed, 0) is not None


def _complaint(path: Path) -> str | None:
    """What is said where a picture is looked for; None where nothing is found or one is."""
    try:
        picture_near(path, 0)
    except InputError as error:
        return str(error)
    return None
