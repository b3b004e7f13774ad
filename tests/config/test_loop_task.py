"""Tasks for closed-loop drives: those of the package, those in files, and what is wrong with one in one line."""

from pathlib import Path

import pytest

from dnb_edge.config.loop_task import TASKS, load_task
from dnb_edge.errors import InputError
from dnb_edge.sim.task import LoopTask, TaskKind

OWN = Path(__file__).resolve().parents[2] / "configs" / "closed-loop" / "evening.yaml"


@pytest.mark.parametrize("name", TASKS)
def test_each_named_task_is_what_its_name_says(name: str) -> None:
    """A drive of its kind, alike for the same seed, and in nothing but its own conditions other than the plain one."""
    task = load_task(name)
    loop = task.loop(7, 2)
    assert (task.name, loop.kind, loop.seed, loop.laps) == (name, TaskKind(name), 7, 2)
    assert loop == load_task(name).loop(7, 2)
    plain = LoopTask(seed=7, laps=2)
    changed = {key for key in LoopTask.__slots__ if getattr(loop, key) != getattr(plain, key)}
    own = {"obstacles": "obstacles", "wrong-way": "wrong_way", "changing-light": "light", "camera-delay": "delay_s"}
    assert changed == ({"kind", own[name]} if name in own else set())


def test_each_seed_stands_obstacles_elsewhere() -> None:
    """Three, by default; the same ones for the same seed."""
    task = load_task("obstacles")
    places = [task.loop(seed).obstacles for seed in range(1, 6)]
    assert [len(one) for one in places] == [3] * 5
    assert len(set(places)) == 5
    assert task.judged["penalties"] == {"collision": {"seconds": 5.0, "factor": 0.65}}


def test_the_example_of_an_own_task_says_all_that_one_may() -> None:
    """Every key of the form stands in it or in its comment, and it reads as it is written."""
    task = load_task(str(OWN))
    loop = task.loop(1)
    assert (task.name, loop.delay_s, loop.front_fps, loop.vehicle.top_speed_mps) == ("evening", 0.10, 20.0, 1.8)
    assert [one.track_m for one in loop.obstacles] == [(2.65, 1.02)]
    assert task.judged["race"] == {"collision_m": 0.0}
    assert set(type(task.file).model_fields) - set(task.file.model_fields_set) == {"format", "score", "crossing"}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("name: a\nkind: flying\n", r"a\.yaml, line 2: kind: "),
        (
            "name: a\nkind: obstacles\nobstacle: 3\n",
            r"a\.yaml, line 3: obstacle: unknown key, did you mean obstacles\?",
        ),
        ("name: a\nkind: obstacles\nobstacles: 30\n", r"a\.yaml: demo track: there is room for"),
        ("name: a\nkind: obstacles\nplace: moon\n", r"a\.yaml: place 'moon' is none of"),
        ("name: a\nkind: obstacles\nlight: {depth: 2}\n", r"a\.yaml, line 3: light"),
        (
            "name: a\nkind: obstacles\npenalties: {collision: {second: 2}}\n",
            r"a\.yaml, line 3: penalties\.collision\.second",
        ),
        ("name: a\nkind: obstacles\nrules: chess\n", r"a\.yaml, line 3: rules: no rule set is called 'chess'"),
        ("- a\n", r"a\.yaml: the task must be a mapping"),
        ("name: a\n", r"a\.yaml: kind: is missing"),
    ],
)
def test_what_is_wrong_with_a_task_is_told_in_one_line(tmp_path: Path, text: str, told: str) -> None:
    """With the file, and the line and the key where there are some."""
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(InputError, match=told) as error:
        load_task(str(tmp_path / "a.yaml"))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("word", "told"), [("parking", "there are lane-following"), ("there/is/none.yaml", "cannot read")]
)
def test_a_task_that_is_not_there_is_told(word: str, told: str) -> None:
    """With those that there are."""
    with pytest.raises(InputError, match=told):
        load_task(word)


def test_the_pages_example_is_a_task(tmp_path: Path) -> None:
    """What docs/ranking.md shows can be driven."""
    page = (OWN.parents[2] / "docs" / "ranking.md").read_text(encoding="utf-8")
    (tmp_path / "dim.yaml").write_text(page.split("```yaml\n")[1].split("```")[0])
    loop = load_task(str(tmp_path / "dim.yaml")).loop(4)
    assert (loop.light.depth, loop.delay_s, len(loop.obstacles)) == (0.6, 0.08, 2)
