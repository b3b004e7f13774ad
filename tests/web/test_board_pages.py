"""The board, the projector's page and the overlay in a browser: what they show of a race, of faults and of broken lines."""

import re
from dataclasses import replace
from types import SimpleNamespace

import pytest
from board_page import DOWN, Stream, hello, site, state, told
from board_races import made, one_car, two_cars

from dnb_edge.values import Observation, PassStatus, RacePhase, Target

SCENERY = {
    "centreline_m": [[2.0 + x, 2.0 + y] for x, y in ((1, 0), (0.7, 0.7), (0, 1), (-0.7, 0.7), (-1, 0), (0, -1))],
    "closed": True,
    "lane_width_m": 0.3,
    "lines": [{"name": "start", "start_m": [3.2, 2.0], "end_m": [2.8, 2.0]}],
    "length_m": 6.28,
    "camera_from_track": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "frame_px": [1280, 720],
}


@pytest.fixture(scope="module")
def browser():
    with site() as pages:
        yield pages


@pytest.fixture
def pages(browser):
    yield browser
    browser.close_all()
    assert browser.faults == [], "errors of scripts, breaches of the policy or outside requests"


@pytest.fixture
def stream():
    return Stream()


def opened(pages, stream, path="/", events=(), of=None, **how):
    """A page that has been told `events`."""
    events = [one for one in events if not _too_many(one)]
    stream.greeting = [hello(), of or state(scenery=SCENERY), *told(events)]
    page = pages.page(stream, **how)
    page.goto(path)
    page.locator("[data-show=line]:has-text('live')").wait_for(state="attached")
    return page


def _too_many(event):
    """Of where the cars are five a second will do here: each message takes the test its time."""
    return isinstance(event, Observation) or (isinstance(event, Target) and round(event.t_s * 30) % 6 > 0)


def text(page, name):
    """What a place shows, without the spaces of the template."""
    return re.sub(r"\s+", " ", page.locator(f"[data-show={name}]").inner_text()).strip()


def shows(page, name, expected):
    """Waits until a place holds `expected`."""
    page.locator(f"[data-show={name}]", has_text=expected).first.wait_for()


def mid_lap():
    """One car in its third lap, everything told, and what a late-comer is told of it."""
    every = one_car()
    cut = next(at for at, event in enumerate(every) if getattr(event, "t_s", 0.0) >= 10.0)
    kept = [one for one in every[:cut] if type(one).__name__ not in {"Observation", "Target", "Running"}]
    return every[:cut], kept


def test_a_reload_in_mid_lap_shows_the_same_laps(pages, stream):
    """Whoever comes late, or reloads, sees the same laps, best, last and lap number as who watched from the beginning."""
    every, kept = mid_lap()
    page = opened(pages, stream, events=every)
    names = ("state", "last", "best", "laps")
    shows(page, "state", "Lap 3")
    before = [text(page, name) for name in names]
    stream.greeting = [hello(following=len(every)), state(scenery=SCENERY), *told(kept)]
    page.reload()
    shows(page, "state", "Lap 3")
    assert [text(page, name) for name in names] == before
    assert page.locator("[data-show=laps] tr").count() == 2


def test_the_clock_runs_between_events(pages, stream):
    """The running lap ticks by itself from the last event on, and stands once nothing has come for a while."""
    every, _ = mid_lap()
    page = opened(pages, stream, events=every)
    shows(page, "state", "Lap 3")
    read = "() => Number(document.querySelector('[data-show=clock]').textContent)"
    first = page.evaluate(read)
    page.wait_for_function(f"(first) => ({read})() > first + 0.3", arg=first)
    page.wait_for_function(
        f"() => new Promise((done) => {{ const a = ({read})(); setTimeout(() => done(a === ({read})()), 200); }})"
    )
    assert first < page.evaluate(read) < first + 3.0


def test_a_daemon_that_is_down_is_said_in_words_and_comes_back(pages, stream):
    """The page says that the timing is not running and what that means, keeps the laps, and goes on by itself."""
    every, _ = mid_lap()
    page = opened(pages, stream, events=every)
    stream.send(DOWN)
    shows(page, "notices", "The timing is not running")
    assert "goes on by itself" in text(page, "notices")
    assert text(page, "line") == "not running"
    assert page.locator("[data-show=laps] tr").count() == 2
    stream.send(hello("e2"), state(run="run-2"))
    shows(page, "line", "live")
    shows(page, "state", "Waiting for the car")
    assert text(page, "notices") == ""
    assert page.locator("[data-show=laps] tr").count() == 0


