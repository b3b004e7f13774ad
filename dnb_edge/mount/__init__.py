"""Where to hang the camera before a hole is drilled: what a place shows, how finely, and which place is best.

Knows a camera, a place and a rectangle of floor; knows no picture, no twin and no run."""
