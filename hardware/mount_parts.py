"""The mount's printable parts: the joint, the three bases and the cradles."""

from hardware.base_parts import base_parts
from hardware.cradle_parts import cradle_parts
from hardware.joint_parts import joint_parts
from hardware.printed import Printed


def mount_parts() -> tuple[Printed, ...]:
    """All of them, in the order of the kit's list."""
    return (*joint_parts(), *base_parts(), *cradle_parts())
