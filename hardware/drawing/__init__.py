"""Dimensioned drawings and exploded pictures of the parts, as SVG that comes out the same every time."""
