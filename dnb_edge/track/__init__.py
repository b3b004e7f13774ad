"""The digital twin: an image of the track becomes an ordered route with arc length, lane widths and lines.

Knows twin pixels and track metres; knows nothing of cameras, time or cars."""
