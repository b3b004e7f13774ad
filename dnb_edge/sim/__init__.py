"""The ground-truth rig: a drawn track, a car that drives it, and a camera that sees both."""
