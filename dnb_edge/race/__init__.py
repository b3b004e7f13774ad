"""Crossings, laps and their rules.

Knows targets' positions on the track plane over time; knows nothing of pixels, files or clocks."""
