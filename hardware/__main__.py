"""`python -m hardware build|check|list`: the kit's printable files, drawings and pictures.

Exit code 0: done; 1: a part cannot be printed, or what docs/ shows is not what comes out; 2: no such part.
"""

import argparse
import sys
from pathlib import Path

from hardware import build, kit, pictures, wiring

ROOT = Path(__file__).resolve().parents[1]
SHOWN_FOLDER = ROOT / "docs" / "pictures" / "hardware"
PAGE = ROOT / "docs" / "printing.md"
OPEN, CLOSE = "<!-- made by: python -m hardware build --docs -->\n", "<!-- end -->\n"


def main(arguments: list[str] | None = None) -> int:
    """Run one verb; what it says goes to standard error, `list` to standard output."""
    options = _options(arguments)
    if options.verb == "list":
        titles = [(part.name, part.title) for part in kit.parts()] + [
            (each.name, each.title) for each in pictures.pictures()
        ]
        sys.stdout.writelines(f"{name:32} {title}\n" for name, title in titles)
        return 0
    try:
        made = build.everything(tuple(options.names), step=options.verb == "build", processes=options.processes)
    except KeyError as unknown:
        return _say(2, f"no part or picture is called {unknown}: see python -m hardware list")
    for fault in made.faults:
        _say(1, fault)
    if options.verb == "check":
        differences = list(_differences(made))
        for line in differences:
            _say(1, line)
        if differences:
            _say(1, "what docs/ shows is out of date: run python -m hardware build --docs, look at it, commit it")
        return 1 if made.faults or differences else _say(0, f"{len(made.files)} files as they should be")
    build.write(made, options.out)
    for name, text in wiring.pictures().items():
        (options.out / "wiring").mkdir(exist_ok=True)
        (options.out / "wiring" / name).write_text(text, encoding="utf-8")
    _say(0, f"{len(made.files)} files in {options.out}")
    if options.docs:
        _renew(made)
    return 1 if made.faults else 0


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m hardware", description="The kit's printable parts, drawings and pictures."
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    making = verbs.add_parser("build", help="write STL, STEP, drawings and pictures")
    making.add_argument("--out", type=Path, default=ROOT / "build" / "hardware", help="where to (build/hardware)")
    making.add_argument("--docs", action="store_true", help="renew what docs/ shows, too")
    checking = verbs.add_parser("check", help="make all anew: can it be printed, and is it what docs/ shows?")
    for parser_of_verb in (making, checking):
        parser_of_verb.add_argument("names", nargs="*", help="parts and pictures; all where none is named")
        parser_of_verb.add_argument("--processes", type=int, default=2)
    verbs.add_parser("list", help="list parts and pictures")
    return parser.parse_args(arguments)


def _shown(made: build.Made) -> dict[str, bytes]:
    """What docs/pictures/hardware holds: of the parts that were made and, where all were, the wiring diagrams."""
    drawn = wiring.pictures() if build.TABLE_FILE in made.files else {}
    return dict(build.shown(made)) | {name: text.encode() for name, text in drawn.items()}


def _differences(made: build.Made) -> list[str]:
    found = []
    new = _shown(made)
    for name, data in new.items():
        path = SHOWN_FOLDER / name
        if not path.is_file():
            found.append(f"{path.relative_to(ROOT)} is missing")
        elif path.read_bytes() != data:
            found.append(f"{path.relative_to(ROOT)} differs")
    if build.TABLE_FILE in made.files:
        left = {path.name for path in SHOWN_FOLDER.glob("*.svg")} - set(new)
        found += [f"{name} in {SHOWN_FOLDER.relative_to(ROOT)} is made by no part" for name in sorted(left)]
        page = PAGE.read_text(encoding="utf-8")
        if _with_table(page, made.files[build.TABLE_FILE].decode()) != page:
            found.append(f"the table in {PAGE.relative_to(ROOT)} differs")
    return found


def _renew(made: build.Made) -> None:
    SHOWN_FOLDER.mkdir(parents=True, exist_ok=True)
    for name, data in _shown(made).items():
        (SHOWN_FOLDER / name).write_bytes(data)
    if build.TABLE_FILE in made.files:
        page = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(_with_table(page, made.files[build.TABLE_FILE].decode()), encoding="utf-8")
    _say(0, f"renewed {SHOWN_FOLDER.relative_to(ROOT)}")


def _with_table(page: str, table: str) -> str:
    before, opened, rest = page.partition(OPEN)
    _, closed, after = rest.partition(CLOSE)
    if not opened or not closed:
        raise ValueError(f"{PAGE} has no table between {OPEN.strip()} and {CLOSE.strip()}")
    return f"{before}{OPEN}\n{table}\n{CLOSE}{after}"


def _say(code: int, text: str) -> int:
    sys.stderr.write(f"hardware: {text}\n")
    return code


if __name__ == "__main__":
    sys.exit(main())
