"""Showing the race: a line protocol over a serial port, a board in the terminal, the status line of the service.

Every display takes whole `BoardState` values and shows the latest; see `base.Display`."""
