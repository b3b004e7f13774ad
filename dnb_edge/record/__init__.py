"""The recording of a run: one MCAP file, durable while it is written, readable by anyone."""
