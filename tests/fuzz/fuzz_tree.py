"""Damage to documents that keeps them documents: odd values in odd places, and YAML's own traps."""

import copy
import json
import math
import random
from typing import Any

import yaml

_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)

ODD: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 7, 2**31, 2**63, -(2**63), 10**30, 10**400, 0.0, -0.0, 0.5, 1e-320, 1e-9, 1e9,
    1e18, 1e308, -1e308, math.inf, -math.inf, math.nan, "", " ", "0", "-1", "1e9", "nan", "x", "auto", "off", "sim:",
    "../../etc/passwd", "/dev/null", "\0", "\n", "\ud7ff\u202e", "x" * 5000, "a.b", "{}", [], {}, [[]], [None],
    [0, 0], [1, 2, 3], [[0, 0], [0, 0]], {"": 0}, {"x": {}}, [1e308, -1e308], [math.nan, 0.0], list(range(500)),
    {"a": 1, "b": [2]}, "2026-11-23", "yes", "~",
)  # fmt: skip
"""Values of every type that a document may hold, at the edges of their range."""


def deep(rng: random.Random) -> Any:
    """A list or mapping in itself, over and over."""
    tree: Any = 0
    for _ in range(rng.choice((3, 19, 21, 60))):
        tree = [tree] if rng.random() < 0.5 else {"a": tree}
    return tree


def mutated(rng: random.Random, tree: Any, *, most: int = 3) -> Any:
    """A copy of `tree`, plain data, after one to `most` damages."""
    holder = [copy.deepcopy(tree)]
    for _ in range(rng.randint(1, most)):
        _damage(rng, holder)
    return holder[0]


def _damage(rng: random.Random, holder: list[Any]) -> None:
    """One damage at a place found by walking down at random, so that keys near the top are as likely as those far below."""
    parent, key = holder, 0
    while isinstance(parent[key], dict | list) and parent[key] and rng.random() < 0.8:
        parent = parent[key]
        key = rng.choice(list(parent)) if isinstance(parent, dict) else rng.randrange(len(parent))
    kind = rng.random()
    if kind < 0.6:
        parent[key] = _value(rng, parent[key])
    elif kind < 0.75:
        del parent[key]
        if not holder:
            holder.append(None)
    elif kind < 0.85 and isinstance(parent, list):
        parent.insert(key, copy.deepcopy(parent[key]))
    elif isinstance(parent, dict):
        parent[rng.choice(("", "x", "name", "version", 0, None, 1.5, True, str(key).upper(), "a" * 300))] = parent[key]
    else:
        parent[key] = deep(rng)


def _value(rng: random.Random, was: Any) -> Any:
    """Another value: of the same type and near at hand as often as of any type."""
    if isinstance(was, int | float) and not isinstance(was, bool) and rng.random() < 0.5:
        near = float(was) if abs(was) < 1e308 else 1e300
        return rng.choice((-was, was * 10, near / 3, was + 1, near * 1e6, int(near), near * 0))
    if isinstance(was, str) and rng.random() < 0.3:
        return rng.choice((was * 2, was[:-1], was + "\u00e9", was.upper(), [was], {was: was}))
    if isinstance(was, list) and rng.random() < 0.4:
        return rng.choice((was[:1], was * 2, was[::-1], was[:-1], [was], dict(enumerate(was)), [0.0] * len(was)))
    return deep(rng) if rng.random() < 0.05 else rng.choice(ODD)


def to_json(tree: Any) -> bytes:
    """As JSON of Python's kind: NaN and infinities are words."""
    try:
        return json.dumps(_with_text_keys(tree)).encode("utf-8", "surrogatepass")
    except RecursionError:  # damage upon damage: deeper than this process can write, which is worth an input as well
        return b"[" * 100_000


def _with_text_keys(tree: Any) -> Any:
    if isinstance(tree, dict):
        return {str(key): _with_text_keys(value) for key, value in tree.items()}
    return [_with_text_keys(value) for value in tree] if isinstance(tree, list) else tree


def to_yaml(rng: random.Random, tree: Any) -> bytes:
    """As YAML in one of its forms."""
    flow = rng.choice((None, True, False))
    text: str = yaml.dump(tree, Dumper=_DUMPER, sort_keys=False, default_flow_style=flow, allow_unicode=True)
    return text.encode("utf-8", "surrogatepass")


TRAPS = (
    "&a [*a]", "&a {x: *a}", "*nowhere", "!!python/object/apply:os.system [id]", "!!int x", "!!float x", "!!bool x",
    "!!null x", "!!binary 'ä'", "!!timestamp x", "!!set {a, b}", "!!omap [a: 1]", "!!pairs [a]", "!unknown x",
    "{? [a]: b}", "{? {a: b}: c}", "{<<: x}", "{<<: [x]}", "0x_", "0b_", "0o9", "1_", "190:20:30", "1:99:99.5",
    "+.inf", ".NaN", "1e400", "-", "?", "|", ">", "%YAML 9.9", "---", "...", "\t", "\ufeff", "@x", "`x`", "'", '"',
    "[", "{", "]", "}", ": :", "1" * 5000, "0x" + "f" * 5000, "1:" * 400 + "1", "[" * 30, "[" * 3000, "{a: " * 900,
    "- " * 900, "? " * 900, "\x00", "\x85", "\u2028", "=", "!!value =", "!<x> y", "!<tag:yaml.org,2002:int> 1.5", "*",
    "&", "!", "&a a",
)  # fmt: skip
"""What YAML makes something else of than one would think."""


def trapped(rng: random.Random, text: bytes) -> bytes:
    """A YAML text with a trap in place of a value, or on a line of its own."""
    lines = text.split(b"\n")
    at = rng.randrange(len(lines))
    trap = rng.choice(TRAPS).encode()
    key, colon, _ = lines[at].partition(b":")
    lines[at] = key + colon + b" " + trap if colon and rng.random() < 0.8 else trap
    return b"\n".join(lines)


def alias_bomb(rng: random.Random, text: bytes) -> bytes:
    """A YAML text with anchors that hold one another several times: little to read, much to walk through."""
    width, height = rng.choice(((2, 18), (2, 40), (10, 9), (50, 4), (3, 15)))
    opening, closing = rng.choice((("[", "]"), ("{", "}"), ("{<<: [", "]}")))
    parts = ["l0: &l0 {a: 1}" if "<" in opening else f"l0: &l0 {opening}{closing}"]
    for k in range(1, height):
        items = ", ".join(f"k{i}: *l{k - 1}" if opening == "{" else f"*l{k - 1}" for i in range(width))
        parts.append(f"l{k}: &l{k} {opening}{items}{closing}")
    bomb = "\n".join(parts).encode()
    if rng.random() < 0.5:
        return bomb + b"\n" + text
    # in place of a value that is asked for
    lines = text.split(b"\n")
    keyed = [k for k, line in enumerate(lines) if line.partition(b":")[1] and not line.startswith(b"#")]
    if not keyed:
        return bomb
    at = rng.choice(keyed)
    lines[at] = lines[at].partition(b":")[0] + f": *l{height - 1}".encode()
    return bomb + b"\n" + b"\n".join(lines)
