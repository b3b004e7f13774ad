"""A cold start, run as a process of its own: `python -m dnb_edge.nut.cold`, which prints one JSON object.

Knows one model, what it is fed, and two clocks. Imports only what a program needs that runs a model, and that late, since the
import is part of what is measured.
"""

from __future__ import annotations

import json
import sys
import time
from importlib import import_module
from pathlib import Path

FURTHER_PASSES = 20
"""After the first answer: some memory is taken only then."""


def main(spawned_ns: str, path: str, threads: str, feeds: str) -> None:
    """Measures; `feeds` is JSON, name: [type, shape]; `spawned_ns` is time.monotonic_ns() before this process began."""
    began_ns = time.monotonic_ns()
    onnx = import_module("dnb_edge.nut.onnx")
    np = import_module("numpy")
    imported_ns = time.monotonic_ns()
    before_bytes = _status_bytes("VmRSS")
    model = onnx.load_model(Path(path), threads=int(threads))
    loaded_ns = time.monotonic_ns()
    fed = {name: np.zeros(shape, dtype=kind) for name, (kind, shape) in json.loads(feeds).items()}
    model.run(fed)
    answered_ns = time.monotonic_ns()
    for _ in range(FURTHER_PASSES):
        model.run(fed)
    told = {
        "process_ms": (began_ns - int(spawned_ns)) * 1e-6,
        "import_ms": (imported_ns - began_ns) * 1e-6,
        "load_ms": (loaded_ns - imported_ns) * 1e-6,
        "first_answer_ms": (answered_ns - loaded_ns) * 1e-6,
        "total_ms": (answered_ns - int(spawned_ns)) * 1e-6,
        "grown_bytes": max(0, _status_bytes("VmRSS") - before_bytes),
        "peak_bytes": _status_bytes("VmHWM"),
    }
    sys.stdout.write(json.dumps(told) + "\n")


def _status_bytes(key: str) -> int:
    """A line of /proc/self/status (proc_pid_status(5)), told in kB; 0 where the kernel has none."""
    for line in Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines():
        name, _, value = line.partition(":")
        if name == key:
            return int(value.split()[0]) * 1024
    return 0


if __name__ == "__main__":
    main(*sys.argv[1:])
