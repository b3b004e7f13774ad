"""Between vehicles and the daemon: lines in, stamped, checked and counted; signals out. One loop that never waits for anybody.

Knows channels, the line to the daemon and the monotonic clock. Knows no race: what a signal is, `signals` knows.
"""

from __future__ import annotations

import logging
import os
import selectors
import time
from collections.abc import Hashable, Sequence

from dnb_edge.live.messages import Hello, State, Told
from dnb_edge.live.vehicle_word import VehicleWord
from dnb_edge.vehicle.channel import MOST_AT_ONCE, Channel, Heard
from dnb_edge.vehicle.ledger import Ledger
from dnb_edge.vehicle.link import Link
from dnb_edge.vehicle.signals import Signal, Signals
from dnb_edge.vehicle.telemetry import Hello as VehicleHello
from dnb_edge.vehicle.telemetry import Nonsense, parse

HAND_OVER_S = 0.02
"""Words are gathered for so long at most: a message each would cost the daemon more than they say."""
PAUSE_S = 0.02
"""How long a channel that gives more than can be taken is left alone: the processor belongs to the race."""
TICK_S = 0.2
REPEAT_S = 1.0
"""So often is what holds said again: a line may get lost, and a vehicle may come later."""
AGAIN_S = (0.03, 0.1)
"""After a change, and a lap, it is said again so soon, twice."""
COMPLAIN_S = 10.0
"""So often at most is it logged that a sender's lines are refused."""
MOST_COMPLAINTS = 64

log = logging.getLogger(__name__)


