"""Pictures and pages of the documentation: each is there, and each is led to."""

import re
from pathlib import Path

import pytest
from site_navigation import INDEX, parts, with_navigation

REPOSITORY = Path(__file__).resolve().parents[2]
PICTURES = sorted(
    path.relative_to(REPOSITORY)
    for path in (REPOSITORY / "docs" / "pictures").rglob("*")
    if path.suffix in {".png", ".jpg", ".svg", ".webp", ".gif"}
)
PAGES = sorted(
    [
        *(REPOSITORY / "docs").glob("*.md"),
        *(REPOSITORY / "docs" / "adr").glob("*.md"),
        *(REPOSITORY / "hardware").rglob("*.md"),
        *(REPOSITORY / "systemd").glob("*.md"),
        REPOSITORY / "tests" / "system" / "README.md",
        *(REPOSITORY / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")),
    ]
)


def shown() -> dict[Path, Path]:
    """Each picture that a page shows or leads to, from the repository's root, with one page that does."""
    found = {}
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for target in re.findall(r"\]\(([^)#\s]+)|\bsrc=\"([^\"]+)\"|\bsrcset=\"([^\"]+)\"", text):
            path = (page.parent / next(filter(None, target))).resolve()
            if path.suffix in {".png", ".jpg", ".svg", ".webp", ".gif"} and path.is_relative_to(REPOSITORY):
                found[path.relative_to(REPOSITORY)] = page
    return found


@pytest.mark.parametrize("picture", PICTURES, ids=str)
def test_no_picture_is_left_over(picture: Path) -> None:
    """A picture that no page shows any more goes with what showed it."""
    assert picture in shown()


def test_every_picture_that_is_shown_is_there() -> None:
    """A page whose picture was renamed or never committed is named."""
    missing = {str(picture): str(page) for picture, page in shown().items() if not (REPOSITORY / picture).is_file()}
    assert not missing


def test_every_page_stands_once_in_the_index() -> None:
    """No page is left out of docs/index.md or named twice; a decision stands in the list of decisions instead."""
    index = REPOSITORY / f"{INDEX}.md"
    named = [
        (index.parent / f"{name}.md").resolve()
        for part in parts(index.read_text(encoding="utf-8"))
        for name in part.pages
    ]
    decisions = REPOSITORY / "docs" / "adr"
    wanted = [page for page in PAGES if page != index and (page.parent != decisions or page.name == "README.md")]
    assert sorted(named) == wanted


def test_every_decision_stands_in_their_list_in_its_order() -> None:
    """A record that was written and not listed is found here; the list has its number, and so has its heading."""
    decisions = REPOSITORY / "docs" / "adr"
    listed = re.findall(
        r"^- \[([^\]]*)\]\(([\w-]+\.md)\)", (decisions / "README.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    files = [path.name for path in sorted(decisions.glob("0*.md"))]
    assert [file for _, file in listed] == files
    for title, file in listed:
        assert title.split(".")[0] == str(int(file[:4]))
        assert (decisions / file).read_text(encoding="utf-8").startswith(f"# {int(file[:4])}. ")


def test_an_index_becomes_a_table_that_sphinx_understands() -> None:
    """Sections with their pages, under the names that the list gives them; other text stays as it is."""
    text = "# Title\n\n## Start\n\n- [One](one.md): first\n- [Two](../two.md)\n\n## Empty\n\nWords.\n"
    made = with_navigation(INDEX, text)
    assert made.startswith(text)
    assert made.endswith("```{toctree}\n:hidden:\n:caption: Start\n\nOne <one>\nTwo <../two>\n```\n")
    assert with_navigation("docs/board", text) == text
