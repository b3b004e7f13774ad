"""Camera pixels to the track plane and back, and how far wrong that map may be.

Knows points and pictures; knows nothing of time, cars or laps."""
