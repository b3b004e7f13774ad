"""What the machine under the software says of itself: heat, supply, memory, room on a disk. Knows no race."""
