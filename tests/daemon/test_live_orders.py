"""What others may ask of the daemon, and the notices that they may have shown."""

import threading

import pytest
from played import Panel, wait_until

from dnb_edge.daemon.notices import LONGEST_S, LONGEST_TEXT, Notices
from dnb_edge.daemon.orders import Orders, Wish
from dnb_edge.daemon.sinks import BoardSink
from dnb_edge.display.service import ServiceNotifier
from dnb_edge.errors import InputError
from dnb_edge.live.messages import AimCamera, NewRun, ShowText

DONE: list[str | None] = [None]


class Asked:
    """The reply to one order."""

    def __init__(self) -> None:
        self.replies: list[str | None] = []

    def __call__(self, reason: str | None) -> None:
        self.replies.append(reason)


def orders(check: object = None) -> Orders:
    """With a check that lets every entry pass."""
    return Orders(Notices(), check if callable(check) else lambda entry: None)


def taken(desk: Orders) -> Wish:
    """The wish, once it has been looked at."""
    wait_until(desk.is_set)
    wish = desk.take()
    assert wish is not None
    return wish


def test_a_new_run_is_answered_when_it_begins() -> None:
    """It ends what is done now; a second order meanwhile is refused with the reason; another one behind it is taken."""
    desk, first, second, third = orders(), Asked(), Asked(), Asked()
    assert not desk.is_set()
    desk(NewRun(ask=1, entry="net"), first)
    desk(NewRun(ask=2), second)
    desk(AimCamera(ask=3, aim=True), third)
    assert taken(desk) == Wish(aim=False, entry="net")
    assert not desk.is_set()
    assert first.replies == []
    (reason,), (other,) = second.replies, third.replies
    assert reason == other
    assert reason is not None
    assert "is under way" in reason
    desk.done()
    desk.done()
    assert first.replies == DONE
    again = Asked()
    desk(NewRun(ask=4), again)
    assert taken(desk) == Wish(aim=False)
    desk.done("the camera is away")
    assert again.replies == ["the camera is away"]


def test_no_race_is_ended_for_one_that_could_not_begin() -> None:
    """The configuration is looked at first, away from the server's thread; what is wrong is the answer, in one line."""
    looked: list[str] = []

    def check(entry: str | None) -> None:
        looked.append(threading.current_thread().name)
        raise InputError(f"dnb-edge.yaml:\n no such {entry}")

    desk, asked = orders(check), Asked()
    desk(NewRun(ask=1, entry="net"), asked)
    wait_until(lambda: bool(asked.replies))
    assert asked.replies == ["dnb-edge.yaml: no such net"]
    assert looked == ["check"]
    assert not desk.is_set()
    assert desk.take() is None


@pytest.mark.parametrize(
    ("aims", "races", "aim", "wish"),
    [
        (False, True, True, Wish(aim=True)),
        (True, False, False, Wish(aim=False)),
        (False, False, False, Wish(aim=False)),
        (True, False, True, None),
        (False, True, False, None),
    ],
    ids=["aim", "race again", "race where nothing is raced", "aims already", "races already"],
)
def test_aiming_and_back(aims: bool, races: bool, aim: bool, wish: Wish | None) -> None:
    """What is so already is done at once."""
    desk, asked = orders(), Asked()
    desk.aims, desk.races = aims, races
    desk(AimCamera(ask=1, aim=aim), asked)
    assert desk.take() == wish
    assert asked.replies == (DONE if wish is None else [])


def test_the_end_of_the_process_ends_what_is_done() -> None:
    """Whether or not there is a wish; without a lock, as signal handlers need it."""
    desk = orders()
    desk.end()
    assert desk.is_set()
    assert desk.take() is None
    assert desk.is_set()


def test_what_waits_behind_a_start_is_not_answered_by_it() -> None:
    """An order that comes while the first run begins waits for its own."""
    desk, asked = orders(), Asked()
    desk(AimCamera(ask=1, aim=True), asked)
    desk.done()
    assert asked.replies == []
    assert desk.take() == Wish(aim=True)
    desk.done()
    assert asked.replies == DONE


def test_what_is_still_looked_at_is_not_answered_by_what_begins_or_fails_meanwhile() -> None:
    """Neither a fault that is told again and again nor a clip that begins anew says that it is done, or not."""
    looked, go_on = threading.Event(), threading.Event()

    def check(entry: str | None) -> None:
        looked.set()
        assert go_on.wait(60.0)
        raise InputError("nobody knows it")

    desk, asked = orders(check), Asked()
    desk(NewRun(ask=1, entry="net"), asked)
    assert looked.wait(60.0)
    desk.done()
    desk.done("no camera is connected")
    assert desk.take() is None
    desk.done()
    assert asked.replies == []
    go_on.set()
    wait_until(lambda: bool(asked.replies))
    assert asked.replies == ["nobody knows it"]


def test_a_look_that_goes_wrong_stands_in_nobodys_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever asked is told, and the next order is taken; the log has what went wrong."""
    logged: list[str] = []
    monkeypatch.setattr(threading, "excepthook", lambda thrown: logged.append(str(thrown.exc_value)))

    def check(entry: str | None) -> None:
        if entry == "bad":
            raise OSError("the driver is confused")

    desk, first, second = orders(check), Asked(), Asked()
    desk(NewRun(ask=1, entry="bad"), first)
    wait_until(lambda: bool(first.replies))
    (reason,) = first.replies
    assert reason is not None
    assert "log" in reason
    wait_until(lambda: logged == ["the driver is confused"])
    desk(NewRun(ask=2, entry="good"), second)
    assert taken(desk) == Wish(aim=False, entry="good")
    desk.done()
    assert second.replies == DONE


class Clock:
    """Turned by hand."""

    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def test_a_notice_is_seen_for_as_long_as_asked() -> None:
    """On the board at once, though no frame comes, then with every picture, and no longer; a new one replaces it."""
    clock, panel = Clock(), Panel()
    notices = Notices(clock)
    board = BoardSink([panel], ServiceNotifier(), None, notices=notices)
    desk, asked = Orders(notices, lambda entry: None), Asked()
    desk(ShowText(ask=1, text="code 4711", for_s=5.0), asked)
    assert asked.replies == DONE
    assert [state.notice for state in panel.shown] == ["code 4711"]
    clock.now_s += 4.9
    board.show()
    notices.show("code 0815", 1.0)
    clock.now_s += 1.0
    board.show()
    assert [state.notice for state in panel.shown] == ["code 4711", "code 4711", "code 0815", None]


@pytest.mark.parametrize(
    ("text", "for_s", "seen"),
    [
        ("two\nlines\x1b[31m", 1.0, "two lines [31m"),
        ("x" * 1000, 1.0, "x" * LONGEST_TEXT),
        ("code", 0.0, None),
        ("code", -1.0, None),
        (" \n ", 1.0, None),
        ("code", 1e300, "code"),
    ],
    ids=["no control reaches a terminal", "cut", "no time", "less than none", "nothing", "for ever"],
)
def test_a_notice_is_one_printable_line(text: str, for_s: float, seen: str | None) -> None:
    """Whatever a client asks for; never for more than an hour."""
    clock = Clock()
    notices = Notices(clock)
    notices.show(text, for_s)
    assert notices.text == seen
    clock.now_s += LONGEST_S
    assert notices.text is None
