"""The shipped model's answers on this processor and on a Raspberry Pi's: the same within 0.001, or exit code 1.

Not a test of `make test`: it needs Linux, root (for `chroot`), the network and Debian's `mmdebstrap` and `qemu-user-static`.
`make aarch64-check` runs it; `.venv/bin/python tests/system/aarch64_output.py --help` tells the options.

It unpacks a small Debian for aarch64 with Python, the wheels for aarch64 of the versions in constraints.txt and this package
beside it, and runs the model there under qemu's user-mode emulation, once as each of a Pi's processors: the Cortex-A72 of a
Pi 4 has no integer dot product, the Cortex-A76 of a Pi 5 has. Nothing is installed or executed while it is built, so that
binfmt_misc is not needed. The inputs are drawn here, once, for all: only the network and the decoding are compared.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve()
REPOSITORY = HERE.parent.parent.parent
LIMIT = 0.001
"""Greatest difference of any number in the raw output maps, and of any number of a decoded peak."""
SUITE, PYTHON = "bookworm", "3.11"
PACKAGES = "python3,libpython3-stdlib,libstdc++6,libgomp1"
WHEELS = ("numpy", "onnxruntime", "opencv-python-headless")
PLATFORMS = ("manylinux_2_28_aarch64", "manylinux_2_27_aarch64", "manylinux2014_aarch64", "manylinux_2_17_aarch64")
QEMU = Path("/usr/bin/qemu-aarch64-static")
SITE = "opt/site"
PROCESSORS = ("cortex-a72", "cortex-a76")
LEAST_CONFIDENCE = 0.1
"""Peaks from here on are compared; the detector reports from 0.2 on."""


def build(root: Path) -> None:
    """An aarch64 Debian with Python and the wheels in `root`; under a minute and 500 MB."""
    for tool in ("mmdebstrap", str(QEMU)):
        if shutil.which(tool) is None:
            sys.exit(f"{tool} is missing: apt-get install mmdebstrap qemu-user-static")
    partial, wheels = root.with_name(root.name + ".part"), root.with_name(root.name + ".wheels")
    for left in (partial, wheels):
        shutil.rmtree(left, ignore_errors=True)
    words = ["mmdebstrap", "--mode=root", "--architectures=arm64", "--variant=extract", f"--include={PACKAGES}"]
    run([*words, SUITE, str(partial), "http://deb.debian.org/debian"])
    words = [sys.executable, "-m", "pip", "download", "--quiet", "--dest", str(wheels), "--only-binary=:all:"]
    words += [word for platform in PLATFORMS for word in ("--platform", platform)]
    words += ["--python-version", PYTHON, "--constraint", str(REPOSITORY / "constraints.txt")]
    run([*words, *WHEELS])
    for wheel in sorted(wheels.glob("*.whl")):
        with zipfile.ZipFile(wheel) as content:
            content.extractall(partial / SITE)
    shutil.copy(QEMU, partial / "usr/bin")
    shutil.rmtree(wheels)
    partial.rename(root)


def run(words: list[str], **more: object) -> None:
    """Runs a command; ends with its name where it fails."""
    done = subprocess.run(words, check=False, **more)
    if done.returncode != 0:
        sys.exit(f"{' '.join(words[:3])} ... failed with exit code {done.returncode}")


def draw_inputs(path: Path, count: int, seed: int) -> None:
    """Writes `count` windows, a tenth as many whole frames, of the simulator's pictures, and as many of noise."""
    from dnb_edge.detect.looks import halved, look_pixels, whole_look, whole_pixels, window_look  # noqa: PLC0415
    from dnb_edge.sim.rig import Rig  # noqa: PLC0415

    rng = np.random.default_rng(seed)
    rig = Rig(seed=seed, laps=1)
    drawn: dict[str, np.ndarray] = {}
    background = halved(rig.frame(0).bgr, 1)
    for number in range(count):
        at = int(rng.integers(rig.frames))
        image = rig.frame(at).bgr
        if number % 10 == 0:
            look = whole_look(image.shape[1], image.shape[0], 448)
            drawn[f"whole{number}"] = whole_pixels(image, rng.integers(0, 30, image.shape[:2], dtype=np.uint8), look)
        place = np.asarray(rig.frame_truth(at).camera_px) + rng.uniform(-40, 40, 2)
        length_px = float(rng.uniform(50, 130))
        look = window_look((float(place[0]), float(place[1])), length_px, window_px=128, window_length_px=44.0)
        drawn[f"window{number}"] = look_pixels(image, background if number % 2 else None, look, 0.5)
        if number % 10 == 5:
            drawn[f"noise{number}"] = rng.integers(0, 256, (128, 128, 4), dtype=np.uint8)
    np.savez_compressed(path, **drawn)


