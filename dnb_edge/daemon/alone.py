"""One appliance a box: a lock on the directory that two of them would fight over.

Knows flock. The lock ends with the process, however that ends, and leaves no file behind.
"""

from __future__ import annotations

import fcntl
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dnb_edge.errors import InputError

log = logging.getLogger(__name__)


@contextmanager
def alone(directory: Path | None) -> Iterator[None]:
    """Holds `directory`, made where it is not there, for this process; does nothing where there is none.

    Raises `InputError` where another appliance holds it, or where it cannot be used.
    """
    if directory is None:
        yield
        return
    try:
        directory.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError as error:
        raise InputError(f"{directory}: cannot record there: {error.strerror}") from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(
                f"{directory}: another dnb-edge is racing with this directory: stop it (`systemctl stop dnb-edge`), or give "
                "--record another one"
            ) from error
        except OSError as error:
            # Some network file systems know no locks.
            log.warning(
                "%s: cannot be locked (%s): see to it that no other dnb-edge uses it", directory, error.strerror
            )
        yield
    finally:
        os.close(descriptor)


def lock_directory(recording: Path | None) -> Path | None:
    """The directory to hold: the recordings' own, else the one that the service manager made; None where neither is."""
    if recording is not None:
        return recording
    given = os.environ.get("RUNTIME_DIRECTORY", "").split(":")[0]
    return Path(given) if given else None