def test_a_broken_line_says_that_figures_are_old(pages, stream):
    """While the page tries again it says so; nothing that was shown goes away, and it mends by itself."""
    every, _ = mid_lap()
    page = opened(pages, stream, events=every)
    stream.greeting = [hello(resumed=True), state(scenery=SCENERY), *told([made.lap(3, 9.0, 4.0)], first=len(every))]
    stream.drop()
    shows(page, "notices", "No line to the box")
    page.locator("[data-show=laps] tr").nth(2).wait_for()
    assert text(page, "notices") == ""


def test_another_run_begins_with_an_empty_board(pages, stream):
    """When the daemon begins another run the old laps go, and late events of the old one change nothing."""
    every, _ = mid_lap()
    page = opened(pages, stream, events=every)
    first = len(every) + 5
    stream.send(state(run="run-2", first_sequence=first), *told([made.lap(9, 0.0, 5.0)], first=len(every)))
    stream.send(*told([made.crossing(2.0, status=PassStatus.START, lap=1)], first=first))
    shows(page, "state", "Lap 1")
    assert page.locator("[data-show=laps] tr").count() == 0


def test_laps_tell_what_counts_against_them(pages, stream):
    """The table has time, sigma and score of each lap, and in words why it does not count or counts more."""
    penalty = made.values.Penalty(offence="off_track", seconds=2.0, reason="it left the lane for 0.8 s", incident=1)
    events = [
        made.crossing(1.0, status=PassStatus.START, lap=1),
        made.lap(1, 1.0, 10.0, valid=False, reasons=("a line was missed",)),
        made.lap(2, 11.0, 9.5, penalties=(penalty,), penalty_s=2.0, official_time_s=11.5),
        made.lap(3, 20.5, 10.25, suspect=("the camera moved by 12 mm",)),
    ]
    page = opened(pages, stream, events=events)
    shows(page, "state", "Lap 4")
    laps = text(page, "laps")
    for words in (
        "Not valid: a line was missed",
        "Official time 11.500 s",
        "+2.0 s: it left the lane",
        "Suspect: the camera moved by 12 mm",
        "10.250 ± 2 ms 95.8 %",
    ):
        assert words in laps
    assert page.locator("[data-show=laps] tr.is-bad th").all_inner_texts() == ["3", "1"]
    assert text(page, "best").startswith("Best lap 10.250")


def test_sectors_are_told_as_they_are_driven(pages, stream):
    """A sector of the running lap is shown with its difference to the best lap's before the lap has ended."""
    every, _ = mid_lap()
    page = opened(pages, stream, events=every)
    page.locator(".sector").nth(2).wait_for()
    assert page.locator(".sector").count() == 3
    assert re.fullmatch(r"S1 \d\.\d{3} [+−]\d\.\d\d", re.sub(r"\s+", " ", page.locator(".sector").first.inner_text()))
    assert "is-to-come" in page.locator(".sector").last.get_attribute("class")


def test_several_cars_have_standings_and_the_leader_in_front(pages, stream):
    """With several cars the places are shown, and whose figures stand in front."""
    page = opened(pages, stream, events=two_cars())
    assert page.locator("[data-show=places] tr").count() == 2
    shows(page, "state", "Car 1, lap")
    single = opened(pages, Stream(), events=mid_lap()[0])
    assert single.locator(".board__places").is_hidden()


def test_a_countdown_is_shown(pages, stream):
    """Before the start the seconds to it stand in the largest figures."""
    page = opened(pages, stream, events=[made.race_state(1.0, RacePhase.COUNTDOWN, countdown_s=3.0)])
    shows(page, "state", "Countdown, 3 s")
    assert text(page, "clock") == "3"


