"""What a panel knows after lines: HELLO forgets, RUN draws, time runs on smoothly, and news are news only once."""

import pytest
from display_events import crossing, health, lap, race
from hypothesis import given
from hypothesis import strategies as st
from panel_cases import BEFORE, CARS, REPAINT, but, line, told, without

from dnb_edge.display import messages, protocol
from dnb_edge.display.panel.scene import COUNT, FRAME_MS, GO, LAP, RUN, SILENT, START, WAIT, Scene
from dnb_edge.display.panel.state import COUNT_ON_MS, CROSS_MS, LAP_MS, SILENT_MS, Panel


def panel_after(*steps):
    return told(Panel(), steps)


def sent(told_messages):
    """What the appliance sends for these messages."""
    return b"".join(protocol.encode_line(message) for message in told_messages)


def test_a_repaint_of_the_appliance_is_known_whole():
    """What the product's own messages tell of a race is what the panel knows of it."""
    state = race(3, laps_wanted=5).after(health(warnings=("dark", "gap"))).noting("set-up code 4711 0815")
    panel = Panel()
    assert panel.feed(sent(messages.repaint(state)), 0)
    shown = panel.shown
    assert [(one.number, one.time_ms) for one in shown.laps] == [
        (one.number, round(1000 * one.time_s)) for one in state.laps
    ]
    assert (shown.word, shown.lap, shown.laps_wanted) == ("LAP", 4, 5)
    assert shown.best == (state.best_lap.number, round(1000 * state.best_lap.time_s))
    assert (shown.warnings, shown.note) == (("dark", "gap"), "set-up code 4711 0815")
    assert panel.dropped == 0


def test_news_and_repaint_say_the_same():
    """A panel that was told step by step knows what one knows that is switched on at the end."""
    state, panel = race(0, laps_wanted=5), Panel()
    panel.feed(sent(messages.repaint(state)), 0)
    for at_ms, later in enumerate((race(1, laps_wanted=5), race(2, laps_wanted=5), race(2).after(health())), start=1):
        panel.feed(sent(messages.news(state, later)), 100 * at_ms)
        state = later
    late = Panel()
    late.feed(sent(messages.repaint(state)), 300)
    assert panel.shown.facts() == late.shown.facts()


def test_nothing_shows_before_run():
    """Half a repaint changes no picture; the line that ends it changes all of it."""
    panel = panel_after((0, REPAINT))
    before = panel.shown.facts()
    assert not panel.feed(b"".join(map(line, BEFORE[:-1])), 100)
    assert panel.shown.facts() == before
    assert panel.feed(line(BEFORE[-1]), 100)
    assert (panel.shown.word, panel.shown.laps, panel.shown.run_ms) == ("WAITING", (), None)


def test_what_a_repaint_leaves_out_is_forgotten():
    """Warnings, the note, the best lap and the cars of a race that is over are gone with the next repaint."""
    panel = panel_after((0, but(CARS, "NOTE code 1", "WARN 1 dark")), (2000, BEFORE))
    fresh = panel_after((2000, BEFORE))
    assert panel.shown.facts() == fresh.shown.facts()


def test_warnings_go_with_the_next_health():
    """They are told anew whenever one changes; `HEALTH` begins the list."""
    warned = panel_after((0, but(REPAINT, "HEALTH FPS 29.9 REC NONE WARNINGS 1", "WARN 1 dark")))
    told(warned, ((100, ("HEALTH FPS 29.9 REC NONE WARNINGS 1", "WARN 1 gap", "RUN 3 4.300")),))
    assert warned.shown.warnings == ("gap",)
    told(warned, ((200, ("HEALTH FPS 29.9 REC NONE WARNINGS 0", "RUN 3 4.400")),))
    assert warned.shown.warnings == ()


def test_penalties_and_reasons_belong_to_their_lap():
    """They follow the line of their lap, which may be told anew."""
    lines = (
        "LAP 3 12.900 +-0.002 OK 90.0",
        "PENALTY 3 2.000 left the lane",
        "SUSPECT 3 moved",
        "WHY 3 late",
        "WHY 3 more",
    )
    panel = panel_after((0, but(REPAINT, "BEST 1 12.483")), (100, (*lines, "RUN 4 1.000")))
    last = panel.shown.last
    assert (last.number, last.official_ms, last.reasons) == (3, 14_900, ("moved", "late"))
    told(panel, ((200, (lines[0], "RUN 4 1.100")),))
    assert (panel.shown.last.official_ms, panel.shown.last.reasons) == (12_900, ())
    assert [one.number for one in panel.shown.laps] == [1, 2, 3] or panel.shown.laps[-1].number == 3


