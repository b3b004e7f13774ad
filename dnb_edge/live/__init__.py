"""What the daemon tells other processes on this box, and what they may ask of it, over a Unix socket."""
