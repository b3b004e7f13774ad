"""A display at the other end of a serial line, plugged in or not.

A thread of its own opens the port, repaints, tells news, and starts again after any fault: the race never waits for it
and never ends by it. Knows pyserial and what a port can do wrong; the words come from `messages`.
"""

from __future__ import annotations

import logging
import os
import select
import termios
import threading
import time

import serial

from dnb_edge.display import messages, protocol
from dnb_edge.display.base import ClosesOnExit, DisplayStatus, Mailbox, is_urgent
from dnb_edge.display.state import BoardState

WRITE_TIMEOUT_S = 0.2
PART_BYTES = 512
"""What is given to the port at once: 0.05 s at 115200 baud. A whole repaint of many cars may take longer than a port may
take no bytes."""
PERIOD_S = 0.1
"""Shortest time between two tellings of the running time, seconds."""
SIGN_OF_LIFE_S = 0.5
"""Longest silence, seconds: the display may call the appliance dead after a few of these, and so may we the display."""
REPAINT_S = 2.0
"""A full repaint every so often, seconds: a display switched on late, or a byte lost, mends itself."""
BACK_OFF_S = (0.25, 0.5, 1.0, 2.0)
"""Pauses between attempts to open, seconds, the last one for ever: a port that returns is back within 3 s."""
CLOSE_S = 1.0
DRAIN_S = 0.3
"""How long `close` lets the last lines leave the kernel's buffer, seconds: 3,400 bytes at 115200 baud."""

PORT_FAULTS = (serial.SerialException, OSError, termios.error)
"""Everything that a port raises when it goes away, at whatever call: termios.error is no OSError."""

log = logging.getLogger(__name__)


class SerialDisplay(ClosesOnExit):
    """A `Display` that speaks `protocol` over `port`, a path such as /dev/ttyUSB0."""

    def __init__(self, port: str, baud: int = protocol.BAUD) -> None:
        self._port_path = port
        self._baud = baud
        self._mailbox = Mailbox()
        self._status = DisplayStatus.OFFLINE
        self._fault: str | None = None
        self._thread = threading.Thread(target=self._serve, name=f"display-{port}", daemon=True)
        self._thread.start()

    @property
    def status(self) -> DisplayStatus:
        """Online while the port takes what it is told."""
        return self._status

    @property
    def fault(self) -> str | None:
        """Why the display is offline; None where it is online or has not been tried yet."""
        return self._fault

    def post(self, state: BoardState) -> None:
        """Show `state` soon."""
        self._mailbox.put(state)

    def close(self) -> None:
        """Tell the last state if the port takes it, and let go of the port."""
        self._mailbox.close()
        self._thread.join(timeout=CLOSE_S)

    def _serve(self) -> None:
        try:
            self._keep_connected()
        finally:
            self._status = DisplayStatus.OFFLINE

    def _keep_connected(self) -> None:
        attempt = 0
        while not self._mailbox.closed:
            try:
                with self._open() as port:
                    attempt = 0
                    self._talk(port)
                    _let_go(port)
            except PORT_FAULTS as fault:
                self._goes_offline(f"{self._port_path}: {_reason(fault)}")
                self._mailbox.sleep(BACK_OFF_S[min(attempt, len(BACK_OFF_S) - 1)])
                attempt += 1

    def _open(self) -> serial.Serial:
        # Exclusive, so that two appliances never write into one another's lines.
        return serial.Serial(self._port_path, self._baud, write_timeout=WRITE_TIMEOUT_S, exclusive=True)

    def _talk(self, port: serial.Serial) -> None:
        """Tell news until the mailbox closes; a port that does not take them stays open and is asked again."""
        shown: BoardState | None = None
        painted_s = 0.0
        closing = False
        while not closing:
            closing = self._mailbox.closed
            patience_s = 0.0 if shown is None else SIGN_OF_LIFE_S
            state = self._mailbox.take(pause_s=min(PERIOD_S, patience_s), patience_s=patience_s) or BoardState()
            # A repaint tells of no crossing, and many lines before the lap: what cannot wait goes first.
            if shown is None or (time.monotonic() - painted_s > REPAINT_S and not is_urgent(shown, state)):
                told = messages.repaint(state)
                painted_s = time.monotonic()
            else:
                told = messages.news(shown, state)
            try:
                write_lines(port, b"".join(protocol.encode_line(message) for message in told), fresh=shown is None)
            except serial.SerialTimeoutException:
                self._goes_offline(f"{self._port_path}: takes no bytes")
                shown = None
            else:
                self._goes_online()
                shown = state

    def _goes_online(self) -> None:
        if self._status is DisplayStatus.OFFLINE:
            log.info("display online: %s", self._port_path)
        self._status, self._fault = DisplayStatus.ONLINE, None

    def _goes_offline(self, fault: str) -> None:
        if self._fault is None:
            log.info("display offline: %s", fault)
        self._status, self._fault = DisplayStatus.OFFLINE, fault


def _reason(fault: Exception) -> str:
    """The system's words where `fault` has its number: pyserial's own repeat number and path."""
    number = fault.args[0] if fault.args else None
    return os.strerror(number) if isinstance(number, int) else str(fault)


def write_lines(port: serial.Serial, lines: bytes, *, fresh: bool) -> None:
    """Gives `lines` to the port. Raises `serial.SerialTimeoutException` where it takes none for `WRITE_TIMEOUT_S`."""
    # The blank line ends whatever torn line went before, and belongs to no message.
    told = b"\r\n" + lines if fresh else lines
    for start in range(0, len(told), PART_BYTES):
        # pyserial spins on a full buffer until its timeout; waiting here first leaves the processor to the race.
        _, ready, _ = select.select([], [port.fileno()], [], WRITE_TIMEOUT_S)
        if not ready:
            raise serial.SerialTimeoutException
        port.write(told[start : start + PART_BYTES])


def _let_go(port: serial.Serial) -> None:
    """Give the last lines `DRAIN_S` to leave, then discard them: close() would wait up to 30 s for a stuck display."""
    deadline_s = time.monotonic() + DRAIN_S
    while port.out_waiting and time.monotonic() < deadline_s:
        time.sleep(0.01)
    if port.out_waiting:
        port.reset_output_buffer()