def answer(model: Path, inputs: Path, out: Path) -> None:
    """Runs the model on every input and writes its maps, and its peaks as rows of numbers."""
    from dnb_edge.detect.decode import peaks  # noqa: PLC0415
    from dnb_edge.detect.onnx import load_model  # noqa: PLC0415

    network = load_model(model)
    answers: dict[str, np.ndarray] = {}
    with np.load(inputs) as given:
        for name in given.files:
            pixels = given[name][None]
            # a network that is told how things lean gets a lean of its own with every input
            told = np.random.default_rng(len(answers)).integers(0, 256, 2, dtype=np.uint8)
            leans = np.broadcast_to(told, (*pixels.shape[:3], 2)).copy() if network.takes_lean else None
            maps = network.many(pixels, leans=leans)[0]
            found = [dataclasses.astuple(peak) for peak in peaks(maps, least_confidence=LEAST_CONFIDENCE, most=12)]
            rows = [[float("inf") if number is None else number for number in peak] for peak in found]
            answers[f"maps.{name}"] = maps.values
            answers[f"peaks.{name}"] = np.asarray(rows, dtype=np.float64).reshape(len(rows), -1)
    np.savez_compressed(out, **answers)


def compare(here: Path, there: Path) -> dict[str, float | int]:
    """Largest difference of the maps and of the peaks; another number of peaks, or an unknown heading, is infinitely far."""
    maps = found = 0.0
    peaks_seen = inputs = 0
    with np.load(here) as ours, np.load(there) as theirs:
        for name in ours.files:
            one, other = ours[name], theirs[name]
            if name.startswith("maps."):
                inputs += 1
                maps = max(maps, float(np.abs(one.astype(np.float64) - other).max()))
                continue
            peaks_seen += len(one)
            same_form = one.shape == other.shape and bool((np.isfinite(one) == np.isfinite(other)).all())
            known = np.isfinite(one)
            apart = np.abs(one[known] - other[known]) if same_form else np.array([np.inf])
            found = max(found, float(apart.max(initial=0.0)))
    return {"inputs": inputs, "peaks": peaks_seen, "maps_largest_difference": maps, "peaks_largest_difference": found}


def guest(root: Path, processor: str, model: Path, inputs: Path) -> Path:
    """What the emulated processor answers; the file with it."""
    work = root / "compare"
    shutil.rmtree(work, ignore_errors=True)
    shutil.rmtree(root / SITE / "dnb_edge", ignore_errors=True)
    shutil.copytree(REPOSITORY / "dnb_edge", root / SITE / "dnb_edge", ignore=shutil.ignore_patterns("__pycache__"))
    work.mkdir()
    for file in (HERE, model, model.with_suffix(".json"), inputs):
        shutil.copy(file, work)
    words = ["chroot", str(root), f"/usr/bin/{QEMU.name}", f"/usr/bin/python{PYTHON}", f"/compare/{HERE.name}"]
    environment = {
        "PYTHONPATH": f"/{SITE}",
        "QEMU_CPU": processor,
        "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
        "HOME": "/",
    }
    words += ["--model", f"/compare/{model.name}", "--answer", f"/compare/{inputs.name}", "/compare/there.npz"]
    # ONNX Runtime complains on stderr that there is no /sys to read the processor from; it then asks the kernel
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"the emulated {processor} failed:\n{done.stderr}")
    return work / "there.npz"


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description="Compare the model's answers on this processor and on aarch64.")
    parser.add_argument(
        "--root",
        type=Path,
        default=Path("/var/tmp/dnb-edge-aarch64"),
        help="folder of the aarch64 Debian; made if absent",
    )
    parser.add_argument("--model", type=Path, help="model with its card beside it; default: the shipped one")
    parser.add_argument("--inputs", type=int, default=40, help="windows to compare, with some whole frames and noise")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--answer", type=Path, nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.answer is not None:
        answer(given.model, *given.answer)
        return
    if os.geteuid() != 0:
        sys.exit("chroot needs root: sudo make aarch64-check")
    from dnb_edge.detect.onnx import default_model_path  # noqa: PLC0415

    model: Path = given.model or default_model_path()
    root: Path = given.root.resolve()
    root.parent.mkdir(parents=True, exist_ok=True)
    if not root.exists():
        build(root)
    inputs, here = root.with_name(root.name + ".inputs.npz"), root.with_name(root.name + ".here.npz")
    draw_inputs(inputs, given.inputs, given.seed)
    answer(model, inputs, here)
    differs = False
    for processor in PROCESSORS:
        figures = compare(here, guest(root, processor, model, inputs))
        differs |= max(figures["maps_largest_difference"], figures["peaks_largest_difference"]) > LIMIT
        print(json.dumps({"model": model.name, "processor": processor, **figures}), flush=True)
    sys.exit(f"differs by more than {LIMIT}" if differs else 0)


if __name__ == "__main__":
    main()
