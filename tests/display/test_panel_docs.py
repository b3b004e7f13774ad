"""The display's page shows what the panels draw now, and names them all."""

import importlib.util
from pathlib import Path

import pytest

from dnb_edge.display.panel import face

DOCS = Path(__file__).parents[2] / "docs"
_spec = importlib.util.spec_from_file_location("display_pictures", DOCS / "tools" / "display_pictures.py")
display_pictures = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(display_pictures)


@pytest.mark.parametrize("name", display_pictures.PICTURES)
def test_the_pages_pictures_are_the_panels(name):
    """Each is, byte for byte, what docs/tools/display_pictures.py draws with the panels' code."""
    assert (display_pictures.FOLDER / name).read_text(encoding="utf-8") == display_pictures.PICTURES[name]()


def test_the_page_names_every_panel():
    """In its table of layouts."""
    page = (DOCS / "display.md").read_text(encoding="utf-8")
    assert all(f"| `{layout}` |" in page for layout in face.LAYOUTS)
