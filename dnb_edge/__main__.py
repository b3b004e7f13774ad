"""`python -m dnb_edge` is the command `dnb-edge`."""

from dnb_edge.cli.main import main

main()
