"""Files for people appear whole or not at all, and what is unfinished leaves nothing behind."""

import pytest

from dnb_edge.errors import InputError, WorkError
from dnb_edge.report.files import scratch_beside


def test_a_scratch_folder_is_gone_after_a_fault(tmp_path):
    """What was written to it goes with it, also where the work failed; what took its place stays."""

    def work() -> None:
        with scratch_beside(tmp_path / "whole.bin") as folder:
            (folder / "whole.bin").write_bytes(b"whole")
            (folder / "rest").write_bytes(b"rest")
            (folder / "whole.bin").replace(tmp_path / "whole.bin")
            raise WorkError("failed")

    with pytest.raises(WorkError):
        work()
    assert [path.name for path in tmp_path.iterdir()] == ["whole.bin"]


def test_no_scratch_folder_where_none_can_be(tmp_path):
    """A folder that is not there is refused in one line that names the file that was wanted."""
    with (
        pytest.raises(InputError, match=r"x\.bin: nothing can be written there"),
        scratch_beside(tmp_path / "no" / "x.bin"),
    ):
        pass
