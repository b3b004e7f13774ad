"""Hands tens of thousands of damaged files to dnb-edge: each must be read, or refused in one line, soon and in little memory.

    python tests/fuzz/fuzz.py                         # 100 000 inputs over all targets
    python tests/fuzz/fuzz.py --target config --inputs 2000 --seed 7
    python tests/fuzz/fuzz.py --target config --seed 7 --only 1234 --keep /tmp/input     # one of them again, with its error

The inputs are drawn from the seed, so that a finding is told by target, seed and number. They are read in processes of their
own, within limits; one that hangs or dies is reported and the rest goes on behind it. Exit code 1 where there are findings.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fuzz_corpus
import fuzz_worker
from fuzz_targets import TARGETS

HERE = Path(__file__).resolve().parent
PART = 1000
"""Inputs that one process reads."""
HUNG_S = 60.0
"""An input that takes so long by the wall's clock is taken for one without end."""
SHOWN = 3


@dataclass(slots=True)
class Result:
    """What a target's inputs came to."""

    inputs: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    slowest_s: float = 0.0
    most_bytes: int = 0
    findings: list[dict[str, Any]] = field(default_factory=list)

    def add(self, told: dict[str, Any]) -> None:
        """What one process said last."""
        self.inputs += told["inputs"]
        self.outcomes.update(told["outcomes"])
        self.slowest_s = max(self.slowest_s, told["slowest_s"])
        self.most_bytes = max(self.most_bytes, told["most_bytes"])


def fuzz(targets: dict[str, int], *, seed: int, jobs: int, corpus: Path, progress: bool = False) -> dict[str, Result]:
    """Reads so many inputs of each target, `jobs` at once. With `progress` it says on stderr how far it is."""
    results = {name: Result() for name in targets}
    parts = [
        (name, first, min(PART, count - first)) for name, count in targets.items() for first in range(0, count, PART)
    ]
    with ThreadPoolExecutor(jobs) as pool:
        for name, one in pool.map(lambda part: (part[0], _part(*part, seed, corpus)), parts):
            results[name].add(
                {
                    "inputs": one.inputs,
                    "outcomes": one.outcomes,
                    "slowest_s": one.slowest_s,
                    "most_bytes": one.most_bytes,
                }
            )
            results[name].findings += one.findings
            if progress:
                print(
                    f"{name}: {results[name].inputs} of {targets[name]}, {len(results[name].findings)} findings",
                    file=sys.stderr,
                )
    return results


def _part(name: str, first: int, count: int, seed: int, corpus: Path) -> Result:
    """`count` inputs from `first`, in as many processes as it takes."""
    result, end = Result(), first + count
    with tempfile.TemporaryDirectory(prefix="dnb-edge-fuzz-") as scratch:
        while first < end:
            lines, died = _process(name, first, end - first, seed, corpus, Path(scratch))
            for line in lines:
                if "done" in line:
                    result.add(line["done"])
                else:
                    result.findings.append({"target": name, "seed": seed} | line)
            if died is None:
                break
            # What the process had read before is lost from the count of outcomes, and counted as read by its number.
            at = int((Path(scratch) / "at").read_bytes() or b"-1")
            result.inputs += at + 1 - first
            result.outcomes["of a process that died"] += at - first
            result.outcomes["died"] += 1
            result.findings.append({"target": name, "seed": seed, "number": at, "outcome": "died", "text": died})
            first = at + 1
    return result


def _process(
    name: str, first: int, count: int, seed: int, corpus: Path, scratch: Path
) -> tuple[list[dict[str, Any]], str | None]:
    """(what it said, how it died; None where it came to its end)."""
    (scratch / "at").write_bytes(b"%12d" % first)
    words = [
        sys.executable,
        str(HERE / "fuzz_worker.py"),
        str(corpus),
        str(scratch),
        name,
        str(seed),
        str(first),
        str(count),
    ]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with (scratch / "out").open("wb") as out, (scratch / "err").open("wb") as err:
        process = subprocess.Popen(words, stdout=out, stderr=err, env=environment)
        hung = _watch(process, scratch / "at")
    lines = [json.loads(line) for line in (scratch / "out").read_text().splitlines()]
    if hung:
        return lines, f"no end within {HUNG_S:.0f} s"
    if process.returncode == 0:
        return lines, None
    return lines, f"exit code {process.returncode}: " + (scratch / "err").read_text(errors="replace")[-600:]


