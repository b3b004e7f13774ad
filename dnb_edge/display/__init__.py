"""Showing the race: a line protocol over a serial port, and a board in the terminal."""