def test_memory_is_bounded():
    """Of a hundred laps, warnings and places only the last, or first, few are kept."""
    bodies = [f"LAP {number} 12.483 +-0.002 OK -" for number in range(1, 100)]
    bodies += [f"WARN {number} dark" for number in range(1, 100)]
    bodies += [f"PLACE {place} {place} 5 12.483 - IN x" for place in range(1, 100)]
    panel = panel_after((0, but(REPAINT, *bodies)))
    assert [one.number for one in panel.shown.laps] == list(range(92, 100))
    assert len(panel.shown.warnings) == 4
    assert [one[0][0] for one in panel.shown.places] == list(range(1, 9))


@given(st.lists(st.integers(0, 80), min_size=5, max_size=40))
def test_the_running_time_never_runs_backwards(delays_ms):
    """Lines that come up to 80 ms late: from frame to frame the time rises, is never ahead, nor later than a late line's."""
    panel, shown_ms = Panel(), -1
    lines = [(1000 + 100 * step + delay_ms, 100 * step) for step, delay_ms in enumerate(delays_ms)]
    for t_ms in range(1000 + delays_ms[0], 1000 + 100 * len(lines), 4):
        while lines and lines[0][0] <= t_ms:
            panel.feed(line(f"RUN 1 {lines.pop(0)[1] / 1000:.3f}"), t_ms)
        if t_ms % FRAME_MS == 0:
            now_ms = panel.running_ms(t_ms)
            assert shown_ms < now_ms
            assert t_ms - 1000 - 84 <= now_ms <= t_ms - 1000
            shown_ms = now_ms


def test_the_running_time_stands_where_the_appliances_stands():
    """Two lines with the same time: nothing is counted on any more; without lines it is for a second and a half."""
    panel = panel_after((0, REPAINT))
    assert panel.running_ms(500) == 4700
    assert panel.running_ms(60_000) == 4200 + COUNT_ON_MS
    told(panel, ((500, ("RUN 3 4.200",)), (1000, ("RUN 3 4.200",))))
    assert panel.running_ms(1400) == 4200
    told(panel, ((1500, ("RUN 3 4.700",)),))
    assert panel.running_ms(1600) == 4800


