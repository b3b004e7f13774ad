"""The whole kit: every printable part, and the pictures that show how they go together."""

from hardware.case_parts import case_parts
from hardware.mount_parts import mount_parts
from hardware.printed import Printed


def parts() -> tuple[Printed, ...]:
    """All printable parts, in the order in which the pages list them."""
    return (*mount_parts(), *case_parts())
