"""Turns of timed passes: every one as often as any other, fairly ordered."""

import pytest

from dnb_edge.detect.onnx import default_model_path, open_model
from dnb_edge.detect.timing import TURN, Pass, Ratio, Timing, in_turns, passes_of, ratio_to
from dnb_edge.errors import InputError


def test_all_passes_take_turns():
    """Each is warmed up, then runs in turns, forwards and backwards in alternation, with one untimed pass a turn."""
    done: list[str] = []
    passes = [
        Pass(model=name, name="window", width_px=1, height_px=1, threads=1, work=lambda name=name: done.append(name))
        for name in "ab"
    ]
    told: list[None] = []
    timings = in_turns(passes, 2, lambda: told.append(None))
    turn = TURN + 1
    assert "".join(done) == "ab" + "a" * turn + "b" * turn + "b" * turn + "a" * turn
    assert [one.samples for one in timings] == [2 * TURN] * 2
    assert len(told) == 2


def timing(threads: int, p50_ms: float, cpu_p50_ms: float) -> Timing:
    return Timing(
        model="m", name="window", width_px=1, height_px=1, threads=threads, p50_ms=p50_ms, p99_ms=9.0, cpu_p50_ms=cpu_p50_ms,
        samples=1,
    )  # fmt: skip


def test_ratios_compare_equal_numbers_of_threads():
    """One thread is compared with one, two with two, and three with nothing."""
    against = [timing(1, 60.0, 50.0), timing(2, 30.0, 60.0)]
    assert ratio_to(timing(2, 0.5, 1.0), against) == Ratio(wall=60.0, cpu=60.0)
    assert ratio_to(timing(1, 0.5, 0.5), against) == Ratio(wall=120.0, cpu=100.0)
    assert ratio_to(timing(3, 0.5, 0.5), against) is None


def test_the_shipped_network_runs_at_both_sizes():
    """Its passes are a window and a full frame of the sizes asked for, and they run."""
    passes = passes_of(open_model(default_model_path()), threads=1, window_px=(128, 96), full_frame_px=(256, 144))
    assert [(one.name, one.width_px, one.height_px) for one in passes] == [
        ("window", 128, 96),
        ("full_frame", 256, 144),
    ]
    for one in passes:
        one.work()


def test_a_network_of_something_else_is_refused(tmp_path):
    """A network that takes neither four channels nor a picture is named."""
    onnx = pytest.importorskip("onnx")
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    ends = [[helper.make_tensor_value_info(name, kind, [1, 7])] for name in ("x", "y")]
    graph = helper.make_graph([helper.make_node("Relu", ["x"], ["y"])], "other", *ends)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    path = tmp_path / "other.onnx"
    path.write_bytes(model.SerializeToString())
    with pytest.raises(InputError, match=r"other\.onnx: takes neither"):
        passes_of(open_model(path), threads=1, window_px=(128, 128), full_frame_px=(448, 256))
