"""How well a driven path matches the route.

Knows two lists of points in metres; knows nothing of time or pictures."""
