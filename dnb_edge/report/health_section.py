"""How the appliance did, on a run's page: figures of the whole run, warnings with their times, interruptions.

Knows a `HealthHistory`; everything is escaped by `report.markup`. Knows no picture.
"""

from __future__ import annotations

from dnb_edge.report.health import HealthHistory, Warned
from dnb_edge.report.markup import NONE, number, plain_table, text


def health_section(health: HealthHistory | None, figure: str) -> str:
    """The section with its picture, which is HTML already; empty where nobody told how the appliance did."""
    if health is None:
        return ""
    parts = [_facts(health), figure, _interruptions(health), _warnings(health)]
    return "<section>\n<h2>Health</h2>\n" + "\n".join(filter(None, parts)) + "\n</section>"


def clock(t_s: float) -> str:
    """`t_s` as `h:mm:ss`, or with tenths within the first hour."""
    tenths = round(t_s * 10)
    minutes, rest = divmod(tenths, 600)
    if minutes < 60:
        return f"{minutes}:{rest // 10:02d}.{rest % 10}"
    whole_s = round(t_s)
    return f"{whole_s // 3600}:{whole_s // 60 % 60:02d}:{whole_s % 60:02d}"


def _facts(health: HealthHistory) -> str:
    lost = health.lost
    raced, gone = health.frames, sum(lost.values())
    reasons = "" if not lost else ": " + ", ".join(f"{count} {reason}" for reason, count in lost.items())
    facts = [
        ("Lasted", clock(health.end_s)),
        ("Frames raced", str(raced)),
        ("Frames lost", f"{gone} ({100 * gone / max(1, raced + gone):.2f} %){reasons}"),
    ]
    slots = health.slots
    if health.latency_p99_ms is not None:
        p95, p99 = number(health.latency_p95_ms, "{:.1f} ms"), f"{health.latency_p99_ms:.1f} ms"
        facts.append(("Latency from picture to events", f"p95 {p95}, p99 {p99}"))
    temperatures = [slot.temperature_c for slot in slots if slot.temperature_c is not None]
    if temperatures:
        facts.append(("Processor", f"{max(temperatures):.1f} \N{DEGREE SIGN}C at most"))
    throttled_s = health.slot_s * sum(slot.throttled for slot in slots)
    if throttled_s:
        facts.append(("Throttled", f"at times, in all less than {clock(throttled_s)}"))
    room = [slot.disk_free_bytes for slot in slots if slot.disk_free_bytes is not None]
    if room:
        facts.append(("Room on the disk", f"{min(room) / 1e9:.2f} GB at least"))
    memory = [slot.memory_bytes for slot in slots if slot.memory_bytes is not None]
    if memory:
        facts.append(("Memory", f"{max(memory) / 1e6:.0f} MB at most"))
    count = len(health.interruptions) + health.more_interruptions
    if count:
        facts.append(("Interrupted", f"{count} times, {clock(health.interrupted_s)} in all"))
    return "<dl>\n" + "".join(f"<dt>{text(name)}</dt><dd>{text(fact)}</dd>\n" for name, fact in facts) + "</dl>"


def _interruptions(health: HealthHistory) -> str:
    if not health.interruptions:
        return ""
    rows = [(clock(one.start_s), clock(one.end_s), f"{one.lasted_s:.2f}") for one in health.interruptions]
    more = f"; {health.more_interruptions} shorter ones are left out" if health.more_interruptions else ""
    return plain_table(f"Times in which no frame came{more}", ("From", "To", "Lasted (s)"), rows)


def _warnings(health: HealthHistory) -> str:
    if not health.warnings:
        return "<p>No warning was told.</p>"
    rows = [_warning(one) for one in health.warnings]
    more = f"; {health.more_warnings} other ones are left out" if health.more_warnings else ""
    return plain_table(
        f"Warnings, by the time since the first frame{more}", ("Warning", "First", "Last", "Spells", "Times told"), rows
    )


def _warning(one: Warned) -> tuple[str, ...]:
    words = one.text if one.last_text == one.text else f"{one.text} (at last: {one.last_text})"
    return words, clock(one.first_s), clock(one.last_s) if one.told > 1 else NONE, str(one.spells), str(one.told)
