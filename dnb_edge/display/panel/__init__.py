"""What a lap display does with the bytes of the line protocol: the same code on its microcontroller and in the simulator.

Knows bytes, a clock in milliseconds and pixels; knows no port, no driver and nothing else of dnb-edge. All of it keeps to what
MicroPython runs: builtins, imports of its own files only, whole numbers for time.
"""
