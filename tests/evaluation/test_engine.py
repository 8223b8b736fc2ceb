"""Engines give the same results wherever they compute; dead workers are replaced and failures named."""

import os
import re
import socket
import sys
from pathlib import Path
from types import ModuleType

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


def test_workers_stay_for_the_next_tasks() -> None:
    engine = Processes(1)
    first, second = (engine.run([Task("who", os.getpid)], lambda _: None) for _ in range(2))
    assert first == second != [os.getpid()]


def test_a_task_that_kills_its_workers_is_named() -> None:
    with pytest.raises(RuntimeError, match=r"^kills: its worker died 3 times$"):
        Processes(1).run([Task("kills", die)], lambda _: None)


@pytest.mark.parametrize("elsewhere", ["processes", "ray"])
def test_a_matrix_is_equal_elsewhere(elsewhere: str, tmp_path: Path) -> None:
    if elsewhere == "ray":
        pytest.importorskip("ray")
    engine = Processes(2) if elsewhere == "processes" else Ray()
    config = DuelConfig(scenario="foi-drive:horizon=30", detectors=("snapshot",))
    players = ("none", "ramp:1"), ("snapshot > latch", "always-exclude")
    wanted = {(one, two): 10 for one in players[0] for two in players[1]}
    wanted["ramp:1", "always-exclude"] = 15
    grown, there = (CellStore(tmp_path / name, config, 10, 3) for name in ("here", "there"))
    grown.matrix(*players, Here(), lambda _: None)
    grown.fill(wanted, Here(), lambda _: None)
    there.fill(wanted, engine, lambda _: None)
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


def test_an_address_that_does_not_answer_is_named_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ray need not be there to be told that nobody listens: it would try for minutes."""
    asked: list[object] = []
    there = ModuleType("ray")
    there.init = lambda **given: asked.append(given["address"])  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "ray", there)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        make_engine("ray", address=f"ray://127.0.0.1:{port}")
    for address in (f"ray://127.0.0.1:{port}", f"127.0.0.1:{port}"):
        with pytest.raises(ValueError, match=rf"^engine: no Ray answers at '{address}': .*[Rr]efused"):
            make_engine("ray", address=address)
    make_engine("ray")
    make_engine("ray", address="auto")
    assert asked == [f"ray://127.0.0.1:{port}", None, "auto"]


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ImportError, match=r"spoofgym\[ray\]"):
        make_engine("ray")
