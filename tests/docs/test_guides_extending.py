"""The examples of docs/extending.md work: put into a copy of the package as the page says, they pass the contract tests."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from dnb_edge.config.rules import load_rule_set

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
COPIED = ("dnb_edge", "tests/capture", "tests/detect", "tests/display", "tests/race", "tests/config", "configs")


def blocks(language: str) -> list[str]:
    """The page's code blocks in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def changed(text: str, hunk: str) -> str:
    """`text` with one hunk done: its lines with a space or a minus must stand there, together, exactly once."""
    lines = [line or " " for line in hunk.strip("\n").split("\n")]
    before = "\n".join(line[1:] for line in lines if line[0] in " -")
    after = "\n".join(line[1:] for line in lines if line[0] in " +")
    assert text.count(before) == 1, f"stands {text.count(before)} times in the file:\n{before}"
    return text.replace(before, after)


@pytest.fixture(scope="module")
def extended(tmp_path_factory) -> Iterator[Path]:
    """A copy of the package and its tests with all that the page says done to it."""
    root = tmp_path_factory.mktemp("extended")
    unwanted = shutil.ignore_patterns("__pycache__", "*.pyc")
    for name in COPIED:
        shutil.copytree(ROOT / name, root / name, ignore=unwanted)
    (root / "docs").mkdir()
    for name in ("pyproject.toml", "docs/rules.md", "tests/conftest.py"):
        shutil.copy(ROOT / name, root / name)
    for block in blocks("python"):
        path = re.match(r"# (\S+\.py)\n", block)
        assert path is not None, block.split("\n")[0]
        assert not (root / path[1]).exists(), path[1]
        (root / path[1]).write_text(block.split("\n", 1)[1], encoding="utf-8")
    for block in blocks("diff"):
        head, *hunks = re.split(r"^@@\n", block, flags=re.MULTILINE)
        paths = list(root.glob(head.removeprefix("--- ").strip()))
        assert paths, head
        for path in paths:
            text = path.read_text(encoding="utf-8")
            for hunk in hunks:
                text = changed(text, hunk)
            path.write_text(text, encoding="utf-8")
    yield root
    shutil.rmtree(root)


def run(root: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Python with the copy in place of the package."""
    env = os.environ | {"PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"}
    return subprocess.run([sys.executable, *words], cwd=root, env=env, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("words", "least"),
    [
        (("tests/capture/test_source_contract.py", "-k", "photos_case"), 5),
        (("tests/detect/test_detector_contract.py", "-k", "colourful"), 9),
        (("tests/display/test_display_contract.py", "-k", "TextFile"), 5),
        (("tests/race/test_speeding.py", "tests/race/test_incidents.py", "tests/config/test_rules_config.py"), 50),
    ],
    ids=["source", "detector", "display", "rule"],
)
def test_the_example_passes_the_contract(extended, words, least):
    """What the page adds passes the tests that all of its kind pass, and rows of its own are among them."""
    done = run(extended, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", *words)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    passed = re.search(r"(\d+) passed", done.stdout)
    assert passed is not None
    assert int(passed[1]) >= least


def test_the_copy_is_what_was_tried(extended):
    """The subprocesses import the copy and not the installed package."""
    done = run(extended, "-c", "import dnb_edge.race.speeding as s; print(s.__file__)")
    assert Path(done.stdout.strip()).is_relative_to(extended)


def test_the_examples_keep_the_house_rules(extended):
    """ruff has nothing to say about the examples, neither of style nor of format."""
    new = re.findall(r"^```python\n# (\S+\.py)$", PAGE, re.MULTILINE)
    for words in (("check", "--no-cache"), ("format", "--check", "--no-cache")):
        done = run(extended, "-m", "ruff", *words, *new)
        assert done.returncode == 0, done.stdout


def test_the_new_detector_times_laps(extended, tmp_path):
    """The simulated race, seen by the example's detector alone, gives its laps."""
    for words in (
        ("demo", "--fast", "--laps", "1", "--out", str(tmp_path)),
        ("run", "--config", f"{tmp_path}/demo.yaml", "--source", "sim:?laps=2", "--set", "detector.kind=colourful"),
    ):
        done = run(extended, "-m", "dnb_edge", *words)
        assert done.returncode == 0, done.stderr
    said = done.stdout + done.stderr
    assert "lap 2" in said
    assert "2 laps; the car was found in" in said


def test_the_rule_set_can_be_copied(tmp_path):
    """The page's rule set is one."""
    (text,) = [block for block in blocks("yaml") if block.startswith("# our-club.yaml")]
    (tmp_path / "our-club.yaml").write_text(text)
    rules = load_rule_set("./our-club.yaml", tmp_path)
    assert (rules.name, rules.sections["race"]) == ("our club", {"laps": 5})
