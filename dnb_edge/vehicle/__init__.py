"""What real cars tell of themselves, and what they are told: a process of its own between a network and the live socket."""
