"""The camera mount: tilt joint, three ways to fix it, a cradle for each camera, and how they go together."""