def test_a_display_whose_clock_runs_fast_keeps_up():
    """One per cent: after a minute the time shown is right within a tenth of a second."""
    panel = Panel()
    for told_ms in range(0, 60_000, 100):
        panel.feed(line(f"RUN 1 {told_ms / 1000:.3f}"), told_ms * 101 // 100)
        assert told_ms <= panel.running_ms(told_ms * 101 // 100) <= told_ms + 100


def test_another_lap_begins_at_its_own_time():
    """Nothing is carried over from the lap before, nor from a time that is far off."""
    short = panel_after((0, but(REPAINT, last="RUN 3 0.150")), (100, ("RUN 4 0.100",)))
    assert short.running_ms(100) == 100
    panel = panel_after((0, REPAINT), (100, ("RUN 4 0.050",)))
    assert panel.running_ms(150) == 100
    told(panel, ((200, ("RUN 4 7.000",)),))
    assert panel.running_ms(210) == 7010


def what(panel, t_ms):
    return Scene(panel, t_ms).what


def test_what_matters_most():
    """Start-up, a repaint without a lap told as news, a new lap for four seconds, the running one, silence."""
    panel = Panel()
    assert what(panel, 10_000) == START
    told(panel, ((10_000, BEFORE),))
    assert what(panel, 10_000) == WAIT
    told(panel, ((10_100, REPAINT),))
    assert what(panel, 10_160) == RUN
    told(panel, ((12_000, ("LAP 3 12.900 +-0.002 OK -", "RUN 4 0.1")), (12_000, ("RUN 4 0.100",))))
    assert what(panel, 12_000) == LAP
    told(panel, ((14_000, ("RUN 4 2.100",)), (12_000 + LAP_MS, ("RUN 4 4.100",))))
    assert what(panel, 12_000 + LAP_MS - FRAME_MS) == LAP
    assert what(panel, 12_000 + LAP_MS) == RUN
    assert what(panel, 12_000 + LAP_MS + SILENT_MS) == SILENT
    assert panel.feed(line("SAVED 2"), 20_000)
    assert what(panel, 20_000) == RUN


def test_a_lap_of_the_race_before_is_not_shown():
    """A new race within four seconds after a lap begins without it; a repaint that lost its `HELLO` makes no lap new."""
    lapped = ((0, REPAINT), (1000, ("LAP 3 12.900 +-0.002 OK -", "RUN 4 0.100")))
    assert what(panel_after(*lapped, (2000, BEFORE)), 2000) == WAIT
    again = panel_after((0, REPAINT), (8000, without(REPAINT, "HELLO")))
    assert what(again, 8000) == RUN


@pytest.mark.parametrize("best", ["BEST 3 12.180", "BEST 1 12.483"])
def test_only_a_better_lap_is_the_best(best):
    """A `BEST` line that says what stood before makes no new lap the best one."""
    panel = panel_after((0, REPAINT), (2000, ("LAP 3 12.180 +-0.002 OK -", best, "RUN 4 0.100")))
    assert Scene(panel, 2000).better == (best == "BEST 3 12.180")


def test_a_crossing_flashes_once_and_outlives_a_repaint():
    """`CROSS` is never repeated: a repaint right after it does not end the flash; a repaint alone makes none."""
    panel = panel_after((0, REPAINT), (1000, ("CROSS 8.250", "RUN 3 5.200")), (1040, REPAINT))
    assert Scene(panel, 1080).crossing
    assert not Scene(panel, 1000 + CROSS_MS).crossing
    assert not Scene(panel_after((0, REPAINT)), 40).crossing


def test_green_is_shown_on_the_first_go_after_a_count():
    """A panel that is switched on during the race shows no green; one that saw the countdown does, for two seconds."""
    counted = panel_after((0, but(BEFORE, "COUNT 1.0")))
    assert [Scene(counted, t_ms).count for t_ms in (0, 120, 1000, 2000)] == ["1", "1", "0", "0"]
    assert what(counted, 0) == COUNT
    told(counted, ((1000, ("GO 300.0", "RUN - -")),))
    assert what(counted, 1000) == GO
    told(counted, ((3000, ("RUN - -",)),))
    assert what(counted, 3000) == WAIT
    assert what(panel_after((0, but(BEFORE, "GO 300.0"))), 0) == WAIT


@pytest.mark.parametrize(
    ("fps", "warnings", "lost"),
    [("-", ("gone",), True), ("0.0", ("gone",), True), ("29.9", ("dark",), False), ("-", (), False)],
)
def test_the_camera_is_lost_where_no_frames_come_and_somebody_says_why(fps, warnings, lost):
    """A rate of none or nought, and a warning."""
    warned = [f"WARN {number} {text}" for number, text in enumerate(warnings, start=1)]
    panel = panel_after((0, but(REPAINT, f"HEALTH FPS {fps} REC NONE WARNINGS {len(warned)}", *warned)))
    assert panel.shown.camera_lost == lost


def test_typed_lines_are_taken_where_that_is_asked_for():
    """Without a checksum, as the specification allows for trying a display out."""
    by_hand, strict = Panel(strict=False), Panel()
    for panel in (by_hand, strict):
        panel.feed(b"HELLO DNB-EDGE 1\nRUN 3 4.200\n", 0)
    assert by_hand.running_ms(0) == 4200
    assert strict.heard_at is None
    assert strict.dropped == 2


def test_the_crossing_and_lap_of_the_appliance_are_news():
    """The product's own words for a crossing and a lap make the panel flash and show the lap."""
    panel = Panel()
    panel.feed(sent(messages.repaint(race(1))), 0)
    panel.feed(sent(messages.news(race(1), race(1).after(crossing(22.0)).after(lap(2)))), 500)
    assert panel.crossed_at == 500
    assert panel.lapped == (2, 500)
    assert without(REPAINT, "RUN")[-1] != REPAINT[-1]
