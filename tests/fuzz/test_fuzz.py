"""Some of the fuzzer's inputs with every run of the tests, and that it notices what it looks for. `make fuzz` has the rest."""

import random
import time
from pathlib import Path

import fuzz
import fuzz_corpus
import fuzz_mcap
import fuzz_targets
import fuzz_worker
import pytest

from dnb_edge.errors import InputError

EACH = 160
"""Inputs of each target; another seed than `make fuzz` begins with."""
SEED = 20261123


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("corpus")
    fuzz_corpus.write(folder)
    return folder


def test_every_right_file_is_read(corpus: Path, tmp_path: Path) -> None:
    """What the fuzzer starts from is what users have: nothing is refused because it was wrong from the start."""
    read = fuzz_corpus.Corpus.read(corpus)
    files = read.files
    whole = {
        "mcap-read": {"run.mcap": files["run.mcap"]},
        "mcap-recover": {"run.mcap.part": files["run.mcap"][:-400]},
        "mcap-rescore": {"run.mcap": files["run.mcap"]},
        "config": {"a.yaml": files["config-full.yaml"]},
        "rules": {"a.yaml": files["rules-carla.yaml"]},
        "calibration": {"a.yaml": files["calibration.yaml"]},
        "lens": {"a.yaml": files["lens.yaml"]},
        "keypoints-yaml": {"a.yaml": files["keypoints.yaml"]},
        "keypoints-npy": {name: files[name] for name in ("camera.npy", "twin.npy")},
        "marker-layout": {"a.yaml": files["layout.yaml"]},
        "track": {"a.yaml": files["track.json"]},
        "edits": {"run.edits.jsonl": files["edits.jsonl"]},
    }
    for target, content in whole.items():
        fuzz_worker.put(fuzz_targets.Case(files=content), tmp_path)
        assert fuzz_worker.run_one(target, fuzz_targets.Case(files=content), tmp_path, read)[0] == "read", target
    assert set(whole) | {"card"} == set(fuzz_targets.TARGETS)


@pytest.mark.parametrize("target", sorted(fuzz_targets.TARGETS))
def test_damaged_files_are_read_or_refused(target: str, corpus: Path) -> None:
    """Only the two errors that users are told; 2 s, 256 MB, and no crash of the process."""
    results = fuzz.fuzz({target: EACH}, seed=SEED, jobs=1, corpus=corpus)
    assert results[target].inputs == EACH
    assert results[target].findings == []


def test_an_input_is_drawn_again_by_its_number(corpus: Path) -> None:
    """A finding is told by target, seed and number; that must be enough to see it again."""
    read = fuzz_corpus.Corpus.read(corpus)
    for target in fuzz_targets.TARGETS:
        once, again = (fuzz_worker.case_of(target, 5, 17, read) for _ in range(2))
        assert once == again, target


def test_damage_gets_past_the_checksums(corpus: Path, tmp_path: Path) -> None:
    """Most changed recordings have right CRCs, so that what lies behind those checks is reached."""
    read = fuzz_corpus.Corpus.read(corpus)
    rng = random.Random(1)
    texts = []
    for _ in range(40):
        (tmp_path / "run.mcap").write_bytes(fuzz_mcap.mutated(rng, read.files["run.mcap"]))
        texts.append(fuzz_worker.run_one("mcap-rescore", fuzz_targets.Case(files={}), tmp_path, read)[1])
    assert sum("checksum" in text or "truncated" in text for text in texts) < 20
    assert any("malformed" in text or "setup" in text for text in texts)


def slow() -> None:
    until = time.process_time() + fuzz_worker.MOST_S + 0.1
    while time.process_time() < until:
        pass


def refuse(text: str) -> None:
    raise InputError(text)


@pytest.mark.parametrize(
    ("read", "outcome"),
    [
        (lambda: None, "read"),
        (lambda: refuse("a.yaml: wrong"), "InputError"),
        (lambda: refuse(" "), "no text"),
        (lambda: {}["x"], "uncaught"),
        (slow, "slow"),
        (lambda: bytearray(b"x") * (fuzz_worker.MOST_BYTES + 30_000_000), "large"),
    ],
)
def test_what_is_looked_for_is_noticed(read, outcome: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """An exception, a blank refusal, 2 s and 256 MB are told apart from what is right."""
    target = fuzz_targets.Target(make=lambda *_: fuzz_targets.Case(files={}), run=lambda *_: read() and None)
    monkeypatch.setitem(fuzz_targets.TARGETS, "made up", target)
    case = fuzz_targets.Case(files={})
    assert fuzz_worker.measured("made up", case, tmp_path, None, fuzz_worker.Tally())[0] == outcome


def test_a_process_that_dies_or_hangs_is_told_and_the_rest_is_read(
    corpus: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The input at hand is the finding; those behind it are read all the same."""
    worker = tmp_path / "fuzz_worker.py"
    worker.write_text(
        "import json, os, sys, time\n"
        "from pathlib import Path\n"
        "scratch, first, count = Path(sys.argv[2]), int(sys.argv[5]), int(sys.argv[6])\n"
        "for number in range(first, first + count):\n"
        "    (scratch / 'at').write_bytes(b'%12d' % number)\n"
        "    if number == 3: os.abort()\n"
        "    if number == 5: time.sleep(60)\n"
        "done = {'inputs': first + count - number, 'outcomes': {'read': 1}, 'slowest_s': 0.0, 'most_bytes': 0}\n"
        "print(json.dumps({'done': done | {'inputs': count}}))\n"
    )
    monkeypatch.setattr(fuzz, "HERE", tmp_path)
    monkeypatch.setattr(fuzz, "HUNG_S", 1.0)
    result = fuzz.fuzz({"config": 8}, seed=1, jobs=1, corpus=corpus)["config"]
    assert [(one["number"], one["text"][:13]) for one in result.findings] == [
        (3, "exit code -6:"),
        (5, "no end within"),
    ]
    assert result.inputs == 8
