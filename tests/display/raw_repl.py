"""MicroPython's raw REPL on stdin and stdout, over whatever runs this file: real MicroPython or, where that is away, CPython.

After `shared/runtime/pyexec.c` of MicroPython 1.26, which boards have and the Unix port has not. Code is really run, in this
process: files are really written, errors are real. It begins as a board does whose program runs, and `machine.reset()` ends it.
"""

import sys

BANNER = (
    'MicroPython v1.26.1 on 2025-09-11; a board of the tests with RP2040\r\nType "help()" for more information.\r\n'
)


class Machine:
    """The module `machine`."""

    @staticmethod
    def reset():
        raise SystemExit


def say(text):
    sys.stdout.write(text)
    if hasattr(sys.stdout, "flush"):
        sys.stdout.flush()


def hear():
    byte = sys.stdin.buffer.read(1)
    if not byte:
        raise SystemExit
    return byte[0]


def wait_for(*codes):
    while True:
        code = hear()
        if code in codes:
            return code


def run(code, names):
    """As a board does: the output, Ctrl-D, the error, Ctrl-D."""
    try:
        exec(code, names)
    except SystemExit:
        raise
    except BaseException as error:  # noqa: BLE001 as a board does
        say('\x04Traceback (most recent call last):\r\n  File "<stdin>", line 1, in <module>\r\n')
        say(f"{type(error).__name__}: {error}\r\n\x04")
    else:
        say("\x04\x04")


def raw(names):
    say("raw REPL; CTRL-B to exit\r\n>")
    line = bytearray()
    while True:
        code = hear()
        if code == 1:
            say("raw REPL; CTRL-B to exit\r\n>")
            line = bytearray()
        elif code == 2:
            say("\r\n")
            return
        elif code == 3:
            line = bytearray()
        elif code == 4:
            say("OK")
            if not line:
                say("\r\nMPY: soft reboot\r\n" + BANNER)
                return
            # Boards send CR LF for LF.
            run(bytes(line).decode(), names)
            say(">")
            line = bytearray()
        else:
            line.append(code)


def serve(names):
    sys.modules["machine"] = Machine
    # A program that reads its lines, until Ctrl-C.
    wait_for(3)
    say(
        '\r\nTraceback (most recent call last):\r\n  File "main.py", line 3, in <module>\r\nKeyboardInterrupt: \r\n'
        + BANNER
    )
    while True:
        say(">>> ")
        wait_for(1)
        raw(names)


if sys.implementation.name != "micropython":
    # What a board would say of itself; everything else is run by what there is.
    told = vars(sys.implementation).copy()
    told.update(name="micropython", version=(1, 26, 1))
    sys.implementation = type(sys.implementation)(**told)
serve({"__name__": "__main__"})