def _watch(process: subprocess.Popen[bytes], at: Path) -> bool:
    """Waits for the process; kills it where one input takes too long, and says so."""
    last, since_s = b"", time.monotonic()
    while True:
        try:
            process.wait(0.2)
        except subprocess.TimeoutExpired:
            now = at.read_bytes()
            if now != last:
                last, since_s = now, time.monotonic()
            elif time.monotonic() - since_s > HUNG_S:
                process.kill()
                process.wait()
                return True
        else:
            return False


def shares(total: int, names: list[str]) -> dict[str, int]:
    """How many of `total` inputs each target gets."""
    whole = sum(TARGETS[name].share for name in names)
    return {name: math.ceil(total * TARGETS[name].share / whole) for name in names}


def tell(results: dict[str, Result]) -> None:
    """A table, and the first findings of each kind."""
    print(f"{'target':16} {'inputs':>7} {'read':>7} {'refused':>8} {'findings':>8} {'slowest':>9} {'memory':>8}")
    for name, result in results.items():
        refused = result.outcomes["InputError"] + result.outcomes["WorkError"]
        print(
            f"{name:16} {result.inputs:7} {result.outcomes['read']:7} {refused:8} {len(result.findings):8} "
            f"{result.slowest_s:7.2f} s {result.most_bytes >> 20:5} MB"
        )
    total = sum(result.inputs for result in results.values())
    findings = sum(len(result.findings) for result in results.values())
    print(f"{'all':16} {total:7} {'':7} {'':8} {findings:8}")
    for result in results.values():
        kinds: Counter[str] = Counter()
        for one in result.findings:
            kind = one["outcome"] + one["text"].strip().splitlines()[-1][:60]
            kinds[kind] += 1
            if kinds[kind] <= SHOWN and len(kinds) <= 30:
                print(
                    f"\n{one['target']} --seed {one['seed']} --only {one['number']}: {one['outcome']}\n{one['text'].rstrip()}"
                )


def again(target: str, seed: int, number: int, corpus: Path, keep: Path | None) -> None:
    """One input once more, in this process and without limits, with what comes of it."""
    read = fuzz_corpus.Corpus.read(corpus)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) if keep is None else keep
        folder.mkdir(parents=True, exist_ok=True)
        case = fuzz_worker.case_of(target, seed, number, read)
        fuzz_worker.put(case, folder)
        print(f"words: {case.words}")
        tally = fuzz_worker.Tally()
        print(*fuzz_worker.measured(target, case, folder, read, tally), sep="\n")
        print(f"{tally.slowest_s:.2f} s, {tally.most_bytes >> 20} MB")


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description="Hand damaged files to dnb-edge.")
    parser.add_argument("--inputs", type=int, default=100_000, help="inputs in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2, help="processes at once")
    parser.add_argument("--target", choices=sorted(TARGETS), action="append", help="only these")
    parser.add_argument("--only", type=int, help="the one input of this number, of one target")
    parser.add_argument("--keep", type=Path, help="with --only: a folder for its files; what lies in it is deleted")
    parser.add_argument("--corpus", type=Path, help="folder of the right files; made if absent, default: a scratch one")
    given = parser.parse_args()
    corpus = given.corpus or Path(tempfile.mkdtemp(prefix="dnb-edge-corpus-"))
    if not (corpus / fuzz_corpus.RUN).exists():
        fuzz_corpus.write(corpus)
    try:
        if given.only is not None:
            again(given.target[0], given.seed, given.only, corpus, given.keep)
            return
        results = fuzz(
            shares(given.inputs, given.target or list(TARGETS)),
            seed=given.seed,
            jobs=given.jobs,
            corpus=corpus,
            progress=True,
        )
        tell(results)
        sys.exit(1 if any(result.findings for result in results.values()) else 0)
    finally:
        if given.corpus is None:
            shutil.rmtree(corpus)


if __name__ == "__main__":
    main()
