"""The one slot between the race and a display's thread."""

import threading

import pytest
from display_events import board, crossing, health, lap, race, run_summary, target
from pty_line import PATIENCE_S

from dnb_edge.display.base import Mailbox, is_urgent

FOR_EVER_S = 3600.0


def take(mailbox, *, pause_s, patience_s):
    """What a taker gets; fails if it still waits after `PATIENCE_S`."""
    taken = []
    taker = threading.Thread(
        target=lambda: taken.append(mailbox.take(pause_s=pause_s, patience_s=patience_s)), daemon=True
    )
    taker.start()
    taker.join(PATIENCE_S)
    assert taken, "the taker still waits"
    return taken[0]


def opened(state):
    """A mailbox whose taker has had `state`."""
    mailbox = Mailbox()
    mailbox.put(state)
    take(mailbox, pause_s=0.0, patience_s=0.0)
    return mailbox


def test_the_latest_state_wins():
    """Of several states the taker gets the last."""
    mailbox = Mailbox()
    for laps in range(4):
        mailbox.put(race(laps))
    assert take(mailbox, pause_s=0.0, patience_s=0.0) == race(3)


def test_urgent_news_do_not_wait():
    """A crossing wakes the taker at once, also where states without news have replaced its own."""
    mailbox = opened(race(1))
    mailbox.put(race(2))
    mailbox.put(race(2).at(23.0))
    assert take(mailbox, pause_s=FOR_EVER_S, patience_s=FOR_EVER_S) == race(2).at(23.0)


def test_other_news_wait_for_the_pause_only():
    """The passing of time is told after the pause, however long the patience."""
    mailbox = opened(race(1))
    mailbox.put(race(1).at(13.0))
    assert take(mailbox, pause_s=0.01, patience_s=FOR_EVER_S) == race(1).at(13.0)


def test_patience_ends():
    """Without news the taker gets the old state again, for a sign of life; None where there never was one."""
    assert take(opened(race(1)), pause_s=0.0, patience_s=0.01) == race(1)
    assert take(Mailbox(), pause_s=0.0, patience_s=0.01) is None


def test_close_wakes_the_taker():
    """A closed mailbox returns at once, from `take` and from `sleep`."""
    mailbox = opened(race(1))
    mailbox.close()
    assert take(mailbox, pause_s=FOR_EVER_S, patience_s=FOR_EVER_S) == race(1)
    mailbox.sleep(FOR_EVER_S)
    assert mailbox.closed


@pytest.mark.parametrize(
    ("event", "urgent"),
    [
        (crossing(12.0), True),
        (lap(2, 12.0, 10.0), True),
        (run_summary(), True),
        (target(13.0), False),
        (health(13.0), False),
    ],
)
def test_is_urgent(event, urgent):
    """Crossings, laps and phases are urgent, anything else can wait for the next picture."""
    before = board(target(1.0), crossing(2.0), lap(1, 2.0, 10.0))
    assert is_urgent(before, before.after(event)) is urgent