@pytest.mark.parametrize(
    ("of", "words"),
    [
        (state("fault", reason="no camera is there: plug one in"), "No camera is there: plug one in."),
        (state("setup"), "The camera gives pictures and no race is on."),
        (state("starting"), "The camera is being opened."),
    ],
)
def test_what_is_no_race_is_said(pages, stream, of, words):
    """Out of a race the page says what the daemon does, and why."""
    stream.greeting = [hello(), of]
    page = pages.page(stream)
    page.goto("/")
    shows(page, "notices", words)
    assert text(page, "state") != "Waiting for the car"


def test_a_box_that_knows_no_track_leads_to_the_set_up(pages, stream):
    """With a link, where somebody can press one: not on a wall."""
    stream.greeting = [hello(), state("setup", reason="no track is set up yet")]
    page = pages.page(stream)
    page.goto("/")
    shows(page, "notices", "No track is set up yet.")
    assert page.locator("[data-show=notices] a[href='/setup']").count() == 1
    page.goto("/projector")
    shows(page, "state", "Being set up")
    assert page.locator("[data-show=notices] a").count() == 0


def test_warnings_and_health_are_words(pages, stream):
    """Warnings stand above the race, health below it: lost frames by reason, drift, disk, heat, saved laps."""
    lost = (made.values.LostFrames(reason="queue", frames=5),)
    health = replace(
        made.health(2.0, warnings=("camera moved by 12 mm",), view_moved_m=0.012, saved_laps=3, display="offline"),
        lost=lost,
        dropped_frames=5,
        disk_free_bytes=700_000_000,
        temperature_c=81.0,
        throttled=True,
        latency_p95_ms=44.0,
    )
    page = opened(pages, stream, events=[health])
    shows(page, "notices", "Camera moved by 12 mm.")
    words = text(page, "health")
    for fact in (
        "5: 5 detector too slow",
        "12 mm",
        "0.7 GB",
        "81 °C, slowed down",
        "3 laps saved",
        "offline",
        "95 % within 44 ms",
    ):
        assert fact in words
    assert page.locator("[data-show=notices] .notice--bad").count() == 1


def test_finished_laps_are_announced_and_past_ones_are_not(pages, stream):
    """Screen readers hear a lap once, when it ends; not the running clock and not what had happened before."""
    every, _ = mid_lap()
    stream.greeting = [hello(following=len(every)), state(), *told(every)]
    page = pages.page(stream)
    page.goto("/")
    shows(page, "state", "Lap 3")
    said = page.locator("[data-show=said]")
    assert said.text_content() == ""
    assert said.get_attribute("aria-live") == "polite"
    assert page.locator("[data-show=clock]").get_attribute("aria-live") == "off"
    stream.send(*told([made.lap(3, 8.0, 3.25)], first=len(every)))
    page.locator("[data-show=said]:has-text('lap 3: 3.25 seconds, best lap, score 96 percent')").wait_for(
        state="attached"
    )


SPOKEN = """
globalThis.spoken = [];
globalThis.SpeechSynthesisUtterance = class { constructor(text) { this.text = text; } };
const speech = { speak: (words) => spoken.push(words.text), cancel: () => {} };
Object.defineProperty(globalThis, "speechSynthesis", { value: speech });
"""


def test_speech_and_beeps_are_off_until_switched_on_and_stay_so(pages, stream):
    """Nothing sounds by itself; a switch is remembered over a reload, by keyboard as well."""
    page = opened(pages, stream)
    page.add_init_script(SPOKEN)
    page.reload()
    shows(page, "line", "live")
    stream.send(*told([made.lap(1, 0.0, 9.0)], first=0))
    shows(page, "state", "Lap 2")
    assert page.evaluate("spoken") == []
    switch = page.get_by_role("switch", name="Spoken laps")
    switch.focus()
    page.keyboard.press("Space")
    stream.send(*told([made.lap(2, 9.0, 8.0)], first=1))
    shows(page, "state", "Lap 3")
    assert page.evaluate("spoken") == ["laps are spoken", "lap 2: 8.00 seconds, best lap, score 96 percent"]
    page.reload()
    assert page.get_by_role("switch", name="Spoken laps").is_checked()
    assert not page.get_by_role("switch", name="Beeps").is_checked()


