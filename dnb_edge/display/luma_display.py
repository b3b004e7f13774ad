"""A display on the box's own SPI: the firmware's parser and faces, run here, on a MAX7219 panel through luma.

A thread of its own draws; the race never waits for it and never ends by it. Nothing on SPI answers: "online" means that the
machine's SPI takes what it is told, not that a panel hangs on it.
"""

from __future__ import annotations

import errno
import logging
import threading
import time
from collections.abc import Callable

from dnb_edge.display import messages, protocol
from dnb_edge.display.base import ClosesOnExit, DisplayStatus, Mailbox
from dnb_edge.display.luma_device import LumaPanel, SpiPanel, need_luma
from dnb_edge.display.panel import face
from dnb_edge.display.panel.state import Panel
from dnb_edge.display.state import BoardState

FRAME_S = 0.04
SIGN_OF_LIFE_S = 0.5
"""Longest silence towards the panel's parser, seconds, as on a serial line."""
BACK_OFF_S = (0.25, 0.5, 1.0, 2.0)
CLOSE_S = 1.0

_ADVICE = {
    errno.ENOENT: "switch SPI on (sudo raspi-config nonint do_spi 0) and start anew",
    errno.EACCES: "the service may not use it: see docs/wiring.md",
    errno.EPERM: "the service may not use it: see docs/wiring.md",
}

log = logging.getLogger(__name__)


class LumaDisplay(ClosesOnExit):
    """A `Display` on the panel `wanted`; `opener` opens it, and may raise `OSError`."""

    def __init__(self, wanted: SpiPanel, opener: Callable[[SpiPanel], LumaPanel] = LumaPanel) -> None:
        self._wanted = wanted
        self._opener = opener
        self._mailbox = Mailbox()
        self._status = DisplayStatus.OFFLINE
        self._fault: str | None = None
        self._panel = Panel()
        self._thread = threading.Thread(target=self._serve, name=f"display-{wanted.path}", daemon=True)
        self._thread.start()

    @property
    def status(self) -> DisplayStatus:
        """Online while the SPI takes what it is told."""
        return self._status

    @property
    def fault(self) -> str | None:
        """Why the display is offline; None where it is online or has not been tried yet."""
        return self._fault

    def post(self, state: BoardState) -> None:
        """Show `state` soon."""
        self._mailbox.put(state)

    def close(self) -> None:
        """Show the last state and let go of the SPI."""
        self._mailbox.close()
        self._thread.join(timeout=CLOSE_S)

    def _serve(self) -> None:
        try:
            attempt = 0
            while not self._mailbox.closed:
                try:
                    panel = self._opener(self._wanted)
                    try:
                        attempt = 0
                        self._follow(panel)
                    finally:
                        panel.close()
                except OSError as fault:
                    self._goes_offline(fault)
                    self._mailbox.sleep(BACK_OFF_S[min(attempt, len(BACK_OFF_S) - 1)])
                    attempt += 1
        finally:
            self._status = DisplayStatus.OFFLINE

    def _follow(self, device: LumaPanel) -> None:
        """Draw until the mailbox closes: at news, and as often as the picture moves by itself."""
        panel, surface = Panel(), face.surface(self._wanted.layout)
        self._panel = panel
        shown: BoardState | None = None
        told_s = due_s = 0.0
        closing = False
        while not closing:
            closing = self._mailbox.closed
            now_s = time.monotonic()
            patience_s = max(FRAME_S, min(due_s, told_s + SIGN_OF_LIFE_S) - now_s)
            state = self._mailbox.take(pause_s=0.0 if shown is None else FRAME_S, patience_s=patience_s) or BoardState()
            now_s = time.monotonic()
            if state is not shown or now_s - told_s >= SIGN_OF_LIFE_S:
                told = messages.repaint(state) if shown is None else messages.news(shown, state)
                panel.feed(b"".join(protocol.encode_line(message) for message in told), _ms(now_s))
                shown, told_s = state, now_s
            face.draw(panel, surface, _ms(now_s))
            device.show(surface)
            due_s = face.next_change(panel, surface, _ms(now_s)) * 1e-3
            self._goes_online()

    def _goes_online(self) -> None:
        if self._status is DisplayStatus.OFFLINE:
            log.info("display online: %s", self._wanted.path)
        self._status, self._fault = DisplayStatus.ONLINE, None

    def _goes_offline(self, error: OSError) -> None:
        advice = _ADVICE.get(error.errno or 0)
        fault = f"{self._wanted.path}: {error.strerror or error}" + (f": {advice}" if advice else "")
        if self._fault is None:
            log.info("display offline: %s", fault)
        self._status, self._fault = DisplayStatus.OFFLINE, fault


def open_luma(wanted: SpiPanel) -> LumaDisplay:
    """The display on the panel `wanted`, which is offline until its SPI is there. Raises `InputError` where luma is missing."""
    need_luma()
    return LumaDisplay(wanted)


def _ms(seconds: float) -> int:
    return int(1000.0 * seconds)
