"""The card of a benchmark, `ENTRY.nut.json`: how fast one model was on one machine, for whoever puts entries into a table.

Knows the file's format alone (docs/nut.md); nothing of models, of how times are taken, or of tables.
"""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from dnb_edge.errors import InputError

FORMAT = "dnb-edge-nut-bench"
VERSION = 1
SUFFIX = ".nut.json"
MOST_BYTES = 1_000_000
"""A card is a few kilobytes: what is larger is something else."""

Amount = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0)]
Words = Annotated[str, Field(min_length=1, max_length=1000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Host:
    """The machine; None where it does not tell."""

    name: Words
    """Its name in the network."""
    cpu: Words
    """The processor's name, such as `Cortex-A76`; the architecture where there is no other."""
    cores: Count
    """Processors that the measuring process might use."""
    architecture: Words
    memory_bytes: Count | None = None
    governor: str | None = None
    """Of the processor's frequency, such as `ondemand`."""
    temperature_before_c: float | None = None
    temperature_after_c: float | None = None
    load: Amount | None = None
    """Processes that wanted a processor, on average over the minute before: more than few, and the times are too long."""
    throttled: bool | None = None
    """Whether the machine slowed itself down, by heat or supply, when the measurement was over."""

    @property
    def words(self) -> str:
        """The machine in a few words, for a table."""
        return f"{self.name}: {self.cpu}, {self.cores} core{'s' * (self.cores != 1)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """A percentile over all passes, and the least and the greatest that one repeat had."""

    all_ms: Amount
    least_ms: Amount
    most_ms: Amount


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency:
    """How long one picture took, over all repeats."""

    p50: Spread
    p95: Spread
    p99: Spread
    mean_ms: Amount
    max_ms: Amount


@dataclass(frozen=True, slots=True, kw_only=True)
class WarmUp:
    """What ran before the clock counted."""

    passes: Count
    first_ms: Amount
    """The very first pass in the measuring process."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ColdStart:
    """A fresh process, median of several; the file lay in the system's cache."""

    starts: Annotated[int, Field(ge=1)]
    process_ms: Amount
    """From the start of the process until Python runs its first line."""
    import_ms: Amount
    """ONNX Runtime and NumPy."""
    load_ms: Amount
    first_answer_ms: Amount
    total_ms: Amount
    """From the start of the process to the first answer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """Resident memory of a fresh process that does nothing else."""

    grown_bytes: Count
    """By loading the model and running it."""
    peak_bytes: Count
    """The most that the whole process had, Python and ONNX Runtime with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchCard:
    """How fast one model was on one machine."""

    entry: Words
    """Whose model it is: the entry's name in tables."""
    model_file: Words
    model_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    model_bytes: Count
    input_shape: tuple[int, ...]
    """As measured, one picture."""
    input_type: Words
    """`float32` or `uint8`."""
    host: Host
    threads: Annotated[int, Field(ge=1)]
    measured_at: Words
    """UTC, ISO 8601."""
    software: dict[str, str]
    """Versions: `dnb-edge`, `onnxruntime`, `numpy`, `python`."""
    repeats: Count
    passes: Count
    """In each repeat."""
    warm_up: WarmUp
    inference: Latency
    """The network alone."""
    fps: Amount
    """Passes a second, one after the other: the network alone."""
    memory: Memory
    cold_start: ColdStart
    cpu_p50_ms: Amount | None = None
    """The network alone by processor time, all threads together: what else the machine does is not in it."""
    frames: str | None = None
    """The clip whose pictures were taken; None for noise."""
    preprocessing: Latency | None = None
    """From the camera's picture in memory to the network's input; None for noise, which needs none."""

    @property
    def p50_ms(self) -> float:
        """Of the network alone, as the others here."""
        return self.inference.p50.all_ms

    @property
    def p95_ms(self) -> float:
        """95 of 100 pictures took no longer."""
        return self.inference.p95.all_ms

    @property
    def p99_ms(self) -> float:
        """99 of 100 pictures took no longer."""
        return self.inference.p99.all_ms


def card_name(entry: str) -> str:
    """Name of the file of an entry's card: what no file name should hold becomes a dash."""
    return f"{re.sub(r'[^A-Za-z0-9._+-]+', '-', entry).strip('-.') or 'entry'}{SUFFIX}"


def card_object(card: BenchCard) -> dict[str, Any]:
    """The card as JSON has it."""
    return {"format": FORMAT, "version": VERSION, **asdict(card)}


def card_text(card: BenchCard) -> str:
    """What the file holds."""
    return json.dumps(card_object(card), indent=2, ensure_ascii=False) + "\n"


def read_bench_card(path: Path) -> BenchCard:
    """The card in `path`. Raises InputError where it cannot be read or is none; keys that it does not know it passes over."""
    try:
        with path.open("rb") as file:
            text = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: the benchmark's card cannot be read ({error.strerror or error})") from error
    if len(text) > MOST_BYTES:
        raise InputError(f"{path}: larger than a benchmark's card: give a file that `dnb-edge nut bench` wrote")
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: no JSON: give a file that `dnb-edge nut bench` wrote") from error
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise InputError(f"{path}: no benchmark's card: give a file that `dnb-edge nut bench` wrote")
    if found.get("version") != VERSION:
        raise InputError(
            f"{path}: a benchmark's card of version {found.get('version')!r}, this dnb-edge reads version {VERSION}: "
            "measure again"
        )
    try:
        return _adapter().validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "card"
        raise InputError(f"{path}: {place}: {first['msg']}; measure again with `dnb-edge nut bench`") from error


@cache
def _adapter() -> TypeAdapter[BenchCard]:
    return TypeAdapter(BenchCard)
