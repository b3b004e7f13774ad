"""The three ways in which work can fail, and what each means to the caller.

Knows nothing of exit codes' wording or of any device: the command line turns `InputError` into one line and exit code 2,
`WorkError` into one line and exit code 1; whoever owns a device retries on `TemporaryFault`.
"""

from __future__ import annotations


class DnbEdgeError(Exception):
    """Base of every error that this package raises on purpose; its text is one line that a user can act on."""


class InputError(DnbEdgeError):
    """The input or the configuration is wrong: the text names the file, key or device and what to do. Exit code 2."""


class WorkError(DnbEdgeError):
    """The input was right and the work failed all the same (a full disk, say). Exit code 1."""


class TemporaryFault(DnbEdgeError):
    """A device is away for now (unplugged camera, stuck display): worth retrying with back-off."""
