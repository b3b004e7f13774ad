"""docs/bom.md: what to buy, what matters in it, and what it comes to.

Knows hardware/bom.csv, and Markdown. Knows no price by itself.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

from page_text import cell, made_by, paragraphs

PAGE = "docs/bom.md"
CSV = Path(__file__).resolve().parents[2] / "hardware" / "bom.csv"

DISPLAYS = {
    "max7219": "LED matrix 32x8 on a Pico: the usual one",
    "digits": "seven-segment digits on a Pico",
    "oled": "small OLED on a Pico",
    "hub75": "HUB75 panel 64x32 on a Pico, for a hall",
    "spi": "LED matrix 32x8 on the Pi's own pins, no Pico",
}
"""The variants of the display: the words of the CSV's column `display`."""
USUAL_DISPLAY = "max7219"

_ABOUT = """
Two lists and a display. The **minimal** one times laps at a table this week. The **complete** one is what we would hang up for
good. Everything is sold in many shops under many names, so the third column says what matters, and the fourth what else does.
The printed parts are on the pages [assembly](assembly.md) and [printing](printing.md), the markers and the track that a paper
printer makes on [printables](printables.md).
"""

_CAMERAS = """
## Which camera

| | frames a second | shutter | focus | about it |
|---|---|---|---|---|
| 720p webcam | 30 | rolling | fixed | enough to learn on; sees 50 degrees, so it hangs far off |
| USB board, M12 lens | 60 | rolling | fixed, by hand | the one to hang up; its lens by [where it must hang](mount.md) |
| 1080p webcam (C920) | 30 | rolling | automatic: switch it off | finer, no faster |
| Camera Module 3 | 56 | rolling | automatic: switch it off | no USB; the box is at most half a metre away |
| global shutter | 60 and more | global | fixed | for sectors of fast cars; lap times hardly gain |
"""

_MATTERS = (
    """**Field of view**: too wide wastes pixels and bends lines, too narrow needs height. 60 to 90 degrees across suit most
    rooms. Calibrate the lens above 80.""",
    """**Fixed focus**, or one that can be fixed: a lens that hunts moves the picture, and so the calibration.""",
    """**Rolling or global**: a rolling shutter reads its rows one after the other. A lap begins and ends at the same row, so it
    drops out of lap times; sectors at different rows are off by some milliseconds ([`capture.row_us`](config.md) takes most of
    it out).""",
    """**MJPEG rate**: 1280x720 at 30 frames a second does not fit through USB 2 raw. Look at `v4l2-ctl --list-formats-ext`
    before you buy ten.""",
    """**Exposure** that can be set by hand, down to 2 ms: [why](cameras.md#manual-exposure-in-three-steps).""",
)

_NOT_IN = """
The car and what it is driven by, the track (print one, or lay tape), a network, tools: a screwdriver, pliers, a knife and a
tape measure; a soldering iron only where the Pico comes without pins.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One row of the list."""

    name: str
    group: str
    part: str
    price: Decimal
    """Of one, in `currency`."""
    currency: str
    priced_on: str
    minimal: int
    """How many the minimal list has."""
    complete: int
    display: tuple[str, ...]
    """The variants of the display that need one."""
    matters: str
    substitutes: str


def items(path: Path = CSV) -> tuple[Item, ...]:
    """The list as the CSV has it."""
    with path.open(encoding="utf-8", newline="") as file:
        return tuple(
            Item(
                name=row["id"],
                group=row["group"],
                part=row["part"],
                price=Decimal(row["price"]),
                currency=row["currency"],
                priced_on=row["priced_on"],
                minimal=int(row["minimal"]),
                complete=int(row["complete"]),
                display=tuple(row["display"].split()),
                matters=row["matters"],
                substitutes=row["substitutes"],
            )
            for row in csv.DictReader(file)
        )


def minimal_beyond_board(rows: Iterable[Item]) -> Decimal:
    """What the minimal list costs beside the board."""
    return sum((row.price * row.minimal for row in rows if row.group != "board"), Decimal(0))


def minimal(rows: Iterable[Item]) -> Decimal:
    """What the minimal list costs, its board included."""
    return sum((row.price * row.minimal for row in rows), Decimal(0))


def display(rows: Iterable[Item], variant: str) -> Decimal:
    """What one variant of the display costs."""
    return sum((row.price for row in rows if variant in row.display), Decimal(0))


def complete(rows: Iterable[Item], variant: str = USUAL_DISPLAY) -> Decimal:
    """What the complete list costs, with its board and one display."""
    rows = tuple(rows)
    return sum((row.price * row.complete for row in rows), display(rows, variant))


def page() -> str:
    """The whole page, Markdown."""
    rows = items()
    day, currency = max(row.priced_on for row in rows), rows[0].currency
    said = (
        f"**Prices are estimates**, made on {day}, in {currency}: about what one piece costs in web shops, without tax and "
        "postage. No shop was asked, and nobody promises them. Memory, and with it the boards, moves most: look it up first."
    )
    sections = [
        ("Minimal", [row for row in rows if row.minimal], "minimal"),
        ("Complete, without display", [row for row in rows if row.complete], "complete"),
        ("Instead", [row for row in rows if row.group.endswith("instead")], None),
    ]
    lines = ["# What to buy", "", made_by(__file__), "", paragraphs(_ABOUT), "", said, "", *_totals(rows, currency)]
    for title, some, quantity in sections:
        lines += ["", f"## {title}", "", *_table(some, quantity, currency)]
    lines += ["", "## Displays", "", *_displays(rows, currency), "", _CAMERAS.strip(), ""]
    lines += [f"- {paragraphs(one)}" for one in _MATTERS]
    lines += ["", "## What is not in the list", "", paragraphs(_NOT_IN)]
    lines += ["", "The list as data: [hardware/bom.csv](../hardware/bom.csv)."]
    return "\n".join(lines) + "\n"


def _totals(rows: tuple[Item, ...], currency: str) -> list[str]:
    lines = [
        f"| list | {currency} |",
        "|---|---|",
        f"| minimal, beyond the board | {minimal_beyond_board(rows)} |",
        f"| minimal, with a Raspberry Pi 4 | {minimal(rows)} |",
    ]
    return lines + [f"| complete, with {cell(title)} | {complete(rows, name)} |" for name, title in DISPLAYS.items()]


def _table(rows: Iterable[Item], quantity: str | None, currency: str) -> list[str]:
    lines = [f"| part | {currency} | what matters | what else does |", "|---|---|---|---|"]
    for row in rows:
        count = 1 if quantity is None else int(getattr(row, quantity))
        times = f"{count} x " if count > 1 else ""
        lines.append(
            f"| {times}{cell(row.part)} | {row.price * count} | {cell(row.matters)} | {cell(row.substitutes)} |"
        )
    return lines


def _displays(rows: tuple[Item, ...], currency: str) -> list[str]:
    marks = " | ".join(DISPLAYS)
    lines = [f"| part | {currency} | {marks} | what matters |", f"|---|---|{'---|' * len(DISPLAYS)}---|"]
    for row in (row for row in rows if row.display):
        needed = " | ".join("1" if name in row.display else "" for name in DISPLAYS)
        lines.append(f"| {cell(row.part)} | {row.price} | {needed} | {cell(row.matters)} |")
    sums = " | ".join(str(display(rows, name)) for name in DISPLAYS)
    lines += [f"| **together, {currency}** | | {sums} | |", ""]
    return [*lines, *(f"- `{name}`: {title}" for name, title in DISPLAYS.items()), "", _WIRED]


_WIRED = "How they look and what they show: [the display](display.md). How they are wired: [wiring](wiring.md)."
