"""The kit's printable parts as code: camera mount and cases, their drawings and pictures.

Knows millimetres, screws and printers. Knows nothing of `dnb_edge`, which in turn never imports this package; only the
parts list and the assembly page say what the two have to do with each other. `python -m hardware` is its command line.
"""