class Gateway:
    """Runs in one thread until `stop()` is called, from another one or a signal handler."""

    def __init__(self, link: Link, channels: Sequence[Channel]) -> None:
        self.ledger = Ledger()
        self._link = link
        self._channels = channels
        self._signals = Signals()
        self._selector = selectors.DefaultSelector()
        self._watched: dict[Link | Channel, tuple[int, int]] = {}
        """What the selector looks at: descriptor and events."""
        self._paused_s: dict[str, float] = {}
        """Until when a channel is left alone."""
        self._words: list[VehicleWord] = []
        self._handed_s = 0.0
        self._said = self._signals.standing
        self._repeat_s = 0.0
        self._later: list[tuple[float, Signal]] = []
        """What is to be said again, and when."""
        self._complained_s: dict[Hashable, float] = {}
        self._cars: set[int] = set()
        self._thrown_away: dict[str, int] = {}
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._stopping = False

    def stop(self) -> None:
        """Ends `run` soon. For signal handlers too: takes no lock."""
        self._stopping = True
        os.eventfd_write(self._wake, 1)

    def run(self) -> None:
        """Raises `InputError` where a channel can never work. All is closed in each case, behind a last `stop`."""
        self._selector.register(self._wake, selectors.EVENT_READ)
        try:
            while not self._stopping:
                self._turn()
        finally:
            self._signals.gone()
            for channel in self._channels:
                channel.tell(self._signals.standing.line, None, time.monotonic())
                channel.close()
            self._link.close()
            self._selector.close()

    def _turn(self) -> None:
        now_s = time.monotonic()
        self._link.tend(now_s)
        for channel in self._channels:
            channel.tend(now_s)
        self._watch(now_s)
        ready = self._selector.select(max(0.0, self._due_s(now_s) - now_s))
        if any(key.data is self._link for key, _ in ready):
            self._hear_daemon()
        for key, _ in ready:
            if key.data is not self._link and key.data is not None:
                self._hear(key.data)
        self._hand_over()
        self._say()

    def _due_s(self, now_s: float) -> float:
        """When the next thing is to be done though nothing comes."""
        due = [now_s + TICK_S, self._repeat_s, *self._paused_s.values(), *(when_s for when_s, _ in self._later)]
        if self._words:
            due.append(self._handed_s + HAND_OVER_S)
        return min(due)

    def _watch(self, now_s: float) -> None:
        """Has the selector look at what is there now, and not at channels that are left alone."""
        self._paused_s = {name: until_s for name, until_s in self._paused_s.items() if until_s > now_s}
        link = self._link
        wanted: dict[Link | Channel, tuple[int, int]] = {}
        if (number := link.fileno()) is not None:
            wanted[link] = (number, selectors.EVENT_READ | (selectors.EVENT_WRITE if link.waits else 0))
        for channel in self._channels:
            if channel.name not in self._paused_s and (number := channel.fileno()) is not None:
                wanted[channel] = (number, selectors.EVENT_READ)
        # All that goes before anything that comes: what is opened anew may have the number of what was closed.
        for one, known in list(self._watched.items()):
            if wanted.get(one) != known:
                self._selector.unregister(known[0])
                del self._watched[one]
        for one, (number, events) in wanted.items():
            if one not in self._watched:
                self._selector.register(number, events, one)
                self._watched[one] = (number, events)

    def _hear_daemon(self) -> None:
        self._link.write()
        for message in self._link.read():
            match message:
                case Hello():
                    self._signals.greeted(message)
                case State():
                    self._signals.state(message)
                case Told():
                    lap = self._signals.told(message)
                    if lap is not None:
                        self._tell(lap)
                case _:
                    pass

    def _hear(self, channel: Channel) -> None:
        found = channel.read()
        if len(found) >= MOST_AT_ONCE:
            self._paused_s[channel.name] = time.monotonic() + PAUSE_S
        for heard in found:
            self._take(channel, heard)
        lost = channel.thrown_away
        self.ledger.over += max(0, lost - self._thrown_away.get(channel.name, 0))
        self._thrown_away[channel.name] = lost

    def _take(self, channel: Channel, heard: Heard) -> None:
        if not self.ledger.has_room(heard.sender, heard.came_ns):
            self._complain(heard.sender, "more lines than are taken: the others are left out")
            return
        try:
            found = parse(heard.line, heard.came_ns)
        except Nonsense as error:
            self.ledger.nonsense += 1
            self._complain(heard.sender, f"a line that is no telemetry: {error}")
            return
        now_s = time.monotonic()
        channel.registered(heard, found.car, now_s)
        if isinstance(found, VehicleHello):
            channel.tell(self._signals.standing.line, found.car, now_s)
            return
        if found.car not in self._cars:
            self._cars.add(found.car)
            log.info("car %d speaks, by %s", found.car, channel.name)
        self._words.append(self.ledger.take(found))

    def _complain(self, sender: Hashable, what: str) -> None:
        """Once in a while: whoever floods us shall not flood the log."""
        now_s = time.monotonic()
        if now_s - self._complained_s.get(sender, -COMPLAIN_S) < COMPLAIN_S:
            return
        if len(self._complained_s) >= MOST_COMPLAINTS:
            self._complained_s.clear()
        self._complained_s[sender] = now_s
        log.warning("%s: %s", " ".join(map(str, sender)) if isinstance(sender, tuple) else sender, what)

    def _hand_over(self) -> None:
        now_s = time.monotonic()
        if self._words and now_s - self._handed_s >= HAND_OVER_S:
            self._handed_s = now_s
            words, self._words = self._words, []
            self._link.hand_over(words)

    def _say(self) -> None:
        """Says what holds, where that has changed or it is time again, and what was to be said again."""
        if not self._link.connected:
            self._signals.gone()
        now_s = time.monotonic()
        standing = self._signals.standing
        if standing != self._said:
            log.info("signal: %s", self._signals.word.value)
            self._later = [(when_s, one) for when_s, one in self._later if one != self._said]
            self._said = standing
            self._tell(standing)
        elif now_s >= self._repeat_s:
            self._send(standing, now_s)
        due = [one for when_s, one in self._later if when_s <= now_s]
        self._later = [(when_s, one) for when_s, one in self._later if when_s > now_s]
        for one in due:
            self._send(one, now_s)
        if now_s >= self._repeat_s:
            self._repeat_s = now_s + REPEAT_S

    def _tell(self, signal: Signal) -> None:
        """Says it now, and again soon."""
        now_s = time.monotonic()
        self._send(signal, now_s)
        self._later += [(now_s + after_s, signal) for after_s in AGAIN_S]

    def _send(self, signal: Signal, now_s: float) -> None:
        for channel in self._channels:
            channel.tell(signal.line, signal.car, now_s)
