"""What is fuzzed: for each kind of file, how an input is made and what of dnb-edge reads it as a user's command would."""

import dataclasses
import hashlib
import io
import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fuzz_bytes
import fuzz_mcap
import fuzz_tree
import numpy as np
from fuzz_corpus import RUN, Corpus

from dnb_edge.archive.replayed import replay
from dnb_edge.config.calibration_file import load_calibration, reference_picture
from dnb_edge.config.keypoints import load_yaml_pairs
from dnb_edge.config.lens_file import load_lens
from dnb_edge.config.load import load_config
from dnb_edge.config.marker_layout import load_marker_layout
from dnb_edge.config.rules import load_rule_set
from dnb_edge.config.track_file import load_track_file
from dnb_edge.detect.onnx import default_model_path, load_model
from dnb_edge.record.edits import read_edits
from dnb_edge.record.reader import iter_frames, read_run
from dnb_edge.record.recover import recover_file
from dnb_edge.view.homography import fit_homography
from dnb_edge.view.keypoints import load_npy_pairs

Run = Callable[[Path, list[str], Corpus], None]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One input: files by name, and words of the command line."""

    files: dict[str, bytes]
    words: list[str] = dataclasses.field(default_factory=list)


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """One kind of input and its reader."""

    make: Callable[[random.Random, Corpus], Case]
    run: Run
    share: float = 1.0
    """How many of all inputs it gets, in proportion."""


def _document(rng: random.Random, corpus: Corpus, name: str) -> bytes:
    """A YAML file after damage of any kind: to its data, its text or its bytes."""
    kind, text = rng.random(), corpus.files[name]
    if kind < 0.55:
        return fuzz_tree.to_yaml(rng, fuzz_tree.mutated(rng, corpus.tree(name)))
    if kind < 0.75:
        return fuzz_tree.trapped(rng, text)
    if kind < 0.8:
        return fuzz_tree.alias_bomb(rng, text)
    if kind < 0.82:
        return fuzz_tree.trapped(rng, fuzz_tree.to_yaml(rng, fuzz_tree.mutated(rng, corpus.tree(name))))
    if kind < 0.825:
        return b"".join([text, text * rng.choice((1, 40)), b"# " + b"x" * rng.choice((10, 10**6))])
    return fuzz_bytes.mutated(rng, text)


def _yaml_target(*names: str, read: Callable[[Path], Any], share: float = 1.0) -> Target:
    def make(rng: random.Random, corpus: Corpus) -> Case:
        return Case(files={"a.yaml": _document(rng, corpus, rng.choice(names))})

    return Target(make=make, run=lambda folder, _words, _corpus: read(folder / "a.yaml"), share=share)


def _config(rng: random.Random, corpus: Corpus) -> Case:
    name = rng.choice(("config-example.yaml", "config-drivenetbench.yaml", "config-full.yaml"))
    if rng.random() < 0.3:
        return Case(files={"a.yaml": corpus.files[name]}, words=_overrides(rng, corpus.tree("config-full.yaml")))
    words = _overrides(rng, corpus.tree("config-full.yaml")) if rng.random() < 0.1 else []
    return Case(files={"a.yaml": _document(rng, corpus, name)}, words=words)


def _overrides(rng: random.Random, tree: Any) -> list[str]:
    """Some `--set` words: mostly of keys that there are, with values that there should not be."""
    words = []
    for _ in range(rng.randint(1, 3)):
        path, here = [], tree
        while isinstance(here, dict) and here and rng.random() < 0.9:
            key = rng.choice(list(here))
            path.append(str(key))
            here = here[key]
        value = fuzz_tree.to_yaml(rng, rng.choice(fuzz_tree.ODD)).decode("utf-8", "replace")
        value = rng.choice((value.partition("\n...")[0], rng.choice(fuzz_tree.TRAPS), str(here)))
        word = ".".join(path) + rng.choice(("=", "=", "=", "=", "", "==", ".=", " = ")) + value
        # a command line has no NUL
        words.append(word.replace("\0", "") if rng.random() < 0.9 else _bytes_text(rng, word))
    return words


def _bytes_text(rng: random.Random, word: str) -> str:
    """Odd bytes of a command line come as lone surrogates."""
    return (
        fuzz_bytes.mutated(rng, word.encode("utf-8", "surrogateescape"))
        .replace(b"\0", b"")
        .decode("utf-8", "surrogateescape")
    )


def _calibrated(path: Path) -> None:
    """As the assembly reads a calibration: for the camera's size, and how sure it is along the picture."""
    calibration = load_calibration(path)
    reference_picture(path, calibration)
    calibration.for_camera(width_px=640, height_px=360, camera_id="usb-0001")
    calibration.scaled_to(1280, 720)


