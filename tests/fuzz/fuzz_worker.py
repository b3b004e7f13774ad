"""One process that reads inputs, each within limits of time and memory; it is expendable.

    python fuzz_worker.py CORPUS SCRATCH TARGET SEED FIRST COUNT

Says each finding as a JSON line, and last what the inputs took. The number of the input at hand stands in SCRATCH/at, so that
whoever watches knows which one hung or killed it.
"""

import json
import random
import resource
import sys
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from fuzz_corpus import Corpus
from fuzz_targets import TARGETS, Case

from dnb_edge.errors import InputError, WorkError

MOST_S = 2.0
"""Processor time that one input may take."""
MOST_BYTES = 256 * 1024 * 1024
"""What the process may grow by while it reads one input."""


@dataclass(slots=True)
class Tally:
    """What the inputs of one target came to."""

    inputs: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    slowest_s: float = 0.0
    most_bytes: int = 0


def case_of(target: str, seed: int, number: int, corpus: Corpus) -> Case:
    """Input `number` of a seed: always the same."""
    return TARGETS[target].make(random.Random(f"{target}/{seed}/{number}"), corpus)


def put(case: Case, folder: Path) -> None:
    """The case's files in `folder`, and nothing else."""
    for left in folder.iterdir():
        left.unlink()
    for name, data in case.files.items():
        (folder / name).write_bytes(data)


def run_one(target: str, case: Case, folder: Path, corpus: Corpus) -> tuple[str, str]:
    """(what came of it, its text): `read` and the two errors that are allowed are good, everything else is a finding."""
    try:
        TARGETS[target].run(folder, case.words, corpus)
    except (InputError, WorkError) as error:
        text = str(error)
        return type(error).__name__ if text.strip() else "no text", text
    except BaseException as error:  # noqa: BLE001 that is what is looked for
        return "uncaught", "".join(traceback.format_exception(error)[-3:])
    return "read", ""


def peak_bytes() -> int:
    """The most memory that this process has had at once since `forget_peak`."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM"):
            return int(line.split()[1]) * 1024
    raise AssertionError("no VmHWM")


def forget_peak() -> None:
    """The most is what it has now (proc(5), clear_refs)."""
    Path("/proc/self/clear_refs").write_text("5")


def measured(target: str, case: Case, folder: Path, corpus: Corpus, tally: Tally) -> tuple[str, str]:
    """As `run_one`, with its time and memory held against the limits."""
    forget_peak()
    before = peak_bytes()
    start_s = time.process_time()
    outcome, text = run_one(target, case, folder, corpus)
    took_s, grew = time.process_time() - start_s, peak_bytes() - before
    tally.inputs += 1
    tally.slowest_s, tally.most_bytes = max(tally.slowest_s, took_s), max(tally.most_bytes, grew)
    if outcome not in ("uncaught", "no text"):
        if took_s > MOST_S:
            outcome, text = "slow", f"{took_s:.1f} s: {text[:200]}"
        elif grew > MOST_BYTES:
            outcome, text = "large", f"{grew >> 20} MB: {text[:200]}"
    tally.outcomes[outcome] += 1
    return outcome, text


def limit_memory() -> None:
    """No more than the limit above what the process has now, however it asks for it."""
    status = Path("/proc/self/status").read_text()
    now = next(int(line.split()[1]) * 1024 for line in status.splitlines() if line.startswith("VmSize"))
    resource.setrlimit(resource.RLIMIT_AS, (now + 2 * MOST_BYTES, now + 2 * MOST_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def main() -> None:
    """The process."""
    corpus = Corpus.read(Path(sys.argv[1]))
    scratch, target, seed = Path(sys.argv[2]), sys.argv[3], int(sys.argv[4])
    first, count = int(sys.argv[5]), int(sys.argv[6])
    folder = scratch / "input"
    folder.mkdir(exist_ok=True)
    warnings.simplefilter("ignore")
    tally = Tally()
    # What is made once, at the first input, belongs to no input.
    warm = case_of(target, seed, 0, corpus)
    put(warm, folder)
    run_one(target, warm, folder, corpus)
    limit_memory()
    with (scratch / "at").open("wb", buffering=0) as at:
        for number in range(first, first + count):
            at.seek(0)
            at.write(b"%12d" % number)
            case = case_of(target, seed, number, corpus)
            put(case, folder)
            outcome, text = measured(target, case, folder, corpus, tally)
            if outcome not in ("read", "InputError", "WorkError"):
                print(json.dumps({"number": number, "outcome": outcome, "text": text}), flush=True)
    done = {
        "inputs": tally.inputs,
        "outcomes": tally.outcomes,
        "slowest_s": tally.slowest_s,
        "most_bytes": tally.most_bytes,
    }
    print(json.dumps({"done": done}), flush=True)


if __name__ == "__main__":
    main()
