"""The design system's colours: contrast of every pair that is used, both themes, and what the page about it says."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
STATIC = ROOT / "dnb_edge" / "web" / "static"
PAGE = ROOT / "docs" / "design-system.md"

TEXT = 4.5
LARGE = 3.0
"""WCAG 2.2 AA: text, and large text or the edges of controls."""

PAIRS = [
    *[(ink, ground, TEXT) for ink in ("ink", "ink-soft", "accent") for ground in ("ground", "surface", "sunken")],
    *[(name, ground, TEXT) for name in ("good", "warn", "bad", "best") for ground in ("ground", "surface")],
    *[(name, f"{name}-tint", TEXT) for name in ("accent", "good", "warn", "bad", "best")],
    *[(ink, f"{tint}-tint", TEXT) for ink in ("ink", "ink-soft") for tint in ("accent", "good", "warn", "bad", "best")],
    ("on-accent", "accent", TEXT),
    ("on-bad", "bad", TEXT),
    ("ground", "ink", TEXT),
    *[("edge", ground, LARGE) for ground in ("ground", "surface", "sunken")],
    *[(name, "asphalt", LARGE) for name in ("ink", "accent", "best")],
]
"""Text and what lies behind it, as the style sheet puts them together."""


def blocks(text):
    """The three blocks of tokens: light, dark by the system, dark by choice."""
    found = re.findall(r"(:root[^{,]*)\{([^{}]*--ground:[^{}]*--best:[^{}]*)\}", text)
    return [dict(re.findall(r"--([a-z-]+):\s*(#[0-9a-f]{6})\b", body)) for _, body in found]


def luminance(colour):
    """Relative luminance, https://www.w3.org/TR/WCAG22/#dfn-relative-luminance."""
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


THEMES = blocks((STATIC / "base.css").read_text())


def test_contrast_is_the_standards():
    """Black on white is 21, and a known grey 4.48: the figures below are of the right kind."""
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.478, abs=0.001)


def test_both_ways_to_dark_are_the_same():
    """Dark by the system and dark by choice do not drift apart, and each theme has every colour."""
    light, by_system, by_choice = THEMES
    assert by_system == by_choice
    assert set(light) == set(by_system)


@pytest.mark.parametrize(("text", "ground", "least"), PAIRS)
def test_every_pair_can_be_read(text, ground, least):
    """Each text on each ground that it stands on has the contrast of WCAG AA, light and dark."""
    for theme in THEMES[:2]:
        assert contrast(theme[text], theme[ground]) >= least


def test_the_page_tells_these_figures():
    """The table in docs/design-system.md is what is computed here."""
    rows = "\n".join(
        f"| `{text}` | `{ground}` | {contrast(THEMES[0][text], THEMES[0][ground]):.1f} | "
        f"{contrast(THEMES[1][text], THEMES[1][ground]):.1f} | {least:g} |"
        for text, ground, least in PAIRS
    )
    assert rows in PAGE.read_text(), f"docs/design-system.md should say:\n{rows}"


@pytest.mark.parametrize("sheet", sorted(STATIC.glob("*.css")), ids=lambda sheet: sheet.name)
def test_no_colour_outside_the_tokens(sheet):
    """Every style sheet takes its colours from the tokens, so that both themes and paper are right."""
    without_tokens = re.sub(r"--[a-z-]+:\s*[^;]+;", "", sheet.read_text())
    assert not re.findall(r":[^;{}]*#[0-9a-fA-F]{3,8}\b[^{}]*?;", without_tokens)
