"""What a process that records race after race keeps of each."""

import foxglove
from foxglove import channel as library

from dnb_edge.record.channels import RunChannels


def test_the_library_keeps_no_channel_of_ours() -> None:
    """It would for as long as the process lives, 26 of each recording."""
    before = len(library._channels_by_id)
    kept = RunChannels(foxglove.Context(), None, images=True)
    assert len(library._channels_by_id) == before
    del kept
