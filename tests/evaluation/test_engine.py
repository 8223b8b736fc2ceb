"""Engines give the same results wherever they compute; dead workers are replaced and failures named."""

import re
from pathlib import Path

import numpy as np
import pytest

from spoofgym.envs.duel_config import DuelConfig
from spoofgym.evaluation.cell_store import CellStore
from spoofgym.evaluation.duels import harms
from spoofgym.evaluation.engine import Engine, Here, Processes, Ray, Task, make_engine
from tests.evaluation.tasks import die, die_once, keep, refuse, square


@pytest.fixture(params=["here", "processes", "ray"])
def engine(request: pytest.FixtureRequest) -> Engine:
    if request.param == "here":
        return Here()
    if request.param == "processes":
        return Processes(2)
    pytest.importorskip("ray")
    return Ray()


def test_results_come_in_the_order_of_the_tasks(engine: Engine) -> None:
    told: list[str] = []
    tasks = [Task(f"the square of {n}", square, (n,)) for n in range(5)]
    assert engine.run(tasks, told.append) == [0, 1, 4, 9, 16]
    assert told == [task.name for task in tasks]
    assert engine.run([], told.append) == []


def test_a_task_that_fails_is_named_and_the_others_end(engine: Engine, tmp_path: Path) -> None:
    after = str(tmp_path / "after")
    tasks = [Task("the bad one", refuse, (3,)), Task("the good one", keep, (after,))]
    with pytest.raises(ValueError, match=r"^the bad one: 3 is refused$"):
        engine.run(tasks, lambda _: None)
    assert Path(after).exists()


def test_a_worker_that_dies_is_replaced(tmp_path: Path) -> None:
    tasks = [Task("dies once", die_once, (str(tmp_path / "dead"),)), Task("lives", square, (2,))]
    assert Processes(2).run(tasks, lambda _: None) == [7, 4]


def test_a_task_that_kills_its_workers_is_named() -> None:
    with pytest.raises(RuntimeError, match=r"^kills: its worker died 3 times$"):
        Processes(1).run([Task("kills", die)], lambda _: None)


def test_a_matrix_is_equal_in_processes(tmp_path: Path) -> None:
    config = DuelConfig(scenario="foi-drive:horizon=30", detectors=("snapshot",))
    players = ("none", "ramp:1"), ("snapshot > latch", "always-exclude")
    wanted = {(one, two): 10 for one in players[0] for two in players[1]}
    wanted["ramp:1", "always-exclude"] = 15
    grown, there = (CellStore(tmp_path / name, config, 10, 3) for name in ("here", "there"))
    grown.matrix(*players, Here(), lambda _: None)
    grown.fill(wanted, Here(), lambda _: None)
    there.fill(wanted, Processes(2), lambda _: None)
    found = [
        harms([[store.cell(one, two, wanted[one, two]) for two in players[1]] for one in players[0]])
        for store in (grown, there)
    ]
    np.testing.assert_array_equal(*found)
    told: list[str] = []
    CellStore(tmp_path / "there", config, 10, 3).matrix(*players, Here(), told.append)
    assert told == []  # all is on disk


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("threads",), "engine must be"),
        (("processes", 0), "workers must be"),
        (("processes", None, "ray://there:1"), "address 'ray://there:1' is of the engine 'ray'"),
        (("ray", 3), "leave workers=3 out"),
    ],
)
def test_engines_that_do_not_exist_are_refused(arguments: tuple, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        make_engine(*arguments)
    assert isinstance(make_engine("processes", 1), Here)
    assert isinstance(make_engine("processes", 2), Processes)


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ImportError, match=r"spoofgym\[ray\]"):
        make_engine("ray")