def _track(rng: random.Random, corpus: Corpus) -> Case:
    if rng.random() < 0.7:
        return Case(files={"a.yaml": _document(rng, corpus, "track.yaml")})
    if rng.random() < 0.3:
        return Case(files={"a.yaml": fuzz_bytes.mutated(rng, corpus.files["track.json"])})
    return Case(files={"a.yaml": fuzz_mcap.payload(rng, corpus.files["track.json"])})


def _arrays(rng: random.Random, corpus: Corpus) -> Case:
    files = {name: corpus.files[name] for name in ("camera.npy", "twin.npy")}
    names = rng.sample(sorted(files), rng.randint(1, 2))
    for name in names:
        files[name] = _array(rng, files[name])
    return Case(files=files)


def _array(rng: random.Random, data: bytes) -> bytes:
    kind = rng.random()
    if kind < 0.3:
        return fuzz_bytes.mutated(rng, data)
    if kind < 0.6:
        return _odd_head(rng, data)
    shape = rng.choice(
        ((5, 2), (5, 2), (5, 2), (4, 2), (3, 2), (2, 5), (10,), (), (0, 2), (5, 0), (5, 2, 1), (5000, 2))
    )
    kinds = ("f8", "f4", "f2", "i1", "i8", "u8", "c16", "b1", "M8[ns]", "m8", "U3", "S3", ">f8", "f8,f8")
    drawn = np.random.default_rng(rng.getrandbits(32)).uniform(0, 1000, shape)
    with np.errstate(all="ignore"):
        array = drawn.astype(rng.choice(kinds[:6])) if rng.random() < 0.6 else np.zeros(shape, dtype=rng.choice(kinds))
    if array.dtype.kind == "f" and array.size and rng.random() < 0.5:
        array.flat[rng.randrange(array.size)] = rng.choice(
            (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-308, 0.0, 65504.0)
        )
    out = io.BytesIO()
    if rng.random() < 0.1:
        np.savez(out, array)
    else:
        np.save(out, array, allow_pickle=rng.random() < 0.5)
    return out.getvalue()


def _odd_head(rng: random.Random, data: bytes) -> bytes:
    """An array whose head tells a tale: of another shape or type, or no Python literal at all."""
    shape = rng.choice(
        (
            "(5, 2)",
            "(10**9, 2)",
            "(1000000000, 2)",
            "(9999999999999999999, 2)",
            "(-5, 2)",
            "(5, 2.0)",
            "5",
            "None",
            "(" * 150,
        )
    )
    kind = rng.choice(
        (
            "'<f8'",
            "'<i4'",
            "'O'",
            "'|V16'",
            "'<f8,<f8'",
            "[('a', '<f8')]",
            "None",
            "'x'",
            "'<U1000000000'",
            "'" + "a" * 99,
        )
    )
    order = rng.choice(("False", "True", "None", "0"))
    head = f"{{'descr': {kind}, 'fortran_order': {order}, 'shape': {shape}, }}".encode()
    version = rng.choice((b"\x01\x00", b"\x02\x00", b"\x03\x00", b"\x09\x09"))
    length = rng.choice((len(head), len(head), len(head), 0, 65535)).to_bytes(2 if version[0] == 1 else 4, "little")
    return b"\x93NUMPY" + version + length + head + data[128:]


def _clicked(folder: Path, _words: list[str], _corpus: Corpus) -> None:
    fit_homography(load_npy_pairs(folder / "camera.npy", folder / "twin.npy"))


