"""How long after an event the page has painted it. A script, not a test.

    python tests/web/page_latency.py [--seconds 30]

A whole box and a board in a real browser. The event's moment is that at which the appliance printed its JSON line; the page's,
that of the second animation frame after the event reached it, when the first has been painted. Prints JSON, milliseconds.
"""

import argparse
import json
import statistics
import tempfile
import time
from pathlib import Path

from running_box import chromium, opened, running_box, wait_until

LISTEN = """async () => {
    const { follow } = await import('/static/live.js');
    window.painted = [];
    follow({ onHello() {}, onState() {}, onEvent(event) {
        const came = Date.now();
        requestAnimationFrame(() => requestAnimationFrame(() => window.painted.push([event.event, event.t_ns ?? event.end_t_ns, came, Date.now()])));
    } });
}"""  # noqa: E501


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=30.0)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, running_box(Path(folder), more=("--observations",)) as box:
        daemon = box.daemon
        assert daemon is not None
        wait_until(lambda: daemon.events("lap"))
        with chromium() as browser:
            page, _ = opened(browser, viewport={"width": 1280, "height": 720})
            page.goto(box.url)
            page.evaluate(LISTEN)
            time.sleep(asked.seconds)
            painted = page.evaluate("window.painted")
    told = {}
    for at_s, line in daemon.lines:
        event = json.loads(line)
        told.setdefault((event["event"], event.get("t_ns", event.get("end_t_ns"))), at_s)
    came, shown, kinds = [], [], set()
    for kind, t_ns, came_ms, painted_ms in painted:
        if (at_s := told.get((kind, t_ns))) is not None and kind != "target":
            came.append(came_ms - 1e3 * at_s)
            shown.append(painted_ms - 1e3 * at_s)
            kinds.add(kind)
    # What was told before the page was there came late because of that.
    came, shown = zip(*[(a, b) for a, b in zip(came, shown, strict=True) if a < 5000], strict=True)
    print(
        json.dumps({"kinds": sorted(kinds), "events": len(came), "came_ms": spread(came), "painted_ms": spread(shown)})
    )


def spread(values: tuple[float, ...]) -> dict[str, float]:
    """Median, 95th percentile and greatest."""
    cuts = statistics.quantiles(values, n=20)
    return {"p50": round(statistics.median(values), 1), "p95": round(cuts[18], 1), "max": round(max(values), 1)}


if __name__ == "__main__":
    main()