def test_light_and_dark_are_chosen_and_kept(pages, stream):
    """The system's theme holds until somebody chooses, by keyboard as well; the choice survives a reload."""
    page = opened(pages, stream, scheme="dark")
    ground = "() => getComputedStyle(document.body).backgroundColor"
    assert page.evaluate(ground) == "rgb(15, 17, 19)"
    page.get_by_role("button", name="Use light colours").press("Enter")
    assert page.evaluate(ground) == "rgb(245, 244, 239)"
    page.reload()
    assert page.evaluate(ground) == "rgb(245, 244, 239)"


@pytest.mark.parametrize("path", ["/", "/projector", "/overlay"])
def test_nothing_is_wider_than_the_screen(pages, stream, path):
    """No page scrolls sideways, from the smallest phone to a large screen, with several cars and long laps."""
    events = [*two_cars(), made.lap(7, 100.0, 123.456, official_time_s=125.456, penalty_s=2.0)]
    page = opened(pages, stream, path, events, height=640)
    for width in (360, 390, 768, 1280, 1920):
        page.set_viewport_size({"width": width, "height": 640})
        assert page.evaluate("() => document.documentElement.scrollWidth") <= width


SMALLEST = """
() => Math.min(...[...document.querySelectorAll("main *")]
  .filter((one) => one.checkVisibility() && !one.closest(".visually-hidden"))
  .filter((one) => [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim() !== ""))
  .map((one) => parseFloat(getComputedStyle(one).fontSize)))
"""


def test_the_projector_can_be_read_from_ten_metres(pages, stream):
    """The largest figures are at least 18 % of the screen's height, no text is less than 4.8 %, and nothing can be pressed."""
    events = [*two_cars(), made.health(13.0, warnings=("the disk is nearly full",))]
    page = opened(pages, stream, "/projector", events)
    for width, height in ((1920, 1080), (1280, 800), (1024, 768)):
        page.set_viewport_size({"width": width, "height": height})
        size = page.evaluate("() => parseFloat(getComputedStyle(document.querySelector('[data-show=clock]')).fontSize)")
        assert size >= 0.18 * height
        assert page.evaluate(SMALLEST) >= 0.0479 * height
        assert page.locator("a:visible, button:visible, input:visible").count() == 0
        for name in ("clock", "last", "best", "score", "places"):
            box = page.locator(f"[data-show={name}]").bounding_box()
            assert box["y"] >= 0
            assert box["y"] + box["height"] <= height + 1, name


def test_the_overlay_has_nothing_behind_it(pages, stream):
    """Over a stream only the figures' own boxes are painted; the address places and scales them."""
    page = opened(pages, stream, "/overlay?corner=bottom-right&scale=2&map=off", mid_lap()[0])
    grounds = page.evaluate(
        "() => [document.documentElement, document.body].map((one) => getComputedStyle(one).backgroundColor)"
    )
    assert grounds == ["rgba(0, 0, 0, 0)"] * 2
    box = page.locator(".overlay__box").bounding_box()
    assert box["x"] > 300
    assert box["y"] + box["height"] <= 720
    assert page.locator(".map").is_hidden()


def test_another_run_is_begun_by_who_may(pages, stream):
    """Who is logged in may begin another run, with a name or without, by keyboard; who only watches has no button for it."""
    watching = opened(pages, Stream())
    assert watching.get_by_role("button", name="New run").count() == 0
    pages.session = SimpleNamespace(csrf="token")
    page = opened(pages, stream)
    pages.session = None
    for name in ("Anna", None):
        page.get_by_role("button", name="New run").press("Enter")
        page.get_by_label("Who or what drives").fill(name or " ")
        page.keyboard.press("Enter")
        page.locator(".toast", has_text="Another run begins.").first.wait_for()
        page.locator("#new-run").wait_for(state="hidden")
    assert pages.posted == [("/api/v1/race/new", "token", {"entry": name}) for name in ("Anna", None)]


@pytest.mark.parametrize("path", ["/", "/projector", "/overlay"])
def test_axe_finds_nothing_serious(pages, stream, path):
    """Names, roles, order and contrast hold on all three pages, both themes."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed")
    events = [*two_cars(), made.health(13.0, warnings=("the disk is nearly full",))]
    page = opened(pages, stream, path, events, bypass_csp=True)
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        found = axe.Axe().run(page).response["violations"]
        serious = [one for one in found if one["impact"] in {"serious", "critical"}]
        assert [(one["id"], [node["html"] for node in one["nodes"]]) for one in serious] == []
