"""The socket's file: whose it is, and what lies there already."""

import shutil
import socket
import stat
from pathlib import Path

import pytest

from dnb_edge.errors import InputError
from dnb_edge.live.socket_file import SocketFile


def dead(path: Path) -> None:
    """Leaves a socket that nobody listens to, as a killed process does."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as left:
        left.bind(str(path))


def test_it_is_for_the_group_alone_and_goes_with_its_owner(tmp_path: Path) -> None:
    """Mode 0660 from the first moment at which anybody could call; away behind `close`, which may be repeated."""
    path = tmp_path / "live.sock"
    file = SocketFile(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o660
    file.close()
    file.close()
    assert not path.exists()


def test_a_dead_one_is_swept_away(tmp_path: Path) -> None:
    """A process that was killed leaves its file; the next one listens there."""
    path = tmp_path / "live.sock"
    dead(path)
    file = SocketFile(path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as caller:
        caller.connect(str(path))
    file.close()


def test_a_second_one_is_refused_and_the_first_goes_on(tmp_path: Path) -> None:
    """In one line that says what to do; also where whoever answers is no dnb-edge and holds no lock."""
    path = tmp_path / "live.sock"
    first = SocketFile(path)
    with pytest.raises(InputError, match="another dnb-edge answers there: stop it"):
        SocketFile(path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as caller:
        caller.connect(str(path))
    first.close()
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as other:
        other.bind(str(path))
        other.listen(1)
        with pytest.raises(InputError, match="another dnb-edge answers there"):
            SocketFile(path)
    SocketFile(path).close()


def test_what_is_no_socket_stays(tmp_path: Path) -> None:
    """A file of somebody's is never removed, a link to a socket neither."""
    path = tmp_path / "live.sock"
    path.write_text("dear diary", encoding="ascii")
    with pytest.raises(InputError, match="no socket lies there"):
        SocketFile(path)
    assert path.read_text(encoding="ascii") == "dear diary"
    dead(tmp_path / "elsewhere")
    path.unlink()
    path.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="no socket lies there"):
        SocketFile(path)


@pytest.mark.parametrize("name", ["nowhere/live.sock", "x" * 120])
def test_an_impossible_path_is_refused(tmp_path: Path, name: str) -> None:
    """A directory that is not there, a path that no socket can have: one line that names it."""
    with pytest.raises(InputError, match="--live") as told:
        SocketFile(tmp_path / name)
    assert "\n" not in str(told.value)
    assert list(tmp_path.iterdir()) == []


def test_another_ones_file_is_left_alone(tmp_path: Path) -> None:
    """Where ours was removed and another socket lies there now, closing ours does not take it away."""
    path = tmp_path / "live.sock"
    file = SocketFile(path)
    path.unlink()
    dead(tmp_path / "new")
    (tmp_path / "new").rename(path)
    file.close()
    assert path.exists()


def test_a_directory_that_has_gone_is_no_error(tmp_path: Path) -> None:
    """Whoever swept the whole directory away, or put something else there: the process that listened ends well."""
    for number, instead in enumerate((False, True)):
        directory = tmp_path / str(number)
        directory.mkdir()
        file = SocketFile(directory / "live.sock")
        shutil.rmtree(directory)
        if instead:
            directory.write_text("a file", encoding="ascii")
        file.close()
        file.close()