def _card(rng: random.Random, corpus: Corpus) -> Case:
    model = default_model_path().read_bytes() if rng.random() < 0.02 else b"\x08\x0a not a model"
    if rng.random() < 0.3:
        return Case(files={"m.onnx": fuzz_bytes.mutated(rng, model), "m.json": corpus.files["card.json"]})
    tree = corpus.tree("card.json") | {"sha256": hashlib.sha256(model).hexdigest()}
    text = fuzz_mcap.payload(rng, json.dumps(tree).encode())
    return Case(files={"m.onnx": model, "m.json": text})


def _edits(rng: random.Random, corpus: Corpus) -> Case:
    """Edits whose seals are right, so that what they say is looked at; or bytes."""
    lines = corpus.files["edits.jsonl"].splitlines()
    if rng.random() < 0.3:
        return Case(files={"run.edits.jsonl": fuzz_bytes.mutated(rng, corpus.files["edits.jsonl"])})
    out, seal = b"", ""
    for line in lines:
        content = json.loads(line)
        del content["sha256"]
        if rng.random() < 0.4:
            content = json.loads(fuzz_tree.to_json(fuzz_tree.mutated(rng, content)))
        text = json.dumps(content)
        seal = hashlib.sha256(f"{seal}\n{text}".encode()).hexdigest()
        if isinstance(content, dict):
            out += json.dumps(content | {"sha256": seal}).encode() + b"\n"
        else:
            out += text.encode() + b"\n"
    return Case(files={"run.edits.jsonl": out})


def _recording(rng: random.Random, corpus: Corpus) -> Case:
    return Case(files={RUN: fuzz_mcap.mutated(rng, corpus.files[RUN])})


def _part(rng: random.Random, corpus: Corpus) -> Case:
    return Case(files={f"{RUN}.part": fuzz_mcap.mutated(rng, corpus.files[RUN])})


def _read(folder: Path, _words: list[str], _corpus: Corpus) -> None:
    run = read_run(folder / RUN, tolerate_damage=True, keep_detections=True)
    for _ in run.messages():
        pass
    for _ in iter_frames(folder / RUN):
        pass


def _recovered(folder: Path, _words: list[str], _corpus: Corpus) -> None:
    """What recovery makes must be whole: damage in it would be ours."""
    recovery = recover_file(folder / f"{RUN}.part")
    run = read_run(recovery.path, tolerate_damage=True)
    assert run.damage is None, run.damage


TARGETS: dict[str, Target] = {
    "mcap-read": Target(make=_recording, run=_read, share=2.0),
    "mcap-recover": Target(make=_part, run=_recovered, share=1.0),
    "mcap-rescore": Target(make=_recording, run=lambda folder, _words, _corpus: void(replay(folder / RUN)), share=1.0),
    "config": Target(
        make=_config, run=lambda folder, words, _corpus: void(load_config(folder / "a.yaml", words)), share=2.0
    ),
    "rules": _yaml_target(
        "rules-carla.yaml", "rules-deepracer.yaml", read=lambda path: load_rule_set(str(path)), share=0.5
    ),
    "calibration": _yaml_target("calibration.yaml", read=_calibrated, share=1.5),
    "lens": _yaml_target("lens.yaml", read=lambda path: load_lens(path).lens_for(640, 360), share=0.5),
    "keypoints-yaml": _yaml_target(
        "keypoints.yaml", read=lambda path: fit_homography(load_yaml_pairs(path)), share=0.5
    ),
    "keypoints-npy": Target(make=_arrays, run=_clicked, share=1.0),
    "marker-layout": _yaml_target("layout.yaml", read=load_marker_layout, share=0.5),
    "track": Target(
        make=_track, run=lambda folder, _words, _corpus: void(load_track_file(folder / "a.yaml")), share=1.0
    ),
    "card": Target(make=_card, run=lambda folder, _words, _corpus: void(load_model(folder / "m.onnx")), share=1.0),
    "edits": Target(
        make=_edits, run=lambda folder, _words, corpus: void(read_edits(folder / RUN, corpus.identity)), share=1.0
    ),
}


def void(_value: object) -> None:
    """Nothing of it."""
