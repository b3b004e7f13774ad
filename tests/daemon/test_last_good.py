"""The copy of the last configuration that raced: whole or not at all, and good for a race by itself."""

import shutil
from pathlib import Path

import pytest

from dnb_edge.assembly import assemble, make_detector
from dnb_edge.cli.demo import write_demo_config
from dnb_edge.config.load import load_config
from dnb_edge.config.schema import Config
from dnb_edge.daemon.last_good import LastGood
from dnb_edge.detect.onnx import default_model_path
from dnb_edge.errors import InputError
from dnb_edge.sim.rig import Rig
from dnb_edge.values import Clock, SourceInfo

INFO = SourceInfo(uri="sim:", width_px=1280, height_px=720, nominal_fps=30.0, clock=Clock.SIMULATED, live=False)


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo's configuration and the files that it names, with a model of its own."""
    directory = tmp_path_factory.mktemp("etc")
    path = write_demo_config(directory, Rig(laps=1))
    model = default_model_path()
    shutil.copy(model, directory / "mine.onnx")
    shutil.copy(model.with_suffix(".json"), directory / "mine.json")
    (directory / "rules.yaml").write_text("name: ours\nversion: '1'\nrace: {max_gap_s: 1.5}\n", encoding="utf-8")
    return path


@pytest.fixture
def etc(original: Path, tmp_path: Path) -> Path:
    """A copy that the test may damage; its configuration's path."""
    shutil.copytree(original.parent, tmp_path / "etc")
    return tmp_path / "etc" / original.name


def loaded(etc: Path, *changes: str) -> Config:
    return load_config(etc, [f"detector.model={etc.parent / 'mine.onnx'}", *changes])


def test_a_kept_configuration_races_without_its_originals(etc: Path, tmp_path: Path) -> None:
    """Everything of the original may be gone: the copy makes the same rooms."""
    config = loaded(etc, "race.laps=7")
    setup = assemble(config, INFO).setup
    kept = LastGood(tmp_path / "last-good")
    kept.keep(config)
    shutil.rmtree(etc.parent)
    again = kept.load()
    assert assemble(again, INFO).setup == setup
    assert again.race.laps == 7
    assert again.detector.model is not None
    assert (tmp_path / "last-good") in again.detector.model.parents
    make_detector(again)


def test_the_newest_is_kept_and_the_same_is_not_written_again(etc: Path, tmp_path: Path) -> None:
    """One copy at a time; a configuration that raced before costs the disk nothing."""
    directory = tmp_path / "last-good"
    kept = LastGood(directory)
    kept.keep(loaded(etc))
    written = {path: path.stat().st_mtime_ns for path in directory.rglob("*")}
    kept.keep(loaded(etc))
    assert {path: path.stat().st_mtime_ns for path in directory.rglob("*")} == written
    kept.keep(loaded(etc, "race.laps=9"))
    assert kept.load().race.laps == 9
    assert len([path for path in directory.iterdir() if path.is_dir()]) == 1
    assert not list(directory.glob(".*"))


def test_a_copy_that_changed_by_a_bit_is_refused_and_mended(etc: Path, tmp_path: Path) -> None:
    """Whichever file it is; keeping the configuration again makes it whole."""
    directory = tmp_path / "last-good"
    kept = LastGood(directory)
    kept.keep(loaded(etc))
    files = [path for path in directory.rglob("*") if path.is_file()]
    assert len(files) >= 7
    for path in files:
        data = path.read_bytes()
        path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
        with pytest.raises(InputError, match="last good configuration"):
            kept.load()
        kept.keep(loaded(etc))
        kept.load()


def test_a_power_cut_before_the_last_rename_leaves_the_old_copy(
    etc: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The new one counts only once the file that names it is replaced."""
    kept = LastGood(tmp_path / "last-good")
    kept.keep(loaded(etc))

    def cut(self: Path, target: Path) -> None:
        raise OSError(5, "power cut")

    monkeypatch.setattr(Path, "replace", cut)
    with pytest.raises(OSError, match="power cut"):
        kept.keep(loaded(etc, "race.laps=9"))
    monkeypatch.undo()
    assert kept.load().race.laps != 9
    kept.keep(loaded(etc, "race.laps=9"))
    assert kept.load().race.laps == 9


@pytest.mark.parametrize("text", [None, "", "../..", "0123456789abcdef", "\xff"])
def test_no_copy_is_one_line(tmp_path: Path, text: str | None) -> None:
    """Nothing, or nonsense, in the directory."""
    if text is not None:
        (tmp_path / "current").write_text(text, encoding="latin-1")
    with pytest.raises(InputError, match="last good configuration"):
        LastGood(tmp_path).load()


def test_a_rule_set_of_ones_own_is_copied_too(etc: Path, tmp_path: Path) -> None:
    """`rules` names a file that lies somewhere else."""
    kept = LastGood(tmp_path / "last-good")
    kept.keep(loaded(etc, f"rules={etc.parent / 'rules.yaml'}"))
    shutil.rmtree(etc.parent)
    assert kept.load().race.max_gap_s == 1.5
