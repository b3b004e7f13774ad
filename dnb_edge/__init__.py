"""dnb-edge: a live appliance that times and scores small self-driving cars from one overhead camera."""

__version__ = "0.1.0"
