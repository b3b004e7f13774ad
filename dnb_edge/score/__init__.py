"""How well a driven path matches the route.

Knows paths and fixes on the track plane, and laps; knows nothing of pictures, detections or who is who."""
