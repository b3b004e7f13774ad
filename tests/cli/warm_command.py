"""`dnb-edge` from a process that has imported its libraries already: each command is a fork of it.

A command of its own imports for a second before it does anything, and the tests run some five hundred. All else is as with
`python -m dnb_edge`: a process, its streams, its end. Run as a script it is that process; `Warm` is its other end.
"""

import array
import atexit
import gc
import json
import os
import runpy
import signal
import socket
import subprocess
import sys
import threading
import traceback
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path

REQUEST_BYTES = 1 << 20


class Warm:
    """The other end: runs commands one after the other."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._line, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            # It ends when our end of the line does.
            self._process = subprocess.Popen(
                [sys.executable, __file__, str(theirs.fileno())],
                env=dict(environment),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
            )

    def run(self, words: Sequence[str], cwd: Path, out: int, err: int, timeout_s: float) -> int:
        """The exit code of `dnb-edge WORDS`, which writes to the descriptors `out` and `err`; that of a signal is negative.

        Raises `subprocess.TimeoutExpired`, the command killed, where it takes longer than `timeout_s`.
        """
        request = json.dumps({"words": list(words), "cwd": str(cwd)}).encode()
        rights = array.array("i", [out, err])
        self._line.settimeout(timeout_s)
        self._line.sendmsg([request], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, rights)])
        pid = self._answer()
        try:
            return self._answer()
        except TimeoutError:
            os.kill(pid, signal.SIGKILL)
            self._answer()
            raise subprocess.TimeoutExpired(list(words), timeout_s) from None

    def _answer(self) -> int:
        answer = self._line.recv(64)
        assert answer, "the warm process is gone"
        return int(answer)

    def close(self) -> None:
        """Ends it."""
        self._line.close()
        self._process.wait()


def serve(line: socket.socket) -> list[str] | None:
    """Forks for each request; in the fork the words of the command, in the parent None once the line has ended."""
    while True:
        request, rights, _, _ = line.recvmsg(REQUEST_BYTES, socket.CMSG_SPACE(2 * array.array("i").itemsize))
        if not request:
            return None
        out, err = array.array("i", rights[0][2])
        pid = os.fork()
        if pid == 0:
            line.close()
            asked = json.loads(request)
            os.dup2(out, 1)
            os.dup2(err, 2)
            os.close(out)
            os.close(err)
            os.chdir(asked["cwd"])
            return [str(word) for word in asked["words"]]
        os.close(out)
        os.close(err)
        line.send(str(pid).encode())
        _, status = os.waitpid(pid, 0)
        line.send(str(os.waitstatus_to_exitcode(status)).encode())


def warm_up() -> None:
    """Imports every verb. A thread that one of them left would be missing in the forks."""
    verbs = import_module("dnb_edge.cli.verbs")
    for place in verbs.VERBS.values():
        import_module(f"dnb_edge.cli.{place.partition(':')[0]}")
    import_module("dnb_edge.detect.onnx")
    # What is never looked at again is not copied into each fork.
    gc.collect()
    gc.freeze()
    threads = len(list(Path("/proc/self/task").iterdir()))
    if threads != 1:
        raise SystemExit(f"{threads} threads after the imports: no process to be forked")


def command(words: Sequence[str]) -> int:
    """The command in this process; its exit code."""
    sys.argv = ["dnb-edge", *words]
    try:
        runpy.run_module("dnb_edge", run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        print(end.code, file=sys.stderr)
        return 1
    except BaseException:  # noqa: BLE001 as the interpreter does
        traceback.print_exc()
        return 1
    return 0


def finish(code: int) -> None:
    """Ends as an interpreter does, but for taking all modules apart, which takes half a second after so many imports."""
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    warm_up()
    found = serve(socket.socket(fileno=int(sys.argv[1])))
    if found is not None:
        sys.path.pop(0)
        finish(command(found))
